//! Finding a lost body again: wherever in the frame something of its size is seen that is not background.
//!
//! The body is put there as it stood when it was last tracked and as it stands at rest, upright, turned every way; the best
//! are refined, and the one that explains the frame best by the score of all hypotheses is kept if it is not lost itself.
//! Depth hardly tells a person's front from the back. What a body cannot do since it was last seen (turn far in short time)
//! and does not do (walk backwards) costs as well.

mod seeds;

use crate::hypotheses::proposals::thin;
use crate::hypotheses::score::limit_strain;
use crate::math::{Aabb, Points, Pose, Quat, Vec3};
use crate::observation::candidates::{REFERENCE_PATCH, body_box};
use crate::observation::frame::Frame;
use crate::observation::segments::{Segment, Segments};
use crate::tracker::Tracker;
use crate::tracker::estimate::{LimbStatus, Status};
use seeds::{Trial, put};

/// The body is searched from this many frames on in which it was lost.
const PATIENCE: usize = 3;
/// After it was found, every so manyth frame is searched again for so long, seconds, or until it was seen to walk: another
/// facing may prove better.
const WATCH: f64 = 5.0;
const WATCHED: usize = 5;
/// The opposite facing explains a frame worse by this, in patches, or it is waited for so long for evidence, seconds.
const DECIDED: f64 = 100.0;
const WAIT: f64 = 0.5;
/// A blob shows at least this share of the surface that a camera can see of the body.
const SHARE: f64 = 0.25;
/// Its extents as shares of the body's, at rest: the longer one at least, the upright one and the others at most.
const EXTENT: [f64; 3] = [0.35, 1.4, 1.5];
/// A person's box is enlarged by this, metres.
const MARGIN: f64 = 0.20;
/// Segments that are tried.
const BLOBS: usize = 2;
/// Points that rough trials look at.
const SAMPLE: usize = 300;
/// Rough trials that are refined, in so many ICP steps, with motion this much freer than between two frames.
const REFINED: usize = 4;
const STEPS: usize = 10;
const FREEDOM: f64 = 6.0;
/// A blob of which a larger share lies farther than this (m) from the body is none.
const MOST_STRAY: f64 = 0.15;
const STRAY: f64 = 0.07;
/// Patches by which a place must be better than the present pose.
const GAIN: f64 = 40.0;
/// Cost of the opposite direction, in patches, for a body that just stood the other way or that walks backwards.
const TURNED: f64 = 120.0;
/// How far a body turns before that counts, radians: at once, and for every second.
const TURN: [f64; 2] = [0.5, 2.0];
/// A blob that moves faster than this (m/s), and by more than this (m), walks; seen over so many seconds.
const WALK: [f64; 2] = [0.3, 0.2];
const WALKED: f64 = 0.7;
/// A blob farther than this from where it was in the frame before is another one, metres.
const JUMP: f64 = 0.4;

/// Working memory, and what is remembered of the lost body.
#[derive(Debug, Default)]
pub(crate) struct Search {
    blobs: Segments,
    sample: Points,
    weights: Vec<f64>,
    best: Vec<f32>,
    distances: Vec<f32>,
    /// Poses at rest with the root at the origin; as last tracked, and when.
    rest: Vec<Pose>,
    kept: Vec<Pose>,
    tracked: Option<f64>,
    /// Up in the world, as the body stood when it was set.
    up: Vec3,
    /// Height and visible patches of the body at rest.
    height: f64,
    patches: f64,
    /// Frames in a row in which it was lost, and until when the search goes on.
    lost: usize,
    watch: Option<f64>,
    watched: usize,
    /// Since when something is seen that may be the body, where it was a while ago and was last, world.
    seen: f64,
    first: Option<(f64, Vec3)>,
    last: Vec3,
    /// Whether the present pose explains the blob it stands in, if there is any.
    explains: Option<bool>,
    trials: Vec<Trial>,
    trial: Vec<Pose>,
    before: Vec<Pose>,
    expected: Vec<Pose>,
    winner: Vec<Pose>,
}

impl Tracker {
    /// Forgets everything that was remembered of an earlier track.
    pub(crate) fn prepare_search(&mut self) {
        let work = &mut self.search;
        work.rest = self.body.rest_pose(Pose::identity());
        let bounds = body_box(&self.body, &work.rest, 0.0);
        work.height = bounds.extents().max_element();
        let area = |shape: &crate::shape::TaperedEllipticCylinder| {
            0.5 * shape.length() * (shape.a0() + shape.a1() + shape.b0() + shape.b1())
        };
        work.patches = self.body.limbs().iter().map(|limb| area(&limb.shape)).sum::<f64>() / REFERENCE_PATCH;
        work.up = self.poses.first().map_or(Vec3::Z, |pose| pose.rotation * Vec3::Z);
        work.kept.clone_from(&self.poses);
        (work.tracked, work.first, work.watch, work.lost) = (None, None, None, 0);
    }

    /// In how many of the last frames the body was lost, from the one on in which the search began; `None` otherwise.
    pub(crate) fn searching(&self) -> Option<usize> {
        self.search.lost.checked_sub(PATIENCE)
    }

