//! Odds that the pose of one limb is right, accumulated over a few frames because single frames are noisy.

use super::two_state::{is_uncertain, updated};
use crate::math::Vec3;
use crate::tracker::estimate::LimbStatus;
use crate::visibility::LITTLE;

/// Odds of one limb, and what the cameras see where it is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LimbFilter {
    /// Log odds of two events: the limb is right, and so is its distal end.
    pub(super) log_odds: [f64; 2],
    /// Fraction of the front-facing patches that this frame violates by free space.
    pub(super) contradicted: f64,
    /// Fraction of them that are unoccluded.
    pub(super) visible: f64,
    /// Displacement of the distal end in the last frame, and its difference to the displacement in the frame before, meters.
    motion: Vec3,
    pub(super) unexpected: f64,
}

impl LimbFilter {
    /// Updates with the displacement of the distal end since the last frame, meters.
    pub(super) fn moved(&mut self, motion: Vec3) {
        self.unexpected = motion.distance(self.motion);
        self.motion = motion;
    }

    /// Updates both odds with the log odds from this frame's measurements for the limb and for its distal end, and with those
    /// from a detection. `unexpected` is the unexpected part of the motion, meters.
    pub(super) fn observe(&mut self, evidence: [f64; 2], detected: f64, unexpected: f64) {
        for (log_odds, evidence) in self.log_odds.iter_mut().zip(evidence) {
            *log_odds = updated(*log_odds, evidence, detected, unexpected);
        }
    }

    /// Whether the cameras see where the limb is.
    pub(super) fn is_visible(&self) -> bool {
        self.visible >= LITTLE
    }

    /// Returns the status of a limb with these log odds: it is measured where measurements support it, and lost where it should be
    /// visible but is not, or cannot be right.
    pub(super) fn status(&self, log_odds: f64) -> LimbStatus {
        if log_odds >= 0.0 {
            LimbStatus::Measured
        } else if self.contradicted > LITTLE || log_odds == f64::NEG_INFINITY {
            LimbStatus::Lost
        } else {
            LimbStatus::Inferred
        }
    }

    /// Whether the evidence for or against the limb is weak.
    pub(super) fn is_uncertain(&self) -> bool {
        is_uncertain(self.log_odds[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::assess::two_state::support_log_odds;

    /// Status after frames with these fractions: supporting the limb, violated by free space, unoccluded.
    fn after(frames: &[[f64; 3]]) -> LimbStatus {
        let mut limb = LimbFilter::default();
        for [supporting, contradicted, visible] in frames {
            (limb.contradicted, limb.visible) = (*contradicted, *visible);
            limb.observe([support_log_odds(supporting - contradicted); 2], 0.0, 0.0);
        }
        limb.status(limb.log_odds[0])
    }

    #[test]
    fn a_measured_limb_is_lost_after_three_contradicting_frames_but_not_after_one() {
        let (good, bad) = ([0.5, 0.0, 1.0], [0.0, 1.0, 1.0]);
        assert_eq!(after(&[good, good]), LimbStatus::Measured);
        assert_ne!(after(&[good, good, good, bad]), LimbStatus::Inferred);
        assert_eq!(after(&[good, good, bad, bad, bad]), LimbStatus::Lost);
    }

    #[test]
    fn a_limb_without_support_is_inferred_and_one_that_violates_free_space_lost() {
        assert_eq!(after(&[[0.0, 0.0, 0.1]]), LimbStatus::Inferred);
        assert_eq!(after(&[[0.0, 0.0, 1.0]]), LimbStatus::Inferred);
        assert_eq!(after(&[[0.0, 0.5, 1.0]]), LimbStatus::Lost);
    }

    #[test]
    fn a_limb_may_be_right_and_its_end_not() {
        let mut limb = LimbFilter::default();
        limb.observe([2.0, -1.0], 0.0, 0.0);
        let [whole, end] = limb.log_odds.map(|log_odds| limb.status(log_odds));
        assert_eq!([whole, end], [LimbStatus::Measured, LimbStatus::Inferred]);
    }
}
