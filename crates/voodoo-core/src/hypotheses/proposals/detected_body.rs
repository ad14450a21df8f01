//! Proposes the whole body as detected: when the trunk is displaced, no change of a single arm or leg is correct.

use super::{Pool, Propose};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::{Pose, shifted};

/// Poses of all limbs, fitted to the detections in this frame, world frame; empty without detections.
#[derive(Debug)]
pub(in crate::hypotheses) struct DetectedBody<'a>(pub(in crate::hypotheses) &'a [Pose]);

impl Propose for DetectedBody<'_> {
    fn propose(&mut self, at: Extremity, _rough: &mut RoughSearch, pool: &mut Pool) {
        // A wrong arm is no evidence against the rest of the body.
        if !at.chain().leg || self.0.len() != at.matched.poses.len() {
            return;
        }
        let origin = at.context.observation.origin();
        pool.body.poses.clear();
        pool.body.poses.extend(self.0.iter().map(|pose| shifted(pose, origin)));
        pool.body.found = true;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::{Context, Fit};
    use crate::math::Vec3;
    use crate::testing::{before_wall, farthest, moved, standing, with_context, without_background};

    #[test]
    fn the_detected_body_is_proposed_for_legs_in_the_working_frame_and_not_for_arms() {
        let (model, poses) = standing();
        let (pixels, config, origin) =
            (before_wall(&model.body, &poses), without_background(), Vec3::new(2.0, -1.0, 0.5));
        let truth_at = moved(&poses, 0.1 * Vec3::X + origin);
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut observation = context.observation;
            observation.views.origin = origin;
            let fit = Fit::new(&config).unwrap();
            let proposed = |leg: bool, detected: &[Pose]| {
                let index = model.extremities.iter().position(|chain| chain.leg == leg).unwrap();
                let context = Context { observation, ..context };
                let at = Extremity { context, matched: fit.matched(&poses), regions: None, index };
                let (mut rough, mut pool) = (RoughSearch::default(), Pool::default());
                DetectedBody(detected).propose(at, &mut rough, &mut pool);
                let found: Vec<_> = pool.found().map(|proposal| proposal.poses.clone()).collect();
                found
            };
            let found = proposed(true, &truth_at);
            assert_eq!(found.len(), 1);
            assert!(farthest(&found[0], &moved(&poses, 0.1 * Vec3::X)) < 1e-12);
            assert!(proposed(false, &truth_at).is_empty());
            assert!(proposed(true, &[]).is_empty(), "no detections");
        });
    }
}
