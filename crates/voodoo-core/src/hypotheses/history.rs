//! What is remembered of each arm and leg from frame to frame.

use super::persistence::Persistence;
use crate::math::{Pose, Vec3};

/// What a proposal rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Basis {
    /// Unexplained points have drawn the arm or leg there.
    #[default]
    Points,
    /// It ended there when all was well.
    Rest,
    /// The body leans: not the arm or leg alone is judged by it.
    Lean,
    /// A detector sees the body there: as above.
    Body,
}

/// The past of one arm or leg.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// What past frames said against it.
    pub(super) persistence: Persistence,
    /// Where it ended when the frame last proved it right, world.
    pub(super) last_good_end: Option<Vec3>,
    /// The body as the frame before wanted it, when that asked for a change, world; else empty.
    pub(super) last_proposal: Vec<Pose>,
    /// What that rests on.
    pub(super) last_basis: Basis,
}
