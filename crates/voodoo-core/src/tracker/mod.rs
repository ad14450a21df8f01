//! The tracker: `step` names the method.

use rayon::prelude::*;

use crate::association::assignment::{Assignment, match_limb};
use crate::association::contour::Contours;
use crate::association::correspondence::{Correspondences, LimbMatches};
use crate::association::visible_side::match_visible_side;
use crate::body::two_bone::TwoBone;
use crate::body::{Body, Pair};
use crate::config::Config;
use crate::error::TrackError;
use crate::math::{Pose, Vec3, shifted};
use crate::observation::background::Backgrounds;
use crate::observation::candidates::{Candidates, body_box};
use crate::observation::depth_view::{DepthViews, find_segmented};
use crate::observation::frame::Frame;
use crate::sizes::girth::Girth;
use crate::solver::{Gate, Problem, Solver, solver};
use crate::tracker::estimate::{Estimate, LimbStatus, Status};
use crate::tracker::motion::predict;

/// Step of a frame from which the outline speaks: earlier, it would push thin limbs off their points (method section 8).
const OUTLINE_FROM: usize = 2;
/// A motion is taken to go on for at most this many of its own intervals.
const LONGEST_PREDICTION: f64 = 2.0;
/// In the second frame after a reset the body's motion is not known yet: this much more of it is unexpected.
const UNKNOWN_MOTION: f64 = 4.0;

/// Follows one body through frames.
#[derive(Debug)]
pub struct Tracker {
    /// The body in its current sizes, and in those it was given in.
    pub(crate) body: Body,
    pub(crate) given: Body,
    pub(crate) config: Config,
    pub(crate) solver: Box<dyn Solver>,
    pub(crate) threads: Option<rayon::ThreadPool>,
    pub(crate) stamp: Option<f64>,
    pub(crate) started: bool,
    /// The next frame shall fit the sizes.
    pub(crate) sizes_open: bool,
    /// Current poses in the working frame, whose origin lies at `origin` in the world.
    pub(crate) poses: Vec<Pose>,
    /// The poses of the frame before and the stamp difference that led to the current ones; none after a reset.
    pub(crate) previous: Vec<Pose>,
    pub(crate) interval: Option<f64>,
    pub(crate) predicted: Vec<Pose>,
    pub(crate) origin: Vec3,
    pub(crate) backgrounds: Backgrounds,
    /// In which images of this frame the body was cut out.
    pub(crate) segmented: Vec<bool>,
    pub(crate) candidates: Candidates,
    pub(crate) assignment: Assignment,
    pub(crate) correspondences: Correspondences,
    pub(crate) contour: Contours,
    pub(crate) measured: Vec<f64>,
    pub(crate) hypotheses: Hypotheses,
    pub(crate) search: Search,
    /// What is known about the girths since the first frame fitted them; empty when they were given.
    pub(crate) girths: Vec<Girth>,
    /// Limbs of one length, how much longer they have become since they were set, and room for the next change.
    pub(crate) pairs: Vec<Pair>,
    pub(crate) stretched: Vec<f64>,
    pub(crate) change: Vec<f64>,
    /// Arms and legs.
    pub(crate) chains: Vec<TwoBone>,
    pub(crate) judgement: Judgement,
    pub(crate) estimate: Estimate,
}

