//! Confirms a detection as a person: the log odds of successive detections at one position add up until they suffice.

use crate::math::Vec3;

/// Sum of log odds from which on a detection is confirmed as a person, or as being elsewhere than the track. No single detection
/// of a tracked person contributes more.
pub(crate) const ENOUGH_ODDS: f64 = 4.0;
/// Amount subtracted from the log odds of every detection, because the errors of successive detections of a static object are
/// correlated.
pub(crate) const DETECTION_COST: f64 = 1.0;
/// Detections within this distance of the last position are of the same person, meters; farther ones are of another.
pub(crate) const SAME_PERSON: f64 = 0.5;

/// Log odds accumulated over detections at one position.
#[derive(Debug, Default)]
pub(super) struct TentativeDetection {
    place: Vec3,
    sum: f64,
}

impl TentativeDetection {
    /// Updates with a detection: the root position of a person, and the log odds that it is one. Returns whether the person is
    /// confirmed.
    pub(super) fn observe(&mut self, detection: Option<(Vec3, f64)>) -> bool {
        let Some((place, person)) = detection else {
            // Intermittent detections are gradually discarded.
            self.sum *= 0.5;
            return false;
        };
        if place.distance(self.place) > SAME_PERSON {
            self.sum = 0.0;
        }
        (self.place, self.sum) = (place, (self.sum + person - DETECTION_COST).max(0.0));
        self.sum >= ENOUGH_ODDS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the index of the detection, given as log odds and position, at which the person is confirmed.
    fn confirmed(detections: &[Option<(f64, f64)>]) -> Option<usize> {
        let mut tentative = TentativeDetection::default();
        detections.iter().position(|given| tentative.observe(given.map(|(person, x)| (Vec3::new(x, 0.0, 1.0), person))))
    }

    #[test]
    fn one_confident_detection_suffices_and_weak_ones_at_one_position_add_up() {
        assert_eq!(confirmed(&[Some((6.0, 2.0))]), Some(0));
        assert_eq!(confirmed(&[Some((3.0, 2.0)); 5]), Some(1));
        assert_eq!(confirmed(&[Some((2.5, 2.0)), Some((2.5, 2.2)), Some((2.5, 2.4))]), Some(2), "a walking person");
    }

    #[test]
    fn intermittent_and_jumping_detections_are_not_confirmed() {
        assert_eq!(confirmed(&[Some((4.0, 2.0)), None, None, None].repeat(5)), None);
        assert_eq!(confirmed(&[Some((1.0, 2.0)); 50]), None);
        assert_eq!(confirmed(&[Some((4.0, 2.0)), Some((4.0, 4.0))].repeat(5)), None);
    }
}
