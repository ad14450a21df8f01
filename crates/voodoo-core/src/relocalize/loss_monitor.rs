//! Counts for how long a body has been lost.

use super::PATIENCE;

/// Outcome of a frame for the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameOutcome {
    /// The body is lost.
    pub lost: bool,
    /// The body is tracked, neither lost nor degraded.
    pub tracked: bool,
    /// Known depth cameras gave no image, so the frame is no evidence that the body left.
    pub silent: bool,
}

/// For how long the body has been lost.
#[derive(Debug, Default)]
pub(super) struct LossMonitor {
    /// Number of consecutive frames in which the body was lost.
    lost: usize,
}

impl LossMonitor {
    /// Resets the monitor for a new track.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// Returns for how many frames the lost body has been searched: the count starts at the frame from which on a loss is not
    /// just a blurred image. `None` if the body is not searched for.
    pub(super) fn frames_searched(&self) -> Option<usize> {
        self.lost.checked_sub(PATIENCE)
    }

    /// Updates with the outcome of a frame.
    pub(super) fn observe(&mut self, outcome: FrameOutcome) {
        let FrameOutcome { lost, tracked, silent } = outcome;
        if lost {
            self.lost += usize::from(!silent);
        } else if tracked || self.frames_searched().is_none() {
            self.lost = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(frames: impl IntoIterator<Item = FrameOutcome>) -> LossMonitor {
        let mut loss = LossMonitor::default();
        frames.into_iter().for_each(|outcome| loss.observe(outcome));
        loss
    }

    fn outcome(lost: bool) -> FrameOutcome {
        FrameOutcome { lost, tracked: !lost, silent: false }
    }

    #[test]
    fn a_body_is_searched_for_from_the_second_lost_frame_on() {
        let searched = |frames| after([outcome(true)].repeat(frames)).frames_searched();
        assert_eq!([1, 2, 3, 4].map(searched), [None, Some(0), Some(1), Some(2)]);
    }

    #[test]
    fn a_single_lost_frame_is_ignored_and_frames_without_images_do_not_count() {
        assert_eq!(after([false, true, false, true].map(outcome)).frames_searched(), None);
        let silent = FrameOutcome { silent: true, ..outcome(true) };
        assert_eq!(after([silent; 20]).frames_searched(), None);
    }

    #[test]
    fn a_tracked_body_is_no_longer_lost_and_a_degraded_one_is() {
        let degraded = FrameOutcome { tracked: false, ..outcome(false) };
        let back = |last| after([outcome(true), outcome(true), last]).frames_searched();
        assert_eq!([outcome(false), degraded].map(back), [None, Some(0)]);
    }
}
