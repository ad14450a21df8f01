//! What the frame says about every limb, and so about the body: measured, inferred or lost.
//!
//! A limb that lies on another explains points that the other explains as well, and the cameras see it where it is: neither
//! proves it right. What only this limb explains, against what of it should show, does; and a camera that sees past it proves
//! it wrong. For arms and legs, `proof` looks closer at what the depth images show; without any, an arm or leg is as good as
//! what it hangs on.
//!
//! The body's own status rests on support alone, because a lost body is searched: arms on the trunk must not start that. But no
//! body is called tracked of which more than a quarter of the limbs is not measured.

use super::Tracker;
use crate::estimate::{LimbStatus, Status};
use crate::evidence::{EXPLAINED, look};
use crate::frame::Frame;
use crate::geometry::Points;
use crate::proof::{Proof, prove};
use crate::render::Outline;
use crate::roundness::roundness;
use crate::view::Views;

/// Candidates that are looked at, about.
const SAMPLE: usize = 250;
/// Share of the visible patches that a measured limb alone explains at least, of so many patches at least.
const SUPPORT: f64 = 0.15;
const LEAST: f64 = 8.0;
/// Share of the patches facing a camera that it may see past.
const CONTRADICTED: f64 = 0.3;
/// A limb of which a smaller share shows is hidden.
const SHOWN: f64 = 0.35;
/// A limb of an arm or leg is measured when what speaks for it less what speaks against it is this at least, of the whole limb
/// and of its outer part: about one in twenty good ones is doubted so on the rendered recordings.
const PROVEN: [f64; 2] = [0.14, 0.05];
/// Without a depth image, points on a limb that make it measured.
const FEW: f64 = 5.0;
/// Share of the past frames in what is said about a limb: evidence flickers.
const MEMORY: f64 = 0.6;
/// What is less round is no body, and the share of the past frames in what is known of it: a blurred frame is no cupboard.
const FLAT: f64 = 0.2;
const SLOW_MEMORY: f64 = 0.9;
/// Share of the limbs of a tracked body that are measured at least.
const TRACKED: f64 = 0.75;
/// A site this far from its measurement does not support its limb, metres.
const SITE_REACH: f64 = 0.10;

/// What is known about one limb, over a few frames.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Support {
    /// Share of the visible patches explained by this limb alone.
    alone: f64,
    /// Share of the facing patches that cameras see past.
    contradicted: f64,
    /// Share of the facing patches not hidden.
    shown: f64,
    /// What speaks for this limb and no other, less what speaks against it; of limbs that images show.
    proven: Option<[f64; 2]>,
    frames: usize,
}

/// Working memory.
#[derive(Debug, Default)]
pub(super) struct Judgement {
    limbs: Vec<Support>,
    alone: Vec<f64>,
    sample: Points,
    distances: Vec<f32>,
    /// Distances of the whole sample, limb after limb.
    all: Vec<f32>,
    /// The part of `alone` that no depth image gave.
    clouds: Vec<f64>,
    outlines: Vec<Outline>,
    proofs: Vec<Proof>,
    /// Roundness of what is seen where the body is thought to be.
    round: Option<f64>,
}

impl Judgement {
    pub(super) fn clear(&mut self) {
        self.limbs.clear();
    }

    /// A pose that somebody vouches for is taken to be on a body until many frames say otherwise.
    pub(super) fn vouch(&mut self) {
        self.limbs.clear();
        self.round = Some(1.0);
    }

    /// Nothing speaks for a new place but what is seen now.
    pub(super) fn begin(&mut self) {
        self.limbs.clear();
        self.round = None;
    }
}

impl Support {
    fn update(&mut self, now: [f64; 3]) {
        let keep = if self.frames == 0 { 0.0 } else { MEMORY };
        for (value, now) in [&mut self.alone, &mut self.contradicted, &mut self.shown].into_iter().zip(now) {
            *value = keep * *value + (1.0 - keep) * now;
        }
        self.frames += 1;
    }

    fn prove(&mut self, proof: &Proof) {
        let now = proof.net();
        let mixed = |before: [f64; 2]| [0, 1].map(|part| MEMORY * before[part] + (1.0 - MEMORY) * now[part]);
        self.proven = proof.known.then(|| self.proven.map_or(now, mixed));
    }

    /// The status by support, corrected by what images prove of the limb.
    fn proven_status(&self, supported: LimbStatus) -> LimbStatus {
        match self.proven {
            None => supported,
            Some([whole, outer]) if whole >= PROVEN[0] && outer >= PROVEN[1] => LimbStatus::Measured,
            Some(_) if self.contradicted > CONTRADICTED => LimbStatus::Lost,
            Some(_) => LimbStatus::Inferred,
        }
    }

    fn status(&self) -> LimbStatus {
        if self.alone >= SUPPORT && self.contradicted <= CONTRADICTED {
            LimbStatus::Measured
        } else if self.shown < SHOWN && self.contradicted <= CONTRADICTED {
            LimbStatus::Inferred
        } else {
            LimbStatus::Lost
        }
    }
}

