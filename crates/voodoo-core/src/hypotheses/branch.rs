//! A second branch: the body fitted to the same color images with weaker priors.
//!
//! Priors and small disturbances determine the limbs that one or two cameras do not observe well. There, a branch with weaker
//! priors converges to other poses; where the images are informative, it converges to the same ones. Where an arm or leg differs
//! between the two, the one that explains the images clearly better is used for both. Otherwise, their distance is a measure of
//! uncertainty.

use super::objective::MARGIN;
use super::refined::Refined;
use crate::config::Config;
use crate::fit::{Context, Fit, Motion};
use crate::math::{Pose, Vec3, refill, shifted};
use crate::terms::APART;

/// Maximum number of cameras with a second branch. More cameras leave little of the body unobserved.
const FEW_CAMERAS: usize = 2;
/// Factor on the motion scale of the second branch, which weakens the priors of motion and of posture.
const LOOSER: f64 = 3.0;

/// The second branch of the body.
#[derive(Debug, Default)]
pub(crate) struct Branch {
    /// Its poses and their prediction, world frame. Without poses there is no second branch.
    pub(super) motion: Motion,
    /// Its poses in this frame, their prediction and the previous ones, and the body with one arm or leg of the branch; working
    /// frame.
    poses: Vec<Pose>,
    predicted: Vec<Pose>,
    previous: Vec<Pose>,
    pub(super) tried: Vec<Pose>,
}

impl Branch {
    /// Fits the second branch to a frame of few color images, before the body itself is fitted. Afterwards, `fit` holds its
    /// correspondences. Returns the number of ICP steps.
    pub(crate) fn follow(&mut self, context: Context, fit: &mut Fit) -> usize {
        let Self { motion, poses, predicted, previous, .. } = self;
        if !is_enabled(context) || motion.poses.len() != context.model.body.limbs().len() {
            motion.poses.clear();
            return 0;
        }
        let (frame, origin) = (context.observation.frame(), context.observation.origin());
        let config = Config { motion_scale: LOOSER * context.config.motion_scale, ..context.config.clone() };
        set_shifted(predicted, motion.expect(&context.model.body, frame.stamp, config.prediction), origin);
        set_shifted(previous, &motion.poses, origin);
        poses.clone_from(predicted);
        let steps = fit.run(Context { config: &config, previous, ..context }, predicted, poses);
        motion.previous.clone_from(&motion.poses);
        set_shifted(&mut motion.poses, poses, -origin);
        motion.commit(frame.stamp);
        steps
    }

    /// Compares the arms and legs of the body and the branch. Where one differs, the one that explains the frame clearly better
    /// replaces the other. `predicted` is the prediction of the body, and `fit` holds the correspondences of `poses` before and
    /// afterwards. Returns the number of ICP steps.
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
                // The branch starts at the current poses.
                self.motion.restart(poses.iter().map(|pose| shifted(pose, -origin)).collect());
                self.motion.commit(context.observation.frame().stamp);
            }
            return steps;
        }
        set_shifted(&mut self.poses, &self.motion.poses, origin);
        for chain in &context.model.extremities {
            // The costs of nearer ones hardly differ.
            if chain.end(poses).distance(chain.end(&self.poses)) < APART {
                continue;
            }
            let now = refined.cost(context, fit, poses);
            self.tried.clone_from(poses);
            chain.place_between(body, &mut self.tried, self.poses[chain.lower].translation, chain.end(&self.poses));
            let (taken, cost) = refined.refine(context, fit, &self.tried, None);
            steps += taken;
            if cost < now - MARGIN {
                poses.clone_from(&refined.poses);
                predicted.clone_from(&self.tried);
                continue;
            }
            fit.swap_matches(&mut refined.matched);
            if cost > now + MARGIN {
                chain.place_between(body, &mut self.poses, poses[chain.lower].translation, chain.end(poses));
            }
        }
        set_shifted(&mut self.motion.poses, &self.poses, -origin);
        steps
    }

    /// Distance between the distal end of a limb of the body, posed in the world frame, and that of the branch, meters; `None`
    /// without a branch.
    pub(crate) fn end_distance(&self, limb: usize, length: f64, world_from_limb: &Pose) -> Option<f64> {
        let end = length * Vec3::Z;
        self.motion.poses.get(limb).map(|own| (*own * end).distance(*world_from_limb * end))
    }
}

/// Whether colors of few cameras compare poses.
fn is_enabled(context: Context) -> bool {
    context.compares_colors() && context.observation.frame().colors.len() <= FEW_CAMERAS
}

fn set_shifted(to: &mut Vec<Pose>, from: &[Pose], origin: Vec3) {
    refill(to, from.iter().map(|pose| shifted(pose, origin)));
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::hypotheses::REFINE;
    use crate::testing::{before_wall, first_arm, moved, raised, standing, with_context, without_background};

    #[test]
    fn there_is_no_second_branch_with_depth_images() {
        let (model, mut poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &poses.clone(), |context| {
            let (mut branch, mut fit) = (Branch::default(), Fit::new(&config).unwrap());
            let mut predicted = poses.clone();
            // An existing branch is removed.
            branch.motion.restart(poses.clone());
            assert_eq!(branch.follow(context, &mut fit), 0);
            let steps = branch.compare(context, &mut Refined::default(), &mut fit, &mut poses, &mut predicted);
            assert_eq!((steps, branch.end_distance(0, 0.1, &poses[0])), (0, None));
        });
    }

    /// Compares two branches in an image of the standing body. Returns the distances of the ends of their first arms from the
    /// observed one, and the number of ICP steps.
    fn compared(first: &[Pose], other: &[Pose]) -> ([f64; 2], usize) {
        let (model, truth) = standing();
        let (pixels, config) = (before_wall(&model.body, &truth), without_background());
        with_context(&pixels, &config, &model, first, |context| {
            let (mut branch, mut fit) = (Branch::default(), Fit::new(&config).unwrap());
            branch.motion.restart(other.to_vec());
            fit.match_last(context, first, true);
            let (mut poses, mut predicted) = (first.to_vec(), first.to_vec());
            let mut refined = Refined { clutter: 1.0, ..Refined::default() };
            let steps = branch.compare(context, &mut refined, &mut fit, &mut poses, &mut predicted);
            let arm = &model.extremities[first_arm(&model)];
            assert_eq!(poses == first, predicted == first, "poses and prediction change together");
            ([&poses, &branch.motion.poses].map(|poses| arm.end(poses).distance(arm.end(&truth))), steps)
        })
    }

    #[test]
    fn the_arm_that_explains_clearly_more_is_used_in_both_branches() {
        let (model, right) = standing();
        let (wrong, _) = raised(&model, &right, 0.2);
        let (taken, steps) = compared(&wrong, &right);
        assert!(taken[0] < 0.02 && taken[1] < 0.02 && steps == REFINE, "{taken:?} after {steps}");
        let (kept, steps) = compared(&right, &wrong);
        assert!(kept[0] < 1e-9 && kept[1] < 0.02 && steps == REFINE, "{kept:?} after {steps}");
        assert_eq!(
            compared(&right, &moved(&right, 0.02 * Vec3::X)).1,
            0,
            "arms at nearly the same position are not compared"
        );
    }

    #[test]
    fn the_distance_of_a_limb_is_that_between_its_distal_ends() {
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
