//! The solver (J10 eq. 4): damped pseudo-inverse steps, strictly ordered levels, the image criterion in their null space, and a
//! rest posture in what remains free.

mod rest;
mod step;

use std::ops::Range;

use super::goal::{Goal, level_cost};
use super::image::Criterion;
use super::linear::LinearSystem;
use super::model::{ChainModel, Kinematics};
use voodoo_core::math::{Pose, refill, reset};

/// Residual that a lower level may leave in a higher one, meters.
const SETTLED: f64 = 1e-10;
/// Rotation that perturbs a stationary pose with a residual, radians.
const NUDGE: f64 = 0.05;
/// The perturbation of an angle at its limit. For a knee at its backward limit and a near goal, the straight pose is farther from
/// the goal and lies between the knee and all forward-bent poses, so a larger rotation is needed.
const NUDGE_AT_LIMIT: f64 = 0.35;
/// The image has converged when the criterion falls by less than this fraction in [`STALLED_STEPS`] consecutive steps.
const LEAST_FALL: f64 = 1e-3;
/// Number of steps without such a fall after which the image has converged.
const STALLED_STEPS: usize = 3;

/// Damping divided by the squared residual with which each level starts.
const FIRST_TRUST: f64 = 0.1;

/// Solver parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Maximum number of steps; J10 uses 15.
    pub steps: usize,
    /// A single level counts as solved when its residual is below this; meters.
    pub tolerance: f64,
    /// Iteration stops when no unknown changes by more than this; radians (root: meters).
    pub still: f64,
    /// Fraction of the image step `h / |grad h|^2` to take, 0 to 1: alpha of J10 eq. 4 divided by that step.
    pub gain: f64,
    /// Change of `h` per radian, as a fraction of the bones' length in the images, below which its gradient is unreliable. It
    /// damps the image step where few samples lie outside, and along the line of sight. 0: Polyak's step undamped.
    pub caution: f64,
    /// Largest change of an unknown in one step, radians.
    pub largest_turn: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { steps: 15, tolerance: 1e-6, still: 1e-6, gain: 1.0, caution: 0.3, largest_turn: 0.5 }
    }
}

/// Result of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Steps used.
    pub steps: usize,
    /// Number of evaluated postures, including rejected ones.
    pub tried: usize,
    /// How many of them were compared with the images.
    pub compared: usize,
    /// Whether the angles or the image criterion converged (or the only level was reached).
    pub converged: bool,
    /// Image criterion at the end, pixels; 0 without images.
    pub h: f64,
}

/// Working memory. Nothing is allocated after the first call with a problem of the same size.
#[derive(Clone, Debug, Default)]
pub struct IkSolver {
    /// The current posture, and the trial posture.
    here: EvaluatedPosture,
    trial: EvaluatedPosture,
    trial_angles: Vec<f64>,
    levels: Levels,
    linear: LinearSystem,
    /// No step, then the step after each level, and after the image: `(stages + 1) x freedoms`.
    stages: Vec<f64>,
    /// Current fraction of the image step.
    gain: f64,
    phase_start: Vec<f64>,
    /// Angles and costs before a perturbation.
    saved_angles: Vec<f64>,
    saved_cost: Vec<f64>,
    report: Report,
    /// Gradients of the criterion where the images rejected a step to rest.
    objections: Vec<f64>,
}

/// A posture and its costs: each level, and the images with their gradient.
#[derive(Clone, Debug, Default)]
struct EvaluatedPosture {
    at: Kinematics,
    cost: Vec<f64>,
    gradient: Vec<f64>,
    h: f64,
}

/// The levels of goals.
#[derive(Clone, Debug, Default)]
struct Levels {
    ranges: Vec<Range<usize>>,
    /// Damping divided by the squared residual, for each level.
    trust: Vec<f64>,
    /// Residual that each level would have before its own part of the step.
    before: Vec<f64>,
    /// Best residual of the levels that are already solved.
    best: Vec<f64>,
}

