//! Alternative configurations of arms and legs: proposed where the frame contradicts the current ones, refined, and compared by
//! one cost.

mod branch;
mod objective;
mod proposals;
mod refined;
mod rough;
mod unexplained;

pub(crate) use objective::{MARGIN, Objective};
pub(crate) use proposals::SWIVELS;
pub(crate) use refined::REFINE;
pub(crate) use rough::{ROUGH_SAMPLE, explain};

use crate::association::correspondence::RegionSupport;
use crate::body::Model;
use crate::detect::Detected;
use crate::fit::{Context, Fit, Motion};
use crate::math::{Pose, make_room};
use crate::terms::PATCH;
use crate::visibility::LITTLE;
use branch::Branch;
use proposals::{propose_clusters, propose_color_directions, propose_detected_end};
use refined::{Refined, is_elsewhere};
use rough::{Extremity, RoughSearch};
use unexplained::Unexplained;

/// Cost of an unexplained patch below which a frame shows clearly more than the body: 7 % of its points, where 5 % are usual.
const LARGE_EXCESS: f64 = 0.85;

/// Tests every arm and leg in every frame.
#[derive(Debug, Default)]
pub(crate) struct Hypotheses {
    unexplained: Unexplained,
    rough: RoughSearch,
    /// Proposals for one arm or leg in the order in which they are refined: the poses of the whole body, or none. They explain points
    /// or colors best, are stretched through unexplained points, or end at the detected position.
    proposals: [Vec<Pose>; 3],
    refined: Refined,
    /// The second branch of the body, fitted to the same color images.
    pub(crate) branch: Branch,
    /// The poses before this frame's hypotheses.
    before: Vec<Pose>,
}

impl Hypotheses {
    /// Forgets the last frame, and the second branch until the next frame has been fitted.
    pub(crate) fn restart(&mut self) {
        self.unexplained.clutter = 1.0;
        self.branch.motion.poses.clear();
    }

    /// Whether the body left more of the last frame unexplained than is usual.
    pub(crate) fn has_excess(&self) -> bool {
        self.unexplained.clutter < 1.0
    }

    /// Whether it left clearly more.
    pub(crate) fn has_large_excess(&self) -> bool {
        self.unexplained.clutter < LARGE_EXCESS
    }

    /// Tests every arm and leg. Where the frame contradicts one, proposes and refines alternatives, and accepts one that explains
    /// the frame better. Returns the number of ICP steps.
    pub(crate) fn improve(
        &mut self,
        context: Context,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &mut Vec<Pose>,
        detection: Option<Detected>,
    ) -> usize {
        self.before.clone_from(poses);
        self.make_room(context, fit);
        self.unexplained.collect(context.observation.candidates, &fit.correspondences);
        self.refined.clutter = self.unexplained.clutter;
        let (mut steps, by_colors) = (0, context.compares_colors());
        for chain in &context.model.extremities {
            let at = Extremity::new(context, fit, poses, chain);
            if !self.is_due(at) {
                continue;
            }
            if by_colors {
                fit.regions.draw(context.posed(poses), |limb| !chain.has(limb));
            }
            self.propose(Extremity::new(context, fit, poses, chain), detection);
            let Self { proposals, refined, unexplained, .. } = self;
            if proposals.iter().all(Vec::is_empty) {
                continue;
            }
            let mut current = refined.cost(context, fit, poses);
            for proposal in proposals.iter().filter(|poses| !poses.is_empty()) {
                let (taken, better) = refined.replace(context, fit, poses, predicted, current, proposal);
                steps += taken;
                if better {
                    current = refined.cost(context, fit, poses);
                    unexplained.collect(context.observation.candidates, &fit.correspondences);
                }
            }
        }
        if by_colors {
            steps += self.branch.compare(context, &mut self.refined, fit, poses, predicted);
        }
        if by_colors && steps > 0 {
            // The last evaluated poses may be those of a rejected hypothesis.
            fit.match_last(context, poses, true);
        }
        steps
    }

    /// Forgets the motion of the arms and legs that a hypothesis has moved in this frame: they did not move there since the last
    /// frame.
    pub(crate) fn forget_motion(&self, model: &Model, motion: &mut Motion) {
        for chain in &model.extremities {
            if is_elsewhere(chain, &self.before, &motion.poses) {
                motion.forget_joints(&model.body, chain.limbs());
            }
        }
    }

    /// Reserves memory for the body and all candidates of the frame, so that later steps do not allocate.
    fn make_room(&mut self, context: Context, fit: &Fit) {
        let Self { rough, proposals, refined: Refined { poses, tried, .. }, branch, .. } = self;
        for poses in proposals.iter_mut().chain([&mut rough.trial, poses, tried, &mut branch.tried]) {
            make_room(poses, context.model.body.limbs().len());
        }
        let most = context.observation.candidates.len();
        self.rough.make_room(most);
        self.refined.matched.reserve(most.min(context.config.max_limb_points), most, &fit.correspondences);
    }

