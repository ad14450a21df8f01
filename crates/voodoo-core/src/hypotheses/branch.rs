//! A second opinion: the body followed by the same pictures, and held less to what is expected.
//!
//! What two cameras do not see is as the prior has it, or where a small chance led it. Somebody who believes less of the prior goes
//! elsewhere there, and to the same place wherever the pictures tell. Where an arm or leg of the two is not in one place, the one
//! that explains clearly more of the pictures is taken; how far they lie apart tells how little the pictures do.

use super::landmark_cost::APART;
use super::refined::{REFINE, Refined};
use super::score::GAIN;
use crate::config::Config;
use crate::fit::{Context, Fit, Motion};
use crate::math::{Pose, Vec3, shifted};

/// With more cameras than this there is hardly anything that none of them sees.
const FEW_CAMERAS: usize = 2;
/// The second body may move so many times as far as is expected of the first, and be held so much less to a usual posture.
const LOOSER: f64 = 3.0;

/// The other body.
#[derive(Debug, Default)]
pub(super) struct Branch {
    /// World frame; without poses there is none.
    motion: Motion,
    /// In this frame, working frame: its poses, those expected and those before, and the first body with one of its arms or legs.
    poses: Vec<Pose>,
    predicted: Vec<Pose>,
    previous: Vec<Pose>,
    tried: Vec<Pose>,
}

impl Branch {
    /// There is none until the next frame has been followed; room for so many limbs.
    pub(super) fn prepare(&mut self, limbs: usize) {
        let Self { motion, poses, predicted, previous, tried } = self;
        for poses in [&mut motion.poses, &mut motion.previous, poses, predicted, previous, tried] {
            poses.clear();
            poses.reserve(limbs);
        }
    }

    /// Follows the second body in a frame, before the first one is: `fit` holds its matches afterwards. Returns the ICP steps.
    pub(super) fn follow(&mut self, context: Context, fit: &mut Fit) -> usize {
        let Self { motion, poses, predicted, previous, .. } = self;
        if !is_enabled(context) || motion.poses.len() != context.model.body.limbs().len() {
            motion.poses.clear();
            return 0;
        }
        let (frame, origin) = (context.observation.frame(), context.observation.origin());
        let config = Config { motion_scale: LOOSER * context.config.motion_scale, ..context.config.clone() };
        motion.expect(&context.model.body, frame.stamp, config.prediction, predicted);
        predicted.iter_mut().for_each(|pose| *pose = shifted(pose, origin));
        set_shifted(previous, &motion.poses, origin);
        poses.clone_from(predicted);
        let steps = fit.run(Context { config: &config, previous, ..context }, predicted, poses);
        motion.previous.clone_from(&motion.poses);
        set_shifted(&mut motion.poses, poses, -origin);
        motion.commit(frame.stamp);
        steps
    }

    /// Where an arm or leg of the two bodies is not in one place, the one that explains clearly more is that of both; `predicted`
    /// is what is expected of the first one. `fit` holds its matches, before and afterwards. Returns the ICP steps.
    pub(super) fn compare(
        &mut self,
        context: Context,
        refined: &mut Refined,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &mut Vec<Pose>,
    ) -> usize {
        let (body, origin) = (&context.model.body, context.observation.origin());
        let mut steps = 0;
        if self.motion.poses.len() != poses.len() {
            if is_enabled(context) {
                // From here on they go their own ways.
                self.motion.restart(poses.iter().map(|pose| shifted(pose, -origin)).collect());
                self.motion.commit(context.observation.frame().stamp);
            }
            return steps;
        }
        set_shifted(&mut self.poses, &self.motion.poses, origin);
        for chain in &context.model.extremities {
            // Nearer ones are hardly told by what they explain.
            if chain.end(poses).distance(chain.end(&self.poses)) < APART {
                continue;
            }
            let now = refined.cost(context, fit, poses);
            self.tried.clone_from(poses);
            chain.place_between(body, &mut self.tried, self.poses[chain.lower].translation, chain.end(&self.poses));
            let cost = refined.refine(context, fit, &self.tried);
            steps += REFINE;
            if cost.total < now.total - GAIN {
                poses.clone_from(&refined.poses);
                predicted.clone_from(&self.tried);
                continue;
            }
            fit.swap_matches(&mut refined.matched);
            if cost.total > now.total + GAIN {
                chain.place_between(body, &mut self.poses, poses[chain.lower].translation, chain.end(poses));
            }
        }
        set_shifted(&mut self.motion.poses, &self.poses, -origin);
        steps
    }

