//! Where and which way round a lost body may stand at a blob: rough looks at every direction, at rest and as it was last tracked.

use super::{REFINED, Search};
use crate::math::{Pose, Quat, Vec3};
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::Frame;
use crate::observation::segments::Segment;
use crate::tracker::Tracker;
use crate::visibility::evidence::{Visibility, limb_visibility};

/// Directions the body is turned to.
const HEADINGS: usize = 8;
/// Up to this distance rough looks take a point as explained, metres.
const ROUGHLY: f64 = 0.10;
/// Depth of a body's middle behind the middle of what a camera sees of it, metres.
const BEHIND: f64 = 0.08;

/// A rough trial: its cost and its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial {
    pub(crate) cost: f64,
    pub(crate) heading: f64,
    pub(crate) root: Pose,
    /// Joints as when last tracked, instead of at rest.
    pub(crate) kept: bool,
}

impl Tracker {
    /// Puts the body at the blob in every way and keeps the best of different directions, the opposite of the best among them.
    pub(crate) fn rough_trials(&self, work: &mut Search, blob: &Segment, frame: &Frame) {
        let mut all = [const { None::<Trial> }; HEADINGS];
        for (number, slot) in all.iter_mut().enumerate() {
            let heading = std::f64::consts::TAU * number as f64 / HEADINGS as f64;
            for kept in [false, true] {
                for height in 0..3 {
                    let Some(root) = self.place(work, blob, frame, heading, kept, height) else { continue };
                    let mut trial = Trial { cost: 0.0, heading, root, kept };
                    trial.cost = self.rough_cost(work, &trial, frame);
                    if slot.is_none_or(|best| trial.cost < best.cost) {
                        *slot = Some(trial);
                    }
                }
            }
        }
        work.trials.clear();
        let mut ranked = all;
        ranked.sort_unstable_by(|a, b| {
            let cost = |slot: &Option<Trial>| slot.map_or(f64::INFINITY, |trial| trial.cost);
            cost(a).total_cmp(&cost(b))
        });
        work.trials.extend(ranked.into_iter().flatten().take(REFINED - 1));
        let Some(best) = work.trials.first().copied() else { return };
        let opposite = |heading: f64| (heading - best.heading).cos() < -0.99;
        let behind = all.into_iter().flatten().find(|trial| opposite(trial.heading));
        if let Some(behind) = behind.filter(|_| !work.trials.iter().any(|trial| opposite(trial.heading))) {
            work.trials.push(behind);
        }
    }

    /// Root of the body at a blob: the middles together, or the tops, or on the ground.
    fn place(
        &self,
        work: &Search,
        blob: &Segment,
        frame: &Frame,
        heading: f64,
        kept: bool,
        height: usize,
    ) -> Option<Pose> {
        let posture = if kept { &work.kept } else { &work.rest };
        let root = posture.first()?.rotation;
        let level = |v: Vec3| v - work.up * v.dot(work.up);
        // Upright by the axis of the root limb; a kept posture keeps its lean.
        let stand = if kept { root } else { Quat::from_rotation_arc(root * Vec3::Z, work.up) * root };
        let axis = work.up.any_orthonormal_vector();
        let ahead = level(stand * Vec3::X).normalize_or(axis);
        let now = ahead.dot(work.up.cross(axis)).atan2(ahead.dot(axis));
        let turn = Quat::from_axis_angle(work.up, heading - now) * stand * root.inverse();
        let (mut middle, mut weight) = (Vec3::ZERO, 0.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let origin = posture[0].translation;
        for (limb, pose) in self.body.limbs().iter().zip(posture) {
            let ends = [Vec3::ZERO, Vec3::Z * limb.shape.length()].map(|end| turn * (*pose * end - origin));
            let size = limb.shape.length() * (limb.shape.a0() + limb.shape.b1());
            middle += size * 0.5 * (ends[0] + ends[1]);
            weight += size;
            for end in ends {
                low = low.min(end.dot(work.up));
                high = high.max(end.dot(work.up));
            }
        }
        let across = blob.centre + BEHIND * level(blob.view) - middle / weight;
        let rise = match height {
            0 => across.dot(work.up),
            1 => (blob.low * work.up).max(blob.high * work.up).element_sum() - high,
            _ => frame.ground.map(|ground| ground.offset - ground.normal.dot(self.origin) - low)?,
        };
        Some(Pose::from_parts(level(across) + work.up * rise, (turn * root).normalize()))
    }

    fn rough_cost(&self, work: &mut Search, trial: &Trial, frame: &Frame) -> f64 {
        let mut poses = std::mem::take(&mut work.trial);
        put(work, trial, &mut poses);
        let Search { sample, weights, best, distances, .. } = work;
        best.clear();
        best.resize(sample.len(), f32::INFINITY);
        let views =
            DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin: self.origin };
        let mut seen = Visibility::default();
        for (limb, pose) in self.body.limbs().iter().zip(&poses) {
            limb.shape.approximate_distances(pose, sample, distances);
            for (best, distance) in best.iter_mut().zip(distances.iter()) {
                *best = best.min(distance.abs());
            }
            seen += limb_visibility(views, limb, pose);
        }
        let points: f64 =
            best.iter().zip(weights.iter()).map(|(d, w)| w * (f64::from(*d) / ROUGHLY).powi(2).min(1.0)).sum();
        work.trial = poses;
        points + seen.cost() + self.facing_cost(work, trial.root.rotation, frame.stamp)
    }
}

/// The body in one of the remembered postures with its root somewhere.
pub(crate) fn put(work: &Search, trial: &Trial, poses: &mut Vec<Pose>) {
    let posture = if trial.kept { &work.kept } else { &work.rest };
    let moved = posture.first().map_or(Pose::identity(), |root| trial.root * root.inverse());
    poses.clear();
    poses.extend(posture.iter().map(|pose| moved * *pose));
}
