//! Step 7: the pose that fits the correspondences. The solver is the one replaceable part of the step.

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
pub(crate) use schedule::{Gate, Reassociation, Schedule, WarmStartInput};
pub(crate) use spread::Spread;
pub(crate) use tree::TreeSolver;
pub(crate) use warm_start::WarmStart;
pub(crate) use whole_body::{LENGTH_INFORMATION, SITE_SCALE, WholeBody};

use crate::association::correspondence::Correspondences;
use crate::body::{Body, Pair};
use crate::config::{Config, SolverKind};
use crate::math::Pose;
use crate::observation::frame::Ground;

/// Largest turn of a joint or limb in one step, radians: linearized rows hold no farther.
const LARGEST_TURN: f64 = 0.5;
/// Standard deviation of a violated joint limit, radians: 3 degrees.
const LIMIT_SIGMA: f64 = 0.05;
/// Relative damping of the normal matrix: what hardly anything measures stays where it is.
const DAMPING: f64 = 1e-3;

/// What a solver works on: one ICP step of one frame.
#[derive(Debug)]
pub(crate) struct Problem<'a> {
    /// The body.
    pub body: &'a Body,
    /// What was matched at the current poses.
    pub correspondences: &'a Correspondences,
    /// The poses expected before the frame was seen.
    pub predicted: &'a [Pose],
    /// The floor, working frame, where it is known.
    pub floor: Option<Ground>,
    /// Index of the step in its frame.
    pub step: usize,
    /// Seconds since the last frame, as multiples of 1/30 s; the standard deviations of motion grow with it.
    pub time_scale: f64,
    /// Parameters.
    pub config: &'a Config,
}

/// Moves the limbs towards their correspondences: prepares a frame, then solves every step of it.
pub(crate) trait Solver: std::fmt::Debug + Send + Sync {
    /// What it wants of the loop.
    fn schedule(&self, config: &Config) -> Schedule;

    /// Follows the named sites before the first step of a frame (warm start); true asks for another round. `problem.predicted`
    /// are the poses before the frame.
    fn prepare(&mut self, _problem: &Problem, _poses: &mut [Pose]) -> bool {
        false
    }

    /// One update of all poses (working frame).
    fn solve(&mut self, problem: &Problem, poses: &mut [Pose]);

    /// Relative changes of the lengths of `pairs` that the correspondences ask for at `poses`, into `change`, which holds how
    /// far the lengths are below those to which they are drawn by the information `pull`. False when the solver knows none.
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

/// The solver of a configuration.
pub(crate) fn solver(kind: SolverKind) -> Box<dyn Solver> {
    match kind {
        SolverKind::Limbwise => Box::new(Limbwise::default()),
        SolverKind::Chain => Box::new(WholeBody::default()),
        SolverKind::Tree => Box::new(WholeBody::tree()),
    }
}