    /// How far from the first body's limb, world frame, the second one's ends, meters; none where there is no second body.
    pub(super) fn end_distance(&self, limb: usize, length: f64, world_from_limb: &Pose) -> Option<f64> {
        let end = length * Vec3::Z;
        self.motion.poses.get(limb).map(|own| (*own * end).distance(*world_from_limb * end))
    }
}

/// Few pictures are all that is seen.
fn is_enabled(context: Context) -> bool {
    context.pictures_alone() && context.observation.frame().colors.len() <= FEW_CAMERAS
}

fn set_shifted(to: &mut Vec<Pose>, from: &[Pose], origin: Vec3) {
    to.clear();
    to.extend(from.iter().map(|pose| shifted(pose, origin)));
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::{before_wall, first_arm, moved, raised, standing, with_context, without_background};

    #[test]
    fn where_depth_is_visible_there_is_no_second_opinion() {
        let (model, mut poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &poses.clone(), |context| {
            let (mut branch, mut fit) = (Branch::default(), Fit::new(&config).unwrap());
            let mut predicted = poses.clone();
            // One that was is given up.
            branch.motion.restart(poses.clone());
            assert_eq!(branch.follow(context, &mut fit), 0);
            let steps = branch.compare(context, &mut Refined::default(), &mut fit, &mut poses, &mut predicted);
            assert_eq!((steps, branch.end_distance(0, 0.1, &poses[0])), (0, None));
        });
    }

    /// What becomes of two bodies that stand so before an image of the standing body: the first one's arm and the second one's, as
    /// distances of their ends from where the arm is seen, and the ICP steps.
    fn compared(first: &[Pose], other: &[Pose]) -> ([f64; 2], usize) {
        let (model, truth) = standing();
        let (pixels, config) = (before_wall(&model.body, &truth), without_background());
        with_context(&pixels, &config, &model, first, |context| {
            let (mut branch, mut fit) = (Branch::default(), Fit::new(&config).unwrap());
            branch.motion.restart(other.to_vec());
            fit.match_last(context, first);
            let (mut poses, mut predicted) = (first.to_vec(), first.to_vec());
            let steps = branch.compare(context, &mut Refined::default(), &mut fit, &mut poses, &mut predicted);
            let arm = &model.extremities[first_arm(&model)];
            assert_eq!(poses == first, predicted == first, "what is taken is what is expected");
            ([&poses, &branch.motion.poses].map(|poses| arm.end(poses).distance(arm.end(&truth))), steps)
        })
    }

    #[test]
    fn the_arm_that_explains_clearly_more_is_that_of_both_bodies() {
        let (model, right) = standing();
        let (wrong, _) = raised(&model, &right, 0.2);
        let (taken, steps) = compared(&wrong, &right);
        assert!(taken[0] < 0.02 && taken[1] < 0.02 && steps == REFINE, "{taken:?} after {steps}");
        let (kept, steps) = compared(&right, &wrong);
        assert!(kept[0] < 1e-9 && kept[1] < 0.02 && steps == REFINE, "{kept:?} after {steps}");
        assert_eq!(compared(&right, &moved(&right, 0.02 * Vec3::X)).1, 0, "they are in one place");
    }

    #[test]
    fn a_limb_differs_by_how_far_apart_its_ends_are() {
        let (model, poses) = standing();
        let (other, _) = raised(&model, &poses, 0.2);
        let arm = &model.extremities[first_arm(&model)];
        let mut branch = Branch::default();
        branch.motion.restart(moved(&other, 0.02 * Vec3::X));
        let differs =
            |limb: usize| branch.end_distance(limb, model.body.limbs()[limb].shape.length(), &poses[limb]).unwrap();
        assert!((differs(0) - 0.02).abs() < 1e-9, "the trunk is only shifted: {}", differs(0));
        assert!(differs(arm.lower) > 0.15, "{}", differs(arm.lower));
    }
}
