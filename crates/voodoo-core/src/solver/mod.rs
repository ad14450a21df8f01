//! Step 7: the pose that fits the correspondences. The solver is the one replaceable part of the step.

mod chain;
mod lengths;
mod limbwise;
mod tree;
mod warm_start;
mod whole_body;

pub use chain::ChainSolver;
pub use limbwise::Limbwise;
pub use tree::TreeSolver;
pub use warm_start::WarmStart;
pub use whole_body::WholeBody;

use crate::association::correspondence::Correspondences;
use crate::body::{Body, Pair};
use crate::config::{Config, SolverKind};
use crate::math::Pose;

/// What a solver works on: one ICP step of one frame.
#[derive(Debug)]
pub struct Problem<'a> {
    /// The body.
    pub body: &'a Body,
    /// What was matched at the current poses.
    pub correspondences: &'a Correspondences,
    /// The poses expected before the frame was seen.
    pub predicted: &'a [Pose],
    /// Index of the step in its frame.
    pub step: usize,
    /// Seconds since the last frame, as multiples of 1/30 s; the standard deviations of motion grow with it.
    pub pace: f64,
    /// Parameters.
    pub config: &'a Config,
}

/// Which points may be matched in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Enlargement of the limb boxes, metres.
    pub box_margin: f64,
    /// Greatest distance of a point from its limb's surface, metres.
    pub distance: f64,
}

/// Moves the limbs towards their correspondences.
pub trait Solver: std::fmt::Debug + Send + Sync {
    /// One update of all poses (working frame).
    fn solve(&mut self, problem: &Problem, poses: &mut [Pose]);

    /// Follows the named sites before the first step of a frame; true asks for another round. Solvers that move all limbs
    /// at once need no such lead. `problem.predicted` are the poses before the frame.
    fn lead(&mut self, _problem: &Problem, _poses: &mut [Pose]) -> bool {
        false
    }

    /// Whether `lead` wants the points matched at the poses it is given, not only the sites.
    fn leads_with_points(&self) -> bool {
        false
    }

    /// Relative changes of the lengths of `pairs` that the correspondences ask for at `poses`, into `change`, which holds how
    /// far the lengths are below the ones set. False when the solver knows none.
    fn lengths(&mut self, _problem: &Problem, _poses: &[Pose], _pairs: &[Pair], _change: &mut [f64]) -> bool {
        false
    }

    /// Whether it reads the elastic bands among the correspondences.
    fn reads_bands(&self) -> bool {
        false
    }

    /// Which points may be matched in a step of a frame.
    fn gate(&self, config: &Config, step: usize) -> Gate;

    /// Whether points get new limbs and rims new edges in a step of a frame, or keep those of the step before: once the gate
    /// has narrowed, few change. The published method renews them in every step.
    fn renews(&self, _step: usize) -> bool {
        true
    }

    /// Whether a frame starts from the predicted poses; the published method starts from the last ones.
    fn starts_from_prediction(&self) -> bool;

    /// Whether depth pixels match only what faces their camera; the published method takes the closest point wherever it is.
    fn faces_cameras(&self) -> bool;
}

/// The solver of a configuration.
pub fn solver(kind: SolverKind) -> Box<dyn Solver> {
    match kind {
        SolverKind::Limbwise => Box::new(Limbwise::default()),
        SolverKind::Chain => Box::new(WholeBody::default()),
        SolverKind::Tree => Box::new(WholeBody::tree()),
    }
}
