//! A body that sits down, squats or stands up: the trunk leans about its shoulders while the feet stand.

use std::f64::consts::TAU;

use super::proposals::thin;
use super::{SAMPLE, SWIVELS, rough_cost};
use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::math::{Points, Pose, Quat, Vec3};
use crate::observation::candidates::Candidates;
use crate::observation::depth_view::DepthViews;
use crate::tracker::Tracker;
use crate::visibility::evidence::limb_visibility;

/// Leans that are tried after none, radians.
const LEANS: [f64; 4] = [-0.2, 0.2, -0.4, 0.4];

/// What leans and what stands, and working memory.
#[derive(Debug, Default)]
pub(crate) struct Lean {
    /// The two legs among the chains, none of a body on one or four, and the two arms: without them nothing leans.
    legs: Option<[usize; 2]>,
    arms: Option<[usize; 2]>,
    /// The limbs from the root to the arms.
    trunk: Vec<usize>,
    points: Points,
    weight: Vec<f64>,
    /// Distances of the points to the limbs that stay, to those and the leaning trunk, and to the legs tried there as well.
    staying: Vec<f32>,
    leaning: Vec<f32>,
    tried: Vec<f32>,
    distances: Vec<f32>,
    trial: Vec<Pose>,
    /// The body as it is, with both feet in place; the best that leans.
    pub(crate) upright: Vec<Pose>,
    pub(crate) leant: Vec<Pose>,
}

/// How a body stands best with both feet in place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stance {
    /// Its trunk as it is.
    Upright,
    /// Leaning.
    Leant,
}

impl Lean {
    /// Learns what leans and what stands of a body.
    pub(crate) fn prepare(&mut self, body: &Body, chains: &[TwoBone]) {
        let pair = |leg: bool| {
            let mut found = (0..chains.len()).filter(|index| chains[*index].leg == leg);
            match (found.next(), found.next(), found.next()) {
                (Some(one), Some(two), None) => Some([one, two]),
                _ => None,
            }
        };
        (self.legs, self.arms) = (pair(true), pair(false));
        self.trunk.clear();
        for arm in self.arms.iter().flatten() {
            let mut limb = chains[*arm].upper;
            while let Some((parent, _)) = &body.limbs()[limb].parent {
                limb = *parent;
                if !self.trunk.contains(&limb) {
                    self.trunk.push(limb);
                }
            }
        }
        for poses in [&mut self.trial, &mut self.upright, &mut self.leant] {
            poses.clear();
            poses.reserve(body.limbs().len());
        }
    }

    /// Room for a frame of so many points.
    pub(crate) fn make_room(&mut self, count: usize) {
        self.points.clear();
        self.points.reserve(count);
        self.weight.clear();
        self.weight.reserve(count);
        for distances in [&mut self.staying, &mut self.leaning, &mut self.tried, &mut self.distances] {
            distances.clear();
            distances.reserve(count.min(SAMPLE));
        }
    }

    fn take(&mut self, candidates: &Candidates) {
        self.make_room(candidates.len());
        let points = &candidates.points;
        for index in 0..candidates.len() {
            self.points.push([points.x[index], points.y[index], points.z[index]]);
            self.weight.push(f64::from(candidates.weight[index]));
        }
        thin(&mut self.points, &mut self.weight, SAMPLE);
    }
}

