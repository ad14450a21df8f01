//! Where an arm, a leg or the trunk may be instead: each kind of proposal is a file.

mod carried_by_parent;
mod color_directions;
mod detected_body;
mod detected_end;
mod last_good_end;
mod last_proposal;
mod trunk_lean;
mod unexplained_cluster;

pub(super) use carried_by_parent::CarriedByParent;
pub(super) use color_directions::ColorDirections;
pub(super) use detected_body::DetectedBody;
pub(super) use detected_end::DetectedEnd;
pub(super) use last_good_end::LastGoodEnd;
pub(super) use last_proposal::LastProposal;
pub(super) use trunk_lean::TrunkLean;
pub(super) use unexplained_cluster::UnexplainedCluster;

use super::history::{Basis, History};
use super::rough::{Extremity, RoughSearch};
use crate::math::Pose;

/// Bends of an arm or leg about the line from its root to its end that are tried, twice as many where nothing seen has to agree
/// with them; and places of its end, at most, and directions of its upper limb: all cost time in proportion.
pub(crate) const SWIVELS: usize = 6;

/// Looks for one kind of other configuration of an arm or leg.
pub(super) trait Propose {
    /// Puts the best one into `pool`, where it is worth refining. `history` is that of all arms and legs.
    fn propose(&mut self, at: Extremity, history: &[History], rough: &mut RoughSearch, pool: &mut Pool);
}

/// One configuration of the whole body that may be refined.
#[derive(Clone, Debug, Default)]
pub(super) struct Proposal {
    pub(super) found: bool,
    pub(super) basis: Basis,
    pub(super) poses: Vec<Pose>,
}

/// What was proposed for one arm or leg, a slot for each kind, in the order in which they are refined.
#[derive(Debug, Default)]
pub(super) struct Pool {
    /// The trunk leans and both feet stay. While the trunk is wrong, both legs ask for what does not last: it comes first.
    pub(super) lean: Proposal,
    /// What the last frame asked for: two frames that ask for a change shall ask for the same one.
    pub(super) again: Proposal,
    /// The end is where it was when all was well.
    pub(super) rest: Proposal,
    /// What explains the points best; it has to cost less than this.
    pub(super) points: Proposal,
    pub(super) least: f64,
    /// Both feet are where they were when all was well.
    pub(super) both_feet: Proposal,
    /// The end is where a detector sees it.
    pub(super) detected: Proposal,
    /// The whole body is as a detector sees it.
    pub(super) body: Proposal,
}

impl Pool {
    /// Room for a body of so many limbs.
    pub(super) fn prepare(&mut self, limbs: usize) {
        for proposal in self.slots() {
            proposal.poses.clear();
            proposal.poses.reserve(limbs);
        }
    }

    /// Empties it; what explains the points has to cost less than `least`.
    pub(super) fn begin(&mut self, least: f64) {
        for proposal in self.slots() {
            proposal.found = false;
        }
        self.least = least;
    }

    /// What was found, in the order in which it is refined.
    pub(super) fn found(&self) -> impl Iterator<Item = &Proposal> {
        let Self { lean, again, rest, points, both_feet, detected, body, .. } = self;
        [lean, again, rest, points, both_feet, detected, body].into_iter().filter(|slot| slot.found)
    }

    fn slots(&mut self) -> [&mut Proposal; 7] {
        let Self { lean, again, rest, points, both_feet, detected, body, .. } = self;
        [lean, again, rest, points, both_feet, detected, body]
    }
}

impl Proposal {
    /// Fills the slot with the poses it holds.
    fn set(&mut self, basis: Basis) {
        (self.found, self.basis) = (true, basis);
    }
}
