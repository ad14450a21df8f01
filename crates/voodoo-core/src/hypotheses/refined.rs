//! A hypothesis after its ICP steps, and what it costs beside the current poses.

use super::history::Basis;
use super::score::{Cost, overall_cost};
use super::suspicion::Suspicion;
use crate::association::correspondence::Correspondences;
use crate::fit::{Context, Fit, Matched};
use crate::math::Pose;
use crate::regions::{Backdrop, Posed};

/// ICP steps that refine a hypothesis: more than a frame has, since it comes from farther.
pub(super) const REFINE: usize = 8;

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
    /// Refines a hypothesis with the whole body. True when it explains the frame better as a whole, and `fit` then holds its
    /// matches; else `fit` is as before.
    #[allow(clippy::too_many_arguments, reason = "what is tried, where, and with what")]
    pub(super) fn improves(
        &mut self,
        context: Context,
        index: usize,
        fit: &mut Fit,
        current: &[Pose],
        hypothesis: &[Pose],
        suspicion: &mut Suspicion,
        basis: Basis,
    ) -> bool {
        let chain = &context.model.extremities[index];
        let before = self.cost(context, fit, current);
        let cost = self.refine(context, fit, hypothesis);
        let matched = fit.matched(&self.poses);
        // What is as suspect as before is not worth a jump.
        let pictures = context.pictures_alone();
        let mut sure = |matched: Matched| pictures || !suspicion.of(context, matched, chain, basis == Basis::Points)[0];
        if cost.is_better_than(&before) && (basis == Basis::Lean || sure(matched)) {
            return true;
        }
        fit.exchange(&mut self.matched);
        false
    }

    /// Refines a hypothesis with the whole body; `fit` then holds its matches, and `matched` those of before.
    pub(super) fn refine(&mut self, context: Context, fit: &mut Fit, hypothesis: &[Pose]) -> Cost {
        self.poses.clear();
        self.poses.extend_from_slice(hypothesis);
        fit.exchange(&mut self.matched);
        let last = context.config.max_steps;
        for step in 0..REFINE {
            fit.step(context, hypothesis, &mut self.poses, last.saturating_sub(REFINE - step));
        }
        fit.match_last(context, &self.poses);
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
        fit.exchange(&mut self.matched);
        let steps = fit.run_far(context, predicted, &mut tried);
        let cost = self.cost(context, fit, &tried);
        self.poses = tried;
        if cost.is_better_than(&before) {
            poses.clone_from(&self.poses);
        } else {
            fit.exchange(&mut self.matched);
        }
        steps
    }

    /// What matched poses cost, by pictures as well where these are all there is.
    pub(super) fn cost(&mut self, context: Context, fit: &Fit, poses: &[Pose]) -> Cost {
        let mut cost = overall_cost(context, fit.matched(poses));
        if context.pictures_alone() {
            let Context { model, seen, previous, .. } = context;
            let posed = Posed { body: &model.body, poses, previous, origin: seen.origin() };
            fit.regions().draw(seen.frame(), posed, |_| true, &mut self.backdrop);
            let explained = fit.regions().explained(seen.frame(), posed, &self.backdrop);
            (cost.evidence, cost.total) = (cost.evidence - explained, cost.total - explained);
        }
        cost
    }
}
