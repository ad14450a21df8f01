//! Proposes an arm or leg that ends at its last good position: a foot stands still while the body moves over it.

use super::{Pool, Propose, SWIVELS};
use crate::hypotheses::history::History;
use crate::hypotheses::rough::{Extremity, RoughSearch};

/// Proposal with the bend of lowest cost. It need not cost less by a margin, because the pose of the trunk may be wrong as well.
#[derive(Debug)]
pub(in crate::hypotheses) struct LastGoodEnd;

impl Propose for LastGoodEnd {
    fn propose(&mut self, at: Extremity, history: &[History], rough: &mut RoughSearch, pool: &mut Pool) {
        let Some(end) = history[at.index].last_good_end else { return };
        let place = end - at.context.observation.origin();
        let cost = rough.end_at(at, place, 2 * SWIVELS, pool.current, &mut pool.last_good.poses);
        pool.last_good.found = cost < pool.current;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::hypotheses::unexplained::Unexplained;
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
            let (mut unexplained, mut rough, mut pool) =
                (Unexplained::default(), RoughSearch::default(), Pool::default());
            unexplained.collect(context, at.matched);
            unexplained.near(at.root(), at.chain().stretched_length(), &mut rough.score.unexplained);
            rough.score.begin(at);
            pool.begin(rough.score.cost(at, &wrong, f64::INFINITY));
            LastGoodEnd.propose(at, &history, &mut rough, &mut pool);
            assert_eq!(pool.found().count(), 0, "no good position is known");
            history[index].last_good_end = Some(expected);
            LastGoodEnd.propose(at, &history, &mut rough, &mut pool);
            let found: Vec<_> = pool.found().collect();
            assert_eq!(found.len(), 1);
            assert!(model.extremities[index].end(&found[0].poses).distance(expected) < 0.005);
            for limb in (0..poses.len()).filter(|limb| !model.extremities[index].limbs().any(|own| own == *limb)) {
                assert_eq!(found[0].poses[limb], wrong[limb]);
            }
        });
    }
}