    /// Remembers a tracked body; looks for a lost one, and takes it where it is found.
    pub(crate) fn search(&mut self, frame: &Frame) {
        let mut work = std::mem::take(&mut self.search);
        // A depth camera that is silent for a while is no sign that the body went.
        let silent = frame.images.is_empty() && !self.backgrounds.is_empty();
        if self.estimate.status == Status::Lost {
            work.lost += usize::from(!silent);
        } else if work.lost < PATIENCE {
            work.lost = 0;
        }
        work.watch = work.watch.filter(|until| frame.stamp < *until);
        work.watched += 1;
        let watched = work.watch.is_some() && work.watched.is_multiple_of(WATCHED);
        if work.lost >= PATIENCE || watched {
            work.blobs.find(frame, self.origin, &self.backgrounds, &self.config);
            self.follow_blob(&mut work, frame);
            let found = self.find_again(&mut work, frame);
            if found || (work.explains != Some(false) && self.estimate.status == Status::Tracking) {
                work.lost = 0;
                work.watch = work.watch.or(Some(frame.stamp + WATCH));
            } else if work.lost > 0 && work.explains == Some(false) {
                // What a lost tracker slid onto is no body as long as it leaves much of every blob unexplained.
                self.estimate.status = Status::Lost;
                self.estimate.limb_status.fill(LimbStatus::Lost);
            }
            if work.lost == 0
                && let Some(walked) = walked(&work, frame.stamp)
                && (self.poses[0].rotation * Vec3::X).dot(walked) > 0.5
            {
                work.watch = None;
            }
        } else if work.watch.is_none() {
            work.first = None;
            if self.estimate.status == Status::Tracking {
                work.kept.clone_from(&self.poses);
                work.tracked = Some(frame.stamp);
            }
        }
        self.search = work;
    }

    /// Whether a blob may be the body.
    fn fits(&self, work: &Search, blob: &Segment) -> bool {
        let extents = blob.high - blob.low;
        let [least, upright, across] = EXTENT.map(|share| share * work.height);
        let tall = extents.dot(work.up.abs());
        let wide = (extents - work.up.abs() * tall).max_element();
        blob.patches > SHARE * work.patches && tall.max(wide) > least && tall < upright && wide < across
    }

    /// Remembers since when, and from where on, the largest blob moves.
    fn follow_blob(&self, work: &mut Search, frame: &Frame) {
        let Some(blob) = work.blobs.found().iter().find(|blob| self.fits(work, blob)) else {
            work.first = None;
            return;
        };
        let place = blob.centre + self.origin;
        let jumped = (place - work.last).length() > JUMP;
        if work.first.is_none() || jumped {
            work.seen = frame.stamp;
        }
        if jumped || work.first.is_none_or(|(since, _)| frame.stamp - since > WALKED) {
            work.first = Some((frame.stamp, place));
        }
        work.last = place;
    }

    /// Tries the body at every blob; true when it was found.
    fn find_again(&mut self, work: &mut Search, frame: &Frame) -> bool {
        if let Some(ground) = frame.ground {
            work.up = ground.normal;
        }
        work.explains = None;
        let mut found: Option<f64> = None;
        work.before.clone_from(&self.poses);
        let mut tried = 0;
        for index in 0..work.blobs.found().len() {
            let blob = work.blobs.found()[index];
            if !self.fits(work, &blob) {
                continue;
            }
            tried += 1;
            if tried > BLOBS {
                break;
            }
            if let Some(gain) = self.try_blob(work, &blob, frame)
                && found.is_none_or(|best| gain > best)
            {
                found = Some(gain);
                work.winner.clone_from(&work.trial);
            }
            self.poses.clone_from(&work.before);
        }
        if found.is_none() {
            return false;
        }
        let steps = self.estimate.steps;
        self.poses.clone_from(&work.winner);
        self.settle(frame, steps);
        if self.estimate.status != Status::Lost {
            // Nothing is known of how it moves.
            self.previous.clear();
            self.interval = None;
            return true;
        }
        self.poses.clone_from(&work.before);
        self.settle(frame, steps);
        false
    }

    /// Estimate and status of this frame for other poses.
    fn settle(&mut self, frame: &Frame, steps: usize) {
        let bounds = body_box(&self.body, &self.poses, self.config.body_box_margin);
        self.candidates.gather(frame, self.origin, &bounds, &self.backgrounds, &self.config);
        self.match_all(frame, self.config.max_steps);
        self.report(frame.stamp, steps);
        self.judgement.begin();
        self.judge(frame);
    }

