//! Candidates that were recently evaluated and rejected. Furniture stays in place; skipping it lets a new person be detected
//! sooner.

use crate::components::PersonCandidate;

/// A candidate is the same object as a rejected one if it lies within this distance, meters, and their surface areas differ by
/// less than the factor below.
const SAME_PLACE: f64 = 0.15;
const SAME_AREA: f64 = 1.3;
/// Maximum number of remembered rejections; the oldest are dropped.
const MOST_REJECTED: usize = 16;
/// Number of images for which a rejected candidate is not reported as new.
const REJECTED_IMAGES: usize = 5;

/// Rejected candidates and the number of the image in which each was rejected, the latest last.
#[derive(Debug, Default)]
pub(crate) struct Rejections {
    images: usize,
    rejected: Vec<(usize, PersonCandidate)>,
}

impl Rejections {
    /// Starts the next image.
    pub(crate) fn next_image(&mut self) {
        self.images += 1;
    }

    /// Whether a candidate was rejected recently.
    pub(crate) fn is_rejected(&self, candidate: &PersonCandidate) -> bool {
        self.rejected.iter().any(|(image, other)| self.images - image < REJECTED_IMAGES && are_alike(candidate, other))
    }

    /// Where a candidate is among the rejected ones, the latest of which is last; `None` for a new candidate.
    pub(crate) fn last_rejection(&self, candidate: &PersonCandidate) -> Option<usize> {
        self.rejected.iter().rposition(|(_, other)| are_alike(candidate, other))
    }

    /// Records an evaluation.
    pub(crate) fn record(&mut self, candidate: &PersonCandidate, person: bool) {
        self.rejected.retain(|(_, other)| !are_alike(candidate, other));
        if !person {
            if self.rejected.len() == MOST_REJECTED {
                self.rejected.remove(0);
            }
            self.rejected.push((self.images, candidate.clone()));
        }
    }
}

/// Whether a candidate is the same object as a rejected one.
fn are_alike(candidate: &PersonCandidate, rejected: &PersonCandidate) -> bool {
    let ratio = candidate.area / rejected.area;
    let apart = rejected.bounds.center().distance(candidate.bounds.center());
    apart < SAME_PLACE && ratio < SAME_AREA && ratio > 1.0 / SAME_AREA
}
