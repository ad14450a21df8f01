//! A body that sits down, squats or stands up: the trunk leans about its shoulders while the feet stand.

use std::f64::consts::TAU;

use super::Tracker;
use super::hypotheses::{SWIVELS, rough_cost};
use super::places::thin;
use crate::body::Body;
use crate::candidates::Candidates;
use crate::evidence::look;
use crate::geometry::{Points, Pose, Quat, Vec3};
use crate::recover::TwoBone;
use crate::view::Views;

/// Leans that are tried, radians: the axis points to the second arm.
const LEANS: [f64; 5] = [0.0, -0.2, 0.2, -0.4, 0.4];
/// Points looked at when they are compared, at most.
const SAMPLE: usize = 400;

/// What leans and what stands, and working memory.
#[derive(Debug, Default)]
pub(super) struct Lean {
    /// The two arms and the two legs among the chains; none of a body that has not just these.
    chains: Option<[[usize; 2]; 2]>,
    /// The limbs from the root to the arms.
    trunk: Vec<usize>,
    points: Points,
    weight: Vec<f64>,
    /// Distances of the points to the limbs that stay, to those and the leaning trunk, and to the legs tried there as well.
    staying: Vec<f32>,
    leaning: Vec<f32>,
    tried: Vec<f32>,
    distances: Vec<f32>,
    trial: Vec<Pose>,
    /// The best of the poses tried.
    pub(super) best: Vec<Pose>,
}

impl Lean {
    /// Learns what leans and what stands of a body.
    pub(super) fn prepare(&mut self, body: &Body, chains: &[TwoBone]) {
        let pair = |leg: bool| {
            let mut found = (0..chains.len()).filter(|index| chains[*index].leg == leg);
            match (found.next(), found.next(), found.next()) {
                (Some(one), Some(two), None) => Some([one, two]),
                _ => None,
            }
        };
        self.chains = pair(false).zip(pair(true)).map(|(arms, legs)| [arms, legs]);
        self.trunk.clear();
        for arm in self.chains.iter().flat_map(|[arms, _]| arms) {
            let mut limb = chains[*arm].upper;
            while let Some((parent, _)) = &body.limbs()[limb].parent {
                limb = *parent;
                if !self.trunk.contains(&limb) {
                    self.trunk.push(limb);
                }
            }
        }
        for poses in [&mut self.trial, &mut self.best] {
            poses.clear();
            poses.reserve(body.limbs().len());
        }
    }

    /// Room for a frame of so many points.
    pub(super) fn make_room(&mut self, count: usize) {
        self.points.clear();
        self.points.reserve(count);
        self.weight.clear();
        self.weight.reserve(count);
        for distances in [&mut self.staying, &mut self.leaning, &mut self.tried, &mut self.distances] {
            distances.clear();
            distances.reserve(count.min(SAMPLE));
        }
    }

    fn take(&mut self, candidates: &Candidates) {
        self.make_room(candidates.len());
        let points = &candidates.points;
        for index in 0..candidates.len() {
            self.points.push([points.x[index], points.y[index], points.z[index]]);
            self.weight.push(f64::from(candidates.weight[index]));
        }
        thin(&mut self.points, &mut self.weight, SAMPLE);
    }
}

impl Tracker {
    /// The body leaning as the frame wants it, with its feet at `ends` (of the chains, world), into `lean.best`; whether there is
    /// such a thing. A body that sinks pushes both legs out of place, and each alone is held by the other and by the trunk.
    pub(super) fn lean(&self, ends: &[Option<Vec3>], views: Views, lean: &mut Lean) -> bool {
        let Some([arms, [one, two]]) = lean.chains else { return false };
        let (Some(one_end), Some(two_end)) = (ends[one], ends[two]) else { return false };
        let legs = [(&self.chains[one], one_end - self.origin), (&self.chains[two], two_end - self.origin)];
        let [first, second] = arms.map(|arm| self.chains[arm].root(&self.body, &self.poses));
        let Some(axis) = (second - first).try_normalize() else { return false };
        let shoulders = 0.5 * (first + second);
        lean.take(&self.candidates);
        let Lean { trunk, points, weight, staying, leaning, tried, distances, trial, best, .. } = lean;
        let mut explain = |limb: usize, poses: &[Pose], least: &mut [f32]| {
            self.body.limbs()[limb].shape.approximate_distances(&poses[limb], points, distances);
            for (least, distance) in least.iter_mut().zip(distances.iter()) {
                *least = least.min(distance.abs());
            }
        };
        let seen = |limb: usize, poses: &[Pose]| look(views, &self.body.limbs()[limb], &poses[limb]).cost();
        staying.resize(points.len(), f32::INFINITY);
        let stands = |limb: usize| legs.iter().any(|(leg, _)| leg.limbs().any(|own| own == limb));
        for limb in (0..self.poses.len()).filter(|limb| !trunk.contains(limb) && !stands(*limb)) {
            explain(limb, &self.poses, staying);
        }
        let mut least = f64::INFINITY;
        for angle in LEANS {
            trial.clone_from(&self.poses);
            leaning.clone_from(staying);
            let turn = Quat::from_axis_angle(axis, angle);
            let mut cost = 0.0;
            for limb in trunk.iter().copied() {
                let pose = &self.poses[limb];
                trial[limb] = Pose::from_parts(
                    shoulders + turn * (pose.translation - shoulders),
                    (turn * pose.rotation).normalize(),
                );
                explain(limb, trial, leaning);
                cost += seen(limb, trial);
            }
            for (leg, end) in &legs {
                // Of the bends of a leg the one that costs least.
                let (mut bend, mut least, mut own) = (0.0, f64::INFINITY, 0.0);
                for swivel in 0..SWIVELS {
                    let swivel = TAU * swivel as f64 / SWIVELS as f64;
                    leg.point_at(&self.body, trial, *end, swivel);
                    tried.clone_from(leaning);
                    leg.limbs().for_each(|limb| explain(limb, trial, tried));
                    let against = leg.limbs().map(|limb| seen(limb, trial)).sum::<f64>() + self.strain(leg, trial);
                    let cost = rough_cost(tried, weight) + against;
                    if cost < least {
                        (bend, least, own) = (swivel, cost, against);
                    }
                }
                leg.point_at(&self.body, trial, *end, bend);
                leg.limbs().for_each(|limb| explain(limb, trial, leaning));
                cost += own;
            }
            cost += rough_cost(leaning, weight);
            if cost < least {
                least = cost;
                best.clone_from(trial);
            }
        }
        least < f64::INFINITY
    }
}