/// What is to be solved.
#[derive(Clone, Copy, Debug)]
pub struct IkProblem<'a> {
    /// The chain.
    pub model: &'a ChainModel,
    /// Pose of its base in the world.
    pub base: Pose,
    /// The goals, sorted by level. Those that cannot be reached, or contradict each other within a level, end at the minimum of
    /// the weighted sum of squares.
    pub goals: &'a [Goal],
    /// The images, into whose silhouettes the bones are moved in the null space of the goals.
    pub criterion: Option<&'a Criterion<'a>>,
    /// Indices of unknowns and their rest values, which pull them below all goals and the images: least squares of the
    /// differences. A value outside the limits is clamped to them.
    pub rest: &'a [(usize, f64)],
    /// Parameters.
    pub options: SolverOptions,
}

impl IkProblem<'_> {
    fn without_images(&self) -> Self {
        Self { criterion: None, ..*self }
    }
}

impl IkSolver {
    /// Moves `angles` to the solution of a problem. They stay within the model's limits in every case; a start outside is clamped.
    pub fn solve(&mut self, problem: &IkProblem, angles: &mut [f64]) -> Report {
        let shows = |criterion: &&Criterion| !criterion.views.is_empty() && !criterion.segments.is_empty();
        let problem = IkProblem { criterion: problem.criterion.filter(shows), ..*problem };
        let goals_only = problem.without_images();
        self.start(&goals_only, angles);
        if angles.is_empty() {
            self.evaluate_here(&problem, angles);
            self.report.h = self.here.h;
            return self.report;
        }
        let count = self.levels.ranges.len();
        // Levels join one after the other, the image last. Thus the result of a level does not depend on those below it.
        for phase in 0..count + usize::from(problem.criterion.is_some()) {
            // The images are evaluated only in their own phase, so that the levels above do not depend on them.
            let problem = if phase == count { &problem } else { &goals_only };
            if phase == count {
                self.evaluate_here(problem, angles);
            }
            angles.clone_into(&mut self.phase_start);
            self.phase(problem, phase, true, angles);
            if phase > 0 && !self.correct_upper_levels(problem, phase.min(count), angles) {
                // Finite steps along curved null spaces led to another local minimum: repeat, with no rise allowed at all.
                angles.copy_from_slice(&self.phase_start);
                self.evaluate_here(problem, angles);
                self.phase(problem, phase, false, angles);
            }
            if phase < count {
                self.levels.best.push(self.here.cost[phase].sqrt());
            }
        }
        if !problem.rest.is_empty() {
            self.pull_to_rest(&problem, angles);
        }
        self.report.h = self.here.h;
        self.report
    }

    /// Steps with the first `phase + 1` levels, or with all levels and the image. With `slack`, a step may raise the levels above
    /// by its second-order effect, which the next step corrects.
    fn phase(&mut self, problem: &IkProblem, phase: usize, slack: bool, angles: &mut [f64]) {
        let (count, options) = (self.levels.ranges.len(), &problem.options);
        let (image, active) = (phase == count, count.min(phase + 1));
        let mut nudged = false;
        let mut idle = 0;
        let mut rest = (0..options.steps).any(|step| {
            let reached = self.here.cost[..active].iter().all(|cost| cost.sqrt() < options.tolerance);
            if reached && (!image || self.here.h <= 0.0) {
                return true;
            }
            self.report.steps += 1;
            let before = self.here.h;
            let moved = self.step(problem, phase, slack, angles);
            idle = if image && before - self.here.h < LEAST_FALL * before { idle + 1 } else { 0 };
            if moved >= options.still && idle < STALLED_STEPS {
                return false;
            }
            let stuck = !image && self.here.cost[phase].sqrt() > options.tolerance;
            if nudged || !stuck || step + 1 == options.steps {
                return true;
            }
            // Either a saddle (a stretched arm whose hand is to come nearer) or the optimum: a perturbation decides which.
            nudged = true;
            self.nudge(problem, angles);
            false
        });
        if nudged && self.worse_than_saved() {
            angles.copy_from_slice(&self.saved_angles);
            self.evaluate_here(problem, angles);
            rest = true;
        }
        self.report.converged &= rest;
    }

