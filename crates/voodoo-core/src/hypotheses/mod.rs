//! Trying other configurations of arms and legs, and keeping the best by one score.

pub(crate) mod landmark_cost;
pub(crate) mod persistence;
pub(crate) mod proposals;
pub(crate) mod score;
pub(crate) mod trunk_lean;

use std::f64::consts::TAU;

use crate::association::correspondence::Correspondences;
use crate::body::two_bone::TwoBone;
use crate::math::{Points, Pose, Vec3, shifted};
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::Frame;
use crate::tracker::Tracker;
use crate::tracker::estimate::{LimbStatus, Status};
use crate::visibility::evidence::{EXPLAINED, Visibility, limb_visibility};
use persistence::Doubt;
use proposals::{carry, targets, thin};
use trunk_lean::{Lean, Stance};

/// So many unexplained patches near a chain make it suspect.
const SUSPICIOUS: f64 = 25.0;
/// So many near an arm make it suspect whatever else speaks for it, unless a larger share of the whole frame is unexplained.
const STRIKING: f64 = 40.0;
const CLUTTER: f64 = 0.15;
/// A chain is idle when the patches that it alone explains are a smaller share of those it shows.
const IDLE: f64 = 0.3;
/// It is refuted when cameras see past a larger share of it.
const REFUTED: f64 = 0.2;
/// Either share is of this many patches at least (of those seen past, of the image), and has to last for so many frames.
const LEAST: f64 = 20.0;
const LEAST_PAST: f64 = 12.0;
const PATIENCE: usize = 2;
/// So many frames where nothing but open points speaks against an arm.
const LONG_PATIENCE: usize = 4;
/// A hypothesis must cost so many patches less than the current pose, and so many of them by what cameras see: to come out of
/// hiding, or out of another limb, is no reason to jump.
pub(crate) const GAIN: f64 = 25.0;
const SEEN_GAIN: f64 = 10.0;
/// ICP steps that refine the best hypothesis.
const REFINE: usize = 8;
/// A new configuration that costs more than this, and more than the old one, is no pose of a body.
const STRAINED: f64 = 60.0;
/// Bends about the line from the root of a chain to a new end that are tried, and to the end it had.
pub(crate) const SWIVELS: usize = 6;
const SWIVELS_AT_REST: usize = 12;
/// A rough hypothesis explains points up to this distance, metres: they are drawn in when it is refined.
const ROUGHLY: f64 = 0.08;
/// Points looked at when hypotheses are compared, at most.
pub(crate) const SAMPLE: usize = 400;

/// What a hypothesis rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ground {
    /// Open points have drawn the chain there.
    Points,
    /// It ended there when all was well.
    Rest,
    /// The body leans: not the chain alone is judged by it.
    Lean,
}

/// Working memory.
#[derive(Debug, Default)]
pub(crate) struct Hypotheses {
    /// Candidates that no limb explains.
    open: Points,
    open_weight: Vec<f64>,
    /// So many are open that a heap of them says nothing.
    cluttered: bool,
    /// Points the chain under test may explain.
    near: Points,
    near_weight: Vec<f64>,
    /// Points it is matched to now.
    own: Points,
    own_weight: Vec<f64>,
    best: Vec<f32>,
    others: Vec<f32>,
    distances: Vec<f32>,
    trial: Vec<Pose>,
    kept: Vec<Pose>,
    at_rest: Vec<Pose>,
    lean: Lean,
    kept_predicted: Vec<Pose>,
    /// What was matched before the hypothesis.
    matched: Correspondences,
    /// Where each chain ended when the frame last proved it right, world.
    ends: Vec<Option<Vec3>>,
    /// What past frames said against each chain.
    doubts: Vec<Doubt>,
    /// The body as the frame wanted it that last asked for a change of each chain, world.
    wanted: Vec<Vec<Pose>>,
    asked_for: Vec<Pose>,
    /// What that one rests on.
    wanted_ground: Vec<Ground>,
}

impl Tracker {
    pub(crate) fn prepare_hypotheses(&mut self) {
        self.chains = TwoBone::of(&self.body);
        let work = &mut self.hypotheses;
        work.ends.clear();
        work.ends.resize(self.chains.len(), None);
        work.doubts.clear();
        work.doubts.resize(self.chains.len(), Doubt::default());
        let room = || Vec::with_capacity(self.body.limbs().len());
        work.wanted.clear();
        work.wanted_ground.clear();
        work.wanted_ground.resize(self.chains.len(), Ground::Points);
        work.wanted.resize_with(self.chains.len(), room);
        work.lean.prepare(&self.body, &self.chains);
        // Room at once, not when the first hard frame comes.
        for poses in [&mut work.trial, &mut work.kept, &mut work.at_rest, &mut work.kept_predicted, &mut work.asked_for]
        {
            poses.clear();
            poses.reserve(self.body.limbs().len());
        }
    }

