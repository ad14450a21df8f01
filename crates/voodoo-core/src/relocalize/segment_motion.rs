//! How the largest thing that may be the body moves: a person who walks faces where he goes.

use super::belief::SAME_PERSON;
use crate::math::Vec3;

/// A segment that moves faster than this (m/s), and as far as that takes it in so many seconds, over which it is seen, walks.
const WALKING_SPEED: f64 = 0.3;
const WALKING_TIME: f64 = 0.7;

/// Where it was a while ago and last; world frame.
#[derive(Debug, Default)]
pub(super) struct SegmentMotion {
    /// Since when something is seen that may be the body, seconds.
    pub(super) seen_since: f64,
    first: Option<(f64, Vec3)>,
    last: Vec3,
}

impl SegmentMotion {
    /// Forgets where it was.
    pub(super) fn clear(&mut self) {
        self.first = None;
    }

    /// Notes where it is now, if it is there.
    pub(super) fn observe(&mut self, place: Option<Vec3>, stamp: f64) {
        let Some(place) = place else {
            self.first = None;
            return;
        };
        let jumped = (place - self.last).length() > SAME_PERSON;
        if self.first.is_none() || jumped {
            self.seen_since = stamp;
        }
        if jumped || self.first.is_none_or(|(since, _)| stamp - since > WALKING_TIME) {
            self.first = Some((stamp, place));
        }
        self.last = place;
    }

    /// The level direction in which it walks, if it does.
    pub(super) fn walks(&self, up: Vec3, stamp: f64) -> Option<Vec3> {
        let (since, first) = self.first?;
        let way = self.last - first;
        let way = way - up * way.dot(up);
        let walks = way.length() > WALKING_SPEED * (stamp - since).max(WALKING_TIME);
        walks.then(|| way.normalize_or_zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(speed: f64) -> SegmentMotion {
        let mut motion = SegmentMotion::default();
        for frame in 0..16 {
            let stamp = f64::from(frame) / 30.0;
            motion.observe(Some(Vec3::new(2.0 + speed * stamp, 0.0, 1.0)), stamp);
        }
        motion
    }

    #[test]
    fn who_walks_has_a_direction_and_who_sways_has_none() {
        let walks = seen(1.0).walks(Vec3::Z, 0.5).unwrap();
        assert!(walks.distance(Vec3::X) < 1e-9);
        assert_eq!(seen(0.2).walks(Vec3::Z, 0.5), None);
    }

    #[test]
    fn another_segment_starts_anew() {
        let mut motion = seen(1.0);
        motion.observe(Some(Vec3::new(-3.0, 0.0, 1.0)), 0.6);
        assert_eq!((motion.walks(Vec3::Z, 0.6), motion.seen_since), (None, 0.6));
        motion.observe(None, 0.7);
        assert_eq!(motion.walks(Vec3::Z, 0.7), None);
    }
}
