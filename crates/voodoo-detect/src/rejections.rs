//! Candidates that were recently evaluated and rejected. Furniture stays in place; skipping it lets a new person be detected
//! sooner.

use crate::components::PersonCandidate;
use voodoo_core::math::Vec3;

/// A candidate is the same object as a rejected one if it lies within this distance, meters, and their surface areas differ by
/// less than the factor below.
const SAME_PLACE: f64 = 0.15;
const SAME_AREA: f64 = 1.3;
/// Maximum number of remembered rejections; the oldest are dropped.
const MOST_REJECTED: usize = 16;
/// Number of images for which a rejected candidate is not reported as new.
const REJECTED_IMAGES: usize = 5;

/// Rejected positions, camera frame, the latest last.
#[derive(Debug, Default)]
pub(crate) struct Rejections {
    images: usize,
    places: Vec<Rejected>,
}

#[derive(Debug)]
struct Rejected {
    middle: Vec3,
    area: f64,
    image: usize,
}

impl Rejections {
    /// Starts the next image.
    pub(crate) fn next_image(&mut self) {
        self.images += 1;
    }

    /// Whether a candidate was rejected recently.
    pub(crate) fn is_rejected(&self, candidate: &PersonCandidate) -> bool {
        self.places.iter().any(|place| self.images - place.image < REJECTED_IMAGES && place.matches(candidate))
    }

    /// Where a candidate is among the rejected ones, the latest of which is last; `None` for a new candidate.
    pub(crate) fn last_rejection(&self, candidate: &PersonCandidate) -> Option<usize> {
        self.places.iter().rposition(|place| place.matches(candidate))
    }

    /// Records an evaluation.
    pub(crate) fn record(&mut self, candidate: &PersonCandidate, person: bool) {
        self.places.retain(|place| !place.matches(candidate));
        if !person {
            if self.places.len() == MOST_REJECTED {
                self.places.remove(0);
            }
            self.places.push(Rejected { middle: candidate.middle(), area: candidate.area, image: self.images });
        }
    }
}

impl Rejected {
    fn matches(&self, candidate: &PersonCandidate) -> bool {
        let ratio = candidate.area / self.area;
        self.middle.distance(candidate.middle()) < SAME_PLACE && ratio < SAME_AREA && ratio > 1.0 / SAME_AREA
    }
}