    /// Whether the frame contradicts an arm or leg: its alternatives are tested.
    fn is_due(&mut self, at: Extremity) -> bool {
        let chain = at.chain;
        if at.objective.regions.is_some() {
            let supports = &at.objective.correspondences.region_support;
            let sum =
                |part: fn(&RegionSupport) -> f64| chain.limbs().filter_map(|limb| supports.get(limb)).map(part).sum();
            let [gained, area]: [f64; 2] = [sum(|support| support.gained), sum(|support| support.area)];
            return gained < LITTLE * area;
        }
        let near = &mut self.rough.unexplained;
        self.unexplained.near(at.root(), chain.stretched_length(), near);
        PATCH * self.unexplained.clutter * near.total() >= MARGIN
    }

    /// Proposes alternative configurations of one arm or leg.
    fn propose(&mut self, at: Extremity, detection: Option<Detected>) {
        let Self { rough, proposals, .. } = self;
        proposals.iter_mut().for_each(Vec::clear);
        let [best, stretched, detected] = proposals;
        rough.begin(at);
        let least = rough.cost(at, at.objective.poses, f64::INFINITY) - MARGIN;
        let least = propose_clusters(at, rough, least, [&mut *best, stretched]);
        propose_color_directions(at, rough, least, best);
        if let Some(detection) = detection {
            propose_detected_end(at, detection, rough, detected);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::refined::REFINE;
    use super::*;
    use crate::config::Config;
    use crate::testing::{before_wall, farthest, first_arm, raised, standing, with_context, without_background};

    /// Runs hypotheses that start with hanging arms on rendered images of the poses in `frames`. Returns the poses and the number
    /// of ICP steps of every frame.
    fn improved(frames: &[&Vec<Pose>]) -> Vec<(Vec<Pose>, usize)> {
        improved_with(&without_background(), frames)
    }

    /// The same with another configuration.
    fn improved_with(config: &Config, frames: &[&Vec<Pose>]) -> Vec<(Vec<Pose>, usize)> {
        let (model, mut poses) = standing();
        let (mut hypotheses, mut fit) = (Hypotheses::default(), Fit::new(config).unwrap());
        hypotheses.restart();
        let mut found = Vec::new();
        for truth in frames {
            let (pixels, previous) = (before_wall(&model.body, truth), poses.clone());
            let mut predicted = previous.clone();
            with_context(&pixels, config, &model, &previous, |context| {
                fit.match_last(context, &poses, true);
                let steps = hypotheses.improve(context, &mut fit, &mut poses, &mut predicted, None);
                assert_eq!(poses == previous, predicted == previous, "poses and prediction change together");
                found.push((poses.clone(), steps));
            });
        }
        found
    }

    #[test]
    fn a_correct_pose_stays_the_same_to_the_bit() {
        let (_, poses) = standing();
        for (found, steps) in improved(&[&poses; 4]) {
            assert_eq!((found, steps), (poses.clone(), 0));
        }
    }

    #[test]
    fn a_raised_arm_is_found_in_the_first_frame_that_shows_it_and_comes_back_with_the_next_that_does_not() {
        let (model, poses) = standing();
        let (truth, end) = raised(&model, &poses, 0.2);
        let found = improved(&[&truth, &truth, &poses]);
        let steps: Vec<usize> = found.iter().map(|(_, steps)| *steps).collect();
        assert!(
            steps[1] == 0 && [0, 2].iter().all(|index| (2 * REFINE..=4 * REFINE).contains(&steps[*index])),
            "{steps:?}"
        );
        for (found, _) in &found[..2] {
            assert!(farthest(found, &truth) < 0.01, "{}", farthest(found, &truth));
        }
        let (chain, back) = (&model.extremities[first_arm(&model)], &found[2].0);
        let (left, expected) = (chain.end(back).distance(chain.end(&poses)), end.distance(chain.end(&poses)));
        assert!(left < 0.2 && expected > 0.8, "{left} of {expected}");
    }

    #[test]
    fn a_raised_arm_is_found_where_limbs_have_more_points_than_are_used() {
        let (model, poses) = standing();
        let (truth, _) = raised(&model, &poses, 0.2);
        for (sampling_factor, max_limb_points) in [(2, 1000), (1, 60)] {
            let config = Config { sampling_factor, max_limb_points, ..without_background() };
            let (found, _) = &improved_with(&config, &[&truth])[0];
            assert!(farthest(found, &truth) < 0.02, "{sampling_factor}: {}", farthest(found, &truth));
            // What is not used is explained as its neighbors are.
            assert_eq!(improved_with(&config, &[&poses])[0].1, 0);
        }
    }

    #[test]
    fn a_hypothesis_without_a_lower_cost_is_refused_and_restores_the_matches() {
        let (model, poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let (mut fit, mut refined) = (Fit::new(&config).unwrap(), Refined::default());
            refined.clutter = 1.0;
            fit.match_last(context, &poses, true);
            let before = format!("{:?}", fit.correspondences);
            let current = refined.cost(context, &mut fit, &poses);
            // One that is the current pose needs no step.
            for (tried, expected) in [(raised(&model, &poses, 0.2).0, REFINE), (poses.clone(), 0)] {
                let (mut present, mut predicted) = (poses.clone(), poses.clone());
                let (steps, better) = refined.replace(context, &mut fit, &mut present, &mut predicted, current, &tried);
                assert!(!better && steps == expected, "{steps}");
                assert!(present == poses && predicted == poses);
            }
            assert_eq!(format!("{:?}", fit.correspondences), before);
        });
    }
}
