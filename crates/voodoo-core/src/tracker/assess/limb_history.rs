//! What is known about one limb, over a few frames: evidence flickers.

use crate::tracker::estimate::LimbStatus;
use crate::visibility::limb_support::LimbSupport;

/// Share of the visible patches that a measured limb alone explains at least.
pub(super) const SUPPORT: f64 = 0.15;
/// Share of the patches facing a camera that it may see past.
const CONTRADICTED: f64 = 0.3;
/// A limb of which a smaller share shows is hidden.
const SHOWN: f64 = 0.35;
/// The tracker relies on a limb of an arm or leg when what speaks for it less what speaks against it is this at least, of the
/// whole limb and of its outer part.
const INTERNAL: [f64; 2] = [0.14, 0.05];
/// It is reported as measured when it is this for the whole limb, and for the upper one as well: one in twenty good ones is
/// doubted so on the rendered recordings.
const REPORTED: f64 = 0.1;
/// The outer part of a limb shows when what speaks for it is this at least.
const OUTER_SHOWS: f64 = 0.01;
/// Share of the past frames in what the tracker relies on, and in what is reported: a limb is lost within few frames.
const SLOW_MEMORY: f64 = 0.6;
const FAST_MEMORY: f64 = 0.4;

/// Running means of what frames said about a limb.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LimbHistory {
    /// Share of the visible patches explained by this limb alone.
    exclusive: f64,
    /// Share of the facing patches that cameras see past.
    contradicted: f64,
    /// Share of the facing patches not hidden.
    shown: f64,
    /// What speaks for this limb and no other, less what speaks against it (the whole, the outer part), with a long memory and
    /// with a short one; of limbs that images show.
    slow: Option<[f64; 2]>,
    fast: Option<[f64; 2]>,
    frames: usize,
}

impl LimbHistory {
    /// Takes a frame's shares: explained by it alone, seen past, not hidden.
    pub(super) fn update(&mut self, now: [f64; 3]) {
        let keep = if self.frames == 0 { 0.0 } else { SLOW_MEMORY };
        let shares = [&mut self.exclusive, &mut self.contradicted, &mut self.shown];
        for (value, now) in shares.into_iter().zip(now) {
            *value = keep * *value + (1.0 - keep) * now;
        }
        self.frames += 1;
    }

    /// Takes what a frame's images say of the limb.
    pub(super) fn support(&mut self, support: &LimbSupport) {
        let now = support.net();
        for (value, keep) in [(&mut self.slow, SLOW_MEMORY), (&mut self.fast, FAST_MEMORY)] {
            let mixed = |before: [f64; 2]| [0, 1].map(|part| keep * before[part] + (1.0 - keep) * now[part]);
            *value = support.known.then(|| value.map_or(now, mixed));
        }
    }

    /// The status by what the limb alone explains.
    pub(super) fn supported(&self) -> LimbStatus {
        if self.exclusive >= SUPPORT && self.contradicted <= CONTRADICTED {
            LimbStatus::Measured
        } else if self.shown < SHOWN && self.contradicted <= CONTRADICTED {
            LimbStatus::Inferred
        } else {
            LimbStatus::Lost
        }
    }

    /// The status the tracker goes by: the one by support, corrected by what images prove of the limb.
    pub(super) fn internal(&self, supported: LimbStatus) -> LimbStatus {
        let proven = self.slow.map(|parts| parts[0] >= INTERNAL[0] && parts[1] >= INTERNAL[1]);
        proven.map_or(supported, |proven| self.image_status(proven))
    }

    /// The status that is reported of the upper limb of an arm or leg, which ends where its outer part shows or its lower limb
    /// begins.
    pub(super) fn reported_upper(&self, lower: &Self, internal: LimbStatus) -> LimbStatus {
        self.fast.map_or(internal, |_| self.image_status(self.shows() && (self.outer_shows() || lower.shows())))
    }

    /// The same of the lower limb: on an upper limb that nothing proves, it may be anything as long that is seen there.
    pub(super) fn reported_lower(&self, upper: &Self, internal: LimbStatus) -> LimbStatus {
        self.fast.map_or(internal, |_| self.image_status(self.shows() && upper.shows()))
    }

    /// The far end of the limb shows: what hangs on it is where it is.
    pub(super) fn outer_shows(&self) -> bool {
        self.fast.is_none_or(|[_, outer]| outer >= OUTER_SHOWS)
    }

    /// What the images show of the limb is enough to report that it is measured; so it is where no image says anything.
    fn shows(&self) -> bool {
        self.fast.is_none_or(|[whole, _]| whole >= REPORTED)
    }

    /// The status of a limb that images show.
    fn image_status(&self, proven: bool) -> LimbStatus {
        if proven {
            LimbStatus::Measured
        } else if self.contradicted > CONTRADICTED {
            LimbStatus::Lost
        } else {
            LimbStatus::Inferred
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(frames: &[[f64; 3]], support: Option<[f64; 2]>) -> LimbHistory {
        let mut limb = LimbHistory::default();
        for now in frames {
            limb.update(*now);
            limb.support(&support.map_or_else(LimbSupport::default, |own| LimbSupport {
                own,
                free_space: [0.0; 2],
                known: true,
            }));
        }
        limb
    }

    #[test]
    fn one_frame_against_a_good_limb_does_not_lose_it_and_three_do() {
        let (good, bad) = ([0.5, 0.0, 1.0], [0.0, 1.0, 1.0]);
        assert_eq!(after(&[good, good], None).supported(), LimbStatus::Measured);
        assert_ne!(after(&[good, good, bad], None).supported(), LimbStatus::Inferred);
        assert_eq!(after(&[good, good, bad, bad, bad], None).supported(), LimbStatus::Lost);
    }

    #[test]
    fn a_hidden_limb_is_inferred_and_one_that_should_show_is_lost() {
        assert_eq!(after(&[[0.0, 0.0, 0.1]], None).supported(), LimbStatus::Inferred);
        assert_eq!(after(&[[0.0, 0.0, 1.0]], None).supported(), LimbStatus::Lost);
    }

    #[test]
    fn images_correct_what_support_says() {
        let weak = after(&[[0.5, 0.0, 1.0]], Some([0.05, 0.0]));
        assert_eq!(weak.internal(weak.supported()), LimbStatus::Inferred);
        let strong = after(&[[0.0, 0.0, 1.0]], Some([0.4, 0.2]));
        assert_eq!(strong.internal(strong.supported()), LimbStatus::Measured);
        let unseen = after(&[[0.5, 0.0, 1.0]], None);
        assert_eq!(unseen.internal(LimbStatus::Lost), LimbStatus::Lost);
    }

    #[test]
    fn a_forearm_is_reported_only_on_an_upper_arm_that_shows() {
        let (shows, hides) = (after(&[[0.5, 0.0, 1.0]], Some([0.4, 0.2])), after(&[[0.5, 0.0, 1.0]], Some([0.0, 0.0])));
        assert_eq!(shows.reported_lower(&shows, LimbStatus::Lost), LimbStatus::Measured);
        assert_eq!(shows.reported_lower(&hides, LimbStatus::Measured), LimbStatus::Inferred);
        assert_eq!(hides.reported_upper(&shows, LimbStatus::Measured), LimbStatus::Inferred);
    }
}