impl Tracker {
    /// A tracker of `body`. It has no pose until [`Tracker::reset`].
    pub fn new(body: Body, config: Config) -> Result<Self, TrackError> {
        let threads = match config.threads {
            1 => None,
            count => Some(rayon::ThreadPoolBuilder::new().num_threads(count).build().map_err(|error| {
                TrackError::measurement("threads", "a number of threads the system can start", error.to_string())
            })?),
        };
        Ok(Self {
            solver: solver(config.solver),
            given: body.clone(),
            body,
            config,
            threads,
            stamp: None,
            started: false,
            sizes_open: false,
            poses: Vec::new(),
            previous: Vec::new(),
            interval: None,
            predicted: Vec::new(),
            origin: Vec3::ZERO,
            backgrounds: Backgrounds::default(),
            segmented: Vec::new(),
            candidates: Candidates::default(),
            assignment: Assignment::default(),
            correspondences: Correspondences::default(),
            contour: Contours::default(),
            measured: Vec::new(),
            hypotheses: Hypotheses::default(),
            search: Search::default(),
            girths: Vec::new(),
            pairs: Vec::new(),
            stretched: Vec::new(),
            change: Vec::new(),
            chains: Vec::new(),
            judgement: Judgement::default(),
            estimate: Estimate::default(),
        })
    }

    /// The body in its current sizes.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The parameters.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The last estimate.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Sets the pose, and with `fit_sizes` the sizes, from positions of named sites (index of the site, world position);
    /// sizes are fitted from those the body was given in, not from those of an earlier reset. Time may start anew afterwards.
    /// The tracker is unchanged on error.
    pub fn reset(&mut self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<&Estimate, TrackError> {
        if let Some((site, _)) = positions.iter().find(|(site, _)| *site >= self.body.sites().len()) {
            return Err(TrackError::measurement("joints", "the index of a site", site.to_string()));
        }
        let start = if fit_sizes { &self.given } else { &self.body };
        let (body, poses) = start.fit(positions, fit_sizes)?;
        self.restart(body, poses);
        self.sizes_open = fit_sizes;
        if fit_sizes && self.config.fit_lengths {
            self.follow_lengths();
        }
        Ok(&self.estimate)
    }

    /// Sets the pose of every limb directly.
    pub fn reset_pose(&mut self, world_from_limb: &[Pose]) -> Result<&Estimate, TrackError> {
        let count = self.body.limbs().len();
        if world_from_limb.len() != count || !world_from_limb.iter().all(Pose::is_finite) {
            return Err(TrackError::measurement(
                "world_from_limb",
                "one finite pose a limb",
                format!("{} pose(s) for {count} limbs", world_from_limb.len()),
            ));
        }
        self.restart(self.body.clone(), world_from_limb.to_vec());
        Ok(&self.estimate)
    }

    pub(crate) fn restart(&mut self, body: Body, world_from_limb: Vec<Pose>) {
        self.body = body;
        self.prepare_hypotheses();
        self.poses = world_from_limb;
        self.origin = Vec3::ZERO;
        self.prepare_search();
        self.stamp = None;
        self.interval = None;
        self.previous.clear();
        self.started = true;
        self.sizes_open = false;
        self.girths.clear();
        self.pairs.clear();
        self.correspondences.limbs.clear();
        self.correspondences.sites.clear();
        self.correspondences.contour.clear();
        self.candidates = Candidates::default();
        self.backgrounds.clear();
        self.report(f64::NAN, 0);
        // The caller vouches for a pose that was set.
        self.estimate.status = Status::Tracking;
        self.judgement.vouch();
        self.estimate.limb_status.clear();
        self.estimate.limb_status.resize(self.poses.len(), LimbStatus::Inferred);
    }

    /// The pose at the next instant (K06 IV-B). On error the tracker is as before.
    pub fn step(&mut self, frame: &Frame) -> Result<&Estimate, TrackError> {
        if !self.started {
            return Err(TrackError::NotInitialised);
        }
        frame.check(&self.body, self.stamp)?;
        self.move_origin();
        let pace = self.predict(frame.stamp);
        find_segmented(frame, &mut self.segmented);
        // 1 Prefilter the free points by the enlarged box of the whole body.
        let bounds = body_box(&self.body, &self.poses, self.config.body_box_margin);
        if self.config.background {
            self.learn_background(frame, &bounds);
        }
        self.candidates.gather(frame, self.origin, &bounds, &self.backgrounds, &self.config);
        if std::mem::take(&mut self.sizes_open) {
            self.fit_sizes(frame);
        }
        self.lead(frame, pace);
        let mut steps = 0;
        let mut previous = f64::INFINITY;
        while steps < self.config.max_steps {
            if self.solver.renews(steps) {
                self.match_all(frame, steps);
            } else {
                self.match_again(frame, steps);
            }
            let distance = self.correspondences.mean_squared_distance().unwrap_or(0.0);
            self.solve(pace, steps);
            steps += 1;
            if (previous - distance).abs() < self.config.min_change {
                break;
            }
            previous = distance;
        }
        self.match_last(frame);
        if self.config.hypotheses && self.solver.starts_from_prediction() && self.stamp.is_some() {
            steps += self.try_hypotheses(frame, pace);
        }
        if !(self.pairs.is_empty() && self.girths.is_empty()) && self.config.max_steps >= OUTLINE_FROM {
            // Sizes follow the outline.
            self.find_outline(frame);
            self.contour.pairs(&self.poses, &mut self.correspondences.contour);
        }
        if !self.pairs.is_empty() && self.estimate.status != Status::Lost {
            self.refine_lengths(pace);
        }
        if self.solver.starts_from_prediction() {
            self.refine_girths();
        }
        self.interval = self.stamp.map(|stamp| frame.stamp - stamp);
        self.stamp = Some(frame.stamp);
        self.report(frame.stamp, steps);
        self.judge(frame);
        if self.config.recovery && self.solver.starts_from_prediction() {
            self.search(frame);
        }
        self.remember_ends();
        self.admit_doubt();
        Ok(&self.estimate)
    }

    /// Keeps the working frame near the body, so that single precision is enough for points.
    pub(crate) fn move_origin(&mut self) {
        let shift = self.poses[0].translation;
        self.origin += shift;
        for pose in self.poses.iter_mut().chain(&mut self.previous) {
            *pose = shifted(pose, shift);
        }
    }

    /// Steps 2-5 at the current poses: everything measured becomes a correspondence.
    pub(crate) fn match_all(&mut self, frame: &Frame, step: usize) {
        // 2 Assign points to limbs.
        let gate = self.solver.gate(&self.config, step);
        self.assign(&gate);
        if step >= OUTLINE_FROM {
            self.find_outline(frame);
        } else {
            self.contour.clear();
        }
        self.match_now(frame, &gate, true);
    }

    /// The same after the last step, but for the outline: it moves nothing any more.
    pub(crate) fn match_last(&mut self, frame: &Frame) {
        let gate = self.solver.gate(&self.config, self.config.max_steps);
        self.assign(&gate);
        self.contour.clear();
        self.match_now(frame, &gate, true);
    }

    pub(crate) fn find_outline(&mut self, frame: &Frame) {
        if self.config.outline {
            let views =
                DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin: self.origin };
            self.contour.find(&self.body, &self.poses, views.iter());
        }
    }

