//! Why a detected person is not tracked.

use crate::math::probability;
use crate::relocalize::ENOUGH_ODDS;

/// Why somebody who was detected is not tracked, see [`People::refusal`](crate::People::refusal).
///
/// ```
/// use voodoo_core::Refusal;
///
/// let words = Refusal::LowConfidence { log_odds: 1.5 }.to_string();
/// assert_eq!(words, "not sure enough to be a person: a probability of 0.818, expected 0.982");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The detections so far are not certain enough.
    #[error("not sure enough to be a person: a probability of {:.3}, expected {:.3}", probability(*log_odds), probability(ENOUGH_ODDS))]
    LowConfidence {
        /// Sum of their log odds.
        log_odds: f64,
    },
    /// At the detected joints hardly any limb would be measured.
    #[error("hardly any limb of a body at the detected joints would be measured")]
    Unsupported,
}
