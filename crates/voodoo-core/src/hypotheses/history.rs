//! History of each arm and leg over frames.

use super::persistence::Persistence;
use crate::math::{Pose, Vec3};

/// Evidence that a proposal is based on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Basis {
    /// The rough cost of the arm or leg alone, from unexplained points or colors.
    #[default]
    Points,
    /// A position of the end that an earlier frame confirmed or a detector reports.
    End,
    /// A lean of the trunk. It may be accepted although the arm or leg remains suspect.
    Lean,
    /// Detections of the whole body. It may be accepted although the arm or leg remains suspect.
    Body,
}

/// History of one arm or leg.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// How long frames have contradicted it.
    pub(super) persistence: Persistence,
    /// Position of its end in the last frame that confirmed it, world frame.
    pub(super) last_good_end: Option<Vec3>,
    /// Poses of all limbs that the last frame requested, world frame; empty if it requested no change.
    pub(super) last_proposal: Vec<Pose>,
    /// Basis of `last_proposal`.
    pub(super) last_basis: Basis,
}
