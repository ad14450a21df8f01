//! How long frames have spoken against an arm or leg, and whether two in a row asked for the same change.

/// After so many refusals in a row a chain is tried in every `REST`th frame only: a hidden arm is refused for seconds.
const TIRED: usize = 30;
const REST: usize = 4;

/// What past frames said against one arm or leg.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Doubt {
    /// Frames in a row that spoke against it.
    frames: usize,
    /// How often it was refused a change since it was in order, or since a frame asked for one.
    refused: usize,
    /// This frame asked for a change, and the frame before did.
    asks: bool,
    asked: bool,
}

impl Doubt {
    /// Takes note of a frame, which speaks against the chain when it names how many such frames it takes; whether it is time
    /// to try other configurations. To be called in every frame.
    pub(crate) fn due(&mut self, patience: Option<usize>) -> bool {
        let asked = std::mem::take(&mut self.asks);
        let Some(patience) = patience else {
            *self = Self::default();
            return false;
        };
        self.asked = asked;
        self.frames += 1;
        self.refused += 1;
        let rests = self.refused > TIRED && !self.refused.is_multiple_of(REST);
        self.frames >= patience && !rests
    }

    /// This frame asks for a change; whether it is made, because the frame before asked as well: a single frame may be disturbed.
    pub(crate) fn ask(&mut self) -> bool {
        self.asks = true;
        self.refused = 0;
        self.asked
    }

    /// This frame asks for a change.
    pub(crate) fn asks(&self) -> bool {
        self.asks
    }

    /// The frame before this one asked for a change.
    pub(crate) fn asked(&self) -> bool {
        self.asked
    }

    /// Nothing speaks against the chain.
    pub(crate) fn none(&self) -> bool {
        self.frames == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_made_when_two_frames_in_a_row_ask_for_it() {
        let mut doubt = Doubt::default();
        assert!(!doubt.due(Some(2)) && doubt.due(Some(2)));
        assert!(!doubt.ask());
        assert!(doubt.due(Some(2)) && doubt.ask());
        // A frame between that does not ask starts anew.
        assert!(doubt.due(Some(2)));
        assert!(doubt.due(Some(2)) && !doubt.ask());
    }

    #[test]
    fn a_frame_that_is_not_tried_for_lack_of_patience_is_a_gap() {
        let mut doubt = Doubt::default();
        doubt.due(Some(2));
        assert!(doubt.due(Some(2)) && !doubt.ask());
        assert!(!doubt.due(Some(4)));
        assert!(doubt.due(Some(4)) && !doubt.ask(), "the vote before the gap was counted");
        assert!(doubt.due(Some(4)) && doubt.ask());
    }

    #[test]
    fn a_frame_in_order_forgets_everything() {
        let mut doubt = Doubt::default();
        doubt.due(Some(1));
        doubt.ask();
        assert!(!doubt.none() && !doubt.due(None) && doubt.none());
        assert!(!doubt.due(Some(2)) && doubt.due(Some(2)) && !doubt.ask());
    }

    #[test]
    fn a_chain_refused_for_long_is_tried_in_every_fourth_frame_until_it_asks() {
        let mut doubt = Doubt::default();
        let tried: Vec<bool> = (0..TIRED + 10 * REST).map(|_| doubt.due(Some(1))).collect();
        assert!(tried[..TIRED].iter().all(|due| *due));
        assert_eq!(tried[TIRED..].iter().filter(|due| **due).count(), 10);
        while !doubt.due(Some(1)) {}
        doubt.ask();
        assert!(doubt.due(Some(1)) && doubt.ask());
    }
}
