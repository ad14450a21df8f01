//! The solver (J10 eq. 4): damped pseudo-inverse steps, strictly ordered levels, the image criterion in what is left free.

use std::ops::Range;

use super::goal::{Goal, level_cost, level_ranges, level_rows};
use super::image::Criterion;
use super::linear::{Damped, Taken, dot, largest};
use super::model::{Kinematics, Model};
use crate::geometry::Pose;

/// Least damping, m^2: small beside `J J^T` of anything a person can see, so that the last steps are Newton's.
const LEAST_DAMPING: f64 = 1e-10;
/// Residual that a lower level may leave in a higher one, metres.
const SETTLED: f64 = 1e-10;
/// Turn that leaves a stationary pose with a residual, radians.
const NUDGE: f64 = 0.05;

/// How to solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Most steps; J10 uses 15.
    pub steps: usize,
    /// A single level with a residual below this is solved; metres.
    pub tolerance: f64,
    /// A step that turns nothing by more is the last one; radians (root: metres).
    pub still: f64,
    /// Share of the image step `h / |grad h|^2` to take, 0 to 1: alpha of J10 eq. 4 over that step.
    pub gain: f64,
    /// Change of `h` per radian, as a share of the bones' length in the images, below which its gradient says little: damps the
    /// image step where few samples lie outside, and along the line of sight. 0: Polyak's step undamped.
    pub caution: f64,
    /// Largest change of an unknown in one step, radians.
    pub largest_turn: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { steps: 15, tolerance: 1e-6, still: 1e-6, gain: 1.0, caution: 0.4, largest_turn: 0.5 }
    }
}

/// How it went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Steps used.
    pub steps: usize,
    /// Whether the angles came to rest (or the only level was reached).
    pub converged: bool,
    /// Image criterion at the end, pixels; 0 without images.
    pub h: f64,
}

/// Working memory; nothing is allocated after the first call with a problem of the same size.
#[derive(Clone, Debug, Default)]
pub struct Solver {
    at: Kinematics,
    trial_at: Kinematics,
    levels: Vec<Range<usize>>,
    /// Damping over the squared residual, each level.
    trust: Vec<f64>,
    cost: Vec<f64>,
    trial_cost: Vec<f64>,
    /// Residual each level would have before its own part of the step.
    before: Vec<f64>,
    gradient: Vec<f64>,
    trial_gradient: Vec<f64>,
    h: f64,
    trial_h: f64,
    gain: f64,
    taken: Taken,
    damped: Damped,
    jacobian: Vec<f64>,
    projected: Vec<f64>,
    residual: Vec<f64>,
    wanted: Vec<f64>,
    part: Vec<f64>,
    /// The step after each level, and after the image: `stages x freedoms`.
    stages: Vec<f64>,
    trial: Vec<f64>,
    /// Residual of the levels whose turn is over.
    best: Vec<f64>,
    phase_start: Vec<f64>,
    saved: Vec<f64>,
    saved_cost: Vec<f64>,
}

struct Problem<'a> {
    model: &'a Model,
    base: &'a Pose,
    goals: &'a [Goal],
    criterion: Option<&'a Criterion<'a>>,
    options: &'a Options,
}

impl Solver {
    /// Moves `angles` towards the goals (sorted by level) and, in what they leave free, the bones into the silhouettes.
    ///
    /// Angles stay within the model's limits, whatever the goals; a start outside is moved onto them. Goals that cannot be
    /// reached, or contradict each other within a level, end at the least sum of weighted squares.
    pub fn solve(
        &mut self,
        model: &Model,
        world_from_base: &Pose,
        goals: &[Goal],
        criterion: Option<&Criterion>,
        options: &Options,
        angles: &mut [f64],
    ) -> Report {
        let criterion = criterion.filter(|criterion| !criterion.views.is_empty() && !criterion.segments.is_empty());
        let problem = Problem { model, base: world_from_base, goals, criterion, options };
        self.start(&problem, angles);
        let count = self.levels.len();
        let mut report = Report { converged: true, ..Report::default() };
        // One level after the other joins, the image last: what a level reaches does not depend on those below it.
        for phase in 0..count + usize::from(criterion.is_some()) {
            self.phase_start.clear();
            self.phase_start.extend_from_slice(angles);
            self.phase(&problem, phase, true, angles, &mut report);
            if phase > 0 && !self.settle(&problem, phase.min(count), angles) {
                // Finite steps along curved null spaces led to another valley: again, with no rise allowed at all.
                angles.copy_from_slice(&self.phase_start);
                self.evaluate_here(&problem, angles);
                self.phase(&problem, phase, false, angles, &mut report);
            }
            if phase < count {
                self.best.push(self.cost[phase].sqrt());
            }
        }
        report.h = self.h;
        report
    }

