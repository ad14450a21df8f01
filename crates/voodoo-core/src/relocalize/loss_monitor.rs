//! Counts for how long a body has been lost, and monitors it for a while after recovery.

use super::PATIENCE;
use super::detection_check::NEW_TRACK_AGE;

/// Outcome of a frame for the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameOutcome {
    /// Stamp of the frame, seconds.
    pub stamp: f64,
    /// The body is lost.
    pub lost: bool,
    /// The body is tracked, neither lost nor degraded.
    pub tracked: bool,
    /// Known depth cameras gave no image, so the frame is no evidence that the body left.
    pub silent: bool,
}

/// For how long the body has been lost, and until when it is monitored after recovery.
#[derive(Debug, Default)]
pub(super) struct LossMonitor {
    /// Number of consecutive frames in which the body was lost.
    lost: usize,
    /// Stamp until which a recovered body is monitored, seconds.
    until: Option<f64>,
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

    /// Monitors the body as if it had just recovered, after a time without frames.
    pub(super) fn interrupt(&mut self, stamp: f64) {
        self.until = Some(stamp + NEW_TRACK_AGE);
    }

    /// Whether the body recovered recently and is still monitored.
    pub(super) fn recently_recovered(&self) -> bool {
        self.until.is_some()
    }

    /// Updates with the outcome of a frame.
    pub(super) fn observe(&mut self, outcome: FrameOutcome) {
        let FrameOutcome { stamp, lost, tracked, silent } = outcome;
        self.until = self.until.filter(|until| stamp < *until);
        if lost {
            self.lost += usize::from(!silent);
        } else if tracked || self.frames_searched().is_none() {
            if self.frames_searched().is_some() {
                self.until = Some(stamp + NEW_TRACK_AGE);
            }
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

    fn outcome(stamp: f64, lost: bool) -> FrameOutcome {
        FrameOutcome { stamp, lost, tracked: !lost, silent: false }
    }

    #[test]
    fn a_body_is_searched_for_from_the_second_lost_frame_on() {
        let searched = |frames: i32| after((0..frames).map(|frame| outcome(f64::from(frame), true))).frames_searched();
        assert_eq!([1, 2, 3, 4].map(searched), [None, Some(0), Some(1), Some(2)]);
    }

    #[test]
    fn a_single_lost_frame_is_ignored_and_frames_without_images_do_not_count() {
        let blurred = [(0.0, false), (0.1, true), (0.2, false), (0.3, true)].map(|(stamp, lost)| outcome(stamp, lost));
        let loss = after(blurred);
        assert_eq!((loss.frames_searched(), loss.recently_recovered()), (None, false));
        let silent = (0..20).map(|frame| FrameOutcome { silent: true, ..outcome(f64::from(frame), true) });
        assert_eq!(after(silent).frames_searched(), None);
    }

    #[test]
    fn a_recovered_body_is_monitored_for_a_while_and_a_degraded_one_is_not_recovered() {
        let lost = [0.1, 0.2].map(|stamp| outcome(stamp, true));
        let back = |stamp| after(lost.into_iter().chain([outcome(0.3, false), outcome(stamp, false)]));
        assert!(back(0.4).recently_recovered() && back(0.4).frames_searched().is_none());
        assert!(!back(0.3 + NEW_TRACK_AGE).recently_recovered());
        let degraded = FrameOutcome { tracked: false, ..outcome(0.3, false) };
        assert_eq!(after(lost.into_iter().chain([degraded])).frames_searched(), Some(0));
    }
}
