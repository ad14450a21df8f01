//! Whether what a detector sees is a person: looks at one place, one after the other, add up until they are enough.

use crate::detect::Detection;
use crate::math::Vec3;

/// From this sum of log odds on it is a person.
const ENOUGH_ODDS: f64 = 3.0;
/// What a look counts less than its log odds: looks at a thing that stands still err alike.
const LOOK_COSTS: f64 = 1.0;
/// What is seen within this of the last place is the same, metres.
const SAME_PERSON: f64 = 0.5;
/// Share that is left of what was believed after a frame without it.
const FADES: f64 = 0.5;

/// What past looks said.
#[derive(Debug, Default)]
pub(super) struct Belief {
    place: Vec3,
    sum: f64,
}

impl Belief {
    /// Takes a frame's look in; whether it is a person now.
    pub(super) fn observe(&mut self, seen: Option<&Detection>) -> bool {
        let root = seen.and_then(|seen| Some((seen.joint("humanoid_root")?.position, seen.person)));
        let Some((place, person)) = root else {
            self.sum *= FADES;
            return false;
        };
        if place.distance(self.place) > SAME_PERSON {
            self.sum = 0.0;
        }
        (self.place, self.sum) = (place, (self.sum + person - LOOK_COSTS).max(0.0));
        self.sum >= ENOUGH_ODDS
    }
}
