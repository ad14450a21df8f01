//! The lowest level: a rest posture that pulls the angles where neither the goals nor the images constrain them.

use super::super::goal::level_rows;
use super::super::linear::largest;
use super::{IkProblem, IkSolver};
use voodoo_core::math::refill;

/// Allowed rise of the image criterion, pixels: rounding.
const LEVEL: f64 = 1e-9;
/// Number of lengths of a step that are tried in order, each a quarter of the one before.
const TRIED_LENGTHS: i32 = 4;

impl IkSolver {
    /// Takes steps towards the rest posture, each corrected by the goals. A step that makes a goal or the images worse is
    /// rejected. Few solves have a rest posture, so the function is marked cold.
    #[cold]
    #[inline(never)]
    pub(super) fn pull_to_rest(&mut self, problem: &IkProblem, angles: &mut [f64]) {
        // Improvements that lower levels made in higher ones also count.
        refill(&mut self.levels.best, self.here.cost.iter().map(|cost| cost.sqrt()));
        let most = self.here.h + LEVEL;
        let rests = (0..problem.options.steps).any(|_| {
            self.report.steps += 1;
            self.pull_once(problem, most, angles) < problem.options.still
        });
        self.report.converged &= rests;
    }

    /// Takes one step with `h` at most `most`. Returns the largest change of an unknown; zero if no step is accepted.
    fn pull_once(&mut self, problem: &IkProblem, most: f64, angles: &mut [f64]) -> f64 {
        let (n, count, limits) = (angles.len(), self.levels.ranges.len(), problem.model.limits());
        let goals_only = problem.without_images();
        angles.clone_into(&mut self.phase_start);
        let off = rest_error(problem, angles);
        self.objections.clear();
        self.objections.reserve((n + 1) * n);
        for refused in 0..=n {
            self.rest_part(problem, angles);
            if largest(&self.stages[(count + 1) * n..]) < problem.options.still {
                return 0.0;
            }
            for fraction in (0..TRIED_LENGTHS).map(|power| 0.25_f64.powi(power)) {
                for (i, [low, high]) in limits.iter().enumerate() {
                    angles[i] = (self.phase_start[i] + fraction * self.stages[(count + 1) * n + i]).clamp(*low, *high);
                }
                problem.model.normalize(angles);
                self.evaluate_here(&goals_only, angles);
                let kept = self.correct_upper_levels(&goals_only, count, angles);
                self.objections.truncate(refused * n);
                if kept && rest_error(problem, angles) < off {
                    if problem.criterion.is_some() {
                        self.evaluate_here(problem, angles);
                    }
                    if self.here.h <= most {
                        let moves = angles.iter().zip(&self.phase_start).map(|(new, old)| (new - old).abs());
                        return moves.fold(0.0, f64::max);
                    }
                    self.objections.extend_from_slice(&self.here.gradient);
                }
                angles.copy_from_slice(&self.phase_start);
                // Moving along a border of the image criterion gets closer than shorter fractions of the step.
                if fraction < 1.0 && self.objections.len() > refused * n {
                    break;
                }
            }
            self.evaluate_here(problem, angles);
            // If the images rejected even the smallest step, continues along the border of the region where they are satisfied.
            if self.objections.len() == refused * n {
                return 0.0;
            }
        }
        0.0
    }

    /// Computes the step to rest in the null space of all goals and of the image gradients that rejected earlier steps, within
    /// the limits. Its stage follows those of the goals.
    fn rest_part(&mut self, problem: &IkProblem, angles: &[f64]) {
        let (n, count) = (angles.len(), self.levels.ranges.len());
        self.linear.taken.clear(n);
        for level in &self.levels.ranges {
            let goals = &problem.goals[level.clone()];
            level_rows(problem.model, goals, &self.here.at, &mut self.linear.jacobian, &mut self.linear.residual);
            self.linear.taken.take(&self.linear.jacobian);
        }
        // Adds the gradients one by one: they differ in strength, but each one counts.
        for gradient in self.objections.chunks_exact(n.max(1)) {
            self.linear.taken.take(gradient);
        }
        self.stages[(count + 1) * n..].fill(0.0);
        for _ in 0..=n {
            self.linear.part.fill(0.0);
            for &(unknown, angle) in problem.rest.iter().filter(|(unknown, _)| *unknown < n) {
                let now = angles[unknown] + self.stages[(count + 1) * n + unknown];
                self.linear.part[unknown] = angle - now;
            }
            self.linear.taken.project(&mut self.linear.part);
            if !self.add_part(problem, count, angles) {
                break;
            }
        }
    }
}

/// Sum of the squared differences between the angles and their rest values.
fn rest_error(problem: &IkProblem, angles: &[f64]) -> f64 {
    let drawn = problem.rest.iter().filter_map(|(unknown, rest)| angles.get(*unknown).map(|angle| angle - rest));
    drawn.map(|off| off * off).sum()
}
