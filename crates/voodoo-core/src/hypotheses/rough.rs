//! Rough cost of configurations of one arm or leg, cheap enough to compare many of them before one is refined.

use std::f64::consts::TAU;

use super::objective::Objective;
use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Fit};
use crate::math::{Points, Pose, Vec3, WeightedPoints, make_room, refill, reset};
use crate::terms::unexplained;

/// Maximum number of points for the rough cost; the time is proportional to it.
pub(crate) const ROUGH_SAMPLE: usize = 400;
/// Tolerance of the rough cost for points, in those of a refined pose: refinement pulls nearby points and limbs together.
const TOLERANCE: f64 = 2.0;

/// The arm or leg under test, and the current poses of the body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extremity<'a> {
    /// The current poses, and the objective by which its configurations are compared.
    pub(super) objective: Objective<'a>,
    pub(super) chain: &'a TwoBone,
}

impl<'a> Extremity<'a> {
    pub(super) fn new(context: Context<'a>, fit: &'a Fit, poses: &'a [Pose], chain: &'a TwoBone) -> Self {
        Self { objective: Objective::new(context, fit, poses), chain }
    }

    /// Center of its ball joint, working frame.
    pub(super) fn root(&self) -> Vec3 {
        self.chain.root(&self.objective.context.model.body, self.objective.poses)
    }
}

/// Search for the configuration of an arm or leg with the lowest rough cost: the points near it, and working memory.
#[derive(Debug, Default)]
pub(super) struct RoughSearch {
    /// Points that no limb explains.
    pub(super) unexplained: WeightedPoints,
    /// A subsample of these, and of the points that the arm or leg explains now and has to keep explaining.
    sample: WeightedPoints,
    /// Distances of the sample to the nearest limb outside the arm or leg. Points near such a limb are explained by every
    /// configuration.
    others: Vec<f32>,
    nearest: Vec<f32>,
    /// Working memory.
    pub(super) distances: Vec<f32>,
    pub(super) trial: Vec<Pose>,
}

impl RoughSearch {
    /// Reserves memory for a frame of `count` candidates.
    pub(super) fn make_room(&mut self, count: usize) {
        self.unexplained.make_room(count);
        self.sample.make_room(2 * count);
        for distances in [&mut self.others, &mut self.nearest, &mut self.distances] {
            make_room(distances, count);
        }
    }

    /// Sets the sample: unexplained points nearby, and the points that are matched to the arm or leg.
    pub(super) fn begin(&mut self, at: Extremity) {
        let Self { unexplained, sample, others, distances, .. } = self;
        let candidates = at.objective.context.observation.candidates;
        sample.clear();
        sample.extend(&unexplained.points, &unexplained.weights);
        for limb in at.chain.limbs() {
            let matches = &at.objective.correspondences.limbs[limb];
            for index in (0..matches.weight.len()).filter(|index| matches.weight[*index] > 0.0) {
                let point = matches.measured.get(index).as_vec3().to_array();
                sample.push(point, matches.area(index, candidates));
            }
        }
        sample.subsample(ROUGH_SAMPLE);
        reset(others, sample.weights.len(), f32::INFINITY);
        let (body, poses) = (&at.objective.context.model.body, at.objective.poses);
        for limb in (0..poses.len()).filter(|limb| !at.chain.has(*limb)) {
            explain(body, limb, poses, &sample.points, others, distances);
        }
    }

    /// Rough cost of the arm or leg at `poses`, nats. The evaluation stops when the points alone cost `least`.
    pub(super) fn cost(&mut self, at: Extremity, poses: &[Pose], least: f64) -> f64 {
        let Self { sample, others, nearest, distances, .. } = self;
        let (chain, body) = (at.chain, &at.objective.context.model.body);
        nearest.clone_from(others);
        chain.limbs().for_each(|limb| explain(body, limb, poses, &sample.points, nearest, distances));
        let near = nearest.iter().zip(&sample.weights);
        let points = near.map(|(distance, weight)| weight * unexplained(f64::from(*distance) / TOLERANCE)).sum();
        // Only colors lower the cost.
        if at.objective.regions.is_none() && points >= least {
            return points;
        }
        points + chain.limbs().map(|limb| at.objective.limb(poses, limb)).sum::<f64>()
    }

    /// Finds the configuration of lowest cost that ends at `place`, among `swivels` bends about the line from the root to it. If
    /// it costs less than `least`, writes it to `best` and returns its cost; otherwise returns `least`.
    pub(super) fn end_at(
        &mut self,
        at: Extremity,
        place: Vec3,
        swivels: usize,
        mut least: f64,
        best: &mut Vec<Pose>,
    ) -> f64 {
        for swivel in 0..swivels {
            let angle = TAU * swivel as f64 / swivels as f64;
            let reach = |poses: &mut [Pose]| at.chain.reach(&at.objective.context.model.body, poses, place, angle);
            least = self.changed(at, reach, least, best);
        }
        least
    }

