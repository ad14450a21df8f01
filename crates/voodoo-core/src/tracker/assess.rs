//! What the frame says about every limb, and so about the body: measured, inferred or lost.
//!
//! A limb that lies on another explains points that the other explains as well, and the cameras see it where it is: neither
//! proves it right. What only this limb explains, against what of it should show, does; and a camera that sees past it proves
//! it wrong. For arms and legs, `proof` looks closer at what the depth images show; without any, an arm or leg is as good as
//! what it hangs on.
//!
//! That is said twice. What the tracker goes by itself (where a limb ended when all was well, whose girth an outline shows) has to
//! be proven along the whole limb and over several frames. What is told of this frame has to be told before the limb is far off,
//! and it asks for both limbs of an arm or leg: a forearm on an arm that nothing proves may be anything that is seen there.
//!
//! The body's own status rests on support alone, because a lost body is searched: arms on the trunk must not start that. But no
//! body is called tracked of which more than a quarter of the limbs is not measured.

use crate::body::two_bone::TwoBone;
use crate::math::Points;
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::Frame;
use crate::tracker::Tracker;
use crate::tracker::estimate::{LimbStatus, Status};
use crate::visibility::evidence::{EXPLAINED, limb_visibility};
use crate::visibility::limb_support::{LimbSupport, measure_support};
use crate::visibility::render::LimbRaycaster;
use crate::visibility::roundness::roundness;

/// Candidates that are looked at, about.
const SAMPLE: usize = 250;
/// Share of the visible patches that a measured limb alone explains at least, of so many patches at least.
const SUPPORT: f64 = 0.15;
const LEAST: f64 = 8.0;
/// Share of the patches facing a camera that it may see past.
const CONTRADICTED: f64 = 0.3;
/// A limb of which a smaller share shows is hidden.
const SHOWN: f64 = 0.35;
/// The tracker relies on a limb of an arm or leg when what speaks for it less what speaks against it is this at least, of the
/// whole limb and of its outer part.
const RELIABLE: [f64; 2] = [0.14, 0.05];
/// It is told to be measured when it is this for the whole limb, and for the upper one as well: one in twenty good ones is doubted
/// so on the rendered recordings.
const TOLD: f64 = 0.1;
/// The outer part of a limb shows when what speaks for it is this at least.
const SHOWS: f64 = 0.01;
/// Without a depth image, points on a limb that make it measured.
const FEW: f64 = 5.0;
/// Share of the past frames in what is said about a limb: evidence flickers.
const MEMORY: f64 = 0.6;
/// The same for what is told: a limb is lost within few frames.
const SHORT_MEMORY: f64 = 0.4;
/// What is less round is no body, and the share of the past frames in what is known of it: a blurred frame is no cupboard.
const FLAT: f64 = 0.2;
const SLOW_MEMORY: f64 = 0.9;
/// Share of the limbs of a tracked body that are measured at least.
const TRACKED: f64 = 0.75;
/// A site this far from its measurement does not support its limb, metres.
const SITE_REACH: f64 = 0.10;

/// What is known about one limb, over a few frames.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Support {
    /// Share of the visible patches explained by this limb alone.
    alone: f64,
    /// Share of the facing patches that cameras see past.
    contradicted: f64,
    /// Share of the facing patches not hidden.
    shown: f64,
    /// What speaks for this limb and no other, less what speaks against it; of limbs that images show.
    proven: Option<[f64; 2]>,
    /// The same with a short memory.
    lately: Option<[f64; 2]>,
    frames: usize,
}

/// Working memory.
#[derive(Debug, Default)]
pub(crate) struct Judgement {
    limbs: Vec<Support>,
    alone: Vec<f64>,
    sample: Points,
    distances: Vec<f32>,
    /// Distances of the whole sample, limb after limb.
    all: Vec<f32>,
    /// The part of `alone` that no depth image gave.
    clouds: Vec<f64>,
    outlines: Vec<LimbRaycaster>,
    proofs: Vec<LimbSupport>,
    /// Roundness of what is seen where the body is thought to be.
    round: Option<f64>,
    /// The status of the limbs that the tracker goes by.
    reliable: Vec<LimbStatus>,
}

impl Judgement {
    pub(crate) fn clear(&mut self) {
        self.limbs.clear();
        self.reliable.clear();
    }

    /// Whether the tracker relied on a limb in the last frame.
    pub(crate) fn relied_on(&self, limb: usize) -> bool {
        self.reliable.get(limb) == Some(&LimbStatus::Measured)
    }

    /// A pose that somebody vouches for is taken to be on a body until many frames say otherwise.
    pub(crate) fn vouch(&mut self) {
        self.clear();
        self.round = Some(1.0);
    }

