//! Proposes an arm or leg that ends at the detected hand, wrist or ankle.

use super::{Pool, Propose, SWIVELS};
use crate::detect::Detected;
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::Vec3;

/// The detections in this frame, if the detector ran.
#[derive(Debug)]
pub(in crate::hypotheses) struct DetectedEnd<'a>(pub(in crate::hypotheses) Option<Detected<'a>>);

impl DetectedEnd<'_> {
    /// Detected position of the chain's end, world frame: a joint detected on its last limb, or the detected wrist or ankle plus
    /// the current offset of the end from it.
    fn end(&self, at: Extremity) -> Option<Vec3> {
        let (chain, body, poses) = (at.chain, &at.context.model.body, at.matched.poses);
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
    fn propose(&mut self, at: Extremity, rough: &mut RoughSearch, pool: &mut Pool) {
        let Some(end) = self.end(at) else { return };
        let place = end - at.context.observation.origin();
        // The bend is searched for, because a detected elbow or knee is no more accurate than the wrist or ankle.
        rough.end_at(at, place, 2 * SWIVELS, f64::INFINITY, &mut pool.detected);
    }
}
