//! Refinement of hypotheses by ICP, and comparison of their cost with that of the current poses.

use super::history::Basis;
use super::proposals::Proposal;
use super::score::{Cost, REFUTED_GAIN, SURE_GAIN, overall_cost};
use super::suspicion::Suspicion;
use crate::association::correspondence::Correspondences;
use crate::body::squared_mahalanobis;
use crate::fit::{Context, Fit, Matched};
use crate::math::Pose;
use crate::regions::{self, Backdrop, Posed};

/// Number of ICP steps that refine a hypothesis: more than a frame has, because a hypothesis starts farther from the solution.
pub(crate) const REFINE: usize = 8;
/// Step at which a hypothesis is rejected if it costs clearly more than the current poses. Of 63 accepted hypotheses in the
/// rendered recordings, none had a higher cost at this step. A test in an earlier step rejected correct ones that started far
/// away.
const GIVE_UP_AFTER: usize = 6;
/// Number of first steps that use a subsample of the points. The final cost uses all points.
const ROUGH_STEPS: usize = GIVE_UP_AFTER;
/// Decrease of the squared Mahalanobis distance from the usual posture that makes a suspect hypothesis acceptable. The prior
/// probability of the pose is then twenty times as large.
const MORE_USUAL: f64 = 6.0;

/// Result of the test of a hypothesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It explains the frame better.
    Better,
    /// It does not explain the frame better, or the arm or leg is suspect in it as well.
    Refused,
    /// Its cost is so high that the next frames are unlikely to accept it.
    Hopeless,
}

/// The current poses and their cost.
#[derive(Clone, Copy, Debug)]
pub(super) struct Present<'a> {
    pub(super) cost: Cost,
    pub(super) poses: &'a [Pose],
}

/// A hypothesis after its ICP steps.
#[derive(Debug, Default)]
pub(super) struct Refined {
    pub(super) poses: Vec<Pose>,
    /// Correspondences that are exchanged with those of the fit: those of the current poses while the fit holds those of the
    /// hypothesis, and vice versa.
    pub(super) matched: Correspondences,
    /// Label images of the whole body.
    pub(super) backdrop: Backdrop,
}

impl Refined {
    /// Refines a hypothesis of one arm or leg together with the whole body, and compares it with `present`. Returns the number of
    /// ICP steps and the outcome. If the hypothesis is better, `fit` holds its correspondences; otherwise `fit` is unchanged.
    pub(super) fn improves(
        &mut self,
        context: Context,
        present: Present,
        index: usize,
        fit: &mut Fit,
        hypothesis: &Proposal,
        suspicion: &mut Suspicion,
    ) -> (usize, Outcome) {
        let chain = &context.model.extremities[index];
        let (basis, pictures) = (hypothesis.basis, context.pictures_alone());
        // With color images alone, the cost of intermediate steps is not informative.
        let most = if pictures { f64::INFINITY } else { present.cost.total + REFUTED_GAIN };
        let (steps, cost) = self.refine_up_to(context, fit, &hypothesis.poses, most);
        let hopeless = cost.total > most;
        if steps == REFINE && !hopeless && cost.is_better_than(&present.cost) {
            let matched = fit.matched(&self.poses);
            // The arm or leg must no longer be suspect, unless the new posture is clearly more usual.
            let mut is_unsuspicious =
                |matched: Matched| pictures || !suspicion.assess(context, matched, chain, basis == Basis::Points)[0];
            let [tried, now] =
                [&self.poses, present.poses].map(|poses| squared_mahalanobis(&context.model.body, poses));
            if matches!(basis, Basis::Lean | Basis::Body) || is_unsuspicious(matched) || tried < now - MORE_USUAL {
                return (steps, Outcome::Better);
            }
        }
        fit.swap_matches(&mut self.matched);
        (steps, if hopeless { Outcome::Hopeless } else { Outcome::Refused })
    }

    /// Refines a hypothesis together with the whole body and returns its cost. Afterwards, `fit` holds its correspondences and
    /// `matched` the previous ones.
    pub(super) fn refine(&mut self, context: Context, fit: &mut Fit, hypothesis: &[Pose]) -> Cost {
        self.refine_up_to(context, fit, hypothesis, f64::INFINITY).1
    }

    /// Like [`Self::refine`], but stops early when the cost exceeds `most`. Returns the number of ICP steps and the cost.
    fn refine_up_to(&mut self, context: Context, fit: &mut Fit, hypothesis: &[Pose], most: f64) -> (usize, Cost) {
        self.poses.clear();
        self.poses.extend_from_slice(hypothesis);
        fit.swap_matches(&mut self.matched);
        let last = if context.pictures_alone() { regions::steps(true) } else { context.config.max_steps };
        for step in 0..REFINE {
            let at = last.saturating_sub(REFINE - step);
            let here = if step < ROUGH_STEPS { context.subsampled() } else { context };
            // After the first half of the steps, every second step keeps the assignment of points to limbs where possible.
            if step.is_multiple_of(2) || 2 * step < REFINE {
                fit.match_all(here, &self.poses, at);
            } else {
                fit.match_again(here, &self.poses, at);
            }
            // Halfway, only a much higher cost stops the refinement: this was so for one of 178 finally better hypotheses.
            let worst = match step {
                GIVE_UP_AFTER => most,
                _ if 2 * step == REFINE => most + SURE_GAIN,
                _ => f64::INFINITY,
            };
            if worst.is_finite() {
                let cost = self.own_cost(context, fit);
                if cost.total > worst {
                    return (step, cost);
                }
            }
            fit.solve(here, hypothesis, &mut self.poses, at);
        }
        fit.match_last(context, &self.poses);
        (REFINE, self.own_cost(context, fit))
    }

    /// Cost of `self.poses`.
    fn own_cost(&mut self, context: Context, fit: &Fit) -> Cost {
        let poses = std::mem::take(&mut self.poses);
        let cost = self.cost(context, fit, &poses);
        self.poses = poses;
        cost
    }

    /// Fits a body that may have moved far by a color-edge search over a larger distance, and accepts the result if it is better.
    /// Returns the number of ICP steps.
    pub(super) fn try_far(
        &mut self,
        context: Context,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &[Pose],
    ) -> usize {
        let before = self.cost(context, fit, poses);
        let mut tried = std::mem::take(&mut self.poses);
        tried.clear();
        tried.extend_from_slice(predicted);
        fit.swap_matches(&mut self.matched);
        let steps = fit.run_far(context, predicted, &mut tried);
        let cost = self.cost(context, fit, &tried);
        self.poses = tried;
        if cost.is_better_than(&before) {
            poses.clone_from(&self.poses);
        } else {
            fit.swap_matches(&mut self.matched);
        }
        steps
    }

    /// Cost of matched poses. Where color images are the only observation, it includes how well the poses explain them.
    pub(super) fn cost(&mut self, context: Context, fit: &Fit, poses: &[Pose]) -> Cost {
        let mut cost = overall_cost(context, fit.matched(poses));
        if context.pictures_alone() {
            let Context { model, observation, previous, .. } = context;
            let posed = Posed { body: &model.body, poses, previous, origin: observation.origin() };
            fit.regions().draw(observation.frame(), posed, |_| true, &mut self.backdrop);
            let explained = fit.regions().explained(observation.frame(), posed, &self.backdrop);
            (cost.evidence, cost.total) = (cost.evidence - explained, cost.total - explained);
        }
        cost
    }
}
