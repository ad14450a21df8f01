//! Step 7: fits the pose to the correspondences. The solver is the one replaceable part of the step:
//! [`solve_limbwise`], or [`WholeBody`] with or without elastic bands.

mod chain;
mod covariance;
mod lengths;
mod limbwise;
mod schedule;
mod tree;
mod warm_start;
mod whole_body;

pub(crate) use chain::ChainSolver;
pub(crate) use limbwise::solve_limbwise;
pub(crate) use schedule::Gate;
pub(crate) use tree::TreeSolver;
pub(crate) use warm_start::WarmStart;
pub(crate) use whole_body::{SITE_SCALE, WholeBody};

use crate::association::correspondence::Correspondences;
use crate::fit::Context;
use crate::math::Pose;

/// Largest rotation of a joint or limb in one step, radians: the linearization is not valid beyond.
const LARGEST_TURN: f64 = 0.5;
/// Relative damping of the normal matrix: unknowns with almost no measurements stay where they are.
const DAMPING: f64 = 1e-3;
/// Initial information of every unknown, so that nothing is singular.
const FLOOR: f64 = 1e-6;

/// Input of a solver: one ICP step of one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem<'a> {
    /// The frame and the body.
    pub context: Context<'a>,
    /// Correspondences at the current poses.
    pub correspondences: &'a Correspondences,
    /// The predicted poses, from before this frame's measurements.
    pub predicted: &'a [Pose],
    /// Index of the step in its frame.
    pub step: usize,
}
