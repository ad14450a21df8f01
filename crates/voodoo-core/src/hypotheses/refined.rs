//! Refinement of hypotheses by ICP, and comparison of their cost with that of the current pose.

use super::objective::{MARGIN, Objective};
use crate::association::correspondence::Correspondences;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Fit};
use crate::math::{Pose, Vec3, refill};

/// Number of ICP steps that refine a hypothesis: more than a frame has, because a hypothesis starts farther from the solution.
pub(crate) const REFINE: usize = 8;
/// Number of first steps that use a subsample of the points. The final cost uses all points.
const ROUGH_STEPS: usize = 6;
/// A hypothesis whose arms and legs all come within this distance of the current pose is the same pose, meters.
const SAME_POSE: f64 = 0.05;

/// A hypothesis after its ICP steps.
#[derive(Debug, Default)]
pub(super) struct Refined {
    pub(super) poses: Vec<Pose>,
    /// Correspondences that are exchanged with those of the fit: those of the current poses while the fit holds those of the
    /// hypothesis, and vice versa.
    pub(super) matched: Correspondences,
    /// Cost of an unexplained patch in this frame, in those of a usual frame.
    pub(super) clutter: f64,
    /// A hypothesis after its ICP steps, while the current pose has as many.
    pub(super) tried: Vec<Pose>,
}

impl Refined {
    /// Refines a hypothesis together with the whole body, and replaces the current pose `poses`, of cost `current`, and its
    /// prediction where that is another pose that explains the frame better. Any pose explains more after more ICP steps: before
    /// it is replaced, the current pose is refined as well, and the result is used if the hypothesis is no better. Returns the
    /// number of ICP steps, and whether `poses` have changed; then, `fit` holds their correspondences. Otherwise, `fit` is
    /// unchanged.
    pub(super) fn replace(
        &mut self,
        context: Context,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &mut Vec<Pose>,
        current: f64,
        hypothesis: &[Pose],
    ) -> (usize, bool) {
        let (steps, cost) = self.refine(context, fit, hypothesis, Some(poses));
        fit.swap_matches(&mut self.matched);
        if steps < REFINE || cost >= current - MARGIN {
            return (steps, false);
        }
        std::mem::swap(&mut self.poses, &mut self.tried);
        let (_, settled) = self.refine(context, fit, poses, None);
        if cost < settled - MARGIN && is_another(context, &self.tried, &self.poses) {
            refill(predicted, hypothesis.iter().copied());
            poses.clone_from(&self.tried);
            fit.match_last(context, poses, true);
        } else if settled < current - MARGIN && is_another(context, &self.poses, poses) {
            predicted.clone_from(poses);
            poses.clone_from(&self.poses);
        } else {
            fit.swap_matches(&mut self.matched);
            return (steps + REFINE, false);
        }
        (steps + REFINE, true)
    }

    /// Refines a hypothesis together with the whole body, and stops early at the pose `rival`. Returns the number of ICP steps and
    /// the cost. Afterwards, `fit` holds its correspondences and `matched` the previous ones.
    pub(super) fn refine(
        &mut self,
        context: Context,
        fit: &mut Fit,
        hypothesis: &[Pose],
        rival: Option<&[Pose]>,
    ) -> (usize, f64) {
        refill(&mut self.poses, hypothesis.iter().copied());
        fit.swap_matches(&mut self.matched);
        for step in 0..REFINE {
            if rival.is_some_and(|other| !is_another(context, &self.poses, other)) {
                return (step, f64::INFINITY);
            }
            // The last step is as at the end of a frame.
            let at = (context.config.max_steps + 1 + step).saturating_sub(REFINE);
            let here = if step < ROUGH_STEPS { context.subsampled() } else { context };
            // After the first half of the steps, every second step keeps the assignment of points to limbs where possible.
            fit.match_all(here, &self.poses, at, step.is_multiple_of(2) || 2 * step < REFINE);
            fit.solve(here, hypothesis, &mut self.poses, at);
        }
        fit.match_last(context, &self.poses, true);
        (REFINE, self.cost(context, fit, &self.poses))
    }

    /// Cost of matched poses, nats.
    pub(super) fn cost(&self, context: Context, fit: &mut Fit, poses: &[Pose]) -> f64 {
        if context.compares_colors() {
            fit.regions.draw(context.posed(poses), |_| true);
        }
        Objective::new(context, fit, poses).body(self.clutter)
    }
}

/// Whether an arm or leg is at another place in one pose than in the other.
fn is_another(context: Context, one: &[Pose], other: &[Pose]) -> bool {
    context.model.extremities.iter().any(|chain| is_elsewhere(chain, one, other))
}

/// Whether this arm or leg is at another place in one pose than in the other.
pub(super) fn is_elsewhere(chain: &TwoBone, one: &[Pose], other: &[Pose]) -> bool {
    let apart = |one: Vec3, other: Vec3| one.distance(other) > SAME_POSE;
    apart(one[chain.lower].translation, other[chain.lower].translation) || apart(chain.end(one), chain.end(other))
}
