//! Step 7: the pose that fits the correspondences. The solver is the one replaceable part of the step.

mod limbwise;

pub use limbwise::Limbwise;

use crate::body::Body;
use crate::config::SolverKind;
use crate::correspondence::Correspondences;
use crate::geometry::Pose;

/// Moves the limbs towards their correspondences.
pub trait Solver: std::fmt::Debug + Send + Sync {
    /// One update of all poses (working frame) from one set of correspondences.
    fn solve(&mut self, body: &Body, correspondences: &Correspondences, poses: &mut [Pose]);
}

/// The solver of a configuration.
pub fn solver(kind: SolverKind) -> Box<dyn Solver> {
    match kind {
        SolverKind::Limbwise => Box::new(Limbwise),
    }
}
