//! Whether a limb is where the pose has it, as log odds that frames add to: a filter of two states, right and wrong.
//!
//! From one frame to the next what was right may have gone wrong, the likelier the farther it moved, and what was wrong may have
//! come right; then the frame's evidence is added. So a frame counts for little where those before it were sure, and for much
//! after a fast motion.

/// What speaks for a limb less what speaks against it, as a share, is weighed by this: here the odds are even, and every time as
/// much again makes them e times greater.
const EVEN: f64 = 0.08;
/// One frame says no more than this, log odds: it may be disturbed.
const MOST_SAID: f64 = 4.0;
/// A limb goes wrong, or comes right, in so many frames of a hundred that say nothing.
const CHANGES: f64 = 0.03;
/// A limb that moved by a tenth of this between two frames, metres, goes wrong once in a hundred times, and with the square of
/// the way: what was predicted wrongly is as likely drawn to something else as it is far off.
const FAR: f64 = 0.33;

/// Log odds that something is right.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TwoState {
    log_odds: f64,
}

impl TwoState {
    /// Takes a frame's `evidence`, log odds, after a motion of so many metres.
    pub(super) fn observe(&mut self, evidence: f64, moved: f64) {
        let before = probability(self.log_odds);
        let goes_wrong = (CHANGES + (moved / FAR).powi(2)).min(1.0 - CHANGES);
        let now = before * (1.0 - goes_wrong) + (1.0 - before) * CHANGES;
        self.log_odds = (now / (1.0 - now)).ln() + evidence;
    }

    /// It is likelier right than wrong.
    pub(super) fn holds(&self) -> bool {
        self.log_odds >= 0.0
    }
}

/// Log odds that what shows so much, as a share less what contradicts it, is right.
pub(super) fn said_by(share: f64) -> f64 {
    share / EVEN - 1.0
}

/// Log odds that all of several things are right, given those of each.
pub(super) fn all(log_odds: &[f64]) -> f64 {
    // log(1 + exp(-z)), of each, without overflow.
    let against: f64 = log_odds.iter().map(|z| (-z.abs()).exp().ln_1p() + (-z).max(0.0)).sum();
    bounded(-against.exp_m1().ln())
}

/// Log odds that one of two things is right at least.
pub(super) fn either(one: f64, other: f64) -> f64 {
    -all(&[-one, -other])
}

fn bounded(log_odds: f64) -> f64 {
    log_odds.clamp(-MOST_SAID, MOST_SAID)
}

fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(frames: &[(f64, f64)]) -> TwoState {
        let mut state = TwoState::default();
        frames.iter().for_each(|(evidence, moved)| state.observe(*evidence, *moved));
        state
    }

    #[test]
    fn one_weak_frame_against_what_was_sure_does_not_turn_it_and_several_do() {
        let (good, bad) = ((MOST_SAID, 0.0), (-1.0, 0.0));
        assert!(after(&[good, good, bad, bad]).holds());
        assert!(!after(&[good, good, bad, bad, bad, bad, bad]).holds());
        assert!(!after(&[bad]).holds() && after(&[good]).holds(), "nothing is taken for granted");
    }

    #[test]
    fn what_moved_far_needs_evidence_anew() {
        let weak = |moved| after(&[(MOST_SAID, 0.0), (-1.0, moved)]).holds();
        assert!(weak(0.05) && !weak(0.3));
        // And so it comes back.
        assert!(after(&[(-MOST_SAID, 0.0), (MOST_SAID, 0.0), (1.0, 0.0)]).holds());
    }

    #[test]
    fn probabilities_of_independent_things_multiply() {
        for (one, other) in [(0.3, -1.2), (2.0, 1.0), (-2.0, 0.5)] {
            let both = probability(one) * probability(other);
            assert!((probability(all(&[one, other])) - both).abs() < 1e-12);
            let any = 1.0 - (1.0 - probability(one)) * (1.0 - probability(other));
            assert!((probability(either(one, other)) - any).abs() < 1e-12);
        }
        assert_eq!([all(&[900.0, 900.0]), all(&[-900.0, 900.0])], [MOST_SAID, -MOST_SAID]);
    }

    #[test]
    fn odds_are_even_at_a_share_and_grow_from_there() {
        assert_eq!([said_by(0.0), said_by(EVEN), said_by(2.0 * EVEN)], [-1.0, 0.0, 1.0]);
    }
}
