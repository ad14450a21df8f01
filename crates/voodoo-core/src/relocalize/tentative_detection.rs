//! Whether what a detector sees is a person: looks at one place, one after the other, add up until they are enough.

use crate::math::Vec3;

/// From this sum of log odds on it is a person, or one is elsewhere; no detection of a tracked one counts for more.
pub(crate) const ENOUGH_ODDS: f64 = 4.0;
/// What a look counts less than its log odds: looks at a thing that stands still err alike.
pub(crate) const DETECTION_COST: f64 = 1.0;
/// What is seen within this of the last place is the same, meters; what appears farther away is another one.
pub(crate) const SAME_PERSON: f64 = 0.5;

/// What past looks said.
#[derive(Debug, Default)]
pub(super) struct TentativeDetection {
    place: Vec3,
    sum: f64,
}

impl TentativeDetection {
    /// Takes a frame's look in: where a person's root is, and the log odds that it is one. Whether it is a person now.
    pub(super) fn observe(&mut self, detection: Option<(Vec3, f64)>) -> bool {
        let Some((place, person)) = detection else {
            // What flickers is forgotten.
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

    /// At which of these looks, log odds and place, a person is believed.
    fn confirmed(detections: &[Option<(f64, f64)>]) -> Option<usize> {
        let mut tentative = TentativeDetection::default();
        detections.iter().position(|given| tentative.observe(given.map(|(person, x)| (Vec3::new(x, 0.0, 1.0), person))))
    }

    #[test]
    fn a_sure_detection_is_enough_and_uncertain_ones_at_one_place_add_up() {
        assert_eq!(confirmed(&[Some((6.0, 2.0))]), Some(0));
        assert_eq!(confirmed(&[Some((3.0, 2.0)); 5]), Some(1));
        assert_eq!(confirmed(&[Some((2.5, 2.0)), Some((2.5, 2.2)), Some((2.5, 2.4))]), Some(2), "people walk");
    }

    #[test]
    fn what_flickers_or_jumps_is_nobody() {
        assert_eq!(confirmed(&[Some((4.0, 2.0)), None, None, None].repeat(5)), None);
        assert_eq!(confirmed(&[Some((1.0, 2.0)); 50]), None);
        assert_eq!(confirmed(&[Some((4.0, 2.0)), Some((4.0, 4.0))].repeat(5)), None);
    }
}
