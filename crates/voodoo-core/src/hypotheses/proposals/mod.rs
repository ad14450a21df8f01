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

/// Proposals for one arm or leg, one of each kind in the order in which they are refined: the poses of the whole body, or none.
#[derive(Debug, Default)]
pub(super) struct Pool {
    /// The configuration of lowest rough cost, and that cost; initially the highest that is worth refining.
    pub(super) points: Vec<Pose>,
    pub(super) least: f64,
    /// It is stretched through unexplained points.
    pub(super) stretched: Vec<Pose>,
    /// The end is at its detected position.
    pub(super) detected: Vec<Pose>,
}

impl Pool {
    /// Removes all proposals. The current configuration costs `current`.
    pub(super) fn begin(&mut self, current: f64) {
        let Self { points, stretched, detected, .. } = self;
        [points, stretched, detected].into_iter().for_each(Vec::clear);
        self.least = current - MARGIN;
    }

    /// The proposals, in the order in which they are refined.
    pub(super) fn found(&self) -> impl Iterator<Item = &Vec<Pose>> {
        [&self.points, &self.stretched, &self.detected].into_iter().filter(|poses| !poses.is_empty())
    }
}
