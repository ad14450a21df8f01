//! Odds that the pose of one limb is right, accumulated over a few frames because single frames are noisy: a binary Bayes filter in
//! log odds.
//!
//! Between frames, a right limb may become wrong, with a probability that grows with its unexpected motion, and a wrong limb may
//! become right. Then the evidence of the frame is added. A single frame therefore changes little after a run of confident
//! frames, and much after a fast motion.

use crate::math::{Vec3, probability};
use crate::tracker::estimate::LimbStatus;
use crate::visibility::LITTLE;

/// Scale of the net support, the supporting minus the contradicting fraction, in log odds. At this value the odds are even, and
/// each further multiple adds 1 to the log odds.
pub(super) const EVEN: f64 = 0.08;
/// Probability that a limb at rest becomes wrong, or right, from one frame to the next. The evidence of a frame is limited to the
/// log odds of this, since a single frame may be disturbed: an observation that contradicts a confident state has to be repeated.
const CHANGES: f64 = 0.05;
/// An arm or leg whose end is this far from its position extrapolated by the last motion, meters, counts as wrong before the
/// evidence is added. For smaller distances the probability grows with the square of the distance, because the error of a
/// prediction is proportional to it.
const FAR: f64 = 0.15;

/// Odds of one limb, and what the cameras see where it is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LimbFilter {
    /// Log odds of two events: the limb is right, and so is its distal end.
    pub(super) log_odds: [f64; 2],
    /// Evidence of this frame, other than that of patches for arms and legs.
    pub(super) evidence: f64,
    /// Fraction of the front-facing patches that this frame violates by free space.
    pub(super) contradicted: f64,
    /// Fraction of them that are unoccluded.
    pub(super) visible: f64,
    /// Displacement of the distal end in the last frame, and its difference to the displacement in the frame before, meters.
    pub(super) motion: Vec3,
    pub(super) unexpected: f64,
}

