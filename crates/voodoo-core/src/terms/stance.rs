//! How people hold their legs: they stand or sit, with both feet on the floor.

use super::LARGEST_COST;
use crate::body::Model;
use crate::body::two_bone::TwoBone;
use crate::math::{Pose, Vec3};
use crate::observation::frame::Ground;

/// Standard deviation of the direction of a thigh or calf, radians.
const STANCE_SIGMA: f64 = 0.6;

/// Cost of the pose of a limb, if it is one of a leg's, nats. It moves none: any leg that is shown is measured far better.
pub(crate) fn stance_cost(floor: Ground, model: &Model, poses: &[Pose], limb: usize) -> f64 {
    let is_of = |one: &&TwoBone| one.leg && (one.upper == limb || one.lower == limb);
    let Some(leg) = model.extremities.iter().find(is_of) else { return 0.0 };
    let [upper, lower] = leg.standing(&model.body, poses, floor);
    let expected = if limb == leg.upper { upper } else { lower };
    let angle = (poses[limb].rotation * Vec3::Z).angle_between(expected);
    (0.5 * (angle / STANCE_SIGMA).powi(2)).min(LARGEST_COST)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::standing;

    #[test]
    fn who_stands_costs_nothing_and_a_leg_stretched_backward_does() {
        let (model, poses) = standing();
        let leg = model.extremities.iter().find(|chain| chain.leg).unwrap();
        let end = leg.end(&poses);
        let floor = Ground { normal: -Vec3::Y, offset: -end.y - 0.07 };
        let cost = |poses: &[Pose]| (0..poses.len()).map(|limb| stance_cost(floor, &model, poses, limb)).sum::<f64>();
        let mut back = poses.clone();
        leg.reach(&model.body, &mut back, leg.root(&model.body, &poses) + Vec3::new(0.0, 0.1, 0.8), 0.0);
        assert!(cost(&poses) < 0.1 && (4.0..2.0 * LARGEST_COST).contains(&cost(&back)), "{}", cost(&back));
    }
}
