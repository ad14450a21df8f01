//! Current, previous and predicted poses of the body: constant-velocity prediction (R07 eq. 16, 17), damped, in a working frame
//! that follows the body.

use crate::body::Body;
use crate::body::kinematics::{joint_turn, place};
use crate::body::shoulders::raise_shoulders;
use crate::math::{Pose, Vec3, extrapolated, extrapolated_rotation, shifted};

/// Longest extrapolation of a motion, in multiples of the interval over which it was measured.
const LONGEST_PREDICTION: f64 = 2.0;
/// Factor on the time scale of the motion prior in the second frame after a reset and where other poses of the body are tried,
/// since the motion is not known yet.
pub(crate) const UNKNOWN_MOTION: f64 = 4.0;
/// Frame rate for which the standard deviations of motion priors are given, 1/s.
const REFERENCE_RATE: f64 = 30.0;
/// Priors are scaled to intervals of up to so many frames of that rate, and down to the same part of one.
const MOST_TIMES: f64 = 10.0;

/// Poses of the body over time, all in the working frame: world axes, origin near the body.
#[derive(Debug, Default)]
pub(crate) struct Motion {
    /// Current poses, one per limb; empty before the first reset.
    pub poses: Vec<Pose>,
    /// Poses of the previous frame; empty after a reset.
    pub previous: Vec<Pose>,
    /// Poses predicted before the frame was observed.
    pub predicted: Vec<Pose>,
    /// The working frame's origin in the world.
    pub origin: Vec3,
    /// Time of the last frame, seconds; none after a reset.
    pub stamp: Option<f64>,
    /// Seconds between the last two frames; none until two have come.
    interval: Option<f64>,
}

impl Motion {
    /// Resets the motion to these world poses.
    pub(crate) fn restart(&mut self, world_from_limb: Vec<Pose>) {
        self.poses = world_from_limb;
        self.origin = Vec3::ZERO;
        self.stamp = None;
        self.forget();
    }

    /// Resets the velocity and keeps the poses.
    pub(crate) fn forget(&mut self) {
        self.previous.clear();
        self.interval = None;
    }

    /// Forgets the motion of these limbs, parents first, relative to their parents.
    pub(crate) fn forget_joints(&mut self, body: &Body, limbs: impl Iterator<Item = usize>) {
        for limb in limbs {
            if let Some((parent, joint)) = &body.limbs()[limb].parent {
                let now = joint_turn(joint, &self.poses[*parent], &self.poses[limb]);
                self.previous[limb] = place(joint, &self.previous[*parent], now);
            }
        }
    }

    /// Advances to the time of a new frame: the current poses become the previous ones, and with `start` the predicted ones
    /// become the current ones. `damping` is the fraction of the last motion that is expected to continue. Returns the time since
    /// the last frame in units of 1/30 s, limited to the range of the motion prior.
    pub(crate) fn advance(&mut self, body: &Body, stamp: f64, damping: f64, start: bool) -> f64 {
        // The working frame moves to the body, so that single precision is enough for points.
        let shift = self.poses[0].translation;
        self.origin += shift;
        for pose in self.poses.iter_mut().chain(&mut self.previous) {
            *pose = shifted(pose, shift);
        }
        let step = self.stamp.map(|last| stamp - last);
        let ratio = self.ratio(stamp);
        if self.previous.len() != self.poses.len() {
            self.previous.clone_from(&self.poses);
        }
        predict(body, &self.previous, &self.poses, ratio * damping, &mut self.predicted);
        self.previous.clone_from(&self.poses);
        if start {
            self.poses.clone_from(&self.predicted);
        }
        // Over short intervals, unexpected motion adds up like noise; over long ones, the speed is unknown.
        let scale = step.map_or(1.0, |step| (step * REFERENCE_RATE).clamp(1.0 / MOST_TIMES, MOST_TIMES));
        let scale = scale.max(scale.sqrt());
        match self.interval {
            None if step.is_some() => scale * UNKNOWN_MOTION,
            _ => scale,
        }
    }

    /// Time from the last frame to `stamp` as a multiple of the interval over which the motion was measured; 0 if it is unknown.
    fn ratio(&self, stamp: f64) -> f64 {
        let known = self.stamp.zip(self.interval);
        known.map_or(0.0, |(last, interval)| ((stamp - last) / interval).min(LONGEST_PREDICTION))
    }

    /// Predicts the poses at a future time and returns them.
    pub(crate) fn expect(&mut self, body: &Body, stamp: f64, damping: f64) -> &[Pose] {
        let ratio = if self.previous.len() == self.poses.len() { self.ratio(stamp) } else { 0.0 };
        let before = if ratio > 0.0 { &self.previous } else { &self.poses };
        predict(body, before, &self.poses, ratio * damping, &mut self.predicted);
        &self.predicted
    }

    /// Completes the frame.
    pub(crate) fn commit(&mut self, stamp: f64) {
        // A frame may be fitted again after the body has moved.
        self.interval = self.stamp.map(|last| stamp - last).filter(|interval| *interval > 0.0);
        self.stamp = Some(stamp);
    }

