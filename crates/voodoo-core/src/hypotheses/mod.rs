//! Alternative configurations of arms and legs: proposed where the frame contradicts the current ones, refined, and compared by
//! one cost.

mod branch;
mod history;
mod landmark_cost;
mod leg_swap;
mod persistence;
mod proposals;
mod refined;
mod rough;
mod score;
mod suspicion;
mod unexplained;

pub(crate) use landmark_cost::{APART, body_landmark_cost};
pub(crate) use persistence::PATIENCE;
pub(crate) use proposals::SWIVELS;
pub(crate) use refined::REFINE;
pub(crate) use score::{GAIN, ROUGH_SAMPLE, SURE_GAIN, explain, limit_strain, overall_cost};
pub(crate) use unexplained::CLUTTER;

use crate::association::correspondence::RegionSupport;
use crate::body::{Body, Model};
use crate::detect::Detected;
use crate::fit::{Context, Fit, Motion};
use crate::math::{Pose, shifted};
use crate::visibility::LITTLE;
use branch::Branch;
use history::History;
use leg_swap::LegSwap;
use persistence::Times;
use proposals::{
    CarriedByParent, ColorDirections, DetectedBody, DetectedEnd, LastGoodEnd, LastProposal, Pool, Propose, TrunkLean,
    UnexplainedCluster,
};
use refined::{Outcome, Present, Refined};
use rough::{Extremity, RoughSearch};
use score::CLEAR_GAIN;
use suspicion::Suspicion;
use unexplained::Unexplained;

/// Tests every arm and leg in every frame, and keeps a history of each.
#[derive(Debug, Default)]
pub(crate) struct Hypotheses {
    history: Vec<History>,
    unexplained: Unexplained,
    suspicion: Suspicion,
    rough: RoughSearch,
    clusters: UnexplainedCluster,
    lean: TrunkLean,
    color_directions: ColorDirections,
    leg_swap: LegSwap,
    pool: Pool,
    refined: Refined,
    branch: Branch,
    /// Stamp of the last frame, seconds; `None` after a restart.
    stamp: Option<f64>,
}

impl Hypotheses {
    /// Clears the history and reserves memory for another body.
    pub(crate) fn restart(&mut self, model: &Model) {
        let limbs = model.body.limbs().len();
        self.history.clear();
        self.history.resize_with(model.extremities.len(), || History {
            last_proposal: Vec::with_capacity(limbs),
            ..History::default()
        });
        self.stamp = None;
        // Reserved now, so that later steps do not allocate.
        self.rough.prepare(limbs);
        self.pool.prepare(limbs);
        self.leg_swap.prepare(limbs);
        self.lean.prepare(model);
        self.branch.prepare(limbs);
        self.refined.poses.clear();
        self.refined.poses.reserve(limbs);
    }

    /// Fits the second branch to a frame of few color images, before the body itself is fitted. Returns the number of ICP steps.
    pub(crate) fn follow_branch(&mut self, context: Context, fit: &mut Fit) -> usize {
        self.branch.follow(context, fit)
    }

    /// Distance between the distal end of a limb of the body, posed in the world frame, and that of the second branch, meters;
    /// `None` without a second branch.
    pub(crate) fn branch_distance(&self, body: &Body, limb: usize, world_from_limb: &Pose) -> Option<f64> {
        self.branch.end_distance(limb, body.limbs()[limb].shape.length(), world_from_limb)
    }

