//! The loop of a frame: match and solve (K06 III-B and IV-B.2 to 7). With the published solver it ends when the mean squared
//! distance settles.

mod context;
mod motion;

pub(crate) use context::{Context, Setting};
pub(crate) use motion::{Motion, UNKNOWN_MOTION};

use crate::association::assignment::{Assignment, match_limb};
use crate::association::contour::Contours;
use crate::association::correspondence::{Correspondences, LimbMatches};
use crate::association::visible_side::match_visible_side;
use crate::body::{Body, Pair};
use crate::config::Config;
use crate::detect::{Detected, DetectedLimbs};
use crate::error::TrackError;
use crate::math::{Pose, Vec3, refill};
use crate::regions;
use crate::solver::{Gate, Problem, WarmStart, WholeBody, solve_limbwise};
use crate::threads::Threads;

/// First step of a frame that uses the depth contour: in earlier steps, it would push thin limbs off their points (method section
/// 8).
pub(crate) const CONTOUR_FROM: usize = 2;

/// Fits the pose to a frame, starting from a nearby pose. Keeps the last correspondences.
#[derive(Debug, Default)]
pub(crate) struct Fit {
    warm_start: WarmStart,
    whole_body: WholeBody,
    assignment: Assignment,
    /// The last correspondences.
    pub(crate) correspondences: Correspondences,
    /// The depth-contour edges that were found last.
    pub(crate) contours: Contours,
    /// The colors of limbs and surroundings.
    pub(crate) regions: regions::ColorRegions,
    /// Where a detector found the limbs in this frame.
    detected_limbs: DetectedLimbs,
    /// Variance of each limb's radius, square meters.
    radius_variances: Vec<f64>,
    band_weights: Vec<f64>,
    threads: Threads,
}

impl Fit {
    /// Starts the threads of a configuration.
    pub(crate) fn new(config: &Config) -> Result<Self, TrackError> {
        Ok(Self { threads: Threads::new(config)?, ..Self::default() })
    }

    /// Sets the detection of this frame, if there is one, whose joints are fitted as well; `poses` are the expected ones.
    pub(crate) fn set_detected(&mut self, detected: Option<Detected>, body: &Body, poses: &[Pose], origin: Vec3) {
        self.forget_detected();
        if let Some(detected) = detected {
            detected.locate(body, origin, &mut self.detected_limbs);
            detected.measure(body, poses, origin, &mut self.correspondences.detected);
        }
    }

    /// Sets the standard deviation of each limb's radius, meters; NaN where it is known.
    pub(crate) fn set_radius_sigmas(&mut self, sigmas: impl Iterator<Item = f64>) {
        refill(&mut self.radius_variances, sigmas.map(|sigma| if sigma.is_nan() { 0.0 } else { sigma * sigma }));
    }

    /// Forgets the detection: poses are compared by what the sensors measure.
    pub(crate) fn forget_detected(&mut self) {
        self.correspondences.detected.clear();
        self.detected_limbs.clear();
    }

    /// Exchanges the last correspondences, so that another pose can be tried in between. The joints that were detected in this frame
    /// stay.
    pub(crate) fn swap_matches(&mut self, matched: &mut Correspondences) {
        std::mem::swap(&mut self.correspondences, matched);
        std::mem::swap(&mut self.correspondences.detected, &mut matched.detected);
    }

    /// Clears the correspondences.
    pub(crate) fn clear(&mut self) {
        self.correspondences = Correspondences::default();
        self.radius_variances.clear();
        self.regions.clear();
    }

    /// Runs a warm start, then steps 2 to 7 until they converge; the correspondences at the end are those at the fitted poses.
    /// Returns the number of steps.
    pub(crate) fn run(&mut self, context: Context, predicted: &[Pose], poses: &mut [Pose]) -> usize {
        self.follow_sites(context, poses);
        let kind = context.config.solver;
        let mut steps = 0;
        let mut before = f64::INFINITY;
        while steps < context.config.max_steps {
            self.match_all(context, poses, steps, kind.reassociates(steps));
            let distance = self.correspondences.mean_squared_distance().unwrap_or(0.0);
            self.solve(context, predicted, poses, steps);
            steps += 1;
            // Whole-body solvers always take all steps: a step more or less would be a jump of the result.
            let settled = !kind.is_whole_body() && (before - distance).abs() < context.config.min_change;
            if settled || steps >= regions::STEPS && context.compares_colors() {
                break;
            }
            before = distance;
        }
        // The last steps hardly moved anything, so points stay assigned to their limbs where they are assigned.
        self.match_last(context, poses, steps == 0 || !kind.is_whole_body());
        steps
    }

    /// Steps 2 to 5 at `poses`: turns all measurements into correspondences; `anew` states whether points are assigned to limbs,
    /// and contours to edges, anew.
    pub(crate) fn match_all(&mut self, context: Context, poses: &[Pose], step: usize, anew: bool) {
        let gate = Gate::new(context.config, step);
        if anew {
            // 2 Assign points to limbs.
            self.assign(context, poses, &gate);
            self.contours.clear();
            if step >= CONTOUR_FROM && context.config.solver.is_whole_body() {
                self.find_contour(context, poses);
            }
        }
        self.match_assigned(context, poses, &gate, anew);
        self.find_regions(context, poses, step);
    }