    /// Applies `change` to the current poses. If the result costs less than `least`, writes it to `best` and returns its cost;
    /// otherwise returns `least`.
    pub(super) fn changed(
        &mut self,
        at: Extremity,
        change: impl FnOnce(&mut [Pose]),
        least: f64,
        best: &mut Vec<Pose>,
    ) -> f64 {
        let mut trial = std::mem::take(&mut self.trial);
        refill(&mut trial, at.objective.poses.iter().copied());
        change(&mut trial);
        let cost = self.cost(at, &trial, least);
        if cost < least {
            best.clone_from(&trial);
        }
        self.trial = trial;
        if cost < least { cost } else { least }
    }
}

/// Updates the distances `least` of points to the nearest of several limbs with one more limb. `distances` is working memory.
pub(crate) fn explain(
    body: &Body,
    limb: usize,
    poses: &[Pose],
    points: &Points,
    least: &mut [f32],
    distances: &mut Vec<f32>,
) {
    body.limbs()[limb].shape.approximate_distances(&poses[limb], points, distances);
    for (least, distance) in least.iter_mut().zip(distances.iter()) {
        *least = least.min(distance.abs());
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::hypotheses::unexplained::Unexplained;
    use crate::testing::{before_wall, first_arm, raised, standing, with_context, without_background};

    #[test]
    fn the_observed_bend_of_an_arm_has_the_lowest_cost() {
        let (model, poses) = standing();
        let (stretched, end) = raised(&model, &poses, 0.2);
        let config = without_background();
        let arm = &model.extremities[first_arm(&model)];
        let root = arm.root(&model.body, &stretched);
        let place = root + 0.6 * (end - root);
        for bend in [0, 2, 5] {
            let mut raised_pose = poses.clone();
            arm.reach(&model.body, &mut raised_pose, place, TAU * f64::from(bend) / 6.0);
            with_context(&before_wall(&model.body, &raised_pose), &config, &model, &poses, |context| {
                let mut fit = Fit::new(&config).unwrap();
                fit.match_last(context, &poses, true);
                let at = Extremity::new(context, &fit, &poses, arm);
                let (mut unexplained, mut rough) = (Unexplained::default(), RoughSearch::default());
                unexplained.collect(context.observation.candidates, at.objective.correspondences);
                unexplained.near(root, arm.stretched_length(), &mut rough.unexplained);
                rough.begin(at);
                let mut best = Vec::new();
                rough.end_at(at, place, 6, f64::INFINITY, &mut best);
                let elbow = best[arm.lower].translation.distance(raised_pose[arm.lower].translation);
                assert!(elbow < 1e-6, "bend {bend}: the elbow has an error of {elbow} m");
            });
        }
    }

    #[test]
    fn an_arm_that_ends_at_the_observed_hand_has_the_lowest_cost() {
        let (model, poses) = standing();
        let (raised_pose, end) = raised(&model, &poses, 0.2);
        let (pixels, config) = (before_wall(&model.body, &raised_pose), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &poses, true);
            let at = Extremity::new(context, &fit, &poses, &model.extremities[first_arm(&model)]);
            let mut unexplained = Unexplained::default();
            unexplained.collect(context.observation.candidates, at.objective.correspondences);
            let mut rough = RoughSearch::default();
            unexplained.near(at.root(), at.chain.stretched_length(), &mut rough.unexplained);
            rough.begin(at);
            let hanging = rough.cost(at, &poses, f64::INFINITY);
            let truth = rough.cost(at, &raised_pose, f64::INFINITY);
            let mut best = Vec::new();
            let least = rough.end_at(at, end, 6, hanging, &mut best);
            assert!(truth < 0.3 * hanging && least < 0.5 * hanging, "{truth} and {least} of {hanging}");
            assert!(at.chain.end(&best).distance(end) < 0.02, "the best configuration ends at the hand");
            // Without a lower cost, the best configuration is unchanged.
            let before = best.clone();
            let mirrored = at.root() - (end - at.root());
            assert_eq!(rough.end_at(at, mirrored, 6, least, &mut best), least);
            assert_eq!(best, before);
            // A change is accepted only if it costs less.
            assert_eq!(rough.changed(at, |_| (), least, &mut best), least);
            assert_eq!(best, before);
            assert_eq!(rough.changed(at, |trial| trial.copy_from_slice(&raised_pose), hanging, &mut best), truth);
            assert_eq!(best, raised_pose);
        });
    }
}