    /// Steps with the upper levels alone (at most as many as a phase has), to correct errors from the lower levels' finite steps.
    /// Returns true when the upper levels are as good as before the phase. The result is compared with the images.
    fn correct_upper_levels(&mut self, problem: &IkProblem, levels: usize, angles: &mut [f64]) -> bool {
        let (goals_only, mut moved) = (problem.without_images(), false);
        for active in (1..=levels).rev() {
            for _ in 0..problem.options.steps {
                let reached = self.here.cost[..active].iter().all(|cost| *cost < SETTLED * SETTLED);
                if reached {
                    break;
                }
                moved = true;
                if self.step(&goals_only, active - 1, true, angles) < 1e-12 {
                    break;
                }
            }
        }
        if problem.criterion.is_some() && moved {
            self.evaluate_here(problem, angles);
        }
        self.here.cost.iter().zip(&self.levels.best).all(|(cost, best)| cost.sqrt() <= best + SETTLED)
    }

    /// Poses and derivatives at the last solution.
    pub fn kinematics(&self) -> &Kinematics {
        &self.here.at
    }

    fn start(&mut self, problem: &IkProblem, angles: &mut [f64]) {
        let n = problem.model.freedoms();
        for (angle, [low, high]) in angles.iter_mut().zip(problem.model.limits()) {
            *angle = angle.clamp(*low, *high);
        }
        problem.model.normalize(angles);
        self.levels.ranges.clear();
        for same in problem.goals.chunk_by(|a, b| a.level == b.level) {
            let start = self.levels.ranges.last().map_or(0, |before| before.end);
            self.levels.ranges.push(start..start + same.len());
        }
        let count = self.levels.ranges.len();
        reset(&mut self.levels.trust, count, FIRST_TRUST);
        reset(&mut self.levels.before, count, 0.0);
        for vector in [&mut self.linear.part, &mut self.here.gradient, &mut self.trial.gradient, &mut self.trial_angles]
        {
            reset(vector, n, 0.0);
        }
        reset(&mut self.stages, (count + 2) * n, 0.0);
        self.levels.best.clear();
        self.report = Report { converged: true, ..Report::default() };
        self.gain = problem.options.gain;
        self.evaluate_here(problem, angles);
    }

    fn evaluate_here(&mut self, problem: &IkProblem, angles: &[f64]) {
        self.trial_angles.copy_from_slice(angles);
        self.evaluate(problem);
        std::mem::swap(&mut self.here, &mut self.trial);
    }

    /// Computes costs, kinematics and the criterion at the trial angles.
    fn evaluate(&mut self, problem: &IkProblem) {
        self.report.tried += 1;
        problem.model.place(&problem.base, &self.trial_angles, &mut self.trial.at);
        let costs = self.levels.ranges.iter().map(|level| level_cost(&problem.goals[level.clone()], &self.trial.at));
        refill(&mut self.trial.cost, costs);
        self.trial.h = problem.criterion.map_or(0.0, |criterion| {
            self.report.compared += 1;
            criterion.evaluate(problem.model, &self.trial.at, &mut self.trial.gradient)
        });
    }

    fn nudge(&mut self, problem: &IkProblem, angles: &mut [f64]) {
        angles.clone_into(&mut self.saved_angles);
        self.saved_cost.clone_from(&self.here.cost);
        for (i, (angle, [low, high])) in angles.iter_mut().zip(problem.model.limits()).enumerate() {
            // Unequal perturbations break the symmetry of symmetric chains; each moves away from the nearer limit.
            let at_limit = *angle <= *low || *angle >= *high;
            let by = if at_limit { NUDGE_AT_LIMIT } else { NUDGE } * (1.0 + 0.37 * (i % 3) as f64);
            *angle = if *high - *angle < *angle - *low { *angle - by } else { *angle + by }.clamp(*low, *high);
        }
        self.levels.trust.fill(FIRST_TRUST);
        self.evaluate_here(problem, angles);
    }

    fn worse_than_saved(&self) -> bool {
        let mut pairs = self.here.cost.iter().zip(&self.saved_cost);
        let differ = |(now, saved): &(&f64, &f64)| **now > **saved + 1e-13 || **now < **saved - 1e-13;
        pairs.find(differ).is_some_and(|(now, saved)| now > saved)
    }
}
