//! Why a detected person is not tracked.

use crate::relocalize::ENOUGH_ODDS;

/// Why somebody who was detected is not tracked, see [`People::refusal`](crate::People::refusal).
///
/// ```
/// use voodoo_core::Refusal;
///
/// let words = Refusal::LowConfidence { log_odds: 1.5 }.to_string();
/// assert_eq!(words, "not sure enough to be a person: a probability of 81.8 %, expected 98.2 %");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The detections so far are not certain enough.
    #[error("not sure enough to be a person: a probability of {:.1} %, expected {:.1} %", percent(*log_odds), percent(ENOUGH_ODDS))]
    LowConfidence {
        /// Sum of their log odds.
        log_odds: f64,
    },
    /// At the detected joints hardly any limb would be measured.
    #[error("hardly any limb of a body at the detected joints would be measured")]
    Unsupported,
}

fn percent(log_odds: f64) -> f64 {
    100.0 / (1.0 + (-log_odds).exp())
}
