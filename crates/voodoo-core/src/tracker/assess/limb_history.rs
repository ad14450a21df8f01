//! Evidence for one limb, accumulated over a few frames because single frames are noisy.

use super::two_state::{EVEN, TwoState};
use crate::math::Vec3;
use crate::tracker::estimate::LimbStatus;
use crate::visibility::LITTLE;

/// Weight of past frames in the running means of a limb's support.
const MEMORY: f64 = 0.6;

/// Running means of the evidence for a limb.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LimbHistory {
    /// Fraction of the visible patches that this limb explains exclusively.
    exclusive: f64,
    /// Fraction of the front-facing patches violated by free space.
    contradicted: f64,
    /// Fraction of the front-facing patches that are unoccluded.
    visible: f64,
    /// Filters for two events: the images support the limb, and they support its distal end. `None` for limbs without
    /// evidence from images.
    states: Option<[TwoState; 2]>,
    frames: usize,
    /// Displacement of the distal end in the last frame, and its difference to the displacement in the frame before, meters.
    motion: Vec3,
    unexpected: f64,
}

impl LimbHistory {
    /// Updates the running means of three fractions of the limb's surface: explained exclusively, violated by free space,
    /// unoccluded.
    pub(super) fn update(&mut self, now: [f64; 3]) {
        let keep = if self.frames == 0 { 0.0 } else { MEMORY };
        let means = [&mut self.exclusive, &mut self.contradicted, &mut self.visible];
        for (value, now) in means.into_iter().zip(now) {
            *value = keep * *value + (1.0 - keep) * now;
        }
        self.frames += 1;
    }

    /// Updates with the displacement of the distal end since the last frame, meters.
    pub(super) fn moved(&mut self, motion: Vec3) {
        self.unexpected = motion.distance(self.motion);
        self.motion = motion;
    }

    /// Difference between the last two displacements of the distal end, meters.
    pub(super) fn unexpected(&self) -> f64 {
        self.unexpected
    }

    /// Updates both filters with the log odds from this frame's images for the limb and for its distal end, and with those from a
    /// detection. `unexpected` is the unexpected part of the motion, meters.
    pub(super) fn observe(&mut self, evidence: [f64; 2], detected: f64, unexpected: f64) {
        let mut states = self.states.unwrap_or_default();
        states.iter_mut().zip(evidence).for_each(|(state, evidence)| state.observe(evidence, detected, unexpected));
        self.states = Some(states);
    }

    /// Clears both filters: no image gives evidence for this limb.
    pub(super) fn clear_states(&mut self) {
        self.states = None;
    }

    /// Returns the status by exclusive support.
    pub(super) fn supported(&self) -> LimbStatus {
        // The exclusive fraction must be twice the one at which images give even odds.
        if self.exclusive >= 2.0 * EVEN && self.contradicted <= LITTLE {
            LimbStatus::Measured
        } else if !self.is_visible() && self.contradicted <= LITTLE {
            LimbStatus::Inferred
        } else {
            LimbStatus::Lost
        }
    }

    /// Whether the cameras see where the limb is.
    pub(super) fn is_visible(&self) -> bool {
        self.visible >= LITTLE
    }

    /// Returns the status of a limb of an arm or leg: by the evidence of images, or `supported` without any.
    pub(super) fn status(&self, supported: LimbStatus) -> LimbStatus {
        match self.states {
            None => supported,
            Some([whole, _]) if whole.is_likely() => LimbStatus::Measured,
            Some(_) if self.contradicted > LITTLE => LimbStatus::Lost,
            Some(_) => LimbStatus::Inferred,
        }
    }

    /// Whether the evidence of images for or against the limb is weak.
    pub(super) fn is_uncertain(&self) -> bool {
        self.states.is_some_and(|[whole, _]| whole.is_uncertain())
    }

    /// Whether the distal end of the limb is supported, and so the position of its child limb.
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
    fn a_measured_limb_is_lost_after_three_contradicting_frames_but_not_after_one() {
        let (good, bad) = ([0.5, 0.0, 1.0], [0.0, 1.0, 1.0]);
        assert_eq!(after(&[good, good], None).supported(), LimbStatus::Measured);
        assert_ne!(after(&[good, good, bad], None).supported(), LimbStatus::Inferred);
        assert_eq!(after(&[good, good, bad, bad, bad], None).supported(), LimbStatus::Lost);
    }

    #[test]
    fn an_occluded_limb_is_inferred_and_an_unsupported_visible_one_is_lost() {
        assert_eq!(after(&[[0.0, 0.0, 0.1]], None).supported(), LimbStatus::Inferred);
        assert_eq!(after(&[[0.0, 0.0, 1.0]], None).supported(), LimbStatus::Lost);
    }

    #[test]
    fn evidence_of_images_overrides_the_status_by_support() {
        let weak = after(&[[0.5, 0.0, 1.0]], Some([-1.0, -1.0]));
        assert_eq!(weak.status(weak.supported()), LimbStatus::Inferred);
        let past = after(&[[0.5, 0.5, 1.0]], Some([-1.0, -1.0]));
        assert_eq!(past.status(LimbStatus::Measured), LimbStatus::Lost, "violates free space");
        let strong = after(&[[0.0, 0.0, 1.0]], Some([2.0, -1.0]));
        assert_eq!(strong.status(strong.supported()), LimbStatus::Measured);
        assert!(!strong.is_end_supported());
        let unseen = after(&[[0.5, 0.0, 1.0]], None);
        assert_eq!(unseen.status(LimbStatus::Lost), LimbStatus::Lost);
        assert!(unseen.is_end_supported());
    }
}
