//! When a body is searched: after some frames in which it was lost, and for a while after it was found.

use super::hidden::Hidden;

/// The body is searched from this many frames on in which it was lost: a blurred frame is no loss.
const LOST_PATIENCE: usize = 3;
/// After it was found, every so manyth frame is searched again for so long, seconds, or until it was seen to walk: another
/// facing may prove better.
const WATCH: f64 = 5.0;
const WATCHED: usize = 5;

/// What a frame said of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Time of the frame, seconds.
    pub stamp: f64,
    /// The body is lost.
    pub lost: bool,
    /// It is tracked, neither lost nor degraded.
    pub tracked: bool,
    /// Depth cameras that have been there gave no image: no sign that the body went.
    pub silent: bool,
}

/// How long the body has been lost, and since when it is back.
#[derive(Debug, Default)]
pub(super) struct Watch {
    /// Frames in a row in which it was lost.
    lost: usize,
    /// Until when the search goes on, seconds.
    until: Option<f64>,
    frames: usize,
    /// Whether the present pose explains what may be the body, if anything may.
    pub(super) explained: Option<bool>,
    /// What stands before it.
    pub(super) hidden: Hidden,
}

impl Watch {
    /// The body was set anew: nothing is lost.
    pub(super) fn restart(&mut self) {
        (self.lost, self.until) = (0, None);
        self.hidden.restart();
    }

    /// In how many of the last frames the body was lost, from the one on in which the search began; `None` otherwise.
    pub(super) fn searched(&self) -> Option<usize> {
        self.lost.checked_sub(LOST_PATIENCE)
    }

    /// The body is lost, or was a moment ago.
    pub(super) fn lost(&self) -> bool {
        self.lost > 0
    }

    /// The search goes on although the body was found.
    pub(super) fn open(&self) -> bool {
        self.until.is_some()
    }

    /// Counts a frame; whether it is searched.
    pub(super) fn due(&mut self, sighting: Sighting) -> bool {
        if sighting.lost {
            self.lost += usize::from(!sighting.silent);
        } else if self.lost < LOST_PATIENCE {
            self.lost = 0;
        }
        self.until = self.until.filter(|until| sighting.stamp < *until);
        self.frames += 1;
        self.lost >= LOST_PATIENCE || (self.open() && self.frames.is_multiple_of(WATCHED))
    }

    /// Ends the search of a frame; `ahead`: it walks where it faces. Whether the pose is to be given up.
    pub(super) fn conclude(&mut self, found: bool, sighting: Sighting, ahead: bool) -> bool {
        let mut given_up = false;
        if found || (self.explained != Some(false) && sighting.tracked) {
            self.lost = 0;
            self.until = self.until.or(Some(sighting.stamp + WATCH));
        } else {
            given_up = self.lost > 0 && self.explained == Some(false);
        }
        if self.lost == 0 && ahead {
            self.until = None;
        }
        given_up
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sighting(stamp: f64, lost: bool) -> Sighting {
        Sighting { stamp, lost, tracked: !lost, silent: false }
    }

    #[test]
    fn a_body_is_searched_from_the_third_lost_frame_on() {
        let mut watch = Watch::default();
        let due: Vec<bool> = (0..4).map(|frame| watch.due(sighting(f64::from(frame), true))).collect();
        assert_eq!((due, watch.searched()), (vec![false, false, true, true], Some(1)));
    }

    #[test]
    fn two_lost_frames_are_forgotten_and_a_silent_camera_counts_for_nothing() {
        let mut watch = Watch::default();
        watch.due(sighting(0.0, true));
        watch.due(sighting(0.1, true));
        watch.due(sighting(0.2, false));
        assert!(!watch.lost());
        for frame in 0..20 {
            assert!(!watch.due(Sighting { silent: true, ..sighting(1.0 + f64::from(frame), true) }));
        }
    }

    #[test]
    fn a_found_body_is_looked_at_again_until_it_walks_or_time_is_up() {
        let mut watch = Watch::default();
        (0..3).for_each(|frame| {
            watch.due(sighting(f64::from(frame), true));
        });
        assert!(!watch.conclude(true, sighting(2.0, false), false) && watch.open());
        let again = (1..=10).filter(|frame| watch.due(sighting(2.0 + 0.1 * f64::from(*frame), false))).count();
        assert_eq!(again, 2, "every fifth frame");
        assert!(!watch.conclude(false, sighting(3.0, false), true) && !watch.open());
        watch.conclude(true, sighting(3.0, false), false);
        assert!(!watch.due(sighting(3.0 + WATCH, false)) && !watch.open());
    }

    #[test]
    fn what_explains_nothing_of_what_may_be_the_body_is_given_up() {
        let mut watch = Watch::default();
        (0..3).for_each(|frame| {
            watch.due(sighting(f64::from(frame), true));
        });
        watch.explained = Some(false);
        assert!(watch.conclude(false, sighting(3.0, false), false) && watch.lost());
        watch.explained = Some(true);
        assert!(!watch.conclude(false, sighting(3.1, false), false) && !watch.lost());
    }
}
