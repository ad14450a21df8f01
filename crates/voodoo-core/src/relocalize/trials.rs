//! Tries a body at a new position: after refinement there, it must explain the points better than the present pose.

use crate::fit::{Context, Fit};
use crate::hypotheses::{Objective, REFINE, ROUGH_SAMPLE, explain};
use crate::math::{Pose, WeightedPoints, refill, reset};
use crate::visibility::EXPLAINED;

/// Maximum fraction of the points of a segment that a body found there may leave far from it.
const STRAY: f64 = 0.15;

/// Minimum fractions that a body explains alone, if it is somebody else than the one found elsewhere: of what it explains, and of
/// what either explains. A body that was put behind the person explains little.
const SOMEBODY_ELSE: [f64; 2] = [0.25, 0.1];

/// Working memory of a trial.
#[derive(Debug, Default)]
pub(super) struct Trials {
    /// A sample of the candidates, and their distances to the body.
    sample: WeightedPoints,
    nearest: Vec<f32>,
    distances: Vec<f32>,
    /// The poses of the last trial, and their start.
    pub(super) poses: Vec<Pose>,
    predicted: Vec<Pose>,
}

impl Trials {
    /// Tries the body at the poses `place`. Returns whether it explains the points there better than the present pose does.
    pub(super) fn try_at(&mut self, context: Context, fit: &mut Fit, present: &[Pose], place: &[Pose]) -> bool {
        fit.match_all(context, present, context.config.max_steps, true);
        let present_cost = Objective::new(context, fit.matched(present), 1.0, None).body();
        self.refine(context, fit, place) < present_cost
    }

    /// Whether the poses of the last trial explain most of the candidates.
    pub(super) fn explains_most(&mut self, context: Context) -> bool {
        let poses = std::mem::take(&mut self.poses);
        let stray = self.stray_fraction(context, &poses);
        self.poses = poses;
        stray < STRAY
    }

    /// Whether the body at `present` is somebody else than at the poses of the last trial: it explains much that is far from these.
    pub(super) fn is_somebody_else(&mut self, context: Context, present: &[Pose]) -> bool {
        let poses = std::mem::take(&mut self.poses);
        self.measure_distances(context, present);
        let here = self.nearest.clone();
        self.measure_distances(context, &poses);
        self.poses = poses;
        let (mut alone, mut own, mut either) = (0.0, 0.0, 0.0);
        for ((here, there), weight) in here.iter().zip(&self.nearest).zip(&self.sample.weights) {
            let [here, there] = [here, there].map(|distance| f64::from(*distance) <= 2.0 * EXPLAINED);
            alone += if here && !there { *weight } else { 0.0 };
            own += if here { *weight } else { 0.0 };
            either += if here || there { *weight } else { 0.0 };
        }
        let [of_own, of_either] = SOMEBODY_ELSE;
        alone > of_own * own && alone > of_either * either
    }

    /// Returns the fraction of a sample of the candidates that lies far from the body.
    pub(super) fn stray_fraction(&mut self, context: Context, poses: &[Pose]) -> f64 {
        self.measure_distances(context, poses);
        let Self { sample, nearest, .. } = self;
        let stray = nearest.iter().zip(&sample.weights).filter(|(distance, _)| f64::from(**distance) > 2.0 * EXPLAINED);
        stray.map(|(_, weight)| weight).sum::<f64>() / sample.total().max(f64::MIN_POSITIVE)
    }

    /// Samples the candidates and measures their distances to the body.
    fn measure_distances(&mut self, context: Context, poses: &[Pose]) {
        let Self { sample, nearest, distances, .. } = self;
        let candidates = context.observation.candidates;
        sample.clear();
        sample.extend(&candidates.points, &candidates.weight);
        sample.subsample(ROUGH_SAMPLE);
        reset(nearest, sample.len(), f32::INFINITY);
        for limb in 0..poses.len() {
            explain(&context.model.body, limb, poses, &sample.points, nearest, distances);
        }
    }

    /// Refines `place` by a few ICP steps and returns its cost; `poses` and `fit` then hold the refined pose and its matches.
    fn refine(&mut self, context: Context, fit: &mut Fit, place: &[Pose]) -> f64 {
        let Self { poses, predicted, .. } = self;
        refill(poses, place.iter().copied());
        predicted.clone_from(poses);
        for step in 0..REFINE {
            fit.match_all(context, poses, step, true);
            fit.solve(context, predicted, poses, step);
        }
        fit.match_all(context, poses, context.config.max_steps, true);
        Objective::new(context, fit.matched(poses), 1.0, None).body()
    }
}