    /// Steps 3-5: points stay with their limbs, rims with their edges.
    pub(crate) fn match_again(&mut self, frame: &Frame, step: usize) {
        let gate = self.solver.gate(&self.config, step);
        self.match_now(frame, &gate, false);
    }

    pub(crate) fn match_now(&mut self, frame: &Frame, gate: &Gate, assigned: bool) {
        // 3 Reduce the number of points, 4 find closest points.
        self.match_points(gate, assigned, self.config.facing && self.solver.faces_cameras());
        // 4 Point-to-point relations, 5 closest points on rays.
        self.correspondences.add_sites(&self.body, &self.poses, frame, self.origin);
        self.contour.pairs(&self.poses, &mut self.correspondences.contour);
    }

    /// Lets the solver follow the named sites before the frame's steps.
    pub(crate) fn lead(&mut self, frame: &Frame, pace: f64) {
        let named = !frame.positions.is_empty() || !frame.rays.is_empty();
        let mut step = 0;
        loop {
            if named && self.solver.leads_with_points() {
                self.match_all(frame, 0);
            } else {
                self.correspondences.add_sites(&self.body, &self.poses, frame, self.origin);
            }
            let Self { body, correspondences, previous, config, solver, poses, .. } = self;
            if !solver.lead(&Problem { body, correspondences, predicted: previous, step, pace, config }, poses) {
                break;
            }
            step += 1;
        }
    }

