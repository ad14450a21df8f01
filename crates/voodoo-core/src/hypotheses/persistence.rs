//! How long frames have contradicted an arm or leg, and whether two consecutive frames requested a change.

use crate::fit::REFERENCE_RATE;

/// Number of consecutive frames that have to contradict an arm or leg, or the whole body, before alternatives are tested: a
/// single frame may be disturbed. Twice as many are required for an arm that only unexplained points contradict.
pub(crate) const PATIENCE: usize = 2;
/// Maximum interval between tests of a suspect chain, in units of 1/30 s. The interval is one unit at first, and one more after
/// each `RETRY_PERIOD` consecutive refusals, because changes of an occluded arm are refused for seconds. When all proposals were
/// hopeless, the maximum applies at once.
pub(super) const RETRY_PERIOD: usize = 4;

/// Stamps of the previous frame and of this one, seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    pub(super) before: f64,
    pub(super) now: f64,
}

impl Times {
    /// Whether this frame is the first in one of the consecutive intervals of `length` / 30 s. Intervals are counted from stamp
    /// zero, so that a missing frame does not shift all later ones.
    fn begin(self, length: usize) -> bool {
        let interval = |stamp: f64| (stamp * REFERENCE_RATE / length as f64).floor();
        interval(self.before) < interval(self.now)
    }
}

/// Evidence of past frames against one arm or leg.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Persistence {
    /// Number of consecutive frames that contradict it.
    frames: usize,
    /// Number of consecutive frames that contradict it without a vote for a change.
    refused: usize,
    /// Whether this frame voted for a change, and whether the previous frame did.
    voted: bool,
    voted_before: bool,
    /// Whether all proposals of its last test were hopeless.
    paused: bool,
}

impl Persistence {
    /// Updates with a frame. If the frame contradicts the chain, `patience` is the number of consecutive such frames before a
    /// test; otherwise it is `None`. Returns whether to test alternatives in this frame. A chain whose changes were refused for
    /// long is tested in fewer frames, except where there is `new` evidence. To be called in every frame.
    pub(super) fn observe(&mut self, patience: Option<usize>, new: bool, times: Times) -> bool {
        let voted_before = self.voted;
        self.voted = false;
        let Some(patience) = patience else {
            *self = Self::default();
            return false;
        };
        self.voted_before = voted_before;
        self.frames += 1;
        self.refused += 1;
        let every = if self.paused { RETRY_PERIOD } else { self.refused.div_ceil(RETRY_PERIOD).min(RETRY_PERIOD) };
        let due = every == 1 || times.begin(every);
        self.paused &= !due;
        self.frames >= patience && (due || new)
    }

    /// Delays the next test, because all proposals in this frame were hopeless.
    pub(super) fn pause(&mut self) {
        self.paused = true;
    }

    /// Requests a change in this frame. Returns whether to make it: whether the previous frame requested one as well.
    pub(super) fn vote(&mut self) -> bool {
        self.voted = true;
        self.refused = 0;
        self.voted_before
    }

    /// Whether the previous frame requested a change.
    pub(super) fn voted_before(&self) -> bool {
        self.voted_before
    }

    /// Whether this frame requests a change.
    pub(super) fn requests_change(&self) -> bool {
        self.voted
    }

