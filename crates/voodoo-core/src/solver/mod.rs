//! Step 7: fits the pose to the correspondences. The solver is the one replaceable part of the step:
//! [`solve_limbwise`], or [`WholeBody`] with or without elastic bands.

mod chain;
mod lengths;
mod limbwise;
mod schedule;
mod spread;
mod tree;
mod warm_start;
mod whole_body;

pub(crate) use chain::ChainSolver;
pub(crate) use limbwise::solve_limbwise;
pub(crate) use schedule::Gate;
pub(crate) use spread::Spread;
pub(crate) use tree::TreeSolver;
pub(crate) use warm_start::WarmStart;
pub(crate) use whole_body::{LENGTH_INFORMATION, OVERLAP_SIGMA, SITE_SCALE, WholeBody};

use crate::association::correspondence::Correspondences;
use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::config::Config;
use crate::math::Pose;
use crate::observation::frame::Ground;

/// Largest rotation of a joint or limb in one step, radians: the linearization is not valid beyond.
const LARGEST_TURN: f64 = 0.5;
/// Relative damping of the normal matrix: unknowns with almost no measurements stay where they are.
const DAMPING: f64 = 1e-3;
/// Initial information of every unknown, so that nothing is singular.
const FLOOR: f64 = 1e-6;

/// Input of a solver: one ICP step of one frame.
#[derive(Debug)]
pub(crate) struct Problem<'a> {
    /// The body.
    pub body: &'a Body,
    /// Its arms and legs.
    pub extremities: &'a [TwoBone],
    /// Correspondences at the current poses.
    pub correspondences: &'a Correspondences,
    /// The predicted poses, from before this frame's measurements.
    pub predicted: &'a [Pose],
    /// The ground plane in the working frame, if it is known.
    pub floor: Option<Ground>,
    /// Index of the step in its frame.
    pub step: usize,
    /// Time since the last frame, in units of 1/30 s; the standard deviations of motion grow with it.
    pub time_scale: f64,
    /// Parameters.
    pub config: &'a Config,
}