    /// Like `match_all`, after the last step, without the contour, which has no effect any more.
    pub(crate) fn match_last(&mut self, context: Context, poses: &[Pose], anew: bool) {
        let gate = Gate::new(context.config, context.config.max_steps);
        if anew {
            self.assign(context, poses, &gate);
        }
        self.contours.clear();
        self.match_assigned(context, poses, &gate, anew);
        self.find_regions(context, poses, context.config.max_steps);
        if context.compares_colors() {
            // What every limb of the arms and legs explains.
            let supports = &mut self.correspondences.region_support;
            self.regions.pixel_gains(context.posed(poses), &context.model.extremities, supports);
        }
    }

    /// Matches only points, within `gate`, to the closest surface of any limb: for poses that the user set.
    pub(crate) fn match_points(&mut self, context: Context, poses: &[Pose], gate: &Gate) {
        self.assign(context, poses, gate);
        self.match_surface(context, poses, gate, true, false);
    }

    /// Searches for the depth-contour edges of limbs and converts them to pairs at `poses`.
    pub(crate) fn match_contour(&mut self, context: Context, poses: &[Pose]) {
        self.find_contour(context, poses);
        self.contours.pairs(poses, context.config.depth_contour_sigma, &mut self.correspondences.contour);
    }

    /// Searches for every color edge separately on both sides of a limb: the pairs determine its width.
    pub(crate) fn match_single_edges(&mut self, context: Context, poses: &[Pose]) {
        self.regions.find_single_edges(context.posed(poses), &mut self.correspondences.regions);
    }

    /// Writes the relative changes of the lengths of `pairs` of limbs that fit the correspondences at `poses` to `change`. On input,
    /// `change` holds the change from each length to the one it is regularized to, with information `pull`. Returns false when
    /// the lengths are not determined.
    pub(crate) fn lengths(
        &mut self,
        context: Context,
        predicted: &[Pose],
        poses: &[Pose],
        pairs: &[Pair],
        pull: &[f64],
        change: &mut [f64],
    ) -> bool {
        let Self { whole_body, correspondences, .. } = self;
        let step = context.config.max_steps;
        // A site with a bias cannot measure a length.
        whole_body.sum_terms(Problem { context, correspondences, predicted, step }, poses, false);
        whole_body.chain.lengths(&context.model.body, poses, pairs, pull, change)
    }

    /// Warm start: follows the measured positions of named sites before the frame's steps.
    fn follow_sites(&mut self, context: Context, poses: &mut [Pose]) {
        let frame = context.observation.frame();
        let named = !frame.positions.is_empty() || !frame.rays.is_empty();
        for step in 0.. {
            if named && !context.config.solver.is_whole_body() {
                self.match_all(context, poses, 0, true);
            } else {
                self.match_sites(context, poses);
            }
            let Self { warm_start, correspondences, .. } = self;
            if !warm_start.prepare(Problem { context, correspondences, predicted: context.previous, step }, poses) {
                break;
            }
        }
    }

    fn match_assigned(&mut self, context: Context, poses: &[Pose], gate: &Gate, anew: bool) {
        // 3 Reduce the number of points, 4 find closest points.
        self.match_surface(context, poses, gate, anew, context.config.facing && context.config.solver.is_whole_body());
        // 4 Point-to-point relations, 5 closest points on rays.
        self.match_sites(context, poses);
        self.contours.pairs(poses, context.config.depth_contour_sigma, &mut self.correspondences.contour);
    }

    fn match_sites(&mut self, context: Context, poses: &[Pose]) {
        let (frame, origin) = (context.observation.frame(), context.observation.origin());
        self.correspondences.add_sites(&context.model.body, poses, frame, origin);
    }

    fn assign(&mut self, context: Context, poses: &[Pose], gate: &Gate) {
        let Context { config, model, observation, .. } = context;
        // The published solver uses points anywhere on its limbs.
        let buried = !config.solver.is_whole_body();
        self.assignment.assign(&model.body, poses, observation.candidates, config.overlap, gate.box_margin, buried);
    }

    fn find_contour(&mut self, context: Context, poses: &[Pose]) {
        if context.config.depth_contour {
            self.contours.find(&context.model.body, poses, context.observation.views.iter());
        }
    }

    fn find_regions(&mut self, context: Context, poses: &[Pose], step: usize) {
        let Self { regions, correspondences, .. } = self;
        correspondences.regions.clear();
        correspondences.region_support.clear();
        if !context.observation.frame().colors.is_empty() {
            regions.find(context.posed(poses), step, |limb| context.uses_edges(limb), correspondences);
        }
    }

