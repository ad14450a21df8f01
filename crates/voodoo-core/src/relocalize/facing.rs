//! Which way a body can face that was last seen another way: depth hardly tells a person's front from the back, but what a body
//! cannot do since it was last seen (turn far in short time) and does not do (walk backwards) costs.

use super::posture::Postures;
use super::segment_motion::SegmentMotion;
use crate::hypotheses::{MOST_TURNED, SURE_GAIN};
use crate::math::{Quat, Vec3};

/// How far a body turns before that counts, beside what it may at once, for every second, radians a second.
const TURN_RATE: f64 = 2.0;

/// What is known of a lost body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known<'a> {
    pub(super) postures: &'a Postures,
    pub(super) motion: &'a SegmentMotion,
    /// It is lost, not only looked at again.
    pub(super) lost: bool,
}

/// Cost of a direction the root faces at `stamp`, in patches.
pub(super) fn facing_cost(known: Known, root: Quat, stamp: f64) -> f64 {
    let Known { postures, motion, .. } = known;
    let level = |v: Vec3| postures.level(v).normalize_or_zero();
    let ahead = level(root * Vec3::X);
    let mut cost = 0.0;
    if let (Some(tracked), Some(pose)) = (postures.tracked_at, postures.tracked.first()) {
        let turn = level(pose.rotation * Vec3::X).angle_between(ahead);
        let free = MOST_TURNED + TURN_RATE * (stamp - tracked);
        cost += SURE_GAIN * if turn.is_finite() { (turn / free).powi(2).min(1.0) } else { 0.0 };
    }
    motion.walks(postures.up, stamp).map_or(cost, |direction| cost + SURE_GAIN * (1.0 - ahead.dot(direction)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, HumanModel};
    use crate::math::Pose;

    #[test]
    fn to_turn_about_costs_until_there_was_time_for_it() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = body.rest_pose(Pose::identity());
        let mut postures = Postures::default();
        postures.restart(&body, &poses);
        let (same, about) = (poses[0].rotation, Quat::from_rotation_z(std::f64::consts::PI) * poses[0].rotation);
        let motion = SegmentMotion::default();
        assert_eq!(
            facing_cost(Known { postures: &postures, motion: &motion, lost: true }, about, 1.0),
            0.0,
            "nobody knows how it stood"
        );
        postures.remember(&poses, 1.0);
        assert!(facing_cost(Known { postures: &postures, motion: &motion, lost: true }, same, 1.1) < 1e-9);
        assert_eq!(facing_cost(Known { postures: &postures, motion: &motion, lost: true }, about, 1.1), SURE_GAIN);
        assert!(facing_cost(Known { postures: &postures, motion: &motion, lost: true }, about, 6.0) < 0.2 * SURE_GAIN);
    }
}
