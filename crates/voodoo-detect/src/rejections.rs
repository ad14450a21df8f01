//! What was looked at lately and is nobody: furniture stands still, and somebody who comes in shall not wait for it.

use crate::components::PersonCandidate;
use voodoo_core::math::Vec3;

/// What stands within this of a rejected place and shows as much surface, by this factor, is the same thing; meters.
const SAME_PLACE: f64 = 0.15;
const SAME_AREA: f64 = 1.3;
/// Things that are remembered, the last ones.
const MOST_REJECTED: usize = 16;
/// What is nobody is no news for so many images.
const REJECTED_IMAGES: usize = 5;

/// Places in the camera's frame, the last one last.
#[derive(Debug, Default)]
pub(crate) struct Rejections {
    evaluations: usize,
    images: usize,
    places: Vec<Rejected>,
}

#[derive(Debug)]
struct Rejected {
    middle: Vec3,
    area: f64,
    evaluation: usize,
    image: usize,
}

impl Rejections {
    /// Another image comes.
    pub(crate) fn next_image(&mut self) {
        self.images += 1;
    }

    /// Whether a candidate was found to be nobody not long ago.
    pub(crate) fn is_rejected(&self, candidate: &PersonCandidate) -> bool {
        self.places.iter().any(|place| self.images - place.image < REJECTED_IMAGES && place.matches(candidate))
    }

    /// Number of the look at which a candidate was last found to be nobody; 0 for a new one.
    pub(crate) fn last_rejection(&self, candidate: &PersonCandidate) -> usize {
        self.places.iter().filter(|place| place.matches(candidate)).map(|place| place.evaluation).max().unwrap_or(0)
    }

    /// Notes a look.
    pub(crate) fn record(&mut self, candidate: &PersonCandidate, person: bool) {
        self.evaluations += 1;
        self.places.retain(|place| !place.matches(candidate));
        if !person {
            if self.places.len() == MOST_REJECTED {
                self.places.remove(0);
            }
            self.places.push(Rejected {
                middle: candidate.middle(),
                area: candidate.area,
                evaluation: self.evaluations,
                image: self.images,
            });
        }
    }
}

impl Rejected {
    fn matches(&self, candidate: &PersonCandidate) -> bool {
        let ratio = candidate.area / self.area;
        self.middle.distance(candidate.middle()) < SAME_PLACE && ratio < SAME_AREA && ratio > 1.0 / SAME_AREA
    }
}
