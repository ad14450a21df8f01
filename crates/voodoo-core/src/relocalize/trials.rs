//! Tries a body at a new position: after refinement there, it must explain the points better than the present pose.

use crate::fit::{Context, Fit};
use crate::hypotheses::{Objective, REFINE, ROUGH_SAMPLE, explain};
use crate::math::{Pose, WeightedPoints, refill, reset};
use crate::visibility::EXPLAINED;

/// Maximum fraction of the points of a segment that a body found there may leave far from it.
pub(super) const STRAY: f64 = 0.15;

/// Minimum fractions that a body explains alone, if it is somebody else than the one found elsewhere: of what it explains, and of
/// what either explains. A body that was put behind the person explains little.
const SOMEBODY_ELSE: [f64; 2] = [0.25, 0.1];

/// Tries the body at the poses `place`. Returns whether it explains the points there, refined by a few ICP steps, better than the
/// present pose does; `found` and `fit` then hold the refined pose and its matches.
pub(super) fn try_at(context: Context, fit: &mut Fit, present: &[Pose], place: &[Pose], found: &mut Vec<Pose>) -> bool {
    let cost = |fit: &mut Fit, poses: &[Pose]| {
        fit.match_all(context, poses, context.config.max_steps, true);
        let correspondences = &fit.correspondences;
        Objective { context, correspondences, poses, regions: None }.body(1.0)
    };
    let present_cost = cost(fit, present);
    refill(found, place.iter().copied());
    for step in 0..REFINE {
        fit.match_all(context, found, step, true);
        fit.solve(context, place, found, step);
    }
    cost(fit, found) < present_cost
}

/// Working memory of trials.
#[derive(Debug, Default)]
pub(super) struct Trials {
    /// A sample of the candidates, and their distances to the body.
    sample: WeightedPoints,
    nearest: Vec<f32>,
    distances: Vec<f32>,
}

impl Trials {
    /// Whether the body at `present` is somebody else than at `found`: it explains much that is far from there.
    pub(super) fn is_somebody_else(&mut self, context: Context, present: &[Pose], found: &[Pose]) -> bool {
        self.measure_distances(context, present);
        let here = self.nearest.clone();
        self.measure_distances(context, found);
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
        sample.extend(&candidates.points, &candidates.area);
        sample.subsample(ROUGH_SAMPLE);
        reset(nearest, sample.weights.len(), f32::INFINITY);
        for limb in 0..poses.len() {
            explain(&context.model.body, limb, poses, &sample.points, nearest, distances);
        }
    }
}
