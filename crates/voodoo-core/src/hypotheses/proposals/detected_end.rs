//! The arm or leg ends where a detector sees its wrist or ankle.

use super::{Pool, Propose, SWIVELS};
use crate::detect::Detected;
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::Vec3;

/// What a detector says of this frame, if it looked.
#[derive(Debug)]
pub(in crate::hypotheses) struct DetectedEnd<'a>(pub(in crate::hypotheses) Option<Detected<'a>>);

impl DetectedEnd<'_> {
    /// Where the end is seen, world frame: the hand's middle, or as far from the ankle as it is now.
    fn end(&self, at: Extremity) -> Option<Vec3> {
        let (chain, body, poses) = (at.chain(), &at.context.model.body, at.matched.poses);
        let detected = self.0?;
        let last = chain.ends.first()?;
        let joint = body.limbs()[*last].parent.as_ref().map(|(_, joint)| joint)?;
        if let Some(detected) = detected.on_limb(*last) {
            return Some(detected.position);
        }
        let beyond = chain.end(poses) - poses[*last] * joint.limb_from_joint.translation;
        Some(detected.hangs_by(*last)?.position + beyond)
    }
}

impl Propose for DetectedEnd<'_> {
    fn propose(&mut self, at: Extremity, _history: &[History], rough: &mut RoughSearch, pool: &mut Pool) {
        let Some(end) = self.end(at) else { return };
        let place = end - at.context.observation.origin();
        // The detector's elbow is no better than its wrist.
        let cost = rough.end_at(at, place, 2 * SWIVELS, f64::INFINITY, &mut pool.detected.poses);
        if cost < f64::INFINITY {
            pool.detected.set(Basis::Rest);
        }
    }
}
