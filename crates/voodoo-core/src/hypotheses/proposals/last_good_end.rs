//! Proposes an arm or leg that ends at its last good position: a foot stands still while the body moves over it.

use super::{Pool, Propose, SWIVELS};
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};

/// Proposal with the bend of lowest cost. It is refined whatever its rough cost, because the pose of the trunk may be wrong as
/// well.
#[derive(Debug)]
pub(in crate::hypotheses) struct LastGoodEnd;

impl Propose for LastGoodEnd {
    fn propose(&mut self, at: Extremity, history: &[History], rough: &mut RoughSearch, pool: &mut Pool) {
        let Some(end) = history[at.index].last_good_end else { return };
        let place = end - at.context.observation.origin();
        let cost = rough.end_at(at, place, 2 * SWIVELS, f64::INFINITY, &mut pool.last_good.poses);
        // With color images alone, the rough cost must be lower: a refinement takes as long as the frame itself.
        let most = if at.regions.is_some() { pool.least } else { f64::INFINITY };
        if cost < most {
            pool.last_good.set(Basis::End);
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
    fn an_arm_is_proposed_at_the_last_good_position_of_its_end() {
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
            assert_eq!(pool.found().count(), 0, "no good position is known");
            history[index].last_good_end = Some(expected);
            LastGoodEnd.propose(at, &history, &mut rough, &mut pool);
            let found: Vec<_> = pool.found().collect();
            assert_eq!((found.len(), found[0].basis), (1, Basis::End));
            assert!(model.extremities[index].end(&found[0].poses).distance(expected) < 0.005);
            for limb in (0..poses.len()).filter(|limb| !model.extremities[index].limbs().any(|own| own == *limb)) {
                assert_eq!(found[0].poses[limb], wrong[limb]);
            }
        });
    }
}
