//! The whole body stands as a detector sees it: of a trunk that has slid aside, no arm or leg alone is right.

use super::{Pool, Propose};
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::{Pose, shifted};

/// Poses of all limbs as a detector sees them in this frame, world frame; empty where it did not look.
#[derive(Debug)]
pub(in crate::hypotheses) struct DetectedBody<'a>(pub(in crate::hypotheses) &'a [Pose]);

impl Propose for DetectedBody<'_> {
    fn propose(&mut self, at: Extremity, _history: &[History], _rough: &mut RoughSearch, pool: &mut Pool) {
        // An arm alone is right or wrong by itself.
        if !at.chain().leg || self.0.len() != at.matched.poses.len() {
            return;
        }
        let origin = at.context.seen.origin();
        pool.body.poses.clear();
        pool.body.poses.extend(self.0.iter().map(|pose| shifted(pose, origin)));
        pool.body.set(Basis::Body);
    }
}
