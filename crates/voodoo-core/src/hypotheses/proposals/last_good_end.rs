//! The arm or leg ends where it did when all was well: a foot stands while the body moves over it.

use super::{Pool, Propose};
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};

/// Bends that are tried: twice as many as towards unexplained points, since nothing seen has to agree with them yet.
const SWIVELS_AT_REST: usize = 12;

/// The best bend is refined whatever it explains so far, because the body itself may be off by as much.
#[derive(Debug)]
pub(in crate::hypotheses) struct LastGoodEnd;

impl Propose for LastGoodEnd {
    fn propose(&mut self, at: Extremity, history: &[History], rough: &mut RoughSearch, pool: &mut Pool) {
        let Some(end) = history[at.index].last_good_end else { return };
        let place = end - at.context.seen.origin();
        let cost = rough.end_at(at, place, SWIVELS_AT_REST, f64::INFINITY, &mut pool.rest.poses);
        if cost < f64::INFINITY {
            pool.rest.set(Basis::Rest);
        }
    }
}
