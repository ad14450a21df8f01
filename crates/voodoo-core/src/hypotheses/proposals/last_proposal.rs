//! What the frame before asked for, again: two frames in a row have to ask for the same change.

use super::{Pool, Propose};
use crate::hypotheses::history::History;
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::shifted;

/// The body as the frame before wanted it.
#[derive(Debug)]
pub(in crate::hypotheses) struct LastProposal;

impl Propose for LastProposal {
    fn propose(&mut self, at: Extremity, history: &[History], _rough: &mut RoughSearch, pool: &mut Pool) {
        let own = &history[at.index];
        if !own.persistence.voted_before() || own.last_proposal.is_empty() {
            return;
        }
        let origin = at.context.seen.origin();
        pool.again.poses.clear();
        pool.again.poses.extend(own.last_proposal.iter().map(|pose| shifted(pose, origin)));
        pool.again.set(own.last_basis);
    }
}