    /// Tests every arm and leg. Where the frame contradicts one, proposes and refines alternatives, and accepts one that explains
    /// the frame better. `detection` holds the detections in this frame, and `detected` the poses of all limbs that were fitted
    /// to them, world frame; empty without detections. Returns the number of ICP steps.
    pub(crate) fn improve(
        &mut self,
        context: Context,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &mut Vec<Pose>,
        detection: Option<Detected>,
        detected: &[Pose],
    ) -> usize {
        self.make_room(context, fit);
        let now = context.observation.frame().stamp;
        let times = Times { before: self.stamp.replace(now).unwrap_or(f64::NEG_INFINITY), now };
        self.unexplained.collect(context, fit.matched(poses));
        let mut steps = 0;
        let pictures = context.pictures_alone();
        if pictures && context.moves_unknown() {
            steps += self.refined.try_far(context, fit, poses, predicted);
        }
        for index in 0..context.model.extremities.len() {
            let regions = pictures.then_some(fit.regions());
            let at = Extremity { context, matched: fit.matched(poses), regions, index };
            if !self.is_suspect(at, detection.is_some(), times) {
                continue;
            }
            self.propose(at, detection, detected);
            let taken = self.try_proposals(context, index, fit, poses, predicted);
            if taken > 0 {
                self.unexplained.collect(context, fit.matched(poses));
            }
            steps += taken;
        }
        if pictures {
            let is_suspect = |index: usize| !self.history[index].persistence.is_clear();
            steps += self.leg_swap.attempt(context, is_suspect, &mut self.refined, fit, poses, predicted);
        }
        if pictures {
            steps += self.branch.compare(context, &mut self.refined, fit, poses, predicted);
        }
        if pictures && steps > 0 {
            // The last evaluated poses may be those of a rejected hypothesis.
            fit.match_last(context, poses);
        }
        steps
    }

    /// Stores the end position of every arm and leg that this frame does not contradict and whose limbs are all `measured`. If
    /// the body is `lost`, first clears all stored positions.
    pub(crate) fn remember(&mut self, model: &Model, motion: &Motion, lost: bool, measured: impl Fn(usize) -> bool) {
        if lost {
            self.history.iter_mut().for_each(|own| own.last_good_end = None);
        }
        for (own, chain) in self.history.iter_mut().zip(&model.extremities) {
            if own.persistence.is_clear() && chain.limbs().all(&measured) {
                own.last_good_end = Some(chain.end(&motion.poses) + motion.origin);
            }
        }
    }

    /// Poses of all limbs, world frame, for each change that this frame requested and the next frame has to confirm.
    pub(crate) fn alternatives(&self) -> impl Iterator<Item = &[Pose]> {
        let requesting =
            self.history.iter().filter(|own| own.persistence.requests_change() && !own.last_proposal.is_empty());
        requesting.map(|own| &own.last_proposal[..])
    }

    /// Reserves memory for all candidates of the frame, so that later steps do not allocate.
    fn make_room(&mut self, context: Context, fit: &Fit) {
        let most = context.observation.candidates.len();
        self.suspicion.make_room(most);
        self.rough.score.make_room(most);
        self.clusters.make_room(most);
        self.lean.make_room(most);
        if context.pictures_alone() {
            let (frame, limbs) = (context.observation.frame(), context.model.body.limbs().len());
            for backdrop in [&mut self.rough.score.backdrop, &mut self.refined.backdrop] {
                backdrop.make_room(frame, limbs);
            }
            self.color_directions.make_room(limbs);
        }
        self.refined.matched.reserve_as(fit.correspondences());
    }

    /// Whether the frame and the preceding ones have contradicted an arm or leg for long enough to test alternatives now.
    /// `detector_ran` is whether there are new detections.
    fn is_suspect(&mut self, at: Extremity, detector_ran: bool, times: Times) -> bool {
        let chain = at.chain();
        if at.regions.is_some() {
            let supports = &at.matched.correspondences.region_support;
            let sum =
                |part: fn(&RegionSupport) -> f64| chain.limbs().filter_map(|limb| supports.get(limb)).map(part).sum();
            let [gained, area]: [f64; 2] = [sum(|support| support.gained), sum(|support| support.area)];
            let suspect = gained < LITTLE * area;
            return self.history[at.index].persistence.observe(suspect.then_some(PATIENCE), false, times);
        }
        let near = &mut self.rough.score.unexplained;
        self.unexplained.near(at.root(), chain.stretched_length(), near);
        let unexplained = near.total();
        // Unexplained points near an arm most likely belong to it; near a leg, they may be furniture.
        let striking = !chain.leg && !self.unexplained.cluttered && unexplained >= CLEAR_GAIN;
        let suspect = unexplained >= GAIN && self.suspicion.assess(at.context, at.matched, chain, false) != [false; 2];
        let patience = if suspect { Some(PATIENCE) } else { striking.then_some(2 * PATIENCE) };
        // Detections are new evidence for a leg whose changes were refused for long.
        self.history[at.index].persistence.observe(patience, detector_ran && chain.leg, times)
    }

