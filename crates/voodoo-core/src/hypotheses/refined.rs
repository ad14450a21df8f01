//! A hypothesis after its ICP steps, and what it costs beside the current poses.

use super::history::Basis;
use super::proposals::Proposal;
use super::score::{Cost, REFUTED_GAIN, SURE_GAIN, overall_cost};
use super::suspicion::Suspicion;
use crate::association::correspondence::Correspondences;
use crate::body::squared_mahalanobis;
use crate::fit::{Context, Fit, Matched};
use crate::math::Pose;
use crate::regions::{self, Backdrop, Posed};

/// ICP steps that refine a hypothesis: more than a frame has, since it comes from farther.
pub(crate) const REFINE: usize = 8;
/// After so many of them a hypothesis is given up that costs clearly more than the current pose: of 63 that were taken in the
/// rendered recordings none was behind at all. Looked at earlier, right ones that came from far were lost.
const GIVE_UP_AFTER: usize = 6;
/// Steps with few points: they need not be exact. The hypothesis is judged by all of them.
const ROUGH_STEPS: usize = GIVE_UP_AFTER;
/// A pose that is nearer to the usual one by this, in squared standard deviations, is twenty times as likely before anything is seen.
const MORE_USUAL: f64 = 6.0;

/// How the look at a hypothesis ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It explains the frame better.
    Better,
    /// It does not, or is as suspect as the current pose.
    Refused,
    /// It is so much worse that the next frame will hardly think otherwise.
    Hopeless,
}

/// The current poses, and what they cost.
#[derive(Clone, Copy, Debug)]
pub(super) struct Present<'a> {
    pub(super) cost: Cost,
    pub(super) poses: &'a [Pose],
}

/// A hypothesis after its ICP steps.
#[derive(Debug, Default)]
pub(super) struct Refined {
    pub(super) poses: Vec<Pose>,
    /// Its correspondences while it is tried; those of the current poses while it is.
    pub(super) matched: Correspondences,
    /// The whole body before what pictures show.
    pub(super) backdrop: Backdrop,
}

impl Refined {
    /// Refines a hypothesis of one arm or leg, with the whole body. Returns the ICP steps that took, and whether
    /// it explains the frame better as a whole than `present`: then `fit` holds its matches, else it is as before.
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
        // What colors alone tell on the way says little.
        let most = if pictures { f64::INFINITY } else { present.cost.total + REFUTED_GAIN };
        let (steps, cost) = self.refine_up_to(context, fit, &hypothesis.poses, most);
        let hopeless = cost.total > most;
        if steps == REFINE && !hopeless && cost.is_better_than(&present.cost) {
            let matched = fit.matched(&self.poses);
            // What is as suspect as before is not worth a jump, unless people rather move that way.
            let mut sure =
                |matched: Matched| pictures || !suspicion.assess(context, matched, chain, basis == Basis::Points)[0];
            let [tried, now] =
                [&self.poses, present.poses].map(|poses| squared_mahalanobis(&context.model.body, poses));
            if matches!(basis, Basis::Lean | Basis::Body) || sure(matched) || tried < now - MORE_USUAL {
                return (steps, Outcome::Better);
            }
        }
        fit.swap_matches(&mut self.matched);
        (steps, if hopeless { Outcome::Hopeless } else { Outcome::Refused })
    }

    /// Refines a hypothesis with the whole body; `fit` then holds its matches, and `matched` those of before.
    pub(super) fn refine(&mut self, context: Context, fit: &mut Fit, hypothesis: &[Pose]) -> Cost {
        self.refine_up_to(context, fit, hypothesis, f64::INFINITY).1
    }

    /// The same; it is given up on the way when it costs more than `most`. With the number of ICP steps.
    fn refine_up_to(&mut self, context: Context, fit: &mut Fit, hypothesis: &[Pose], most: f64) -> (usize, Cost) {
        self.poses.clear();
        self.poses.extend_from_slice(hypothesis);
        fit.swap_matches(&mut self.matched);
        let last = if context.pictures_alone() { regions::steps(true) } else { context.config.max_steps };
        for step in 0..REFINE {
            let at = last.saturating_sub(REFINE - step);
            let here = if step < ROUGH_STEPS { context.subsampled() } else { context };
            // As in a frame's own steps, points mostly stay with the limbs they have, once it has come near.
            if step.is_multiple_of(2) || 2 * step < REFINE {
                fit.match_all(here, &self.poses, at);
            } else {
                fit.match_again(here, &self.poses, at);
            }
            // Half way, only what is far behind: of 178 that explained the frame better in the end one was.
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

    /// What its own poses cost.
    fn own_cost(&mut self, context: Context, fit: &Fit) -> Cost {
        let poses = std::mem::take(&mut self.poses);
        let cost = self.cost(context, fit, &poses);
        self.poses = poses;
        cost
    }

    /// Tries to find a body that may have moved far by edges that are looked for far away. Returns the number of ICP steps.
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

    /// What matched poses cost, by pictures as well where these are all there is.
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