    /// Nothing speaks for a new place but what is seen now.
    pub(crate) fn begin(&mut self) {
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

    fn measure_support(&mut self, proof: &LimbSupport) {
        let now = proof.net();
        for (value, keep) in [(&mut self.proven, MEMORY), (&mut self.lately, SHORT_MEMORY)] {
            let mixed = |before: [f64; 2]| [0, 1].map(|part| keep * before[part] + (1.0 - keep) * now[part]);
            *value = proof.known.then(|| value.map_or(now, mixed));
        }
    }

    /// The status the tracker goes by: the one by support, corrected by what images prove of the limb.
    fn reliable(&self, supported: LimbStatus) -> LimbStatus {
        let proven = self.proven.map(|parts| parts[0] >= RELIABLE[0] && parts[1] >= RELIABLE[1]);
        proven.map_or(supported, |proven| self.image_status(proven))
    }

    /// The status that is told of the upper limb of an arm or leg, which ends where its outer part shows or its lower limb begins.
    fn told_upper(&self, lower: &Self, reliable: LimbStatus) -> LimbStatus {
        self.lately.map_or(reliable, |_| self.image_status(self.shows() && (self.outer_shows() || lower.shows())))
    }

    /// The same of the lower limb: on an upper limb that nothing proves, it may be anything as long that is seen there.
    fn told_lower(&self, upper: &Self, reliable: LimbStatus) -> LimbStatus {
        self.lately.map_or(reliable, |_| self.image_status(self.shows() && upper.shows()))
    }

    /// What the images show of the limb is enough to tell that it is measured; so it is where no image says anything.
    fn shows(&self) -> bool {
        self.lately.is_none_or(|[whole, _]| whole >= TOLD)
    }

    fn outer_shows(&self) -> bool {
        self.lately.is_none_or(|[_, outer]| outer >= SHOWS)
    }

    /// The status of a limb that images show.
    fn image_status(&self, proven: bool) -> LimbStatus {
        if proven {
            LimbStatus::Measured
        } else if self.contradicted > CONTRADICTED {
            LimbStatus::Lost
        } else {
            LimbStatus::Inferred
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
    pub(crate) fn judge(&mut self, frame: &Frame) {
        let mut work = std::mem::take(&mut self.judgement);
        let count = self.poses.len();
        if self.candidates.is_empty() && self.correspondences.sites.is_empty() {
            // Nothing was measured: what was known before does not speak for this frame.
            work.limbs.clear();
        }
        work.limbs.resize(count, Support::default());
        self.count_alone(&mut work);
        let views =
            DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin: self.origin };
        measure_support(views, &self.body, &self.poses, &self.chains, &mut work.outlines, &mut work.proofs);
        for limb in 0..count {
            let seen = limb_visibility(views, &self.body.limbs()[limb], &self.poses[limb]).image;
            let visible = seen.front_facing - seen.occluded;
            let alone = work.alone[limb];
            let mut now = if seen.front_facing > 0.0 {
                [alone / visible.max(LEAST), seen.free_space / seen.front_facing, visible / seen.front_facing]
            } else {
                [SUPPORT * alone / FEW, 0.0, 0.0]
            };
            let site = |pair: &&crate::association::correspondence::SitePair| {
                pair.limb == limb && pair.weight > 0.0 && (pair.x - pair.p).length() < SITE_REACH
            };
            let mut proof = work.proofs[limb];
            if self.correspondences.sites.iter().find(site).is_some() {
                now = [1.0, 0.0, 1.0];
                proof.known = false;
            }
            // What other sensors than depth cameras see of a limb no depth image disproves.
            proof.known &= work.clouds[limb] < FEW;
            work.limbs[limb].measure_support(&proof);
            work.limbs[limb].update(now.map(|value| value.min(1.0)));
        }
        let statuses = &mut self.estimate.limb_status;
        statuses.clear();
        statuses.extend(work.limbs.iter().map(Support::status));
        for chain in &self.chains {
            if statuses[chain.lower] == LimbStatus::Measured {
                statuses[chain.lower] = statuses[chain.upper];
            }
        }
        hang(&self.chains, statuses);
        self.estimate.status = overall(statuses);
        for limb in self.chains.iter().flat_map(|chain| [chain.upper, chain.lower]) {
            statuses[limb] = work.limbs[limb].reliable(statuses[limb]);
        }
        hang(&self.chains, statuses);
        if let Some(now) = roundness(views, &self.body, &self.poses) {
            work.round = Some(work.round.map_or(now, |before| SLOW_MEMORY * before + (1.0 - SLOW_MEMORY) * now));
        }
        if work.round.is_some_and(|round| round < FLAT) {
            self.estimate.status = Status::Lost;
            statuses.fill(LimbStatus::Lost);
        }
        self.judgement = work;
    }

    /// Keeps the limbs' status that the tracker goes by, and tells the other; no body is tracked of which too many limbs are not
    /// measured. After the search, which goes by support.
    pub(crate) fn admit_doubt(&mut self) {
        let Self { judgement, chains, estimate, .. } = self;
        let statuses = &mut estimate.limb_status;
        judgement.reliable.clone_from(statuses);
        // A body that is lost altogether has no limb that is not.
        if statuses.iter().any(|status| *status != LimbStatus::Lost) {
            for chain in &*chains {
                let [upper, lower] = [chain.upper, chain.lower].map(|limb| &judgement.limbs[limb]);
                statuses[chain.upper] = upper.told_upper(lower, statuses[chain.upper]);
                statuses[chain.lower] = lower.told_lower(upper, statuses[chain.lower]);
            }
            hang(chains, statuses);
            for chain in &*chains {
                // A forearm may be known by its inner part, but not the hand.
                let hidden =
                    statuses[chain.lower] == LimbStatus::Measured && !judgement.limbs[chain.lower].outer_shows();
                chain.ends.iter().filter(|_| hidden).for_each(|end| statuses[*end] = LimbStatus::Inferred);
            }
        }
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

/// Hands and feet show too few patches to tell on their own.
fn hang(chains: &[TwoBone], statuses: &mut [LimbStatus]) {
    for chain in chains {
        chain.ends.iter().for_each(|end| statuses[*end] = statuses[chain.lower]);
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
