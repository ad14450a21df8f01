//! Whether the frame speaks against an arm or leg where it is.

use super::score::{GAIN, REFUTED_GAIN, bounds, explain, may_explain};
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Matched};
use crate::math::{Points, Pose, WeightedPoints};
use crate::visibility::LITTLE;
use crate::visibility::evidence::{EXPLAINED, Visibility, limb_visibility};

/// It is refuted when cameras see past a larger share of it.
const REFUTED: f64 = 0.2;

/// What an arm or leg explains now, and working memory.
#[derive(Debug, Default)]
pub(super) struct Suspicion {
    /// Points it is matched to.
    pub(super) own: WeightedPoints,
    /// Their distances to the nearest limb that does not belong to it.
    others: Vec<f32>,
    distances: Vec<f32>,
}

impl Suspicion {
    /// Room for a frame of so many candidates.
    pub(super) fn make_room(&mut self, count: usize) {
        self.own.clear();
        self.own.reserve(count);
        for distances in [&mut self.others, &mut self.distances] {
            distances.clear();
            distances.reserve(count);
        }
    }

    /// Whether the frame speaks against all of an arm or leg, and against what lies beyond its hinge.
    ///
    /// What cameras see past counts by its area in the image. Where unexplained points have drawn it there (`drawn`), it counts
    /// as if seen from the side, too: a thing that appears draws a calf along the ray, where nothing of it is seen. And it has
    /// to show itself: an arm behind the trunk may end at anything that comes into view there.
    pub(super) fn assess(&mut self, context: Context, matched: Matched, chain: &TwoBone, drawn: bool) -> [bool; 2] {
        let upper = self.collect_own(matched, chain);
        let Self { own, others, distances } = self;
        distances_to_others(context, matched.poses, chain, &own.points, others, distances);
        let exclusive = |from: usize| -> f64 {
            let weighted = others[from..].iter().zip(&own.weights[from..]);
            weighted.filter(|(other, _)| f64::from(**other) > EXPLAINED).map(|(_, weight)| *weight).sum()
        };
        let body = &context.model.body;
        let mut visibility = Visibility::default();
        let mut against = |limb: usize, exclusive: f64| {
            visibility += limb_visibility(context.observation.views, &body.limbs()[limb], &matched.poses[limb]);
            exclusive <= LITTLE * (visibility.image.front_facing - visibility.image.occluded).max(GAIN)
                || visibility.image.free_space > (REFUTED * visibility.image.front_facing).max(REFUTED_GAIN)
        };
        chain.ends.iter().for_each(|end| {
            against(*end, 0.0);
        });
        let lower = against(chain.lower, exclusive(upper));
        let upper = against(chain.upper, exclusive(0));
        let visible = visibility.image.front_facing - visibility.image.occluded - visibility.image.free_space;
        let past = visibility.side.free_space > (REFUTED * visibility.side.front_facing).max(GAIN);
        let drawn = drawn && (past || visible < GAIN);
        [upper || drawn, lower || drawn]
    }

    /// Collects the points it is matched to; returns how many of them lie on the upper limb.
    fn collect_own(&mut self, matched: Matched, chain: &TwoBone) -> usize {
        self.own.clear();
        let mut upper = 0;
        for limb in chain.limbs() {
            let matches = &matched.correspondences.limbs[limb];
            for (index, weight) in matches.weight.iter().enumerate() {
                if *weight > 0.0 {
                    let point = matches.measured.get(index).to_array().map(|value| value as f32);
                    self.own.push(point, f64::from(*weight));
                }
            }
            if limb == chain.upper {
                upper = self.own.len();
            }
        }
        upper
    }
}

/// Distances of points to the nearest limb that does not belong to an arm or leg; those that are too far to explain a point are
/// not told apart.
pub(super) fn distances_to_others(
    context: Context,
    poses: &[Pose],
    chain: &TwoBone,
    points: &Points,
    others: &mut Vec<f32>,
    distances: &mut Vec<f32>,
) {
    others.clear();
    others.resize(points.len(), f32::INFINITY);
    let bounds = bounds(points);
    let limbs = context.model.body.limbs();
    for limb in (0..poses.len()).filter(|limb| !chain.limbs().any(|own| own == *limb)) {
        if may_explain(&limbs[limb].shape, &poses[limb], bounds) {
            explain(&context.model.body, limb, poses, points, others, distances);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::body::kinematics::{hinge_axis, place};
    use crate::fit::Fit;
    use crate::math::{Quat, Vec3};
    use crate::testing::{before_wall, first_arm, raised, standing, turned, with_context, without_background};

    /// What is said of the first arm at `poses` when the body is seen in `truth`: all of it, and beyond its hinge.
    fn suspect(truth: &[Pose], poses: &[Pose], drawn: bool) -> [bool; 2] {
        let (model, _) = standing();
        let (pixels, config) = (before_wall(&model.body, truth), without_background());
        with_context(&pixels, &config, &model, poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, poses);
            Suspicion::default().assess(context, fit.matched(poses), &model.extremities[first_arm(&model)], drawn)
        })
    }

    #[test]
    fn an_arm_where_it_is_visible_is_not_suspect() {
        let (model, poses) = standing();
        let (raised, _) = raised(&model, &poses, 0.2);
        for pose in [&poses, &raised] {
            assert_eq!([false, true].map(|drawn| suspect(pose, pose, drawn)), [[false; 2]; 2]);
        }
    }

    #[test]
    fn an_arm_that_the_camera_sees_past_is_suspect() {
        let (model, poses) = standing();
        assert_eq!(suspect(&poses, &raised(&model, &poses, 0.2).0, false), [true; 2]);
        assert_eq!(suspect(&raised(&model, &poses, 0.2).0, &poses, false), [true; 2]);
    }

    #[test]
    fn an_arm_behind_the_trunk_explains_nothing_alone() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let mut hidden = poses.clone();
        let aside = (arm.root(&model.body, &poses).x - poses[0].translation.x).signum();
        arm.reach(&model.body, &mut hidden, poses[0].translation + Vec3::new(0.02 * aside, 0.0, 0.16), 0.0);
        assert_eq!(suspect(&hidden, &hidden, false), [true; 2]);
    }

    #[test]
    fn a_forearm_alone_may_be_wrong() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let (truth, _) = raised(&model, &poses, 0.2);
        let all = turned(&truth, truth[arm.lower].translation, Vec3::Z, -1.6);
        let mut bent = truth.clone();
        arm.limbs().skip(1).for_each(|limb| bent[limb] = all[limb]);
        assert_eq!(suspect(&truth, &bent, false), [false, true]);
    }

    #[test]
    fn a_forearm_along_the_ray_is_suspect_where_points_have_drawn_it() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let (_, joint) = model.body.limbs()[arm.lower].parent.as_ref().unwrap();
        let mut bent = poses.clone();
        let turn = Quat::from_axis_angle(hinge_axis(joint), FRAC_PI_2);
        bent[arm.lower] = place(joint, &poses[arm.upper], turn);
        let hand = poses[arm.lower].inverse() * poses[arm.ends[0]];
        bent[arm.ends[0]] = bent[arm.lower] * hand;
        assert_eq!([false, true].map(|drawn| suspect(&poses, &bent, drawn)), [[false, true], [true; 2]]);
    }
}