impl LimbFilter {
    /// Updates both odds with the log odds from this frame's measurements for the limb and for its distal end, and with those
    /// from a detection. `unexpected` is the unexpected part of the motion, meters.
    pub(super) fn observe(&mut self, evidence: [f64; 2], detected: f64, unexpected: f64) {
        for (log_odds, evidence) in self.log_odds.iter_mut().zip(evidence) {
            *log_odds = updated(*log_odds, evidence, detected, unexpected);
        }
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
}

/// Returns the log odds that a limb is right, given those before the frame, and those from the frame's images and from a detector,
/// after a motion of which `unexpected` meters were not predicted.
fn updated(log_odds: f64, images: f64, detector: f64, unexpected: f64) -> f64 {
    let before = probability(log_odds);
    let goes_wrong = (CHANGES + (unexpected / FAR).powi(2)).min(1.0);
    let now = before * (1.0 - goes_wrong) + (1.0 - before) * CHANGES;
    let evidence = [images, detector].map(|value| value.clamp(-max_log_odds(), max_log_odds()));
    (now / (1.0 - now)).ln() + evidence[0] + evidence[1]
}

/// Whether log odds are smaller than the evidence of a frame without any support.
pub(super) fn is_uncertain(log_odds: f64) -> bool {
    log_odds.abs() < -support_log_odds(0.0)
}

/// Returns the log odds that a limb is right, from the fraction of its surface that supports it minus the one that contradicts
/// it.
pub(super) fn support_log_odds(fraction: f64) -> f64 {
    fraction / EVEN - 1.0
}

/// Returns the log odds that all of several events are true, given those of each.
pub(super) fn all_log_odds(log_odds: &[f64]) -> f64 {
    // log(1 + exp(-z)) for each, without overflow.
    let against: f64 = log_odds.iter().map(|z| (-z.abs()).exp().ln_1p() + (-z).max(0.0)).sum();
    -against.exp_m1().ln()
}

/// Returns the log odds that at least one of two events is true.
pub(super) fn any_log_odds(one: f64, other: f64) -> f64 {
    -all_log_odds(&[-one, -other])
}

/// Limit of the evidence: the log odds that a limb at rest did not change.
fn max_log_odds() -> f64 {
    ((1.0 - CHANGES) / CHANGES).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Log odds after frames with this evidence of images, and unexpected motion.
    fn after(frames: &[(f64, f64)]) -> f64 {
        frames.iter().fold(0.0, |log_odds, (evidence, moved)| updated(log_odds, *evidence, 0.0, *moved))
    }

    #[test]
    fn one_weak_frame_does_not_reverse_a_confident_state_and_several_do() {
        let (good, bad) = ((max_log_odds(), 0.0), (-1.0, 0.0));
        assert!(after(&[good, good, bad, bad]) >= 0.0);
        assert!(after(&[good, good, bad, bad, bad, bad, bad]) < 0.0);
        assert!(after(&[bad]) < 0.0 && after(&[good]) >= 0.0, "the initial odds are even");
    }

    #[test]
    fn a_limb_that_moved_far_needs_new_evidence() {
        let weak = |moved| after(&[(max_log_odds(), 0.0), (-1.0, moved)]) >= 0.0;
        assert!(weak(0.02) && !weak(0.15));
        // A wrong limb becomes right in the same way.
        assert!(after(&[(-max_log_odds(), 0.0), (max_log_odds(), 0.0), (1.0, 0.0)]) >= 0.0);
    }

    #[test]
    fn one_detection_does_not_reverse_a_confident_state_and_two_reverse_it_without_images() {
        let detection = -20.0;
        let confident = (0..5).fold(0.0, |log_odds, _| updated(log_odds, max_log_odds(), 0.0, 0.0));
        let once = updated(confident, max_log_odds(), detection, 0.0);
        assert!(once >= 0.0 && !is_uncertain(once));
        let twice = (0..2).fold(once, |log_odds, _| updated(log_odds, 0.0, detection, 0.0));
        assert!(twice < 0.0 && is_uncertain(0.0));
    }

    #[test]
    fn probabilities_of_independent_events_multiply() {
        for (one, other) in [(0.3, -1.2), (2.0, 1.0), (-2.0, 0.5)] {
            let both = probability(one) * probability(other);
            assert!((probability(all_log_odds(&[one, other])) - both).abs() < 1e-12);
            let any = 1.0 - (1.0 - probability(one)) * (1.0 - probability(other));
            assert!((probability(any_log_odds(one, other)) - any).abs() < 1e-12);
        }
        assert_eq!([all_log_odds(&[-90.0, 90.0]), any_log_odds(-90.0, 5.0)], [-90.0, 5.0]);
        assert_eq!(
            [all_log_odds(&[f64::INFINITY]), all_log_odds(&[1.0, f64::NEG_INFINITY])],
            [f64::INFINITY, f64::NEG_INFINITY]
        );
    }

    #[test]
    fn log_odds_are_zero_at_the_even_fraction_and_grow_linearly() {
        assert_eq!([support_log_odds(0.0), support_log_odds(EVEN), support_log_odds(2.0 * EVEN)], [-1.0, 0.0, 1.0]);
    }

    /// Status after frames with these fractions: supporting the limb, violated by free space, unoccluded.
    fn status_after(frames: &[[f64; 3]]) -> LimbStatus {
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
        assert_eq!(status_after(&[good, good]), LimbStatus::Measured);
        assert_ne!(status_after(&[good, good, good, bad]), LimbStatus::Inferred);
        assert_eq!(status_after(&[good, good, bad, bad, bad]), LimbStatus::Lost);
    }

    #[test]
    fn a_limb_without_support_is_inferred_and_one_that_violates_free_space_lost() {
        assert_eq!(status_after(&[[0.0, 0.0, 0.1]]), LimbStatus::Inferred);
        assert_eq!(status_after(&[[0.0, 0.0, 1.0]]), LimbStatus::Inferred);
        assert_eq!(status_after(&[[0.0, 0.5, 1.0]]), LimbStatus::Lost);
    }

    #[test]
    fn a_limb_may_be_right_and_its_end_not() {
        let mut limb = LimbFilter::default();
        limb.observe([2.0, -1.0], 0.0, 0.0);
        let [whole, end] = limb.log_odds.map(|log_odds| limb.status(log_odds));
        assert_eq!([whole, end], [LimbStatus::Measured, LimbStatus::Inferred]);
    }
}
