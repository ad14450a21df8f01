//! How long frames have spoken against an arm or leg, and whether two in a row asked for the same change.

use crate::fit::REFERENCE_RATE;

/// Frames in a row that have to speak against an arm or leg, or against the whole body, and twice as many against an arm by nothing but
/// unexplained points: a single frame may be disturbed.
pub(crate) const PATIENCE: usize = 2;
/// A chain is tried in every second 1/30 s only after so many refusals in a row, in every third after twice as many, and so on, but at
/// least in every `REST`th: a hidden arm is refused for seconds. That is as well the next one where nothing came near to what the frame
/// shows.
pub(super) const REST: usize = 4;

/// Times of the frame before and of this one, seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    pub(super) before: f64,
    pub(super) now: f64,
}

impl Times {
    /// Whether this frame is the first in one of the intervals of so many 1/30 s that follow each other. They do not depend on
    /// when somebody began to count: a frame that is missing must not move all that come after it.
    fn begin(self, length: usize) -> bool {
        let interval = |stamp: f64| (stamp * REFERENCE_RATE / length as f64).floor();
        interval(self.before) < interval(self.now)
    }
}

/// What past frames said against one arm or leg.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Persistence {
    /// Frames in a row that spoke against it.
    frames: usize,
    /// How often it was refused a change since it was in order, or since a frame asked for one.
    refused: usize,
    /// This frame voted for a change, and the frame before did.
    voted: bool,
    voted_before: bool,
    /// Nothing came near to what the frame showed in which it was tried last.
    rests: bool,
}

impl Persistence {
    /// Takes note of a frame, which speaks against the chain when it names how many such frames it takes; whether it is time
    /// to try other configurations: of a chain that was refused for long in few frames, but where there is something `new`. To be
    /// called in every frame.
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
        let every = if self.rests { REST } else { self.refused.div_ceil(REST).min(REST) };
        let due = every == 1 || times.begin(every);
        self.rests &= !due;
        self.frames >= patience && (due || new)
    }

    /// Nothing that was tried in this frame came near to what it shows: the next frames will hardly think otherwise.
    pub(super) fn pause(&mut self) {
        self.rests = true;
    }

    /// This frame asks for a change; whether it is made, because the frame before asked as well: a single frame may be disturbed.
    pub(super) fn vote(&mut self) -> bool {
        self.voted = true;
        self.refused = 0;
        self.voted_before
    }

    /// The frame before this one asked for a change.
    pub(super) fn voted_before(&self) -> bool {
        self.voted_before
    }

    /// This frame asks for a change.
    pub(super) fn requests_change(&self) -> bool {
        self.voted
    }

    /// Nothing speaks against the chain.
    pub(super) fn is_clear(&self) -> bool {
        self.frames == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every interval begins with the first frame.
    const FIRST: Times = Times { before: f64::NEG_INFINITY, now: 0.0 };

    /// The times of a frame, by its number from one that begins every interval on.
    fn frame(number: usize) -> Times {
        let stamp = |number: f64| (number + 0.5) / REFERENCE_RATE;
        Times { before: stamp(number as f64 - 1.0), now: stamp(number as f64) }
    }

    #[test]
    fn a_change_is_made_when_two_frames_in_a_row_ask_for_it() {
        let mut persistence = Persistence::default();
        assert!(!persistence.observe(Some(2), false, FIRST) && persistence.observe(Some(2), false, FIRST));
        assert!(!persistence.vote());
        assert!(persistence.observe(Some(2), false, FIRST) && persistence.vote());
        // A frame between that does not ask starts anew.
        assert!(persistence.observe(Some(2), false, FIRST));
        assert!(persistence.observe(Some(2), false, FIRST) && !persistence.vote());
    }

    #[test]
    fn a_frame_that_is_not_tried_for_lack_of_patience_is_a_gap() {
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
    fn a_frame_in_order_forgets_everything() {
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
    fn a_chain_for_which_nothing_came_near_waits_for_the_next_fourth_frame_unless_it_was_in_order() {
        for first in 0..REST {
            let mut persistence = Persistence::default();
            assert!(persistence.observe(Some(1), false, frame(first)));
            persistence.pause();
            let tried = |number: usize| persistence.observe(Some(1), false, frame(number));
            let found: Vec<bool> = (first + 1..=REST).map(tried).collect();
            assert_eq!(found, (first + 1..=REST).map(|number| number >= REST).collect::<Vec<_>>());
            persistence.pause();
            assert!(!persistence.observe(None, false, frame(1)) && persistence.observe(Some(1), false, frame(2)));
        }
    }

    #[test]
    fn a_chain_is_tried_less_the_longer_it_is_refused_until_it_asks() {
        let mut persistence = Persistence::default();
        let all = REST * REST + 10 * REST;
        let tried: Vec<bool> = (0..all).map(|number| persistence.observe(Some(1), false, frame(number))).collect();
        let due = |tried: &[bool]| tried.iter().filter(|due| **due).count();
        let fours = [0, 1, 3].map(|four| due(&tried[four * REST..][..REST]));
        assert_eq!((fours, due(&tried[REST * REST..])), ([4, 2, 1], 10));
        let mut tired = persistence;
        assert!((1..REST).all(|number| tired.observe(Some(1), true, frame(all + number))), "there is something new");
        assert!(persistence.observe(Some(1), false, frame(all)));
        persistence.vote();
        assert!(persistence.observe(Some(1), false, frame(all + 1)) && persistence.vote());
    }

    #[test]
    fn a_missing_frame_moves_none_of_those_that_come_after_it() {
        let mut persistence = [Persistence::default(); 2];
        let (missing, long) = (5, REST * REST);
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
    fn slower_frames_are_all_tried_where_they_are_as_far_apart_as_tries() {
        let mut persistence = Persistence::default();
        let apart = REST as f64 / REFERENCE_RATE;
        let tried = |number: usize| {
            let now = (number as f64 + 0.5) * apart;
            persistence.observe(Some(1), false, Times { before: now - apart, now })
        };
        assert!((0..20 * REST).all(tried));
    }
}
