//! Whether the frame contradicts the configuration of an arm or leg.

use super::score::{GAIN, REFUTED_GAIN, bounds, explain, may_explain};
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Matched};
use crate::math::{Points, Pose, WeightedPoints};
use crate::visibility::LITTLE;
use crate::visibility::evidence::{EXPLAINED, Visibility, limb_visibility};

/// Free-space violations on more than this fraction of the surface that faces a camera contradict an arm or leg.
const REFUTED: f64 = 0.2;

/// Points that an arm or leg explains, and working memory.
#[derive(Debug, Default)]
pub(super) struct Suspicion {
    /// Points that are matched to the arm or leg.
    pub(super) own: WeightedPoints,
    /// Distances of these points to the nearest limb outside the arm or leg.
    others: Vec<f32>,
    distances: Vec<f32>,
}

impl Suspicion {
    /// Reserves memory for a frame of `count` candidates.
    pub(super) fn make_room(&mut self, count: usize) {
        self.own.clear();
        self.own.reserve(count);
        for distances in [&mut self.others, &mut self.distances] {
            distances.clear();
            distances.reserve(count);
        }
    }

    /// Whether the frame contradicts the whole arm or leg, and whether it contradicts the part distal to its hinge.
    ///
    /// A part is contradicted when it explains few points exclusively, compared with its visible area, or when much of its
    /// surface violates free space. Both are weighted by area in the image. With `from_points`, the configuration was selected by
    /// unexplained points, and is also contradicted in two other cases. First, when free space is violated with patches weighted
    /// as if viewed from the side: points of another object can align a calf with the viewing ray, where its image area is small.
    /// Second, when its visible area is small: an arm behind the trunk can be assigned to any points that come into view nearby.
    pub(super) fn assess(
        &mut self,
        context: Context,
        matched: Matched,
        chain: &TwoBone,
        from_points: bool,
    ) -> [bool; 2] {
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
        let spurious = from_points && (past || visible < GAIN);
        [upper || spurious, lower || spurious]
    }

    /// Collects the points matched to the arm or leg, first those of the upper limb. Returns the number of the latter.
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

/// Distances of points to the nearest limb outside an arm or leg. Limbs that are too far away to explain any point are ignored.
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

    /// Assesses the first arm at `poses` in an image of the body at `truth`: the whole arm, and the part distal to its hinge.
    fn suspect(truth: &[Pose], poses: &[Pose], from_points: bool) -> [bool; 2] {
        let (model, _) = standing();
        let (pixels, config) = (before_wall(&model.body, truth), without_background());
        with_context(&pixels, &config, &model, poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, poses);
            Suspicion::default().assess(context, fit.matched(poses), &model.extremities[first_arm(&model)], from_points)
        })
    }

    #[test]
    fn an_arm_at_its_observed_position_is_not_suspect() {
        let (model, poses) = standing();
        let (raised, _) = raised(&model, &poses, 0.2);
        for pose in [&poses, &raised] {
            assert_eq!([false, true].map(|from_points| suspect(pose, pose, from_points)), [[false; 2]; 2]);
        }
    }

    #[test]
    fn an_arm_that_violates_free_space_is_suspect() {
        let (model, poses) = standing();
        assert_eq!(suspect(&poses, &raised(&model, &poses, 0.2).0, false), [true; 2]);
        assert_eq!(suspect(&raised(&model, &poses, 0.2).0, &poses, false), [true; 2]);
    }

    #[test]
    fn an_arm_behind_the_trunk_explains_nothing_exclusively() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let mut hidden = poses.clone();
        let aside = (arm.root(&model.body, &poses).x - poses[0].translation.x).signum();
        arm.reach(&model.body, &mut hidden, poses[0].translation + Vec3::new(0.02 * aside, 0.0, 0.16), 0.0);
        assert_eq!(suspect(&hidden, &hidden, false), [true; 2]);
    }

    #[test]
    fn a_wrong_forearm_makes_only_the_distal_part_suspect() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let (truth, _) = raised(&model, &poses, 0.2);
        let all = turned(&truth, truth[arm.lower].translation, Vec3::Z, -1.6);
        let mut bent = truth.clone();
        arm.limbs().skip(1).for_each(|limb| bent[limb] = all[limb]);
        assert_eq!(suspect(&truth, &bent, false), [false, true]);
    }

    #[test]
    fn a_forearm_along_the_ray_makes_an_arm_proposed_from_points_suspect() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let (_, joint) = model.body.limbs()[arm.lower].parent.as_ref().unwrap();
        let mut bent = poses.clone();
        let turn = Quat::from_axis_angle(hinge_axis(joint), FRAC_PI_2);
        bent[arm.lower] = place(joint, &poses[arm.upper], turn);
        let hand = poses[arm.lower].inverse() * poses[arm.ends[0]];
        bent[arm.ends[0]] = bent[arm.lower] * hand;
        assert_eq!([false, true].map(|from_points| suspect(&poses, &bent, from_points)), [[false, true], [true; 2]]);
    }
}