    /// The best pose at a blob, into `work.trial`, and how much better than the present one it is.
    fn try_blob(&mut self, work: &mut Search, blob: &Segment, frame: &Frame) -> Option<f64> {
        let bounds = Aabb::new(blob.low - Vec3::splat(MARGIN), blob.high + Vec3::splat(MARGIN));
        self.candidates.gather(frame, self.origin, &bounds, &self.backgrounds, &self.config);
        let total: f64 = self.candidates.weight.iter().map(|weight| f64::from(*weight)).sum();
        let last = self.config.max_steps;
        self.match_all(frame, last);
        let present = self.place_score(work, frame, total);
        self.draw_sample(work);
        let explains = self.stray_share(work) < MOST_STRAY;
        work.explains = Some(explains || work.explains == Some(true));
        self.rough_trials(work, blob, frame);
        let mut best = present - GAIN;
        let mut found = false;
        let mut opposite = f64::INFINITY;
        let stood = self.poses[0].rotation * Vec3::X;
        let mut ahead = stood;
        work.expected.clone_from(&self.predicted);
        for index in 0..work.trials.len() {
            let trial = work.trials[index];
            put(work, &trial, &mut self.poses);
            self.predicted.clone_from(&self.poses);
            for step in 0..STEPS {
                self.match_all(frame, step);
                self.solve(FREEDOM, step);
            }
            self.match_all(frame, last);
            let score = self.place_score(work, frame, total);
            let faces = self.poses[0].rotation * Vec3::X;
            let turned = faces.dot(ahead) < 0.0;
            let stray = self.stray_share(work);
            // A body that is where it should be may only turn out to face the other way.
            let allowed = !(explains || work.lost == 0) || faces.dot(stood) < 0.0;
            if allowed && score < best && stray < MOST_STRAY {
                if turned {
                    opposite = best;
                }
                best = score;
                found = true;
                ahead = faces;
                work.trial.clone_from(&self.poses);
            } else if turned {
                opposite = opposite.min(score);
            }
        }
        self.predicted.clone_from(&work.expected);
        let decided = opposite - best > DECIDED || frame.stamp - work.seen > WAIT;
        (found && decided).then_some(present - best)
    }

    /// The points at a blob that rough looks are taken at.
    fn draw_sample(&self, work: &mut Search) {
        let Search { sample, weights, .. } = work;
        let points = &self.candidates.points;
        sample.clear();
        for index in 0..points.len() {
            sample.push([points.x[index], points.y[index], points.z[index]]);
        }
        weights.clear();
        weights.extend(self.candidates.weight.iter().map(|weight| f64::from(*weight)));
        thin(sample, weights, SAMPLE);
    }

    /// Share of the points at the blob that lie farther than this from the body.
    fn stray_share(&self, work: &mut Search) -> f64 {
        let Search { sample, weights, best, distances, .. } = work;
        best.clear();
        best.resize(sample.len(), f32::INFINITY);
        for (limb, pose) in self.body.limbs().iter().zip(&self.poses) {
            limb.shape.approximate_distances(pose, sample, distances);
            for (best, distance) in best.iter_mut().zip(distances.iter()) {
                *best = best.min(distance.abs());
            }
        }
        let stray = best.iter().zip(weights.iter()).filter(|(distance, _)| f64::from(**distance) > STRAY);
        stray.map(|(_, weight)| weight).sum::<f64>() / weights.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// The score of all hypotheses, without the motion since the last frame, and what facing and named sites say.
    fn place_score(&mut self, work: &Search, frame: &Frame, total: f64) -> f64 {
        let previous = std::mem::take(&mut self.previous);
        let score = self.overall_cost(frame).total;
        self.previous = previous;
        score.min(4.0 * total)
            + self.facing_cost(work, self.poses[0].rotation, frame.stamp)
            + self.all_sites_missed()
            + self.joints_strained()
    }

    /// Cost of the broken limits of joints that belong to no arm or leg, or end one: a foot that points backwards.
    fn joints_strained(&self) -> f64 {
        let inner = |limb: usize| self.chains.iter().any(|chain| limb == chain.upper || limb == chain.lower);
        let others = (1..self.poses.len()).filter(|limb| !inner(*limb));
        others.map(|limb| limit_strain(&self.body, &self.poses, limb)).sum()
    }

    /// Cost of a direction the body stands in.
    fn facing_cost(&self, work: &Search, root: Quat, stamp: f64) -> f64 {
        let level = |v: Vec3| (v - work.up * v.dot(work.up)).normalize_or_zero();
        let ahead = level(root * Vec3::X);
        let mut cost = 0.0;
        if let (Some(tracked), Some(pose)) = (work.tracked, work.kept.first()) {
            let turn = level(pose.rotation * Vec3::X).angle_between(ahead);
            let free = TURN[0] + TURN[1] * (stamp - tracked);
            cost += TURNED * if turn.is_finite() { (turn / free).powi(2).min(1.0) } else { 0.0 };
        }
        walked(work, stamp).map_or(cost, |direction| cost + TURNED * (1.0 - ahead.dot(direction)))
    }
}

/// Where to what may be the body walks, if it does.
fn walked(work: &Search, stamp: f64) -> Option<Vec3> {
    let (since, first) = work.first?;
    let way = work.last - first;
    let way = way - work.up * way.dot(work.up);
    (way.length() > WALK[1].max(WALK[0] * (stamp - since))).then(|| way.normalize_or_zero())
}
