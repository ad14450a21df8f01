//! Step acceptance: no level may become worse than the levels above it require.

use super::{Active, IkProblem, IkSolver, SETTLED};
use voodoo_core::math::dot;

impl IkSolver {
    /// Takes the whole step, or as much of it as leaves no level worse than the levels above it require.
    pub(super) fn advance(&mut self, problem: &IkProblem, active: Active, angles: &mut [f64]) -> f64 {
        let Active { levels: count, image, slack } = active;
        let n = angles.len();
        let last = if image { count } else { count - 1 };
        self.propose(problem, angles, last, 1.0);
        self.evaluate(problem, image);
        let Some(failed) = self.first_failure(n, active, last) else {
            for level in 0..count {
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
            self.propose(problem, angles, failed, fraction);
            self.evaluate(problem, image);
            let above = Active { levels: count.min(failed + 1), image: image && failed == count, slack };
            if (fraction == 0.0 && slack) || self.first_failure(n, above, failed).is_none() {
                return self.take_trial(angles);
            }
        }
        // A rejected step does not count as converged: more damping comes next.
        if self.levels.trust.first().is_none_or(|trust| *trust < 1e5) { f64::INFINITY } else { 0.0 }
    }

    fn propose(&mut self, problem: &IkProblem, angles: &[f64], stage: usize, fraction: f64) {
        let n = angles.len();
        let limits = problem.model.limits();
        for i in 0..n {
            let above = if stage == 0 { 0.0 } else { self.stages[(stage - 1) * n + i] };
            let step = above + fraction * (self.stages[stage * n + i] - above);
            // The clamp only removes rounding errors: stages end at the limits.
            self.trial_angles[i] = (angles[i] + step).clamp(limits[i][0], limits[i][1]);
        }
    }

    /// The first level that the trial leaves worse than it was before its own part, beyond the second-order effect of the other
    /// levels' parts; their number stands for the image.
    fn first_failure(&self, n: usize, active: Active, stage: usize) -> Option<usize> {
        let length = |from: Option<usize>| -> f64 {
            let step = &self.stages[stage * n..(stage + 1) * n];
            (0..n).map(|i| step[i] - from.map_or(0.0, |from| self.stages[from * n + i])).map(|d| d * d).sum()
        };
        for level in 0..active.levels.min(stage + 1) {
            let rise = length((level == 0).then_some(0));
            let limit = match self.levels.best.get(level) {
                Some(best) if !active.slack => (best + 0.1 * SETTLED).max(self.levels.before[level]),
                _ => self.levels.before[level] + rise + 1e-13,
            };
            let residual = self.trial.cost[level].sqrt();
            if residual.is_nan() || residual > limit {
                return Some(level);
            }
        }
        if active.image && stage == self.levels.ranges.len() {
            let above =
                if stage == 0 { 0.0 } else { dot(&self.here.gradient, &self.stages[(stage - 1) * n..stage * n]) };
            if self.trial.h.is_nan() || self.trial.h > self.here.h + above.max(0.0) + 1e-9 {
                return Some(self.levels.ranges.len());
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