    /// Steps with the first `phase + 1` levels, or all and the image. `slack`: levels above may rise by the second order of a
    /// step, to be made good by the next.
    fn phase(&mut self, problem: &Problem, phase: usize, slack: bool, angles: &mut [f64], report: &mut Report) {
        let (count, options) = (self.levels.len(), problem.options);
        let image = phase == count;
        let active = if image { count } else { phase + 1 };
        let mut nudged = false;
        let mut rest = false;
        for step in 0..options.steps {
            let reached = self.cost[..active].iter().all(|cost| cost.sqrt() < options.tolerance);
            if reached && (!image || self.h <= 0.0) {
                rest = true;
                break;
            }
            report.steps += 1;
            let moved = self.step(problem, active, image, slack, angles);
            if moved >= options.still {
                continue;
            }
            let stuck = !image && self.cost[phase].sqrt() > options.tolerance;
            if nudged || !stuck || step + 1 == options.steps {
                rest = true;
                break;
            }
            // A saddle (a stretched arm whose hand shall come nearer) or the best there is: a nudge tells.
            nudged = true;
            self.nudge(problem, angles);
        }
        if nudged && self.worse_than_saved() {
            angles.copy_from_slice(&self.saved);
            self.evaluate_here(problem, angles);
            rest = true;
        }
        report.converged &= rest;
    }

    /// Steps of the levels above alone (no more than a phase has), against what the lower ones' finite steps left; true when they are as good as before the phase.
    fn settle(&mut self, problem: &Problem, levels: usize, angles: &mut [f64]) -> bool {
        for active in (1..=levels).rev() {
            for _ in 0..problem.options.steps {
                let reached = self.cost[..active].iter().all(|cost| *cost < SETTLED * SETTLED);
                if reached || self.step(problem, active, false, true, angles) < 1e-12 {
                    break;
                }
            }
        }
        self.cost.iter().zip(&self.best).all(|(cost, best)| cost.sqrt() <= best + SETTLED)
    }

    /// Poses and derivatives at the last solution.
    pub fn kinematics(&self) -> &Kinematics {
        &self.at
    }

    fn start(&mut self, problem: &Problem, angles: &mut [f64]) {
        let n = problem.model.freedoms();
        for (angle, [low, high]) in angles.iter_mut().zip(problem.model.limits()) {
            *angle = angle.clamp(*low, *high);
        }
        problem.model.normalise(angles);
        level_ranges(problem.goals, &mut self.levels);
        let count = self.levels.len();
        self.trust.clear();
        self.trust.resize(count, 0.1);
        self.before.clear();
        self.before.resize(count, 0.0);
        for vector in [&mut self.part, &mut self.gradient, &mut self.trial_gradient, &mut self.trial] {
            vector.clear();
            vector.resize(n, 0.0);
        }
        self.stages.clear();
        self.stages.resize((count + 1) * n, 0.0);
        self.best.clear();
        self.gain = problem.options.gain;
        self.evaluate_here(problem, angles);
    }

    fn evaluate_here(&mut self, problem: &Problem, angles: &[f64]) {
        self.trial.copy_from_slice(angles);
        self.evaluate(problem, true);
        self.accept();
    }

