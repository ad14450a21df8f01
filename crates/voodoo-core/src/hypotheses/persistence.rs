//! How long frames have spoken against an arm or leg, and whether two in a row asked for the same change.

/// Frames in a row that have to speak against an arm or leg, and twice as many against an arm by nothing but unexplained points:
/// a single frame may be disturbed.
pub(super) const PATIENCE: usize = 2;
/// After so many refusals in a row a chain is tried in every fourth frame only: a hidden arm is refused for seconds.
const TIRED: usize = 30;

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
}

impl Persistence {
    /// Takes note of a frame, which speaks against the chain when it names how many such frames it takes; whether it is time
    /// to try other configurations. To be called in every frame.
    pub(super) fn observe(&mut self, patience: Option<usize>) -> bool {
        let voted_before = self.voted;
        self.voted = false;
        let Some(patience) = patience else {
            *self = Self::default();
            return false;
        };
        self.voted_before = voted_before;
        self.frames += 1;
        self.refused += 1;
        let rests = self.refused > TIRED && !self.refused.is_multiple_of(2 * PATIENCE);
        self.frames >= patience && !rests
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
        assert!(!persistence.observe(Some(2)) && persistence.observe(Some(2)));
        assert!(!persistence.vote());
        assert!(persistence.observe(Some(2)) && persistence.vote());
        // A frame between that does not ask starts anew.
        assert!(persistence.observe(Some(2)));
        assert!(persistence.observe(Some(2)) && !persistence.vote());
    }

    #[test]
    fn a_frame_that_is_not_tried_for_lack_of_patience_is_a_gap() {
        let mut persistence = Persistence::default();
        persistence.observe(Some(2));
        assert!(persistence.observe(Some(2)) && !persistence.vote());
        assert!(!persistence.observe(Some(4)));
        assert!(persistence.observe(Some(4)) && !persistence.vote(), "the vote before the gap was counted");
        assert!(persistence.observe(Some(4)) && persistence.vote());
    }

    #[test]
    fn a_frame_in_order_forgets_everything() {
        let mut persistence = Persistence::default();
        persistence.observe(Some(1));
        persistence.vote();
        assert!(!persistence.is_clear() && !persistence.observe(None) && persistence.is_clear());
        assert!(!persistence.observe(Some(2)) && persistence.observe(Some(2)) && !persistence.vote());
    }

    #[test]
    fn a_chain_refused_for_long_is_tried_in_every_fourth_frame_until_it_asks() {
        let mut persistence = Persistence::default();
        let tried: Vec<bool> = (0..TIRED + 10 * (2 * PATIENCE)).map(|_| persistence.observe(Some(1))).collect();
        assert!(tried[..TIRED].iter().all(|due| *due));
        assert_eq!(tried[TIRED..].iter().filter(|due| **due).count(), 10);
        while !persistence.observe(Some(1)) {}
        persistence.vote();
        assert!(persistence.observe(Some(1)) && persistence.vote());
    }
}