impl Tracker {
    /// Fills the status of the limbs and of the body.
    pub(super) fn judge(&mut self, frame: &Frame) {
        let mut work = std::mem::take(&mut self.judgement);
        let count = self.poses.len();
        if self.candidates.is_empty() && self.correspondences.sites.is_empty() {
            // Nothing was measured: what was known before does not speak for this frame.
            work.limbs.clear();
        }
        work.limbs.resize(count, Support::default());
        self.count_alone(&mut work);
        let views = Views { frame, backgrounds: &self.backgrounds, cut_out: &self.cut_out, origin: self.origin };
        prove(views, &self.body, &self.poses, &self.chains, &mut work.outlines, &mut work.proofs);
        for limb in 0..count {
            let seen = look(views, &self.body.limbs()[limb], &self.poses[limb]);
            let visible = seen.facing - seen.hidden;
            let alone = work.alone[limb];
            let mut now = if seen.facing > 0.0 {
                [alone / visible.max(LEAST), seen.contradicted / seen.facing, visible / seen.facing]
            } else {
                [SUPPORT * alone / FEW, 0.0, 0.0]
            };
            let site = |pair: &&crate::correspondence::SitePair| {
                pair.limb == limb && pair.weight > 0.0 && (pair.x - pair.p).length() < SITE_REACH
            };
            let mut proof = work.proofs[limb];
            if self.correspondences.sites.iter().find(site).is_some() {
                now = [1.0, 0.0, 1.0];
                proof.known = false;
            }
            // What other sensors than depth cameras see of a limb no depth image disproves.
            proof.known &= work.clouds[limb] < FEW;
            work.limbs[limb].prove(&proof);
            work.limbs[limb].update(now.map(|value| value.min(1.0)));
        }
        let statuses = &mut self.estimate.limb_status;
        statuses.clear();
        statuses.extend(work.limbs.iter().map(Support::status));
        let hang = |statuses: &mut Vec<LimbStatus>| {
            for chain in &self.chains {
                // Hands and feet show too few patches to tell on their own.
                for end in &chain.ends {
                    statuses[*end] = statuses[chain.lower];
                }
            }
        };
        for chain in &self.chains {
            if statuses[chain.lower] == LimbStatus::Measured {
                statuses[chain.lower] = statuses[chain.upper];
            }
        }
        hang(statuses);
        self.estimate.status = overall(statuses);
        for limb in self.chains.iter().flat_map(|chain| [chain.upper, chain.lower]) {
            statuses[limb] = work.limbs[limb].proven_status(statuses[limb]);
        }
        hang(statuses);
        if let Some(now) = roundness(views, &self.body, &self.poses) {
            work.round = Some(work.round.map_or(now, |before| SLOW_MEMORY * before + (1.0 - SLOW_MEMORY) * now));
        }
        if work.round.is_some_and(|round| round < FLAT) {
            self.estimate.status = Status::Lost;
            statuses.fill(LimbStatus::Lost);
        }
        self.judgement = work;
    }

    /// No body is tracked of which too many limbs are not measured; after the search, which goes by support.
    pub(super) fn admit_doubt(&mut self) {
        if self.estimate.status == Status::Tracking && measured_share(&self.estimate.limb_status) < TRACKED {
            self.estimate.status = Status::Degraded;
        }
    }

    /// Weight of the candidates that each limb explains and no other but its neighbours.
    fn count_alone(&self, work: &mut Judgement) {
        let Judgement { alone, sample, distances, all, clouds, .. } = work;
        let count = self.poses.len();
        let pixels = self.candidates.cameras.last().map_or(0, |(end, _)| *end as usize);
        for counts in [&mut *alone, &mut *clouds] {
            counts.clear();
            counts.resize(count, 0.0);
        }
        let step = (self.candidates.len() / SAMPLE).max(1);
        let points = &self.candidates.points;
        sample.clear();
        for index in (0..points.len()).step_by(step) {
            sample.push([points.x[index], points.y[index], points.z[index]]);
        }
        all.clear();
        for (limb, pose) in self.body.limbs().iter().zip(&self.poses) {
            limb.shape.approximate_distances(pose, sample, distances);
            all.extend(distances.iter().map(|distance| distance.abs()));
        }
        for place in 0..sample.len() {
            let distance = |limb: usize| all[limb * sample.len() + place];
            let closest = (1..count).fold(0, |best, limb| if distance(limb) < distance(best) { limb } else { best });
            if distance(closest) >= EXPLAINED as f32 {
                continue;
            }
            let rival = |other: &usize| {
                *other != closest && distance(*other) <= EXPLAINED as f32 && !self.body.adjacent(*other, closest)
            };
            if (0..count).find(rival).is_none() {
                let weight = f64::from(self.candidates.weight[place * step]) * step as f64;
                alone[closest] += weight;
                clouds[closest] += if place * step < pixels { 0.0 } else { weight };
            }
        }
    }
}

fn measured_share(limbs: &[LimbStatus]) -> f64 {
    limbs.iter().filter(|limb| **limb == LimbStatus::Measured).count() as f64 / limbs.len() as f64
}

/// Lost without a measured root and half of the limbs; degraded when more than a quarter of the limbs are not measured.
fn overall(limbs: &[LimbStatus]) -> Status {
    let measured = measured_share(limbs);
    if measured < 0.25 || (limbs[0] != LimbStatus::Measured && measured < 0.5) {
        Status::Lost
    } else if measured < TRACKED {
        Status::Degraded
    } else {
        Status::Tracking
    }
}