impl Tracker {
    /// Stances of the body with its feet at `ends` (of the chains, world), into `lean`; the one that costs least, none when there
    /// is no such thing. A body that sinks pushes both legs out of place, and each alone is held by the other and by the trunk.
    pub(crate) fn lean(&self, ends: &[Option<Vec3>], views: DepthViews, lean: &mut Lean) -> Option<Stance> {
        let [one, two] = lean.legs?;
        let (one_end, two_end) = (ends[one]?, ends[two]?);
        let legs = [(&self.chains[one], one_end - self.origin), (&self.chains[two], two_end - self.origin)];
        let roots = lean.arms.map(|arms| arms.map(|arm| self.chains[arm].root(&self.body, &self.poses)));
        let (shoulders, axis) = roots.map_or((Vec3::ZERO, Vec3::ZERO), |[first, second]| {
            (0.5 * (first + second), (second - first).normalize_or_zero())
        });
        let leans = if axis == Vec3::ZERO { &[] } else { LEANS.as_slice() };
        lean.take(&self.candidates);
        let Lean { trunk, points, weight, staying, leaning, tried, distances, trial, upright, leant, .. } = lean;
        let mut explain =
            |limb: usize, poses: &[Pose], least: &mut [f32]| self.explain(limb, poses, points, least, distances);
        let seen = |limb: usize, poses: &[Pose]| limb_visibility(views, &self.body.limbs()[limb], &poses[limb]).cost();
        staying.resize(points.len(), f32::INFINITY);
        let stands = |limb: usize| legs.iter().any(|(leg, _)| leg.limbs().any(|own| own == limb));
        for limb in (0..self.poses.len()).filter(|limb| !trunk.contains(limb) && !stands(*limb)) {
            explain(limb, &self.poses, staying);
        }
        let (mut least, mut stance) = (f64::INFINITY, None);
        for angle in [&0.0].into_iter().chain(leans) {
            trial.clone_from(&self.poses);
            leaning.clone_from(staying);
            let turn = Quat::from_axis_angle(axis, *angle);
            let mut cost = 0.0;
            for limb in trunk.iter().copied() {
                let pose = &self.poses[limb];
                trial[limb] = Pose::from_parts(
                    shoulders + turn * (pose.translation - shoulders),
                    (turn * pose.rotation).normalize(),
                );
                explain(limb, trial, leaning);
                cost += seen(limb, trial);
            }
            for (leg, end) in &legs {
                // Of the bends of a leg the one that costs least.
                let (mut bend, mut least, mut own) = (0.0, f64::INFINITY, 0.0);
                for swivel in 0..SWIVELS {
                    let swivel = TAU * swivel as f64 / SWIVELS as f64;
                    leg.reach(&self.body, trial, *end, swivel);
                    tried.clone_from(leaning);
                    leg.limbs().for_each(|limb| explain(limb, trial, tried));
                    let against = leg.limbs().map(|limb| seen(limb, trial)).sum::<f64>() + self.strain(leg, trial);
                    let cost = rough_cost(tried, weight) + against;
                    if cost < least {
                        (bend, least, own) = (swivel, cost, against);
                    }
                }
                leg.reach(&self.body, trial, *end, bend);
                leg.limbs().for_each(|limb| explain(limb, trial, leaning));
                cost += own;
            }
            cost += rough_cost(leaning, weight);
            if stance.is_none() {
                (least, stance) = (cost, Some(Stance::Upright));
                upright.clone_from(trial);
            } else if cost < least {
                (least, stance) = (cost, Some(Stance::Leant));
                leant.clone_from(trial);
            }
        }
        stance
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::config::Config;
    use crate::observation::candidates::body_box;
    use crate::observation::frame::{DepthImage, DepthPixels, Frame};
    use crate::visibility::render::{Rendering, Viewpoint};

    /// A person upright in a camera's frame whose trunk and head are bent forward by `bow`, with thighs and calves at these
    /// angles from the vertical, the middle of the feet at the same place for all.
    fn bent(body: &Body, bow: f64, thigh: f64, calf: f64) -> Vec<Pose> {
        let upright = Quat::from_axis_angle(Vec3::X, std::f64::consts::FRAC_PI_2);
        let rest = body.rest_pose(Pose::from_parts(Vec3::ZERO, upright * Quat::from_axis_angle(Vec3::Z, -1.571)));
        let mut poses: Vec<Pose> = Vec::new();
        for (limb, rest) in body.limbs().iter().zip(&rest) {
            let angle = match limb.name.as_str() {
                name if name.ends_with("thigh") => -thigh,
                name if name.ends_with("calf") => calf,
                name if name.ends_with("foot") => 0.0,
                _ => bow,
            };
            let rotation = Quat::from_axis_angle(Vec3::X, angle) * rest.rotation;
            let at = limb.parent.as_ref().map_or(Vec3::ZERO, |(parent, joint)| {
                poses[*parent] * joint.parent_from_joint.translation - rotation * joint.limb_from_joint.translation
            });
            poses.push(Pose::from_parts(at, rotation));
        }
        let feet: Vec<Vec3> = TwoBone::of(body).iter().filter(|leg| leg.leg).map(|leg| leg.end(&poses)).collect();
        let shift = Vec3::new(0.0, 0.9, 2.6) - 0.5 * (feet[0] + feet[1]);
        poses.iter().map(|pose| Pose::from_parts(pose.translation + shift, pose.rotation)).collect()
    }

    /// Largest distance of a hip or knee from where it is in `truth`.
    fn off(legs: &[&TwoBone], body: &Body, poses: &[Pose], truth: &[Pose]) -> f64 {
        let places = |leg: &TwoBone, poses: &[Pose]| [leg.root(body, poses), poses[leg.lower].translation];
        let distances = legs.iter().flat_map(|leg| {
            let (is, was) = (places(leg, poses), places(leg, truth));
            [is[0].distance(was[0]), is[1].distance(was[1])]
        });
        distances.fold(0.0, f64::max)
    }

    #[test]
    fn a_body_that_sits_down_leans_until_its_feet_stand() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let truth = bent(&body, 0.5, 1.1, 0.15);
        let view = Viewpoint {
            width: 160,
            height: 124,
            intrinsics: [145.0, 145.0, 79.5, 61.5],
            rays: None,
            world_from_sensor: Pose::identity(),
        };
        let mut rendering = Rendering::default();
        rendering.render(&body, &truth, &view, None).unwrap();
        let pixels: Vec<u16> = rendering.depth().iter().map(|depth| (depth * 1000.0) as u16).collect();
        let images = [DepthImage {
            pixels: DepthPixels::U16(&pixels),
            width: view.width,
            height: view.height,
            metres_per_unit: 0.001,
            intrinsics: view.intrinsics,
            rays: None,
            world_from_sensor: view.world_from_sensor,
            weight: 1.0,
            source: 0,
        }];
        let frame = Frame { images: &images, ..Frame::empty(0.0) };
        let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap();
        // The trunk has not bent, and straight legs hang on it: hips and feet are off.
        let [first, second] = {
            let arms: Vec<Vec3> =
                TwoBone::of(&body).iter().filter(|arm| !arm.leg).map(|arm| arm.root(&body, &truth)).collect();
            [arms[0], arms[1]]
        };
        let turn = Quat::from_axis_angle((second - first).normalize(), 0.35);
        let middle = 0.5 * (first + second);
        let wrong: Vec<Pose> = truth
            .iter()
            .map(|pose| Pose::from_parts(middle + turn * (pose.translation - middle), turn * pose.rotation))
            .collect();
        tracker.reset_pose(&wrong).unwrap();
        let bounds = body_box(&body, &wrong, 0.5);
        tracker.candidates.gather(&frame, Vec3::ZERO, &bounds, &tracker.backgrounds, &tracker.config);
        let ends: Vec<Option<Vec3>> = tracker.chains.iter().map(|chain| Some(chain.end(&truth))).collect();
        let views =
            DepthViews { frame: &frame, backgrounds: &tracker.backgrounds, segmented: &[true], origin: Vec3::ZERO };
        let mut lean = Lean::default();
        lean.prepare(&body, &tracker.chains);
        let legs: Vec<&TwoBone> = tracker.chains.iter().filter(|chain| chain.leg).collect();
        let before = off(&legs, &body, &wrong, &truth);
        assert_eq!(tracker.lean(&ends, views, &mut lean), Some(Stance::Leant));
        let after = off(&legs, &body, &lean.leant, &truth);
        assert!(before > 0.12 && after < 0.07, "{before} {after}");
        for (leg, end) in legs.iter().zip(ends.iter().zip(&tracker.chains).filter(|(_, chain)| chain.leg)) {
            assert!(leg.end(&lean.leant).distance(end.0.unwrap()) < 0.02);
        }
        // Where all is right nothing leans, and without a foot's place nothing is said.
        tracker.poses.clone_from(&truth);
        assert_eq!(tracker.lean(&ends, views, &mut lean), Some(Stance::Upright));
        assert_eq!(tracker.lean(&vec![None; ends.len()], views, &mut lean), None);
    }
}
