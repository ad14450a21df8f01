//! The arm or leg ends where it did when all was well: a foot stands while the body moves over it.

use super::{Pool, Propose, SWIVELS};
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};

/// The best bend is refined whatever it explains so far, because the body itself may be off by as much.
#[derive(Debug)]
pub(in crate::hypotheses) struct LastGoodEnd;

impl Propose for LastGoodEnd {
    fn propose(&mut self, at: Extremity, history: &[History], rough: &mut RoughSearch, pool: &mut Pool) {
        let Some(end) = history[at.index].last_good_end else { return };
        let place = end - at.context.observation.origin();
        let cost = rough.end_at(at, place, 2 * SWIVELS, f64::INFINITY, &mut pool.rest.poses);
        // Pictures judge it as it is: a refinement takes as long as the frame.
        let most = if at.regions.is_some() { pool.least } else { f64::INFINITY };
        if cost < most {
            pool.rest.set(Basis::Rest);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::testing::{before_wall, first_arm, raised, standing, with_context, without_background};

    #[test]
    fn an_arm_is_proposed_where_it_ended_when_all_was_well() {
        let (model, poses) = standing();
        let (wrong, _) = raised(&model, &poses, 0.2);
        let index = first_arm(&model);
        let expected = model.extremities[index].end(&poses);
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &wrong, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &wrong);
            let at = Extremity { context, matched: fit.matched(&wrong), regions: None, index };
            let mut history = vec![History::default(); model.extremities.len()];
            let (mut rough, mut pool) = (RoughSearch::default(), Pool::default());
            LastGoodEnd.propose(at, &history, &mut rough, &mut pool);
            assert_eq!(pool.found().count(), 0, "nobody knows where");
            history[index].last_good_end = Some(expected);
            LastGoodEnd.propose(at, &history, &mut rough, &mut pool);
            let found: Vec<_> = pool.found().collect();
            assert_eq!((found.len(), found[0].basis), (1, Basis::Rest));
            assert!(model.extremities[index].end(&found[0].poses).distance(expected) < 0.005);
            for limb in (0..poses.len()).filter(|limb| !model.extremities[index].limbs().any(|own| own == *limb)) {
                assert_eq!(found[0].poses[limb], wrong[limb]);
            }
        });
    }
}