    /// Computes the closest points of the limbs' candidates; `anew` states whether the candidates have changed since the last
    /// call.
    fn match_surface(&mut self, context: Context, poses: &[Pose], gate: &Gate, anew: bool, visible_side: bool) {
        let Context { config, model, observation, .. } = context;
        let Self { assignment, correspondences, threads, detected_limbs, radius_variances, .. } = self;
        let (assignment, limbs, candidates) = (&*assignment, model.body.limbs(), observation.candidates);
        correspondences.limbs.resize_with(poses.len(), LimbMatches::default);
        let work = |(index, matches): (usize, &mut LimbMatches)| {
            if anew {
                assignment.sample_limb(index, candidates, config, matches);
                detected_limbs.weigh(index, limbs[index].shape.max_radius(), &matches.measured, &mut matches.own);
            }
            matches.radius_variance = radius_variances.get(index).copied().unwrap_or_default();
            match_limb(&limbs[index], &poses[index], gate.distance, config.solver.is_whole_body(), matches);
            if visible_side {
                match_visible_side(&limbs[index].shape, &poses[index], candidates, gate.distance, matches);
            }
        };
        threads.each(&mut correspondences.limbs, work);
    }

    /// Steps 6 and 7: fits the body to the correspondences.
    pub(crate) fn solve(&mut self, context: Context, predicted: &[Pose], poses: &mut [Pose], step: usize) {
        let Self { whole_body, correspondences, band_weights, .. } = self;
        if context.config.solver.is_whole_body() {
            whole_body.solve(Problem { context, correspondences, predicted, step }, poses);
            return;
        }
        // 6 Elastic bands on both limbs.
        correspondences.add_bands(&context.model.body, poses, context.config.band_ratio, band_weights);
        // 7 Fit the model.
        solve_limbwise(correspondences, poses);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::config::SolverKind;
    use crate::testing::{before_wall, farthest, moved, standing, turned, with_context};

    /// The solvers, and their error after the steps of one frame, meters: the published one leaves limbs tilted.
    const SOLVERS: [(SolverKind, f64); 3] =
        [(SolverKind::Chain, 0.007), (SolverKind::Tree, 0.007), (SolverKind::Limbwise, 0.025)];
    const GATE: Gate = Gate { box_margin: 0.1, distance: 0.1 };

    /// Runs the loop on an image of the standing body from a start with an error of 6 cm. Returns the fitted poses, their error,
    /// and the number of steps.
    fn found(config: &Config) -> (Vec<Pose>, f64, usize) {
        let (model, poses) = standing();
        let start = turned(&moved(&poses, Vec3::new(0.03, 0.0, 0.03)), poses[0].translation, Vec3::Y, 0.09);
        let pixels = before_wall(&model.body, &poses);
        with_context(&pixels, config, &model, &start, |context| {
            let mut found = start.clone();
            let mut fit = Fit::new(config).unwrap();
            let steps = fit.run(Context { time_scale: 4.0, ..context }, &start, &mut found);
            let off = farthest(&found, &poses);
            (found, off, steps)
        })
    }

    #[test]
    fn a_body_set_a_little_off_is_drawn_to_where_it_is_visible() {
        for (solver, reached) in SOLVERS {
            let (_, off, _) = found(&Config { solver, ..Config::default() });
            assert!(off < reached, "{solver:?}: {off} m off");
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let (alone, _, steps) = found(&Config::default());
        for threads in [2, 3] {
            let (poses, _, again) = found(&Config { threads, ..Config::default() });
            assert_eq!((poses, again), (alone.clone(), steps), "{threads} threads");
        }
    }

    #[test]
    fn an_swap_gives_back_exactly_what_was_matched() {
        let (model, poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), Config::default());
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_all(context, &poses, config.max_steps, true);
            let written = |fit: &Fit| format!("{:?}", fit.correspondences);
            let (before, mut matched) = (written(&fit), Correspondences::default());
            fit.swap_matches(&mut matched);
            fit.match_all(context, &moved(&poses, 0.05 * Vec3::X), config.max_steps, true);
            assert_ne!(written(&fit), before);
            fit.swap_matches(&mut matched);
            assert_eq!(written(&fit), before);
            fit.clear();
            assert_eq!(fit.correspondences.mean_squared_distance(), None);
        });
    }

    #[test]
    fn points_alone_are_matched_within_the_gate_that_is_given() {
        let (model, poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), Config::default());
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            let mut matched = |distance: f64, poses: &[Pose]| {
                fit.match_points(context, poses, &Gate { distance, ..GATE });
                assert!(fit.correspondences.sites.is_empty() && fit.correspondences.contour.is_empty());
                let limbs = fit.correspondences.limbs.iter();
                limbs.map(|limb| limb.accepted()).sum::<usize>() as f64 / context.observation.candidates.len() as f64
            };
            assert!(matched(0.1, &poses) > 0.95);
            let deeper = moved(&poses, 0.06 * Vec3::Z);
            assert!(matched(0.1, &deeper) > 0.8 && matched(0.02, &deeper) < 0.1);
        });
    }
}