    /// One ICP step (2-7).
    pub(crate) fn match_and_solve(&mut self, frame: &Frame, pace: f64, step: usize) {
        self.match_all(frame, step);
        self.solve(pace, step);
    }

    /// Moves the body to what was matched.
    pub(crate) fn solve(&mut self, pace: f64, step: usize) {
        // 6 Elastic bands on both limbs.
        if self.solver.reads_bands() {
            self.correspondences.add_bands(&self.body, &self.poses, self.config.band_ratio, &mut self.measured);
        }
        // 7 Fit the model.
        let Self { body, correspondences, predicted, config, solver, poses, .. } = self;
        solver.solve(&Problem { body, correspondences, predicted, step, pace, config }, poses);
    }

    /// Sets the predicted poses, and the current ones to them where the solver wants it; the current ones become the previous.
    /// Returns the time since the last frame in units of 1/30 s, held to what a motion model can say.
    pub(crate) fn predict(&mut self, stamp: f64) -> f64 {
        let step = self.stamp.map(|last| stamp - last);
        let ratio = match (step, self.interval) {
            (Some(step), Some(interval)) => (step / interval).min(LONGEST_PREDICTION),
            _ => 0.0,
        };
        if self.previous.len() != self.poses.len() {
            self.previous.clone_from(&self.poses);
        }
        predict(&self.body, &self.previous, &self.poses, ratio * self.config.prediction, &mut self.predicted);
        self.previous.clone_from(&self.poses);
        if self.solver.starts_from_prediction() {
            self.poses.clone_from(&self.predicted);
        }
        // Unexpected motion of short intervals adds up like noise; over long ones nothing is known of the speed.
        let pace = step.map_or(1.0, |step| (step * 30.0).clamp(0.1, 10.0));
        let pace = pace.max(pace.sqrt());
        match self.interval {
            None if step.is_some() => pace * UNKNOWN_MOTION,
            _ => pace,
        }
    }

    pub(crate) fn assign(&mut self, gate: &Gate) {
        let Self { body, poses, candidates, assignment, config, .. } = self;
        assignment.assign(body, poses, candidates, config.overlap, gate.box_margin);
    }

    /// Closest points of the limbs' candidates; `assigned` says whether those are others than the last time.
    pub(crate) fn match_points(&mut self, gate: &Gate, assigned: bool, facing: bool) {
        let Self { body, poses, candidates, assignment, correspondences, config, threads, .. } = self;
        correspondences.limbs.resize_with(poses.len(), LimbMatches::default);
        let assignment = &*assignment;
        let work = |(index, matches): (usize, &mut LimbMatches)| {
            if assigned {
                assignment.sample_limb(index, candidates, config, matches);
            }
            match_limb(&body.limbs()[index], &poses[index], gate.distance, matches);
            if facing {
                match_visible_side(&body.limbs()[index].shape, &poses[index], candidates, gate.distance, matches);
            }
        };
        match threads {
            // Every limb is worked on by one thread in a fixed order: the result does not depend on their number.
            Some(pool) => pool.install(|| correspondences.limbs.par_iter_mut().enumerate().for_each(work)),
            None => correspondences.limbs.iter_mut().enumerate().for_each(work),
        }
    }
}

mod assess;
pub(crate) mod background_update;
mod edits;
pub mod estimate;
pub mod motion;
mod queries;
mod report;

use crate::hypotheses::Hypotheses;
use crate::relocalize::Search;
use assess::Judgement;
