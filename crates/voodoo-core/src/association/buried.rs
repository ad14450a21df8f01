//! Limbs inside other limbs: no camera sees them, so no point belongs to them.
//!
//! When an arm has slipped into the chest, its surface comes as near to the chest's points as the chest itself. Those points
//! would hold it there.

use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::visibility::ALONG_LIMB;

/// A position this deep in another limb counts as inside it, meters: limbs are soft, and thinner or thicker than their models.
const DEEP: f64 = 0.03;

/// Whether a limb has most of its axis inside other limbs, whose bounding spheres are `spheres`. Limbs that are joined, or have the
/// same parent, are not tested against each other: they overlap in any pose.
pub(super) fn is_buried(body: &Body, poses: &[Pose], spheres: &[(Vec3, f64)], limb: usize) -> bool {
    let parts = body.limbs();
    let inside = |fraction: &&f64| {
        let place = poses[limb] * (**fraction * parts[limb].shape.length() * Vec3::Z);
        (0..poses.len()).any(|other| {
            let (middle, reach) = spheres[other];
            let depth = || -parts[other].shape.approximate_distance(poses[other].inverse_transform_point(place));
            (place - middle).length_squared() < reach * reach && body.are_apart(limb, other) && depth() > DEEP
        })
    };
    2 * ALONG_LIMB.iter().filter(inside).count() > ALONG_LIMB.len()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::math::Quat;
    use crate::testing::standing;

    /// Names of the limbs that lie inside other limbs.
    fn buried<'a>(body: &'a Body, poses: &[Pose]) -> Vec<&'a str> {
        let spheres: Vec<_> = body.limbs().iter().zip(poses).map(|(limb, pose)| limb.shape.sphere(pose)).collect();
        let found = body.limbs().iter().enumerate().filter(|(limb, _)| is_buried(body, poses, &spheres, *limb));
        found.map(|(_, limb)| limb.name.as_str()).collect()
    }

    #[test]
    fn a_forearm_within_the_trunk_is_inside_it_and_one_that_lies_on_it_is_not() {
        let (model, poses) = standing();
        let body = &model.body;
        assert!(buried(body, &poses).is_empty(), "limbs that are joined overlap");
        let [forearm, hand, trunk] = ["l_forearm", "l_hand", "thorax"].map(|name| body.limb_index(name).unwrap());
        let front = body.limbs()[trunk].shape.a0();
        // Perpendicular to the trunk's axis, at half of its height, at the given distance in front of it.
        let across = |ahead: f64| {
            let mut poses = poses.clone();
            let length = body.limbs()[forearm].shape.length();
            let turn = poses[trunk].rotation * Quat::from_axis_angle(Vec3::X, std::f64::consts::FRAC_PI_2);
            let start = Vec3::new(ahead, 0.5 * length, 0.5 * body.limbs()[trunk].shape.length());
            poses[forearm] = Pose::from_parts(poses[trunk] * start, turn);
            poses[hand] = poses[forearm] * Pose::from_parts(Vec3::Z * length, Quat::IDENTITY);
            poses
        };
        assert_eq!(buried(body, &across(0.0)), ["l_forearm"]);
        assert!(buried(body, &across(front)).is_empty() && buried(body, &across(front + 0.04)).is_empty());
    }
}
