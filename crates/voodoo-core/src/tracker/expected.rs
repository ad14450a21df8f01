//! Extrapolation of the body from the last two estimates to other times.

use super::BodyTracker;
use crate::error::TrackError;
use crate::math::{Pose, Vec3};

/// Poses of all limbs in the last two estimates, world frame.
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Body, Config, Frame, HumanModel, Tracker};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let mut tracker = Tracker::new(body.clone(), Config::default())?;
/// tracker.reset_pose(&body.rest_pose(Pose::IDENTITY))?;
/// assert!(tracker.limb_motion().is_none()); // before two frames
/// for stamp in [0.0, 0.1] {
///     tracker.step(&Frame::empty(stamp))?;
/// }
/// let motion = tracker.limb_motion().ok_or("two frames give a motion")?;
/// let velocity: Vec3 = (motion.now[0].translation - motion.before[0].translation) / motion.interval; // m/s
/// assert!(velocity.length() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct LimbMotion<'a> {
    /// Poses in the last estimate.
    pub now: &'a [Pose],
    /// Poses in the estimate before.
    pub before: &'a [Pose],
    /// Time between the two estimates, seconds.
    pub interval: f64,
}

impl LimbMotion<'_> {
    /// Largest plausible speed of a point of the body, meters per second. A faster one has jumped and is expected to stay where it is.
    pub const FASTEST: f64 = 8.0;
}

impl BodyTracker {
    /// Returns the motion of the limbs between the last two estimates; `None` where these are unrelated, as after a reset.
    pub fn limb_motion(&self) -> Option<LimbMotion<'_>> {
        let (before, now) = (&self.before, &self.estimate);
        let interval = now.stamp - before.stamp;
        let same = before.world_from_limb.len() == now.world_from_limb.len() && before.sites.len() == now.sites.len();
        (interval > 0.0 && same).then_some(LimbMotion {
            now: &now.world_from_limb,
            before: &before.world_from_limb,
            interval,
        })
    }

    /// Returns the expected position of every site at a time, world frame, meters: the last estimate, extrapolated by the
    /// fraction of its motion that is expected to continue ([`crate::Config::prediction`]).
    ///
    /// # Errors
    /// [`TrackError::NotInitialized`] without a pose.
    pub fn expected_sites(&self, stamp: f64) -> Result<Vec<Vec3>, TrackError> {
        self.started()?;
        let sites = &self.estimate.sites;
        let Some(LimbMotion { interval, .. }) = self.limb_motion() else { return Ok(sites.clone()) };
        let elapsed = self.config.prediction * (stamp - self.estimate.stamp);
        let moved = |(place, before): (&Vec3, &Vec3)| {
            let velocity = (*place - *before) / interval;
            if velocity.length() <= LimbMotion::FASTEST { *place + elapsed * velocity } else { *place }
        };
        Ok(sites.iter().zip(&self.before.sites).map(moved).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::{Body, Config};

    /// Returns a tracker whose body moved by `shift` within a tenth of a second.
    fn moved(shift: Vec3) -> BodyTracker {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut tracker = BodyTracker::new(body.clone(), Config { prediction: 0.5, ..Config::default() }).unwrap();
        assert!(matches!(tracker.expected_sites(0.0), Err(TrackError::NotInitialized)));
        tracker.reset_pose(&body.rest_pose(Pose::IDENTITY)).unwrap();
        tracker.before = tracker.estimate.clone();
        tracker.reset_pose(&body.rest_pose(Pose::from_translation(shift))).unwrap();
        (tracker.before.stamp, tracker.estimate.stamp) = (0.0, 0.1);
        tracker
    }

    #[test]
    fn sites_go_on_by_a_fraction_of_their_motion_and_rest_after_a_jump() {
        let step = Vec3::new(0.1, -0.02, 0.0);
        let tracker = moved(step);
        let now = tracker.estimate.sites.clone();
        for (elapsed, fraction) in [(0.0, 0.0), (0.1, 0.5), (-0.02, -0.1)] {
            let expected = tracker.expected_sites(0.1 + elapsed).unwrap();
            assert!(expected.iter().zip(&now).all(|(site, now)| site.distance(*now + fraction * step) < 1e-12));
        }
        let jumped = moved(Vec3::new(2.0, 0.0, 0.0));
        assert_eq!(jumped.expected_sites(0.2).unwrap(), jumped.estimate.sites);
    }

    #[test]
    fn nothing_is_known_of_the_motion_after_a_reset_or_with_another_body() {
        let mut tracker = moved(Vec3::X);
        assert_eq!(tracker.limb_motion().unwrap().interval, 0.1);
        tracker.remove_limb("l_hand").unwrap();
        assert!(tracker.limb_motion().is_none());
        let mut tracker = moved(Vec3::X);
        let poses = tracker.estimate.world_from_limb.clone();
        tracker.reset_pose(&poses).unwrap();
        assert!(tracker.limb_motion().is_none());
        assert_eq!(tracker.expected_sites(9.0).unwrap(), tracker.estimate.sites);
    }
}
