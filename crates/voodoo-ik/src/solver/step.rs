//! One step: the parts of all levels and of the image, each within the limits, and its acceptance: no level may become worse
//! than the levels above it require.

use super::super::goal::level_rows;
use super::super::linear::largest;
use super::{IkProblem, IkSolver, SETTLED};
use voodoo_core::math::{dot, refill};

/// Minimum damping, m^2: small relative to `J J^T` of any visible motion, so that the last steps are Newton steps.
const LEAST_DAMPING: f64 = 1e-10;

impl IkSolver {
    /// Computes one step of the levels up to `last`; the image follows all levels. Returns the largest change of an unknown.
    pub(super) fn step(&mut self, problem: &IkProblem, last: usize, slack: bool, angles: &mut [f64]) -> f64 {
        let (n, count) = (angles.len(), self.levels.ranges.len());
        self.linear.taken.clear(n);
        for level in 0..count.min(last + 1) {
            self.level_part(problem, level, angles);
            if level < last {
                self.linear.taken.take(&self.linear.jacobian);
            }
        }
        if last == count {
            self.image_part(problem, count, angles);
        }
        self.advance(problem, last, slack, angles)
    }

    /// Computes the part of one level: `(J P)^+ (-e - J d)` after the step `d` of the levels above (Baerlocher and Boulic 2004).
    /// It is cut at the limits and solved again without the unknowns that are at a limit.
    fn level_part(&mut self, problem: &IkProblem, level: usize, angles: &[f64]) {
        let n = angles.len();
        let goals = &problem.goals[self.levels.ranges[level].clone()];
        level_rows(problem.model, goals, &self.here.at, &mut self.linear.jacobian, &mut self.linear.residual);
        self.stages.copy_within(level * n..(level + 1) * n, (level + 1) * n);
        let damping = self.levels.trust[level] * self.here.cost[level] + LEAST_DAMPING;
        for attempt in 0..=n {
            let stage = &self.stages[(level + 1) * n..(level + 2) * n];
            let rows = self.linear.jacobian.chunks_exact(n).zip(&self.linear.residual);
            refill(&mut self.linear.target, rows.map(|(row, e)| -e - dot(row, stage)));
            if attempt == 0 {
                self.levels.before[level] = dot(&self.linear.target, &self.linear.target).sqrt();
            }
            self.linear.projected.clone_from(&self.linear.jacobian);
            self.linear.projected.chunks_exact_mut(n).for_each(|row| self.linear.taken.project(row));
            self.linear.solve(damping);
            if !self.add_part(problem, level, angles) {
                break;
            }
        }
    }

    /// Computes the image's part: `-alpha (I - J^+ J) grad h` (J10 eq. 4) with Polyak's step `alpha = gain h / |P grad h|^2`,
    /// because the minimum of `h` is zero. Where the free motion is hardly visible in the images (along the line of sight), the
    /// gradient is small and unreliable, so `alpha = gain h / (|P grad h|^2 + (caution reach)^2)`.
    fn image_part(&mut self, problem: &IkProblem, count: usize, angles: &[f64]) {
        let n = angles.len();
        self.stages.copy_within(count * n..(count + 1) * n, (count + 1) * n);
        let blind = problem.options.caution * problem.criterion.map_or(0.0, |criterion| criterion.reach(&self.here.at));
        for _ in 0..=n {
            self.linear.part.copy_from_slice(&self.here.gradient);
            self.linear.taken.project(&mut self.linear.part);
            let square = dot(&self.linear.part, &self.linear.part);
            if square < 1e-16 {
                break;
            }
            let alpha = self.gain * self.here.h / (square + blind * blind);
            self.linear.part.iter_mut().for_each(|value| *value *= -alpha);
            if !self.add_part(problem, count, angles) {
                break;
            }
        }
    }

    /// Adds the part to a stage as far as the limits allow. Returns true if a limit was reached; that unknown is then fixed.
    pub(super) fn add_part(&mut self, problem: &IkProblem, stage: usize, angles: &[f64]) -> bool {
        let n = angles.len();
        let most = largest(&self.linear.part);
        if !most.is_finite() {
            return false;
        }
        let mut fraction = (problem.options.largest_turn / most.max(problem.options.largest_turn)).min(1.0);
        let step = &mut self.stages[(stage + 1) * n..(stage + 2) * n];
        let mut hit = None;
        for (i, [low, high]) in problem.model.limits().iter().enumerate() {
            let (from, by) = (angles[i] + step[i], self.linear.part[i]);
            let room = if by < -1e-15 {
                low - from
            } else if by > 1e-15 {
                high - from
            } else {
                continue;
            };
            if fraction * by.abs() > room.abs() {
                fraction = (room / by).max(0.0);
                hit = Some(i);
            }
        }
        step.iter_mut().zip(&self.linear.part).for_each(|(step, part)| *step += fraction * part);
        hit.is_some_and(|unknown| self.linear.taken.pin(unknown))
    }