    /// Looks at every arm and leg; where the frame speaks against it, tries others.
    pub(crate) fn try_hypotheses(&mut self, frame: &Frame, pace: f64) -> usize {
        let mut work = std::mem::take(&mut self.hypotheses);
        let mut steps = 0;
        self.collect_open(&mut work);
        for index in 0..self.chains.len() {
            let taken = self.try_chain(index, frame, pace, &mut work);
            if taken > 0 {
                self.collect_open(&mut work);
            }
            steps += taken;
        }
        self.hypotheses = work;
        steps
    }

    /// Candidates that the current matches leave unexplained.
    fn collect_open(&self, work: &mut Hypotheses) {
        work.open.clear();
        work.open_weight.clear();
        work.near.clear();
        work.near_weight.clear();
        work.own.clear();
        work.own_weight.clear();
        work.others.clear();
        work.distances.clear();
        // Room for the worst case at once, not when the first hard frame comes.
        let most = self.candidates.len();
        work.open.reserve(most);
        work.open_weight.reserve(most);
        work.near.reserve(most);
        work.near_weight.reserve(most);
        work.own.reserve(most);
        work.own_weight.reserve(most);
        work.others.reserve(most);
        work.distances.reserve(most);
        work.lean.make_room(most);
        work.matched.reserve_as(&self.correspondences);
        work.best.clear();
        work.best.resize(self.candidates.len(), f32::INFINITY);
        for matches in &self.correspondences.limbs {
            for (candidate, distance) in matches.candidate.iter().zip(&matches.surface.signed_distance) {
                let best = &mut work.best[*candidate as usize];
                // A refused match (a cap inside the body) still explains its point.
                *best = best.min(distance.abs());
            }
        }
        for (index, distance) in work.best.iter().enumerate() {
            if f64::from(*distance) > EXPLAINED {
                let points = &self.candidates.points;
                work.open.push([points.x[index], points.y[index], points.z[index]]);
                work.open_weight.push(f64::from(self.candidates.weight[index]));
            }
        }
        let all: f64 = self.candidates.weight.iter().map(|weight| f64::from(*weight)).sum();
        work.cluttered = work.open_weight.iter().sum::<f64>() > CLUTTER * all;
    }

