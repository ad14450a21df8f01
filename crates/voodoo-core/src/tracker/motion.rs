//! Constant-velocity prediction (R07 eq. 16, 17), damped: the root's motion and every joint's turn go on.

use crate::body::Body;
use crate::body::kinematics::{joint_turn, place};
use crate::math::{Pose, Quat, ShortestAxis};

/// Poses expected after `current` when `previous` came before it, into `predicted`; `factor` scales the motion.
pub fn predict(body: &Body, previous: &[Pose], current: &[Pose], factor: f64, predicted: &mut Vec<Pose>) {
    predicted.clear();
    for (index, limb) in body.limbs().iter().enumerate() {
        let pose = match &limb.parent {
            None => {
                let (before, now) = (&previous[0], &current[0]);
                let rotation = go_on(before.rotation, now.rotation, factor);
                Pose::from_parts(now.translation + factor * (now.translation - before.translation), rotation)
            }
            Some((parent, joint)) => {
                let before = joint_turn(joint, &previous[*parent], &previous[index]);
                let now = joint_turn(joint, &current[*parent], &current[index]);
                place(joint, &predicted[*parent], go_on(before, now, factor))
            }
        };
        predicted.push(Pose::from_parts(pose.translation, pose.rotation.normalize()));
    }
}

fn go_on(before: Quat, now: Quat, factor: f64) -> Quat {
    let motion = (now * before.inverse()).to_scaled_axis_shortest();
    Quat::from_scaled_axis(factor * motion) * now
}
