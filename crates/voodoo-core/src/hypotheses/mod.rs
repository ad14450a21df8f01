//! Trying other configurations of arms and legs where the frame speaks against the current ones, and keeping the best by one
//! score.

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

/// Looks at every arm and leg in every frame. Remembers what past frames said of each.
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
    /// Time of the last frame, seconds; none after a restart.
    stamp: Option<f64>,
}

impl Hypotheses {
    /// Forgets everything and makes room for another body.
    pub(crate) fn restart(&mut self, model: &Model) {
        let limbs = model.body.limbs().len();
        self.history.clear();
        self.history.resize_with(model.extremities.len(), || History {
            last_proposal: Vec::with_capacity(limbs),
            ..History::default()
        });
        self.stamp = None;
        // Room at once, not when the first hard frame comes.
        self.rough.prepare(limbs);
        self.pool.prepare(limbs);
        self.leg_swap.prepare(limbs);
        self.lean.prepare(model);
        self.branch.prepare(limbs);
        self.refined.poses.clear();
        self.refined.poses.reserve(limbs);
    }

    /// Follows a second body in what few cameras see, before the first one is. Returns the number of ICP steps.
    pub(crate) fn follow_branch(&mut self, context: Context, fit: &mut Fit) -> usize {
        self.branch.follow(context, fit)
    }

    /// How far from the far end of the body's limb, world frame, that of a second body lies, meters; none without a second body.
    pub(crate) fn branch_distance(&self, body: &Body, limb: usize, world_from_limb: &Pose) -> Option<f64> {
        self.branch.end_distance(limb, body.limbs()[limb].shape.length(), world_from_limb)
    }

    /// Looks at every arm and leg; where the frame speaks against it, tries others, and takes what explains the frame better.
    /// `detection` is what a detector says of this frame, and `detected` the poses there, world frame. Returns the number of ICP
    /// steps.
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
            // What was looked at last was tried.
            fit.match_last(context, poses);
        }
        steps
    }

    /// Remembers where the arms and legs end that this frame proves right; a lost body has been anywhere.
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

    /// The body, world, as this frame wants it where the next one has to ask for it as well.
    pub(crate) fn alternatives(&self) -> impl Iterator<Item = &[Pose]> {
        let asking =
            self.history.iter().filter(|own| own.persistence.requests_change() && !own.last_proposal.is_empty());
        asking.map(|own| &own.last_proposal[..])
    }

    /// Room for the worst case at once, not when the first hard frame comes.
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

    /// Whether the frame, and those before it, speak against an arm or leg for long enough to try others; where a detector
    /// `detector_ran`, there are new ones.
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
        // Nothing else than the arm is expected about an arm, but furniture stays open beside legs.
        let striking = !chain.leg && !self.unexplained.cluttered && unexplained >= CLEAR_GAIN;
        let suspect = unexplained >= GAIN && self.suspicion.assess(at.context, at.matched, chain, false) != [false; 2];
        let patience = if suspect { Some(PATIENCE) } else { striking.then_some(2 * PATIENCE) };
        // Of a leg that was refused for long a detector may tell something new.
        self.history[at.index].persistence.observe(patience, detector_ran && chain.leg, times)
    }

    /// Fills the pool with other configurations of one arm or leg.
    fn propose(&mut self, at: Extremity, detection: Option<Detected>, detected: &[Pose]) {
        let Self { history, suspicion, rough, clusters, lean, color_directions, pool, .. } = self;
        rough.score.begin(at, &suspicion.own);
        let current = rough.score.cost(at, at.matched.poses, f64::INFINITY);
        pool.begin(current - GAIN);
        // The kinds of proposals: one more is a file and a line here.
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

    /// Refines what was proposed until one explains the frame better. Two frames in a row have to ask for a change before it is
    /// made: a single frame may be disturbed.
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
                // The prediction spoke for the old configuration; the new one is what is expected now.
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

    /// Shows what is seen in `frames` to hypotheses that start with the arms hanging; the poses after every frame, and the steps.
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
                assert_eq!(poses == previous, predicted == previous, "what is taken is what is expected");
                found.push((poses.clone(), steps));
            });
        }
        found
    }

    #[test]
    fn a_right_pose_is_left_alone_bit_by_bit() {
        let (_, poses) = standing();
        for (found, steps) in improved(&[&poses; 4]) {
            assert_eq!((found, steps), (poses.clone(), 0));
        }
    }

    #[test]
    fn a_raised_arm_is_found_when_two_frames_in_a_row_ask_for_it() {
        let (model, poses) = standing();
        let (truth, _) = raised(&model, &poses, 0.2);
        let found = improved(&[&truth; 5]);
        let steps: Vec<usize> = found.iter().map(|(_, steps)| *steps).collect();
        assert_eq!(steps, [0, REFINE, REFINE, 0, 0], "one frame is waited for, two ask, and then all is well");
        assert!(found[..2].iter().all(|(found, _)| *found == poses));
        assert!(farthest(&found[2].0, &truth) < 0.01, "{}", farthest(&found[2].0, &truth));
    }

    #[test]
    fn two_disturbed_frames_before_one_in_order_change_nothing() {
        let (model, poses) = standing();
        let (truth, _) = raised(&model, &poses, 0.2);
        for (found, _) in improved(&[&truth, &truth, &poses, &truth, &truth, &poses]) {
            assert_eq!(found, poses);
        }
    }

    #[test]
    fn what_does_not_explain_the_frame_better_is_refused_and_leaves_no_trace() {
        let (model, poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let (mut fit, mut refined, mut suspicion) =
                (Fit::new(&config).unwrap(), Refined::default(), Suspicion::default());
            fit.match_last(context, &poses);
            let before = format!("{:?}", fit.correspondences());
            let (wrong, _) = raised(&model, &poses, 0.2);
            // The others are as good as the current one, and no better.
            let present = Present { cost: refined.cost(context, &fit, &poses), poses: &poses };
            for (tried, basis, ended) in [
                (&wrong, Basis::Rest, |steps, outcome| steps < REFINE && outcome == Outcome::Hopeless),
                (&poses, Basis::Body, |steps, outcome| (steps, outcome) == (REFINE, Outcome::Refused)),
                (&poses, Basis::Rest, |steps, outcome| (steps, outcome) == (REFINE, Outcome::Refused)),
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
    fn ends_are_remembered_of_arms_that_a_frame_proves_right_until_the_body_is_lost() {
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
        // One arm is not measured, and something spoke against one that is.
        let times = Times { before: 0.0, now: 0.1 };
        hypotheses.history[arm + 1].persistence.observe(Some(PATIENCE), false, times);
        hypotheses.remember(&model, &motion, false, |limb| limb != model.extremities[arm].lower);
        assert_eq!(known(&hypotheses), 2, "the legs");
        hypotheses.history[arm + 1].persistence.observe(None, false, times);
        hypotheses.remember(&model, &motion, false, |_| true);
        for (own, chain) in hypotheses.history.iter().zip(&model.extremities) {
            assert_eq!(own.last_good_end, Some(chain.end(&motion.poses) + origin));
        }
        hypotheses.remember(&model, &motion, false, |_| false);
        assert_eq!(known(&hypotheses), 4, "who is not measured now has been");
        hypotheses.remember(&model, &motion, true, |_| false);
        assert_eq!(known(&hypotheses), 0);
    }
}
