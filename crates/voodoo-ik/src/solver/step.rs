//! One step: the parts of all levels and of the image, each within the limits.

use super::super::goal::level_rows;
use super::super::linear::largest;
use super::{Active, IkProblem, IkSolver};
use voodoo_core::math::{dot, refill};

/// Minimum damping, m^2: small relative to `J J^T` of any visible motion, so that the last steps are Newton steps.
const LEAST_DAMPING: f64 = 1e-10;

impl IkSolver {
    /// Computes one step of the first `count` levels, and of the image. Returns the largest change of an unknown.
    pub(super) fn step(&mut self, problem: &IkProblem, active: Active, angles: &mut [f64]) -> f64 {
        let Active { levels: count, image, .. } = active;
        let n = angles.len();
        self.linear.taken.clear(n);
        for level in 0..count {
            self.level_part(problem, level, angles);
            if level + 1 < count || image {
                self.linear.taken.take(&self.linear.jacobian);
            }
        }
        if image {
            self.image_part(problem, count, angles);
        }
        let moved = self.advance(problem, active, angles);
        problem.model.normalize(angles);
        moved
    }

    /// Computes the part of one level: `(J P)^+ (-e - J d)` after the step `d` of the levels above (Baerlocher and Boulic 2004).
    /// It is cut at the limits and solved again without the unknowns that are at a limit.
    fn level_part(&mut self, problem: &IkProblem, level: usize, angles: &[f64]) {
        let n = angles.len();
        let goals = &problem.goals[self.levels.ranges[level].clone()];
        level_rows(problem.model, goals, &self.here.at, &mut self.linear.jacobian, &mut self.linear.residual);
        self.inherit(level, n);
        let damping = self.levels.trust[level] * self.here.cost[level] + LEAST_DAMPING;
        for attempt in 0..=n {
            let stage = &self.stages[level * n..(level + 1) * n];
            let rows = self.linear.jacobian.chunks_exact(n).zip(&self.linear.residual);
            refill(&mut self.linear.target, rows.map(|(row, e)| -e - dot(row, stage)));
            if attempt == 0 {
                self.levels.before[level] = dot(&self.linear.target, &self.linear.target).sqrt();
            }
            self.linear.projected.clone_from(&self.linear.jacobian);
            self.linear.projected.chunks_exact_mut(n).for_each(|row| self.linear.taken.project(row));
            self.linear.damped.solve(&self.linear.projected, &self.linear.target, damping, &mut self.linear.part);
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
        self.inherit(count, n);
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

    /// Copies the stage before as the start of this one.
    fn inherit(&mut self, stage: usize, n: usize) {
        if stage == 0 {
            self.stages[..n].fill(0.0);
        } else {
            self.stages.copy_within((stage - 1) * n..stage * n, stage * n);
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
        let step = &mut self.stages[stage * n..(stage + 1) * n];
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
}
