//! What is known about one limb, over a few frames: evidence flickers.

use super::two_state::{EVEN, TwoState};
use crate::math::Vec3;
use crate::tracker::estimate::LimbStatus;
use crate::visibility::LITTLE;

/// Share of the past frames in what is known of a limb's support.
const MEMORY: f64 = 0.6;

/// Running means of what frames said about a limb.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LimbHistory {
    /// Share of the visible patches explained by this limb alone.
    exclusive: f64,
    /// Share of the facing patches that cameras see past.
    contradicted: f64,
    /// Share of the facing patches not hidden.
    visible: f64,
    /// That images show this limb, and no other, where it is, and so that of its far end; of limbs of which an image says
    /// something.
    states: Option<[TwoState; 2]>,
    frames: usize,
    /// How its far end moved in the last frame, and by how much otherwise than in the one before, meters.
    motion: Vec3,
    unexpected: f64,
}

impl LimbHistory {
    /// Takes a frame's shares: explained by it alone, seen past, not hidden.
    pub(super) fn update(&mut self, now: [f64; 3]) {
        let keep = if self.frames == 0 { 0.0 } else { MEMORY };
        let means = [&mut self.exclusive, &mut self.contradicted, &mut self.visible];
        for (value, now) in means.into_iter().zip(now) {
            *value = keep * *value + (1.0 - keep) * now;
        }
        self.frames += 1;
    }

    /// Takes how its far end moved since the frame before, meters.
    pub(super) fn moved(&mut self, motion: Vec3) {
        self.unexpected = motion.distance(self.motion);
        self.motion = motion;
    }

    /// By how many meters its far end moved otherwise than from the last frame but one to the last.
    pub(super) fn unexpected(&self) -> f64 {
        self.unexpected
    }

    /// Takes what a frame's images say of the limb and of its far end, and what a detector says of it, log odds, after a motion that
    /// was unexpected by so many meters.
    pub(super) fn observe(&mut self, evidence: [f64; 2], detected: f64, unexpected: f64) {
        let mut states = self.states.unwrap_or_default();
        states.iter_mut().zip(evidence).for_each(|(state, evidence)| state.observe(evidence, detected, unexpected));
        self.states = Some(states);
    }

    /// No image says anything of the limb.
    pub(super) fn clear_states(&mut self) {
        self.states = None;
    }

    /// The status by what the limb alone explains.
    pub(super) fn supported(&self) -> LimbStatus {
        // What it alone explains has to be twice that at which images leave it open.
        if self.exclusive >= 2.0 * EVEN && self.contradicted <= LITTLE {
            LimbStatus::Measured
        } else if self.visible < LITTLE && self.contradicted <= LITTLE {
            LimbStatus::Inferred
        } else {
            LimbStatus::Lost
        }
    }

    /// The status of a limb of an arm or leg: the one by support, or what images show of it.
    pub(super) fn status(&self, supported: LimbStatus) -> LimbStatus {
        match self.states {
            None => supported,
            Some([whole, _]) if whole.is_likely() => LimbStatus::Measured,
            Some(_) if self.contradicted > LITTLE => LimbStatus::Lost,
            Some(_) => LimbStatus::Inferred,
        }
    }

    /// Whether the limb is right or wrong may as well be the other way round.
    pub(super) fn is_uncertain(&self) -> bool {
        self.states.is_some_and(|[whole, _]| whole.is_uncertain())
    }

    /// The far end of the limb shows: what hangs on it is where it is.
    pub(super) fn is_end_supported(&self) -> bool {
        self.states.is_none_or(|[_, end]| end.is_likely())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(frames: &[[f64; 3]], evidence: Option<[f64; 2]>) -> LimbHistory {
        let mut limb = LimbHistory::default();
        for now in frames {
            limb.update(*now);
            match evidence {
                Some(evidence) => limb.observe(evidence, 0.0, 0.0),
                None => limb.clear_states(),
            }
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
    fn images_correct_what_support_reports() {
        let weak = after(&[[0.5, 0.0, 1.0]], Some([-1.0, -1.0]));
        assert_eq!(weak.status(weak.supported()), LimbStatus::Inferred);
        let past = after(&[[0.5, 0.5, 1.0]], Some([-1.0, -1.0]));
        assert_eq!(past.status(LimbStatus::Measured), LimbStatus::Lost, "cameras see past it");
        let strong = after(&[[0.0, 0.0, 1.0]], Some([2.0, -1.0]));
        assert_eq!(strong.status(strong.supported()), LimbStatus::Measured);
        assert!(!strong.is_end_supported());
        let unseen = after(&[[0.5, 0.0, 1.0]], None);
        assert_eq!(unseen.status(LimbStatus::Lost), LimbStatus::Lost);
        assert!(unseen.is_end_supported());
    }
}