    /// Takes the whole step, or as much of it as leaves no level worse than the levels above it require.
    fn advance(&mut self, problem: &IkProblem, last: usize, slack: bool, angles: &mut [f64]) -> f64 {
        let (n, count) = (angles.len(), self.levels.ranges.len());
        self.attempt(problem, angles, last, 1.0);
        let Some(failed) = self.first_failure(n, last, slack) else {
            for level in 0..count.min(last + 1) {
                // Slow progress indicates an unreachable goal, where less damping would overshoot.
                let shrink = if self.trial.cost[level] < 0.9 * self.here.cost[level] { 0.3 } else { 0.8 };
                self.levels.trust[level] = (shrink * self.levels.trust[level]).max(1e-6);
            }
            self.gain = (1.5 * self.gain).min(problem.options.gain);
            return self.take_trial(angles);
        };
        if failed < count {
            self.levels.trust[failed] = (4.0 * self.levels.trust[failed]).min(1e6);
        } else {
            self.gain *= 0.5;
        }
        // First without the lower levels; then with a quarter of the failed level's own part; then with the levels above only.
        for fraction in [1.0, 0.25, 0.0] {
            if (failed == last && fraction == 1.0) || (failed == 0 && fraction == 0.0) {
                continue;
            }
            self.attempt(problem, angles, failed, fraction);
            if (fraction == 0.0 && slack) || self.first_failure(n, failed, slack).is_none() {
                return self.take_trial(angles);
            }
        }
        // A rejected step does not count as converged: more damping comes next.
        if self.levels.trust.first().is_none_or(|trust| *trust < 1e5) { f64::INFINITY } else { 0.0 }
    }

    /// Evaluates the trial posture of the stages above one, and a fraction of its own part.
    fn attempt(&mut self, problem: &IkProblem, angles: &[f64], stage: usize, fraction: f64) {
        let n = angles.len();
        let limits = problem.model.limits();
        for i in 0..n {
            let above = self.stages[stage * n + i];
            let step = above + fraction * (self.stages[(stage + 1) * n + i] - above);
            // The clamp only removes rounding errors: stages end at the limits.
            self.trial_angles[i] = (angles[i] + step).clamp(limits[i][0], limits[i][1]);
        }
        problem.model.normalize(&mut self.trial_angles);
        self.evaluate(problem);
    }

    /// The first level that the trial leaves worse than it was before its own part, beyond the second-order effect of the other
    /// levels' parts; their number stands for the image.
    fn first_failure(&self, n: usize, stage: usize, slack: bool) -> Option<usize> {
        let count = self.levels.ranges.len();
        let length = |from: usize| -> f64 {
            let step = self.stages[(stage + 1) * n..(stage + 2) * n].iter().zip(&self.stages[from * n..]);
            step.map(|(step, from)| step - from).map(|d| d * d).sum()
        };
        for level in 0..count.min(stage + 1) {
            let rise = length(usize::from(level == 0));
            let limit = match self.levels.best.get(level) {
                Some(best) if !slack => (best + 0.1 * SETTLED).max(self.levels.before[level]),
                _ => self.levels.before[level] + rise + 1e-13,
            };
            let residual = self.trial.cost[level].sqrt();
            if residual.is_nan() || residual > limit {
                return Some(level);
            }
        }
        if stage == count {
            let above = dot(&self.here.gradient, &self.stages[stage * n..(stage + 1) * n]);
            if self.trial.h.is_nan() || self.trial.h > self.here.h + above.max(0.0) + 1e-9 {
                return Some(count);
            }
        }
        None
    }

    fn take_trial(&mut self, angles: &mut [f64]) -> f64 {
        let moved = angles.iter().zip(&self.trial_angles).fold(0.0_f64, |most, (old, new)| most.max((old - new).abs()));
        angles.copy_from_slice(&self.trial_angles);
        std::mem::swap(&mut self.here, &mut self.trial);
        moved
    }
}
