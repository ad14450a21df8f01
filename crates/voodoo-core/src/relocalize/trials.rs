//! Whether a lost body stands at a segment: the best rough looks are refined and scored.

use super::facing::{Known, facing_cost};
use super::posture::Place;
use super::seeds::{RoughLook, Seed, find_seeds, put};
use crate::body::Model;
use crate::fit::{Context, Fit};
use crate::hypotheses::{CLEAR_GAIN, CLUTTER, SURE_GAIN, body_landmark_cost, explain, limit_strain, overall_cost};
use crate::math::{Pose, Vec3};
use crate::observation::segments::Segment;

/// Where the opposite facing does not explain a frame surely worse it is waited for so long for evidence, seconds.
const WAIT: f64 = 0.5;
/// Points that rough looks are taken at: costs time in proportion.
const SEED_SAMPLE: usize = 300;
/// ICP steps that refine a rough look.
const STEPS: usize = 10;
/// What lies farther than this (m) from the body is stray: a segment of which too much is stray is no body.
const STRAY_DISTANCE: f64 = 0.07;
/// What cameras have against a place counts at most this many times the weight of its points: so much says that it is wrong.
const MOST_COST: f64 = 4.0;

/// What the trials at one segment gave.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    /// By how much the best place is better than the present pose, patches; none when nothing is better, or not yet decided.
    pub(super) gain: Option<f64>,
    /// The present pose explains the segment.
    pub(super) explained: bool,
}

/// Working memory.
#[derive(Debug, Default)]
pub(super) struct Trials {
    rough: RoughLook,
    seeds: Vec<Seed>,
    /// The pose that is tried, where it started, and the best so far.
    poses: Place,
    predicted: Place,
    best: Place,
}

impl Trials {
    /// The best poses that the last segment gave.
    pub(super) fn best(&self) -> &Place {
        &self.best
    }

    /// Tries the body at a segment, whose points are the candidates of `context`.
    pub(super) fn at_segment(
        &mut self,
        context: Context,
        known: Known,
        fit: &mut Fit,
        present: &[Pose],
        segment: &Segment,
    ) -> Outcome {
        let total = self.take_sample(context);
        fit.match_all(context, present, context.config.max_steps);
        let mut present_score = place_score(context, known, fit, present, total);
        let explained = stray_share(&mut self.rough, context, present) < CLUTTER;
        if explained {
            // Refined as the others are: a body that is 2 cm off shall not be turned about for that.
            self.poses.clear();
            self.poses.extend_from_slice(present);
            self.refine(context, fit);
            present_score = present_score.min(place_score(context, known, fit, &self.poses, total));
        }
        find_seeds(&mut self.rough, context, known, segment, &mut self.seeds);
        let mut least = present_score - CLEAR_GAIN;
        let mut found = false;
        let mut opposite = f64::INFINITY;
        let stood = present[0].rotation * Vec3::X;
        let mut ahead = stood;
        for seed in 0..self.seeds.len() {
            put(known.postures, &self.seeds[seed], &mut self.poses);
            self.refine(context, fit);
            let score = place_score(context, known, fit, &self.poses, total);
            let faces = self.poses[0].rotation * Vec3::X;
            let turned = faces.dot(ahead) < 0.0;
            let stray = stray_share(&mut self.rough, context, &self.poses);
            // A body that is where it should be may only turn out to face the other way.
            let allowed = !explained && known.lost || faces.dot(stood) < 0.0;
            if allowed && score < least && stray < CLUTTER {
                if turned {
                    opposite = least;
                }
                least = score;
                found = true;
                ahead = faces;
                self.best.clone_from(&self.poses);
            } else if turned {
                opposite = opposite.min(score);
            }
        }
        let waited = context.seen.frame().stamp - known.motion.seen_since > WAIT;
        let decided = opposite - least > SURE_GAIN || waited;
        Outcome { gain: (found && decided).then_some(present_score - least), explained }
    }

    /// Tries the body where a detector saw it, with the points there as the candidates of `context`; whether it explains them no
    /// worse than the present pose does.
    pub(super) fn at_detection(&mut self, context: Context, fit: &mut Fit, present: &[Pose], place: &[Pose]) -> bool {
        let total = self.take_sample(context);
        fit.match_all(context, present, context.config.max_steps);
        let present_score = pose_score(context, fit, present, total);
        self.poses.clear();
        self.poses.extend_from_slice(place);
        self.refine(context, fit);
        let stray = stray_share(&mut self.rough, context, &self.poses);
        // Depth hardly tells a person's front from the back; the detector does.
        let turned = (self.poses[0].rotation * Vec3::X).dot(present[0].rotation * Vec3::X) < 0.0;
        let allowed = present_score + if turned { SURE_GAIN } else { 0.0 };
        let found = pose_score(context, fit, &self.poses, total) < allowed && stray < CLUTTER;
        if found {
            self.best.clone_from(&self.poses);
        }
        found
    }

    /// Takes the points at which rough looks are taken; the weight of all points there.
    fn take_sample(&mut self, context: Context) -> f64 {
        let candidates = context.seen.candidates;
        self.rough.sample.assign(&candidates.points, &candidates.weight);
        self.rough.sample.subsample(SEED_SAMPLE);
        candidates.weight.iter().map(|weight| f64::from(*weight)).sum()
    }

    /// Refines `poses` in some ICP steps; `fit` then holds their matches.
    fn refine(&mut self, context: Context, fit: &mut Fit) {
        let Self { poses, predicted, .. } = self;
        predicted.clone_from(poses);
        for step in 0..STEPS {
            fit.step(context, predicted, poses, step);
        }
        fit.match_all(context, poses, context.config.max_steps);
    }
}

/// Share of the points at the segment that lie farther than `STRAY_DISTANCE` from the body.
fn stray_share(rough: &mut RoughLook, context: Context, poses: &[Pose]) -> f64 {
    let RoughLook { sample, nearest, distances, .. } = rough;
    nearest.clear();
    nearest.resize(sample.len(), f32::INFINITY);
    for limb in 0..poses.len() {
        explain(&context.model.body, limb, poses, &sample.points, nearest, distances);
    }
    let stray = nearest.iter().zip(&sample.weights).filter(|(distance, _)| f64::from(**distance) > STRAY_DISTANCE);
    stray.map(|(_, weight)| weight).sum::<f64>() / sample.total().max(f64::MIN_POSITIVE)
}

/// The score of all hypotheses, and what named sites and the other joints say.
fn pose_score(context: Context, fit: &Fit, poses: &[Pose], total: f64) -> f64 {
    let matched = fit.matched(poses);
    let score = overall_cost(context, matched).total;
    score.min(MOST_COST * total) + body_landmark_cost(matched) + other_joints_strain(context.model, poses)
}

/// The same, and what the facing says.
fn place_score(context: Context, known: Known, fit: &Fit, poses: &[Pose], total: f64) -> f64 {
    pose_score(context, fit, poses, total) + facing_cost(known, poses[0].rotation, context.seen.frame().stamp)
}

/// Cost of the broken limits of joints that belong to no arm or leg, or end one: a foot that points backwards.
fn other_joints_strain(model: &Model, poses: &[Pose]) -> f64 {
    let inner = |limb: usize| model.extremities.iter().any(|chain| limb == chain.upper || limb == chain.lower);
    let others = (1..poses.len()).filter(|limb| !inner(*limb));
    others.map(|limb| limit_strain(&model.body, poses, limb)).sum()
}
