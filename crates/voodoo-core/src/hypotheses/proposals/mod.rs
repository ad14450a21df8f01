//! Proposals of alternative configurations of an arm or leg, one file for each kind.

mod color_directions;
mod detected_end;
mod unexplained_cluster;

pub(super) use color_directions::ColorDirections;
pub(super) use detected_end::DetectedEnd;
pub(super) use unexplained_cluster::UnexplainedCluster;

use super::MARGIN;
use super::rough::{Extremity, RoughSearch};
use crate::math::Pose;

/// Number of bends of an arm or leg about the line from its root to its end that are compared; twice as many where the position
/// of the end is given. Also the maximum number of clusters of unexplained points, and of directions of the upper limb, for one
/// arm or leg. The time is proportional to all of them.
pub(crate) const SWIVELS: usize = 6;

/// A kind of proposal for an arm or leg.
pub(super) trait Propose {
    /// Writes the best configuration of this kind to `pool` if it is worth refining.
    fn propose(&mut self, at: Extremity, rough: &mut RoughSearch, pool: &mut Pool);
}

/// A configuration of the whole body that may be refined.
#[derive(Clone, Debug, Default)]
pub(super) struct Proposal {
    pub(super) found: bool,
    pub(super) poses: Vec<Pose>,
}

/// Proposals for one arm or leg: one slot for each kind, in the order in which they are refined.
#[derive(Debug, Default)]
pub(super) struct Pool {
    /// The configuration of lowest rough cost, and that cost; initially the highest that is worth refining.
    pub(super) points: Proposal,
    pub(super) least: f64,
    /// It is stretched through unexplained points.
    pub(super) stretched: Proposal,
    /// The end is at its detected position.
    pub(super) detected: Proposal,
}

impl Pool {
    /// Reserves memory for a body of `limbs` limbs.
    pub(super) fn prepare(&mut self, limbs: usize) {
        for proposal in self.slots() {
            proposal.poses.clear();
            proposal.poses.reserve(limbs);
        }
    }

    /// Clears all slots. The current configuration costs `current`.
    pub(super) fn begin(&mut self, current: f64) {
        for proposal in self.slots() {
            proposal.found = false;
        }
        self.least = current - MARGIN;
    }

    /// The proposals found, in the order in which they are refined.
    pub(super) fn found(&self) -> impl Iterator<Item = &Proposal> {
        let Self { points, stretched, detected, .. } = self;
        [points, stretched, detected].into_iter().filter(|slot| slot.found)
    }

    fn slots(&mut self) -> [&mut Proposal; 3] {
        let Self { points, stretched, detected, .. } = self;
        [points, stretched, detected]
    }
}