    /// Returns the current poses in the world frame.
    pub(crate) fn world_from_limb(&self) -> impl Iterator<Item = Pose> + '_ {
        self.poses.iter().map(|pose| shifted(pose, -self.origin))
    }
}

/// Writes the poses predicted after `previous` and `current` to `predicted`; `factor` scales the motion.
fn predict(body: &Body, previous: &[Pose], current: &[Pose], factor: f64, predicted: &mut Vec<Pose>) {
    predicted.clear();
    for (index, limb) in body.limbs().iter().enumerate() {
        let pose = match &limb.parent {
            None => extrapolated(&previous[0], &current[0], factor),
            Some((parent, joint)) => {
                let before = joint_turn(joint, &previous[*parent], &previous[index]);
                let now = joint_turn(joint, &current[*parent], &current[index]);
                // A clavicle moves with its arm.
                let factor = if body.roles().is_clavicle(index) { 0.0 } else { factor };
                place(joint, &predicted[*parent], extrapolated_rotation(before, now, factor))
            }
        };
        predicted.push(Pose::from_parts(pose.translation, pose.rotation.normalize()));
    }
    raise_shoulders(body, previous, current, predicted);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::math::Quat;

    const STEP: Vec3 = Vec3::new(0.03, -0.01, 0.02);

    fn walking() -> (Body, Motion) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut motion = Motion::default();
        motion.restart(body.rest_pose(Pose::from_parts(Vec3::new(400.0, -70.0, 1.0), Quat::IDENTITY)));
        for frame in 0..3 {
            motion.advance(&body, f64::from(frame) / 30.0, 1.0, false);
            motion.poses.iter_mut().for_each(|pose| pose.translation += STEP);
            motion.commit(f64::from(frame) / 30.0);
        }
        (body, motion)
    }

    #[test]
    fn a_steady_motion_is_expected_to_go_on_as_far_as_it_is_damped() {
        for damping in [0.0, 0.6, 1.0] {
            let (body, mut motion) = walking();
            let before: Vec<Pose> = motion.world_from_limb().collect();
            motion.advance(&body, 3.0 / 30.0, damping, true);
            for (pose, before) in motion.world_from_limb().zip(before) {
                assert!((pose.translation - before.translation - damping * STEP).length() < 1e-9);
                assert!(pose.rotation.angle_between(before.rotation) < 1e-6);
            }
        }
    }

    #[test]
    fn a_long_gap_is_bridged_by_two_intervals_at_most() {
        let (body, mut motion) = walking();
        let before = motion.world_from_limb().next().unwrap();
        let scale = motion.advance(&body, 5.0, 1.0, true);
        let moved = motion.world_from_limb().next().unwrap().translation - before.translation;
        assert!((moved - LONGEST_PREDICTION * STEP).length() < 1e-9);
        assert_eq!(scale, MOST_TIMES);
    }

    #[test]
    fn an_arm_whose_motion_is_forgotten_goes_on_with_the_trunk_alone() {
        let (body, mut motion) = walking();
        let arm = ["l_upperarm", "l_forearm", "l_hand"].map(|name| body.limb_index(name).unwrap());
        motion.advance(&body, 3.0 / 30.0, 1.0, false);
        motion.poses.iter_mut().for_each(|pose| pose.translation += STEP);
        for limb in arm {
            let (parent, joint) = body.limbs()[limb].parent.as_ref().unwrap();
            let turned = Quat::from_rotation_x(0.8) * joint_turn(joint, &motion.poses[*parent], &motion.poses[limb]);
            motion.poses[limb] = place(joint, &motion.poses[*parent], turned);
        }
        motion.forget_joints(&body, arm.into_iter());
        motion.commit(3.0 / 30.0);
        let now: Vec<Pose> = motion.world_from_limb().collect();
        motion.advance(&body, 4.0 / 30.0, 1.0, true);
        for limb in arm {
            let expected = motion.world_from_limb().nth(limb).unwrap();
            assert!((expected.translation - now[limb].translation - STEP).length() < 1e-6);
            assert!(expected.rotation.angle_between(now[limb].rotation) < 1e-5);
        }
    }

    #[test]
    fn the_working_frame_follows_the_body() {
        let (body, mut motion) = walking();
        motion.advance(&body, 0.1, 0.0, true);
        assert!(motion.poses[0].translation.length() < 1e-12 && motion.origin.x > 400.0);
    }

    #[test]
    fn after_a_reset_nothing_is_expected_and_then_much_is_allowed() {
        let (body, mut motion) = walking();
        let poses: Vec<Pose> = motion.world_from_limb().collect();
        motion.restart(poses.clone());
        assert_eq!(motion.advance(&body, 9.0, 1.0, true), 1.0);
        motion.commit(9.0);
        assert!((motion.advance(&body, 9.0 + 1.0 / 30.0, 1.0, true) - UNKNOWN_MOTION).abs() < 1e-9);
        for (pose, expected) in motion.world_from_limb().zip(&poses) {
            assert!((pose.translation - expected.translation).length() < 1e-9);
        }
    }
}
