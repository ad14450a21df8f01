//! How long frames have spoken against an arm or leg, and whether two in a row asked for the same change.

/// Frames in a row that have to speak against an arm or leg, or against the whole body, and twice as many against an arm by nothing but
/// unexplained points: a single frame may be disturbed. An arm or leg rests for as many where nothing came near.
pub const PATIENCE: usize = 2;

/// What past frames said against one arm or leg.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Persistence {
    /// Frames in a row that spoke against it.
    frames: usize,
    /// This frame voted for a change, and the frame before did.
    voted: bool,
    voted_before: bool,
    /// So many more frames are let pass.
    rest: usize,
}

impl Persistence {
    /// Takes note of a frame, which speaks against the chain when it names how many such frames it takes; whether it is time
    /// to try other configurations, and it does not rest, or there is something `new`. To be called in every frame.
    pub(super) fn observe(&mut self, patience: Option<usize>, new: bool) -> bool {
        let voted_before = self.voted;
        self.voted = false;
        let Some(patience) = patience else {
            *self = Self::default();
            return false;
        };
        self.voted_before = voted_before;
        self.frames += 1;
        let rests = self.rest > 0 && !new;
        self.rest = self.rest.saturating_sub(1);
        self.frames >= patience && !rests
    }

    /// Nothing that was tried in this frame came near to what it shows: the next frames will hardly think otherwise.
    pub(super) fn rest(&mut self) {
        self.rest = PATIENCE;
    }

    /// This frame asks for a change; whether it is made, because the frame before asked as well: a single frame may be disturbed.
    pub(super) fn vote(&mut self) -> bool {
        self.voted = true;
        self.voted_before
    }

    /// The frame before this one asked for a change.
    pub(super) fn voted_before(&self) -> bool {
        self.voted_before
    }

    /// This frame asks for a change.
    pub(super) fn asks(&self) -> bool {
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

    #[test]
    fn a_change_is_made_when_two_frames_in_a_row_ask_for_it() {
        let mut persistence = Persistence::default();
        assert!(!persistence.observe(Some(2), false) && persistence.observe(Some(2), false));
        assert!(!persistence.vote());
        assert!(persistence.observe(Some(2), false) && persistence.vote());
        // A frame between that does not ask starts anew.
        assert!(persistence.observe(Some(2), false));
        assert!(persistence.observe(Some(2), false) && !persistence.vote());
    }

    #[test]
    fn a_frame_that_is_not_tried_for_lack_of_patience_is_a_gap() {
        let mut persistence = Persistence::default();
        persistence.observe(Some(2), false);
        assert!(persistence.observe(Some(2), false) && !persistence.vote());
        assert!(!persistence.observe(Some(4), false));
        assert!(persistence.observe(Some(4), false) && !persistence.vote(), "the vote before the gap was counted");
        assert!(persistence.observe(Some(4), false) && persistence.vote());
    }

    #[test]
    fn a_frame_in_order_forgets_everything() {
        let mut persistence = Persistence::default();
        persistence.observe(Some(1), false);
        persistence.vote();
        assert!(!persistence.is_clear() && !persistence.observe(None, false) && persistence.is_clear());
        assert!(!persistence.observe(Some(2), false) && persistence.observe(Some(2), false) && !persistence.vote());
    }

    #[test]
    fn a_chain_for_which_nothing_came_near_rests_unless_it_was_in_order_or_there_is_something_new() {
        let mut persistence = Persistence::default();
        assert!(persistence.observe(Some(1), false));
        persistence.rest();
        let tried: Vec<bool> = (0..5).map(|_| persistence.observe(Some(1), false)).collect();
        assert_eq!(tried, [false, false, true, true, true]);
        persistence.rest();
        assert!(persistence.observe(Some(1), true));
        assert!(!persistence.observe(None, false) && persistence.observe(Some(1), false));
    }
}