    fn try_chain(&mut self, index: usize, frame: &Frame, pace: f64, work: &mut Hypotheses) -> usize {
        let chain = &self.chains[index];
        let root = chain.root(&self.body, &self.poses);
        let reach = 1.15 * chain.stretched_length();
        work.near.clear();
        work.near_weight.clear();
        for index in 0..work.open.len() {
            let point = work.open.get(index);
            if (point - root).length() < reach {
                work.near.push(point.to_array().map(|value| value as f32));
                work.near_weight.push(work.open_weight[index]);
            }
        }
        let open: f64 = work.near_weight.iter().sum();
        let views =
            DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin: self.origin };
        let look = |poses: &[Pose]| {
            let mut sum = Visibility::default();
            chain.limbs().for_each(|limb| sum += limb_visibility(views, &self.body.limbs()[limb], &poses[limb]));
            sum
        };
        // Furniture stays open beside legs; nothing else than the arm is expected about an arm.
        let striking = !chain.leg && !work.cluttered && open >= STRIKING;
        let suspect = open >= SUSPICIOUS && self.suspect(chain, views, work, false) != [false; 2];
        let patience = if suspect { Some(PATIENCE) } else { striking.then_some(LONG_PATIENCE) };
        if !work.doubts[index].due(patience) {
            return 0;
        }
        let targets = targets(&work.near, &work.near_weight, root, &mut work.best);
        // The points the chain explains now must stay explained.
        for index in 0..work.own.len() {
            work.near.push(work.own.get(index).to_array().map(|value| value as f32));
        }
        work.near_weight.extend(&work.own_weight);
        // What the other limbs explain anyway is no merit of this one.
        thin(&mut work.near, &mut work.near_weight, SAMPLE);
        self.distances_to_others(chain, &work.near, &mut work.others, &mut work.best);
        let others = std::mem::take(&mut work.others);
        // No part of the cost is negative: what cannot fall below `least` any more is not looked at further.
        let score = |poses: &[Pose],
                     least: f64,
                     near: &Points,
                     weights: &[f64],
                     best: &mut Vec<f32>,
                     distances: &mut Vec<f32>| {
            best.clone_from(&others);
            chain.limbs().for_each(|limb| self.explain(limb, poses, near, best, distances));
            let points = rough_cost(best, weights);
            if points >= least {
                return points;
            }
            let seen = points + look(poses).cost();
            if seen >= least { seen } else { seen + self.strain(chain, poses) }
        };
        let current =
            score(&self.poses, f64::INFINITY, &work.near, &work.near_weight, &mut work.best, &mut work.distances);
        let enough = current - GAIN;
        let Hypotheses { near, near_weight, best, distances, trial, kept, at_rest, .. } = work;
        // The best way to end at a place that costs less than `least`, into `kept`; returns its cost.
        let mut end_at = |target: Vec3, ways: usize, mut least: f64, kept: &mut Vec<Pose>| {
            for swivel in 0..ways {
                trial.clone_from(&self.poses);
                chain.reach(&self.body, trial, target, TAU * swivel as f64 / ways as f64);
                let cost = score(trial, least, near, near_weight, best, distances);
                if cost < least {
                    least = cost;
                    kept.clone_from(trial);
                }
            }
            least
        };
        let mut least =
            targets.into_iter().flatten().fold(enough, |least, target| end_at(target, SWIVELS, least, kept));
        // Its end where it was when all was well: a foot stands while the body moves over it. The best way of that is refined
        // too, whatever it explains so far, because the body itself may be off by as much.
        let rested = work.ends[index]
            .is_some_and(|end| end_at(end - self.origin, SWIVELS_AT_REST, f64::INFINITY, at_rest) < f64::INFINITY);
        if self.previous.len() == self.poses.len() {
            // Where the chain was a frame ago, carried by its parent.
            trial.clone_from(&self.poses);
            carry(chain, &self.body, &self.previous, trial);
            let cost = score(trial, least, near, near_weight, best, distances);
            if cost < least {
                least = cost;
                kept.clone_from(trial);
            }
        }
        work.others = others;
        // What the last frame asked for comes before what is new: two frames that ask for a change shall ask for the same one.
        // Only a lean comes earlier: while the trunk is wrong, both legs ask for what does not last.
        let mut wanted = std::mem::take(&mut work.wanted[index]);
        wanted.iter_mut().for_each(|pose| *pose = shifted(pose, self.origin));
        let stance = if self.chains[index].leg { self.lean(&work.ends, views, &mut work.lean) } else { None };
        let doubtful = self.chains.iter().zip(&work.doubts).all(|(chain, doubt)| !chain.leg || !doubt.none());
        // Found; what it rests on; the body.
        let tried = [
            (stance == Some(Stance::Leant), Ground::Lean, std::mem::take(&mut work.lean.leant)),
            (work.doubts[index].asked() && !wanted.is_empty(), work.wanted_ground[index], wanted),
            (rested, Ground::Rest, std::mem::take(&mut work.at_rest)),
            (least < enough, Ground::Points, std::mem::take(&mut work.kept)),
            // Both feet, when both legs are in doubt.
            (stance == Some(Stance::Upright) && doubtful, Ground::Rest, std::mem::take(&mut work.lean.upright)),
        ];
        let mut steps = 0;
        for (_, ground, poses) in tried.iter().filter(|(found, ..)| *found) {
            if !work.doubts[index].asks() {
                steps += REFINE;
                if self.refine(index, frame, pace, poses, work, *ground) && !work.doubts[index].ask() {
                    work.wanted_ground[index] = *ground;
                    work.asked_for.extend(self.poses.iter().map(|pose| shifted(pose, -self.origin)));
                    self.take_back(work);
                }
            }
        }
        [
            (.., work.lean.leant),
            (.., work.wanted[index]),
            (.., work.at_rest),
            (.., work.kept),
            (.., work.lean.upright),
        ] = tried;
        std::mem::swap(&mut work.wanted[index], &mut work.asked_for);
        work.asked_for.clear();
        steps
    }

    /// The poses from before the hypothesis, and what was matched there.
    fn take_back(&mut self, work: &mut Hypotheses) {
        self.poses.clone_from(&work.trial);
        self.predicted.clone_from(&work.kept_predicted);
        std::mem::swap(&mut self.correspondences, &mut work.matched);
    }

    /// Remembers where the chains end that this frame proves right; a lost body has been anywhere.
    pub(crate) fn remember_ends(&mut self) {
        if self.estimate.status == Status::Lost {
            self.hypotheses.ends.fill(None);
        }
        let measured = |limb: usize| self.estimate.limb_status[limb] == LimbStatus::Measured;
        for (index, chain) in self.chains.iter().enumerate() {
            if self.hypotheses.doubts[index].none() && chain.limbs().all(measured) {
                self.hypotheses.ends[index] = Some(chain.end(&self.poses) + self.origin);
            }
        }
    }

    /// Whether the frame speaks against a chain where it is: against all of it, and against what lies beyond its hinge. What
    /// cameras see past counts by its area in the image. Where open points have drawn the chain, it counts as if seen from the
    /// side, too: a thing that appears draws a calf along the ray, where nothing of it is seen. And the chain has to show itself:
    /// an arm behind the trunk may end at anything that comes into view there.
    fn suspect(&self, chain: &TwoBone, views: DepthViews, work: &mut Hypotheses, drawn: bool) -> [bool; 2] {
        let Hypotheses { own, own_weight, others, best, .. } = work;
        own.clear();
        own_weight.clear();
        let mut upper = 0;
        for limb in chain.limbs() {
            let matches = &self.correspondences.limbs[limb];
            for (index, weight) in matches.weight.iter().enumerate() {
                if *weight > 0.0 {
                    own.push(matches.measured.get(index).to_array().map(|value| value as f32));
                    own_weight.push(f64::from(*weight));
                }
            }
            if limb == chain.upper {
                upper = own.len();
            }
        }
        self.distances_to_others(chain, own, others, best);
        let alone = |from: usize| -> f64 {
            let weighted = others[from..].iter().zip(&own_weight[from..]);
            weighted.filter(|(other, _)| f64::from(**other) > EXPLAINED).map(|(_, weight)| *weight).sum()
        };
        let mut seen = Visibility::default();
        let mut against = |limb: usize, alone: f64| {
            seen += limb_visibility(views, &self.body.limbs()[limb], &self.poses[limb]);
            alone <= IDLE * (seen.image.front_facing - seen.image.occluded).max(LEAST)
                || seen.image.free_space > (REFUTED * seen.image.front_facing).max(LEAST_PAST)
        };
        chain.ends.iter().for_each(|end| {
            against(*end, 0.0);
        });
        let lower = against(chain.lower, alone(upper));
        let upper = against(chain.upper, alone(0));
        let shown = seen.image.front_facing - seen.image.occluded - seen.image.free_space;
        let past = seen.side.free_space > (REFUTED * seen.side.front_facing).max(LEAST);
        let drawn = drawn && (past || shown < SUSPICIOUS);
        [upper || drawn, lower || drawn]
    }

    /// Distance of points to the nearest limb that does not belong to a chain.
    fn distances_to_others(&self, chain: &TwoBone, points: &Points, others: &mut Vec<f32>, distances: &mut Vec<f32>) {
        others.clear();
        others.resize(points.len(), f32::INFINITY);
        for limb in (0..self.poses.len()).filter(|limb| !chain.limbs().any(|own| own == *limb)) {
            self.explain(limb, &self.poses, points, others, distances);
        }
    }

    /// Lowers the least distances of points to the limbs of a hypothesis by those to one more limb.
    pub(crate) fn explain(
        &self,
        limb: usize,
        poses: &[Pose],
        points: &Points,
        least: &mut [f32],
        distances: &mut Vec<f32>,
    ) {
        self.body.limbs()[limb].shape.approximate_distances(&poses[limb], points, distances);
        for (least, distance) in least.iter_mut().zip(distances.iter()) {
            *least = least.min(distance.abs());
        }
    }

    /// Refines a hypothesis with the whole body and takes it when it explains the frame better as a whole; else all is as before.
    fn refine(
        &mut self,
        index: usize,
        frame: &Frame,
        pace: f64,
        hypothesis: &Vec<Pose>,
        work: &mut Hypotheses,
        ground: Ground,
    ) -> bool {
        let before = self.overall_cost(frame);
        let strained = self.strain(&self.chains[index], &self.poses).max(STRAINED);
        work.trial.clone_from(&self.poses);
        self.poses.clone_from(hypothesis);
        // The prediction spoke for the old configuration; the new one is what is expected now.
        work.kept_predicted.clone_from(&self.predicted);
        self.predicted.clone_from(hypothesis);
        std::mem::swap(&mut self.correspondences, &mut work.matched);
        let last = self.config.max_steps;
        for step in 0..REFINE {
            self.match_and_solve(frame, pace, last.saturating_sub(REFINE - step));
        }
        self.match_last(frame);
        let cost = self.overall_cost(frame);
        if cost.total < before.total - GAIN && cost.evidence < before.evidence - SEEN_GAIN {
            let views =
                DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin: self.origin };
            let chain = &self.chains[index];
            // What is as suspect as before is not worth a jump.
            let mut sure = || !self.suspect(chain, views, work, ground == Ground::Points)[0];
            if self.strain(chain, &self.poses) <= strained && (ground == Ground::Lean || sure()) {
                return true;
            }
        }
        self.take_back(work);
        false
    }
}

/// Cost of points at these distances from the nearest limb of a rough hypothesis.
pub(crate) fn rough_cost(distances: &[f32], weights: &[f64]) -> f64 {
    distances.iter().zip(weights).map(|(d, w)| w * (f64::from(*d) / ROUGHLY).powi(2).min(1.0)).sum()
}
