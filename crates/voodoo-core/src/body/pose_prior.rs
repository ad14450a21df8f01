//! Pose prior: how probable the joint rotations of a human pose are jointly.
//!
//! A normal distribution over the joint rotations of the human's arms, legs and waist, learned from motion capture
//! (`training/pose_prior.py`). There is no prior for other bodies.

use super::pose_statistics::{MEAN, PRECISION};
use super::{Body, JointKind, JointRole, Side};
use crate::body::kinematics::joint_turn;
use crate::math::{Pose, ShortestAxis};

/// The joints, with the index of their first component and the number of components: hinges have one.
const JOINTS: [(JointRole, usize, usize); 9] = [
    (JointRole::Waist, 0, 3),
    (JointRole::Shoulder(Side::Left), 3, 3),
    (JointRole::Elbow(Side::Left), 6, 1),
    (JointRole::Shoulder(Side::Right), 7, 3),
    (JointRole::Elbow(Side::Right), 10, 1),
    (JointRole::Hip(Side::Left), 11, 3),
    (JointRole::Knee(Side::Left), 14, 1),
    (JointRole::Hip(Side::Right), 15, 3),
    (JointRole::Knee(Side::Right), 18, 1),
];
/// Number of components of all joints.
const SIZE: usize = MEAN.len();
/// Squared Mahalanobis distance of a pose from the mean; 0 for bodies without a prior.
pub(crate) fn squared_mahalanobis(body: &Body, poses: &[Pose]) -> f64 {
    let mut off = [0.0; SIZE];
    each_turn(body, poses, |component, value| off[component] = value);
    let mut rest = PRECISION.as_slice();
    let mut sum = 0.0;
    for (i, own) in off.iter().enumerate() {
        let (entries, others) = rest.split_at(i + 1);
        let row: f64 = entries.iter().zip(&off).map(|(entry, other)| entry * other).sum();
        sum += own * (2.0 * row - entries[i] * own);
        rest = others;
    }
    sum
}

/// Calls `take` with the index of every component and its difference from the mean.
fn each_turn(body: &Body, poses: &[Pose], mut take: impl FnMut(usize, f64)) {
    let roles = body.roles();
    if !roles.is_human() {
        return;
    }
    for (limb, part) in body.limbs().iter().enumerate() {
        let Some((parent, joint)) = &part.parent else { continue };
        let Some(role) = roles.joint(limb) else { continue };
        let hinge = joint.kind() == JointKind::Hinge;
        let known = JOINTS.iter().find(|(known, _, count)| *known == role && hinge == (*count == 1));
        let Some(&(_, first, count)) = known else { continue };
        let turn = joint_turn(joint, &poses[*parent], &poses[limb]).to_scaled_axis_shortest();
        (0..count).for_each(|k| take(first + k, turn[k] - MEAN[first + k]));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::kinematics::{hinge_axis, place};
    use crate::body::{HumanModel, Joint};
    use crate::math::{Quat, Vec3};

    fn human() -> (Body, Vec<Pose>) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = body.rest_pose(Pose::IDENTITY);
        (body, poses)
    }

    fn joint(body: &Body, role: JointRole) -> (usize, usize, &Joint) {
        let limb = body.roles().limb_at(role).unwrap();
        let (parent, joint) = body.limbs()[limb].parent.as_ref().unwrap();
        (limb, *parent, joint)
    }

    #[test]
    fn left_and_right_are_alike_and_the_mean_costs_nothing() {
        let (body, mut mean) = human();
        for (role, first, count) in JOINTS {
            let (limb, parent, joint) = joint(&body, role);
            let mut turn = Vec3::ZERO;
            (0..count).for_each(|k| turn[k] = MEAN[first + k]);
            mean[limb] = place(joint, &mean[parent], Quat::from_scaled_axis(turn));
        }
        assert!(squared_mahalanobis(&body, &mean) < 1e-12, "{}", squared_mahalanobis(&body, &mean));
        let bent = |role| {
            let (_, mut poses) = human();
            let (limb, parent, joint) = joint(&body, role);
            poses[limb] = place(joint, &poses[parent], Quat::from_axis_angle(Vec3::X, 1.2));
            squared_mahalanobis(&body, &poses)
        };
        for role in [JointRole::Shoulder, JointRole::Elbow, JointRole::Hip, JointRole::Knee] {
            let [left, right] = Side::BOTH.map(|side| bent(role(side)));
            assert!((left - right).abs() < 0.01 * left, "{:?}: {left} {right}", role(Side::Left));
        }
    }

    #[test]
    fn an_arm_in_the_chest_is_less_usual_than_one_that_hangs() {
        let (body, mut poses) = human();
        let hanging = squared_mahalanobis(&body, &poses);
        let (limb, parent, shoulder) = joint(&body, JointRole::Shoulder(Side::Left));
        poses[limb] = place(shoulder, &poses[parent], Quat::from_scaled_axis(Vec3::new(-0.3, 1.2, 0.5)));
        let (fore, _, elbow) = joint(&body, JointRole::Elbow(Side::Left));
        poses[fore] = place(elbow, &poses[limb], Quat::from_axis_angle(hinge_axis(elbow), 2.0));
        assert!(squared_mahalanobis(&body, &poses) > hanging + 6.0, "{} {hanging}", squared_mahalanobis(&body, &poses));
    }

    #[test]
    fn of_another_body_nothing_is_known() {
        let (body, poses) = human();
        let other = Body::new("robot", body.limbs().to_vec(), Vec::new()).unwrap();
        assert_eq!(squared_mahalanobis(&other, &poses), 0.0);
    }
}