    /// Costs, criterion and kinematics at the trial angles.
    fn evaluate(&mut self, problem: &Problem, image: bool) {
        problem.model.place(problem.base, &self.trial, &mut self.trial_at);
        self.trial_cost.clear();
        let costs = self.levels.iter().map(|level| level_cost(&problem.goals[level.clone()], &self.trial_at));
        self.trial_cost.extend(costs);
        self.trial_h = match problem.criterion {
            Some(criterion) if image => criterion.evaluate(problem.model, &self.trial_at, &mut self.trial_gradient),
            _ => 0.0,
        };
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.at, &mut self.trial_at);
        std::mem::swap(&mut self.cost, &mut self.trial_cost);
        std::mem::swap(&mut self.gradient, &mut self.trial_gradient);
        self.h = self.trial_h;
    }

    /// One step of the first `count` levels, and of the image; the largest change of an unknown.
    fn step(&mut self, problem: &Problem, count: usize, image: bool, slack: bool, angles: &mut [f64]) -> f64 {
        let n = angles.len();
        self.taken.clear(n);
        for level in 0..count {
            self.level_part(problem, level, angles);
            if level + 1 < count || image {
                self.taken.take(&self.jacobian);
            }
        }
        if image {
            self.image_part(problem, count, angles);
        }
        let moved = self.advance(problem, count, image, slack, angles);
        problem.model.normalise(angles);
        moved
    }

    /// The part of one level: `(J P)^+ (-e - J d)` after the step `d` of the levels above (Baerlocher and Boulic 2004), cut at
    /// the limits and solved again without the unknowns that stand there.
    fn level_part(&mut self, problem: &Problem, level: usize, angles: &[f64]) {
        let n = angles.len();
        let goals = &problem.goals[self.levels[level].clone()];
        level_rows(problem.model, goals, &self.at, &mut self.jacobian, &mut self.residual);
        self.inherit(level, n);
        let damping = self.trust[level] * self.cost[level] + LEAST_DAMPING;
        for attempt in 0..=n {
            let stage = &self.stages[level * n..(level + 1) * n];
            self.wanted.clear();
            let rows = self.jacobian.chunks_exact(n).zip(&self.residual);
            self.wanted.extend(rows.map(|(row, e)| -e - dot(row, stage)));
            if attempt == 0 {
                self.before[level] = dot(&self.wanted, &self.wanted).sqrt();
            }
            if self.taken.is_empty() {
                self.damped.solve(&self.jacobian, &self.wanted, damping, &mut self.part);
            } else {
                self.projected.clear();
                self.projected.extend_from_slice(&self.jacobian);
                self.projected.chunks_exact_mut(n).for_each(|row| self.taken.project(row));
                self.damped.solve(&self.projected, &self.wanted, damping, &mut self.part);
            }
            if !self.add_part(problem, level, angles) {
                break;
            }
        }
    }

    /// The image's part: `-alpha (I - J^+ J) grad h` (J10 eq. 4) with Polyak's step `alpha = gain h / |P grad h|^2`, since the
    /// least `h` is zero. Where the images hardly see the free motion (along the line of sight) the gradient is small and
    /// says little, so `alpha = gain h / (|P grad h|^2 + (caution reach)^2)`.
    fn image_part(&mut self, problem: &Problem, count: usize, angles: &[f64]) {
        let n = angles.len();
        self.inherit(count, n);
        let blind = problem.options.caution * problem.criterion.map_or(0.0, |criterion| criterion.reach(&self.at));
        for _ in 0..=n {
            self.part.copy_from_slice(&self.gradient);
            self.taken.project(&mut self.part);
            let square = dot(&self.part, &self.part);
            if square < 1e-16 {
                break;
            }
            let alpha = self.gain * self.h / (square + blind * blind);
            self.part.iter_mut().for_each(|value| *value *= -alpha);
            if !self.add_part(problem, count, angles) {
                break;
            }
        }
    }

    /// A stage starts from the one before it.
    fn inherit(&mut self, stage: usize, n: usize) {
        if stage == 0 {
            self.stages[..n].fill(0.0);
        } else {
            self.stages.copy_within((stage - 1) * n..stage * n, stage * n);
        }
    }

    /// Adds the part to a stage as far as the limits allow; true when one was hit, whose unknown then is taken.
    fn add_part(&mut self, problem: &Problem, stage: usize, angles: &[f64]) -> bool {
        let n = angles.len();
        let most = largest(&self.part);
        if !most.is_finite() {
            return false;
        }
        let mut share = (problem.options.largest_turn / most.max(problem.options.largest_turn)).min(1.0);
        let step = &mut self.stages[stage * n..(stage + 1) * n];
        let mut hit = None;
        for (i, [low, high]) in problem.model.limits().iter().enumerate() {
            let (from, by) = (angles[i] + step[i], self.part[i]);
            let room = if by < -1e-15 {
                low - from
            } else if by > 1e-15 {
                high - from
            } else {
                continue;
            };
            if share * by.abs() > room.abs() {
                share = (room / by).max(0.0);
                hit = Some(i);
            }
        }
        step.iter_mut().zip(&self.part).for_each(|(step, part)| *step += share * part);
        hit.is_some_and(|unknown| self.taken.pin(unknown))
    }

    /// Takes the whole step, or as much of it as leaves no level worse than those above it must make it.
    fn advance(&mut self, problem: &Problem, count: usize, image: bool, slack: bool, angles: &mut [f64]) -> f64 {
        let n = angles.len();
        let last = if image { count } else { count.saturating_sub(1) };
        if count == 0 && !image {
            return 0.0;
        }
        self.propose(problem, angles, last, 1.0);
        self.evaluate(problem, true);
        let Some(failed) = self.first_failure(n, count, image, slack, last) else {
            for level in 0..count {
                // Slow progress is the sign of a goal out of reach, where less damping would overshoot.
                let shrink = if self.trial_cost[level] < 0.9 * self.cost[level] { 0.3 } else { 0.8 };
                self.trust[level] = (shrink * self.trust[level]).max(1e-6);
            }
            self.gain = (1.5 * self.gain).min(problem.options.gain);
            return self.take_trial(angles);
        };
        if failed < count {
            self.trust[failed] = (4.0 * self.trust[failed]).min(1e6);
        } else {
            self.gain *= 0.5;
        }
        // Without what is below; then a quarter of its own part; then nothing but the levels above.
        for (stage, share) in [(failed, 1.0), (failed, 0.25), (failed, 0.0)] {
            if (stage == last && share == 1.0) || (stage == 0 && share == 0.0) {
                continue;
            }
            self.propose(problem, angles, stage, share);
            self.evaluate(problem, true);
            if (share == 0.0 && slack)
                || self.first_failure(n, count.min(failed + 1), image && failed == count, slack, stage).is_none()
            {
                return self.take_trial(angles);
            }
        }
        // A refused step is not rest: more damping comes next.
        if self.trust[0] < 1e5 { f64::INFINITY } else { 0.0 }
    }

    fn propose(&mut self, problem: &Problem, angles: &[f64], stage: usize, share: f64) {
        let n = angles.len();
        let limits = problem.model.limits();
        for i in 0..n {
            let above = if stage == 0 { 0.0 } else { self.stages[(stage - 1) * n + i] };
            let step = above + share * (self.stages[stage * n + i] - above);
            // The clamp only takes off rounding: stages end at the limits.
            self.trial[i] = (angles[i] + step).clamp(limits[i][0], limits[i][1]);
        }
    }

    /// The first level that the trial leaves worse than it was before its own part, beyond the second-order effect of the
    /// others' parts; `count` stands for the image.
    fn first_failure(&self, n: usize, count: usize, image: bool, slack: bool, stage: usize) -> Option<usize> {
        let length = |from: Option<usize>| -> f64 {
            let step = &self.stages[stage * n..(stage + 1) * n];
            (0..n).map(|i| step[i] - from.map_or(0.0, |from| self.stages[from * n + i])).map(|d| d * d).sum()
        };
        for level in 0..count.min(stage + 1) {
            let rise = match level {
                0 if stage == 0 => 0.0,
                0 => length(Some(0)),
                _ => length(None),
            };
            let limit = match self.best.get(level) {
                Some(best) if !slack => (best + 0.1 * SETTLED).max(self.before[level]),
                _ => self.before[level] + rise + 1e-13,
            };
            let residual = self.trial_cost[level].sqrt();
            if residual.is_nan() || residual > limit {
                return Some(level);
            }
        }
        if image && stage == self.levels.len() {
            let above = if stage == 0 { 0.0 } else { dot(&self.gradient, &self.stages[(stage - 1) * n..stage * n]) };
            if self.trial_h.is_nan() || self.trial_h > self.h + above.max(0.0) + 1e-9 {
                return Some(self.levels.len());
            }
        }
        None
    }

    fn take_trial(&mut self, angles: &mut [f64]) -> f64 {
        let moved = angles.iter().zip(&self.trial).fold(0.0_f64, |most, (old, new)| most.max((old - new).abs()));
        angles.copy_from_slice(&self.trial);
        self.accept();
        moved
    }

    fn nudge(&mut self, problem: &Problem, angles: &mut [f64]) {
        self.saved.clear();
        self.saved.extend_from_slice(angles);
        self.saved_cost.clear();
        self.saved_cost.extend_from_slice(&self.cost);
        for (i, (angle, [low, high])) in angles.iter_mut().zip(problem.model.limits()).enumerate() {
            // Uneven, so that symmetric chains leave their symmetry; away from the nearer limit.
            let by = NUDGE * (1.0 + 0.37 * (i % 3) as f64);
            *angle = if *high - *angle < *angle - *low { *angle - by } else { *angle + by }.clamp(*low, *high);
        }
        self.trust.fill(0.1);
        self.evaluate_here(problem, angles);
    }

    fn worse_than_saved(&self) -> bool {
        for (now, saved) in self.cost.iter().zip(&self.saved_cost) {
            if *now > saved + 1e-13 {
                return true;
            }
            if *now < saved - 1e-13 {
                return false;
            }
        }
        false
    }
}
