//! Why a detected person is not tracked.

use crate::relocalize::ENOUGH_ODDS;

/// Why somebody who was detected is not tracked, see [`People::refusal`](crate::People::refusal).
///
/// ```
/// use voodoo_core::Refusal;
///
/// let words = Refusal::LowConfidence { log_odds: 1.5 }.to_string();
/// assert!(words.starts_with("log odds of 1.5"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The detections so far are not certain enough.
    #[error("log odds of {log_odds:.1} that it is a person, expected {ENOUGH_ODDS:.1} before it is tracked")]
    LowConfidence {
        /// Sum of their log odds.
        log_odds: f64,
    },
    /// At the detected joints hardly any limb would be measured.
    #[error("a body at the detected joints, of which hardly any limb would be measured")]
    Unsupported,
}