    /// Whether the last frame did not contradict the chain.
    pub(super) fn is_clear(&self) -> bool {
        self.frames == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stamps of a frame that begins an interval of any length.
    const FIRST: Times = Times { before: f64::NEG_INFINITY, now: 0.0 };

    /// Stamps of a frame by its number. Frame 0 begins an interval of any length.
    fn frame(number: usize) -> Times {
        let stamp = |number: f64| (number + 0.5) / REFERENCE_RATE;
        Times { before: stamp(number as f64 - 1.0), now: stamp(number as f64) }
    }

    #[test]
    fn a_change_is_made_when_two_consecutive_frames_request_it() {
        let mut persistence = Persistence::default();
        assert!(!persistence.observe(Some(2), false, FIRST) && persistence.observe(Some(2), false, FIRST));
        assert!(!persistence.vote());
        assert!(persistence.observe(Some(2), false, FIRST) && persistence.vote());
        // A frame without a request in between starts over.
        assert!(persistence.observe(Some(2), false, FIRST));
        assert!(persistence.observe(Some(2), false, FIRST) && !persistence.vote());
    }

    #[test]
    fn a_frame_that_is_not_tested_for_lack_of_patience_interrupts_the_votes() {
        let mut persistence = Persistence::default();
        persistence.observe(Some(2), false, FIRST);
        assert!(persistence.observe(Some(2), false, FIRST) && !persistence.vote());
        assert!(!persistence.observe(Some(4), false, FIRST));
        assert!(
            persistence.observe(Some(4), false, FIRST) && !persistence.vote(),
            "the vote before the gap was counted"
        );
        assert!(persistence.observe(Some(4), false, FIRST) && persistence.vote());
    }

    #[test]
    fn a_frame_that_does_not_contradict_clears_the_evidence() {
        let mut persistence = Persistence::default();
        persistence.observe(Some(1), false, FIRST);
        persistence.vote();
        assert!(!persistence.is_clear() && !persistence.observe(None, false, FIRST) && persistence.is_clear());
        assert!(
            !persistence.observe(Some(2), false, FIRST)
                && persistence.observe(Some(2), false, FIRST)
                && !persistence.vote()
        );
    }

    #[test]
    fn a_chain_with_hopeless_proposals_waits_for_the_next_longest_interval_unless_it_is_cleared() {
        for first in 0..RETRY_PERIOD {
            let mut persistence = Persistence::default();
            assert!(persistence.observe(Some(1), false, frame(first)));
            persistence.pause();
            let tried = |number: usize| persistence.observe(Some(1), false, frame(number));
            let found: Vec<bool> = (first + 1..=RETRY_PERIOD).map(tried).collect();
            assert_eq!(found, (first + 1..=RETRY_PERIOD).map(|number| number >= RETRY_PERIOD).collect::<Vec<_>>());
            persistence.pause();
            assert!(!persistence.observe(None, false, frame(1)) && persistence.observe(Some(1), false, frame(2)));
        }
    }

    #[test]
    fn a_chain_is_tested_less_often_the_longer_it_is_refused_until_it_votes() {
        let mut persistence = Persistence::default();
        let all = RETRY_PERIOD * RETRY_PERIOD + 10 * RETRY_PERIOD;
        let tried: Vec<bool> = (0..all).map(|number| persistence.observe(Some(1), false, frame(number))).collect();
        let due = |tried: &[bool]| tried.iter().filter(|due| **due).count();
        let fours = [0, 1, 3].map(|four| due(&tried[four * RETRY_PERIOD..][..RETRY_PERIOD]));
        assert_eq!((fours, due(&tried[RETRY_PERIOD * RETRY_PERIOD..])), ([4, 2, 1], 10));
        let mut tired = persistence;
        assert!(
            (1..RETRY_PERIOD).all(|number| tired.observe(Some(1), true, frame(all + number))),
            "new evidence is tested at once"
        );
        assert!(persistence.observe(Some(1), false, frame(all)));
        persistence.vote();
        assert!(persistence.observe(Some(1), false, frame(all + 1)) && persistence.vote());
    }

    #[test]
    fn a_missing_frame_does_not_shift_later_tests() {
        let mut persistence = [Persistence::default(); 2];
        let (missing, long) = (5, RETRY_PERIOD * RETRY_PERIOD);
        let tried = |own: &mut Persistence, number: usize, before: usize| {
            let times = Times { before: frame(before).now, now: frame(number).now };
            own.observe(Some(1), false, times)
        };
        for number in 1..2 * long {
            let [whole, damaged] = &mut persistence;
            let truth = tried(whole, number, number - 1);
            if number != missing {
                let last = if number == missing + 1 { missing - 1 } else { number - 1 };
                let same = tried(damaged, number, last) == truth;
                assert!(same || number < long + 2, "frame {number}");
            }
        }
    }

    #[test]
    fn frames_as_far_apart_as_the_longest_interval_are_all_tested() {
        let mut persistence = Persistence::default();
        let apart = RETRY_PERIOD as f64 / REFERENCE_RATE;
        let tried = |number: usize| {
            let now = (number as f64 + 0.5) * apart;
            persistence.observe(Some(1), false, Times { before: now - apart, now })
        };
        assert!((0..20 * RETRY_PERIOD).all(tried));
    }
}