    /// Fills the pool with alternative configurations of one arm or leg.
    fn propose(&mut self, at: Extremity, detection: Option<Detected>, detected: &[Pose]) {
        let Self { history, suspicion, rough, clusters, lean, color_directions, pool, .. } = self;
        rough.score.begin(at, &suspicion.own);
        let current = rough.score.cost(at, at.matched.poses, f64::INFINITY);
        pool.begin(current - GAIN);
        // All kinds of proposals. To add one, add a file in `proposals` and an element here.
        let kinds: [&mut dyn Propose; 8] = [
            clusters,
            &mut LastGoodEnd,
            &mut CarriedByParent,
            &mut LastProposal,
            lean,
            color_directions,
            &mut DetectedEnd(detection),
            &mut DetectedBody(detected),
        ];
        for kind in kinds {
            kind.propose(at, history, rough, pool);
        }
    }

    /// Refines the proposals until one explains the frame better. A change is made only when two consecutive frames request it,
    /// because a single frame may be disturbed. Returns the number of ICP steps.
    fn try_proposals(
        &mut self,
        context: Context,
        index: usize,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &mut Vec<Pose>,
    ) -> usize {
        let Self { history, suspicion, pool, refined, .. } = self;
        let own = &mut history[index];
        own.last_proposal.clear();
        if pool.found().next().is_none() {
            return 0;
        }
        let cost = refined.cost(context, fit, poses);
        let (mut steps, mut hopeless) = (0, true);
        for proposal in pool.found() {
            let present = Present { cost, poses };
            let (taken, outcome) = refined.improves(context, present, index, fit, proposal, suspicion);
            steps += taken;
            hopeless &= outcome == Outcome::Hopeless;
            if outcome != Outcome::Better {
                continue;
            }
            if own.persistence.vote() {
                poses.clone_from(&refined.poses);
                // The prediction belongs to the old configuration; the proposal replaces it.
                predicted.clone_from(&proposal.poses);
            } else {
                own.last_basis = proposal.basis;
                let origin = context.observation.origin();
                own.last_proposal.extend(refined.poses.iter().map(|pose| shifted(pose, -origin)));
                fit.swap_matches(&mut refined.matched);
            }
            break;
        }
        if hopeless {
            own.persistence.pause();
        }
        steps
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::history::Basis;
    use super::proposals::Proposal;
    use super::refined::REFINE;
    use super::*;
    use crate::math::Vec3;
    use crate::testing::{before_wall, farthest, first_arm, raised, standing, with_context, without_background};

    /// Runs hypotheses that start with hanging arms on rendered images of the poses in `frames`. Returns the poses and the number
    /// of ICP steps of every frame.
    fn improved(frames: &[&Vec<Pose>]) -> Vec<(Vec<Pose>, usize)> {
        let (model, mut poses) = standing();
        let config = without_background();
        let (mut hypotheses, mut fit) = (Hypotheses::default(), Fit::new(&config).unwrap());
        hypotheses.restart(&model);
        let mut found = Vec::new();
        for truth in frames {
            let (pixels, previous) = (before_wall(&model.body, truth), poses.clone());
            let mut predicted = previous.clone();
            with_context(&pixels, &config, &model, &previous, |context| {
                fit.match_last(context, &poses);
                let steps = hypotheses.improve(context, &mut fit, &mut poses, &mut predicted, None, &[]);
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
    fn a_raised_arm_is_found_when_two_consecutive_frames_request_it() {
        let (model, poses) = standing();
        let (truth, _) = raised(&model, &poses, 0.2);
        let found = improved(&[&truth; 5]);
        let steps: Vec<usize> = found.iter().map(|(_, steps)| *steps).collect();
        assert_eq!(steps, [0, REFINE, REFINE, 0, 0], "one frame of patience, two requests, then no test");
        assert!(found[..2].iter().all(|(found, _)| *found == poses));
        assert!(farthest(&found[2].0, &truth) < 0.01, "{}", farthest(&found[2].0, &truth));
    }

    #[test]
    fn two_disturbed_frames_before_an_undisturbed_one_change_nothing() {
        let (model, poses) = standing();
        let (truth, _) = raised(&model, &poses, 0.2);
        for (found, _) in improved(&[&truth, &truth, &poses, &truth, &truth, &poses]) {
            assert_eq!(found, poses);
        }
    }

    #[test]
    fn a_hypothesis_without_a_lower_cost_is_refused_and_restores_the_matches() {
        let (model, poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let (mut fit, mut refined, mut suspicion) =
                (Fit::new(&config).unwrap(), Refined::default(), Suspicion::default());
            fit.match_last(context, &poses);
            let before = format!("{:?}", fit.correspondences());
            let (wrong, _) = raised(&model, &poses, 0.2);
            // The second and third hypotheses equal the current poses.
            let present = Present { cost: refined.cost(context, &fit, &poses), poses: &poses };
            for (tried, basis, ended) in [
                (&wrong, Basis::End, |steps, outcome| steps < REFINE && outcome == Outcome::Hopeless),
                (&poses, Basis::Body, |steps, outcome| (steps, outcome) == (REFINE, Outcome::Refused)),
                (&poses, Basis::End, |steps, outcome| (steps, outcome) == (REFINE, Outcome::Refused)),
            ] as [(_, _, fn(usize, Outcome) -> bool); 3]
            {
                let tried = Proposal { found: true, basis, poses: tried.clone() };
                let arm = first_arm(&model);
                let (steps, outcome) = refined.improves(context, present, arm, &mut fit, &tried, &mut suspicion);
                assert!(ended(steps, outcome), "{basis:?}: {outcome:?} after {steps}");
            }
            assert_eq!(format!("{:?}", fit.correspondences()), before);
        });
    }

    #[test]
    fn ends_of_confirmed_extremities_are_kept_until_the_body_is_lost() {
        let (model, poses) = standing();
        let mut hypotheses = Hypotheses::default();
        hypotheses.restart(&model);
        let origin = Vec3::new(3.0, -1.0, 2.0);
        let mut motion = Motion::default();
        (motion.poses, motion.origin) = (poses, origin);
        let (arm, legs) = (first_arm(&model), model.extremities.iter().filter(|chain| chain.leg).count());
        let known =
            |hypotheses: &Hypotheses| hypotheses.history.iter().filter(|own| own.last_good_end.is_some()).count();
        assert_eq!(legs, 2);
        // One arm is not measured, and the frame contradicts the other.
        let times = Times { before: 0.0, now: 0.1 };
        hypotheses.history[arm + 1].persistence.observe(Some(PATIENCE), false, times);
        hypotheses.remember(&model, &motion, false, |limb| limb != model.extremities[arm].lower);
        assert_eq!(known(&hypotheses), 2, "only the legs are confirmed");
        hypotheses.history[arm + 1].persistence.observe(None, false, times);
        hypotheses.remember(&model, &motion, false, |_| true);
        for (own, chain) in hypotheses.history.iter().zip(&model.extremities) {
            assert_eq!(own.last_good_end, Some(chain.end(&motion.poses) + origin));
        }
        hypotheses.remember(&model, &motion, false, |_| false);
        assert_eq!(known(&hypotheses), 4, "unmeasured limbs keep their ends");
        hypotheses.remember(&model, &motion, true, |_| false);
        assert_eq!(known(&hypotheses), 0);
    }
}
