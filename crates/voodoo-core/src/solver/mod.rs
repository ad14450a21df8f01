//! Step 7: fits the pose to the correspondences. The solver is the one replaceable part of the step.

mod chain;
mod lengths;
mod limbwise;
mod schedule;
mod spread;
mod tree;
mod warm_start;
mod whole_body;

pub(crate) use chain::ChainSolver;
pub(crate) use lengths::Lengths;
pub(crate) use limbwise::Limbwise;
pub(crate) use schedule::Gate;
pub(crate) use spread::Spread;
pub(crate) use tree::TreeSolver;
pub(crate) use warm_start::WarmStart;
pub(crate) use whole_body::{LENGTH_INFORMATION, OVERLAP_SIGMA, SITE_SCALE, WholeBody};

use crate::association::correspondence::Correspondences;
use crate::body::two_bone::TwoBone;
use crate::body::{Body, Pair};
use crate::config::{Config, SolverKind};
use crate::math::Pose;
use crate::observation::frame::Ground;

/// Largest rotation of a joint or limb in one step, radians: the linearization is not valid beyond.
const LARGEST_TURN: f64 = 0.5;
/// Standard deviation of a violated joint limit, radians: 3 degrees.
pub(crate) const LIMIT_SIGMA: f64 = 0.05;
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

/// Moves the limbs towards their correspondences: prepares a frame, then solves every step of it.
pub(crate) trait Solver: std::fmt::Debug + Send + Sync {
    /// Warm start: follows the named sites before the first step of a frame. Returns true to request another round.
    /// `problem.predicted` are the poses before the frame.
    fn prepare(&mut self, problem: &Problem, poses: &mut [Pose]) -> bool;

    /// One update of all poses (working frame).
    fn solve(&mut self, problem: &Problem, poses: &mut [Pose]);

    /// Writes the relative changes of the lengths of `pairs` that fit the correspondences at `poses` to `change`. On input,
    /// `change` holds the change from each length to the one it is regularized to, with information `pull`. Returns false when
    /// the solver cannot estimate lengths.
    fn lengths(
        &mut self,
        _problem: &Problem,
        _poses: &[Pose],
        _pairs: &[Pair],
        _pull: &[f64],
        _change: &mut [f64],
    ) -> bool {
        false
    }
}

/// Creates the solver of a configuration.
pub(crate) fn solver(kind: SolverKind) -> Box<dyn Solver> {
    match kind {
        SolverKind::Limbwise => Box::new(Limbwise::default()),
        SolverKind::Chain => Box::new(WholeBody::default()),
        SolverKind::Tree => Box::new(WholeBody::tree()),
    }
}
