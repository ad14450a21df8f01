//! Proposes the change that the previous frame requested: two consecutive frames have to request the same change.

use super::{Pool, Propose};
use crate::hypotheses::history::History;
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::shifted;

/// Proposal of the poses that the previous frame requested.
#[derive(Debug)]
pub(in crate::hypotheses) struct LastProposal;

impl Propose for LastProposal {
    fn propose(&mut self, at: Extremity, history: &[History], _rough: &mut RoughSearch, pool: &mut Pool) {
        let own = &history[at.index];
        if !own.persistence.voted_before() || own.last_proposal.is_empty() {
            return;
        }
        let origin = at.context.observation.origin();
        pool.repeated.poses.clear();
        pool.repeated.poses.extend(own.last_proposal.iter().map(|pose| shifted(pose, origin)));
        pool.repeated.set(own.last_basis);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::{Context, Fit};
    use crate::hypotheses::history::Basis;
    use crate::hypotheses::persistence::Times;
    use crate::math::Vec3;
    use crate::testing::{before_wall, farthest, first_arm, moved, raised, standing, with_context, without_background};

    #[test]
    fn the_last_request_is_proposed_again_in_the_current_working_frame() {
        let (model, poses) = standing();
        let (expected, _) = raised(&model, &poses, 0.2);
        let (pixels, config, index) = (before_wall(&model.body, &poses), without_background(), first_arm(&model));
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut observation = context.observation;
            observation.views.origin = Vec3::new(2.0, -1.0, 0.5);
            let fit = Fit::new(&config).unwrap();
            let at = Extremity {
                context: Context { observation, ..context },
                matched: fit.matched(&poses),
                regions: None,
                index,
            };
            let mut history = vec![History::default(); model.extremities.len()];
            let (mut rough, mut pool) = (RoughSearch::default(), Pool::default());
            history[index].last_proposal = expected.clone();
            history[index].last_basis = Basis::Lean;
            history[index].persistence.observe(Some(1), false, Times { before: 0.0, now: 0.1 });
            LastProposal.propose(at, &history, &mut rough, &mut pool);
            assert_eq!(pool.found().count(), 0, "no frame requested it");
            history[index].persistence.vote();
            history[index].persistence.observe(Some(1), false, Times { before: 0.0, now: 0.1 });
            LastProposal.propose(at, &history, &mut rough, &mut pool);
            let found: Vec<_> = pool.found().collect();
            assert_eq!((found.len(), found[0].basis), (1, Basis::Lean));
            assert!(farthest(&found[0].poses, &moved(&expected, -observation.views.origin)) < 1e-12);
        });
    }
}
