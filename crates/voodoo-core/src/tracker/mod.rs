//! The tracker of one body. [`BodyTracker::step`] documents the method.

mod assess;
mod edits;
pub(crate) mod estimate;
pub(crate) mod expected;
mod queries;

use crate::body::{Body, Model};
use crate::config::Config;
use crate::detect::{Detect, DetectError, Detected, PlacedDetection};
use crate::error::TrackError;
use crate::fit::{Context, Fit, Motion, Setting};
use crate::hypotheses::Hypotheses;
use crate::math::{Pose, Vec3, refill};
use crate::observation::candidates::body_box;
use crate::observation::frame::{Frame, check_poses};
use crate::observation::observer::Observer;
use crate::observation::ownership::OwnershipMask;
use crate::relocalize::{DetectionVerdict, Reasons, Relocalizer, distance_cost, trunk_is_elsewhere};
use crate::sizes::{Sizes, Start};
use crate::uncertainty::{FittedPose, Uncertainty};
use assess::Assessor;
use estimate::{Estimate, LimbStatus, Status};

/// After this time without a frame the body may be anywhere, in any pose, seconds.
const INTERRUPTION: f64 = 0.5;

/// The tracker of one body, in the part of each frame that shows it: as [`Tracker`](crate::Tracker) and
/// [`People`](crate::People) hold one for every person. It answers queries about the body between two frames, and the body can be
/// edited through it.
///
/// ```
/// use voodoo_core::math::Pose;
/// use voodoo_core::{Body, BodyTracker, Config, HumanModel, Tracker};
///
/// fn height(person: &BodyTracker) -> f64 {
///     person.estimate().sites.iter().map(|site| site.z).fold(0.0, f64::max)
/// }
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let mut tracker = Tracker::new(body.clone(), Config::default())?;
/// tracker.reset_pose(&body.rest_pose(Pose::IDENTITY))?;
/// assert!(height(&tracker) > 0.5); // above the root
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct BodyTracker {
    config: Config,
    model: Model,
    motion: Motion,
    observer: Observer,
    fit: Fit,
    hypotheses: Hypotheses,
    relocalizer: Relocalizer,
    sizes: Sizes,
    assessor: Assessor,
    uncertainty: Uncertainty,
    estimate: Estimate,
    /// The estimate before that one.
    before: Estimate,
    /// Index of the image and pixels of the detection to which the body was moved in this frame: they show no scene.
    pub(crate) moved_to: Option<(usize, Vec<usize>)>,
}

impl BodyTracker {
    /// Returns a tracker of `body`. It has no pose yet.
    pub(crate) fn new(body: Body, config: Config) -> Result<Self, TrackError> {
        config.check()?;
        Ok(Self {
            model: Model::new(body),
            motion: Motion::default(),
            observer: Observer::default(),
            fit: Fit::new(&config)?,
            hypotheses: Hypotheses::default(),
            relocalizer: Relocalizer::default(),
            sizes: Sizes::default(),
            assessor: Assessor::default(),
            uncertainty: Uncertainty::default(),
            estimate: Estimate::default(),
            before: Estimate::default(),
            moved_to: None,
            config,
        })
    }

    /// Replaces the detector, or removes it.
    pub(crate) fn set_detector(&mut self, detector: Option<Box<dyn Detect>>) {
        self.relocalizer.detector.set(detector, &self.model.body);
    }

    /// Whether the tracker searches for the body while it has no pose: it has a detector that supports this body.
    pub fn can_search(&self) -> bool {
        self.relocalizer.detector.knows
    }

    /// The error of the detector in the last step, if it failed. The step then ran without detections.
    pub(crate) fn detector_error(&self) -> Option<&DetectError> {
        self.relocalizer.detector.error.as_ref()
    }

    /// Sets the pose, and with `fit_sizes` the sizes, from positions of named sites (index of the site, world position). Sizes
    /// are fitted starting from those of the body that was given to the tracker, not from those of an earlier reset. Stamps after
    /// a reset may start again from any time. On error the tracker is unchanged.
    pub(crate) fn reset(&mut self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<&Estimate, TrackError> {
        let (body, poses) = self.model.fit(positions, fit_sizes)?;
        self.restart(body, poses, if fit_sizes { Start::Positions } else { Start::SizesKnown });
        self.relocalizer.forget();
        Ok(&self.estimate)
    }

    /// Sets the pose of every limb directly.
    pub(crate) fn reset_pose(&mut self, world_from_limb: &[Pose]) -> Result<&Estimate, TrackError> {
        check_poses(&self.model.body, world_from_limb)?;
        self.restart(self.model.body.clone(), world_from_limb.to_vec(), Start::SizesKnown);
        self.relocalizer.forget();
        Ok(&self.estimate)
    }

    fn restart(&mut self, body: Body, world_from_limb: Vec<Pose>, start: Start) {
        self.model.adopt(body);
        self.jump();
        self.motion.restart(world_from_limb);
        self.observer.clear();
        self.fit.clear();
        self.hypotheses.restart();
        self.relocalizer.restart(&self.model, &self.motion.poses);
        self.sizes.restart(&self.model, start, &self.config);
        self.assessor.trust_pose();
        self.report(f64::NAN, 0, None);
    }

    /// Updates the pose with the pixels and points of a frame, which the caller has checked, that show this body or nobody (K06
    /// IV-B). A body without a pose stays without.
    pub(crate) fn step(&mut self, frame: &Frame, ownership: OwnershipMask) {
        self.relocalizer.detector.error = None;
        self.moved_to = None;
        if self.is_started() {
            std::mem::swap(&mut self.before, &mut self.estimate);
            // Where the ground plane is not given, the one that the detector found under the body is used.
            let ground = frame.ground.or(self.relocalizer.floor);
            let colors = if self.config.regions { frame.colors } else { &[] };
            let frame = &Frame { ground, colors, ..*frame };
            self.relocate(frame, ownership);
            self.track(frame, ownership);
        }
    }

    /// Forgets the motion: the poses before belong to another place, or to another body.
    fn jump(&mut self) {
        self.motion.forget();
        self.before.stamp = f64::NAN;
    }

    /// Restarts the track at the current detection, in the sizes that were set or, where they clearly differ, in the detected
    /// ones. Returns whether it could.
    fn restart_at_detection(&mut self) -> bool {
        let set = self.sizes.set.as_ref().unwrap_or(&self.model.body);
        let Some((body, poses, _)) = self.relocalizer.fit_detected(&self.model, Some(set)) else { return false };
        self.restart_fitted(body, poses, self.sizes.set.is_none(), self.relocalizer.check.auto_initialized);
        true
    }

    /// Restarts the track with the body and its poses that fit the current detection.
    fn restart_fitted(&mut self, body: Body, poses: Vec<Pose>, sizes_known: bool, auto_initialized: bool) {
        self.restart(body, poses, if sizes_known { Start::SizesKnown } else { Start::Detected });
        self.relocalizer.record_start(auto_initialized);
        self.update_sizes();
    }

    /// Whether the last estimate has a body that is not lost.
    pub(crate) fn is_there(&self) -> bool {
        !matches!(self.estimate.status, Status::Lost | Status::Searching)
    }

    /// Updates the reported lengths of an auto-initialized body with the detection of this frame, if there is one.
    fn update_sizes(&mut self) {
        if let Some(detected) = self.relocalizer.detected().filter(|_| self.sizes.rough) {
            self.sizes.reported.update(detected);
        }
    }

    /// Starts the track at a detection, in the detected sizes or, with `known`, in the sizes that the body has unless these clearly
    /// differ. Returns whether the person is there.
    pub(crate) fn start_at_detection(
        &mut self,
        frame: &Frame,
        ownership: OwnershipMask,
        detection: PlacedDetection,
        known: bool,
    ) -> bool {
        self.moved_to = None;
        self.relocalizer.detection = Some(detection);
        let set = known.then_some(&self.model.body);
        let Some((body, poses, known)) = self.relocalizer.fit_detected(&self.model, set) else { return false };
        self.restart_fitted(body, poses, known, true);
        std::mem::swap(&mut self.before, &mut self.estimate);
        self.assessor.moved();
        self.track(frame, ownership);
        self.is_there()
    }

    /// Starts the track at the frame's measured positions, whose sizes the body gets with `fit_sizes`. Returns whether the person
    /// is there.
    pub(crate) fn start_at_positions(&mut self, frame: &Frame, ownership: OwnershipMask, fit_sizes: bool) -> bool {
        let positions: Vec<(usize, Vec3)> = frame.positions.iter().map(|of| (of.site, of.position)).collect();
        let started = self.reset(&positions, fit_sizes).is_ok();
        if started {
            self.step(frame, ownership);
        }
        started && self.is_there()
    }

    /// Moves the body to a detection in an image (number) of the frame that was stepped last, if that explains the frame better, and
    /// it is not lost there, or is lost where it was not detected. Returns whether the person moved and is there.
    pub(crate) fn recover(
        &mut self,
        frame: &Frame,
        ownership: OwnershipMask,
        image: usize,
        detection: PlacedDetection,
    ) -> bool {
        (self.relocalizer.image, self.relocalizer.detection) = (image, Some(detection));
        let Self { model, motion, relocalizer, assessor, .. } = self;
        let elsewhere = |found| trunk_is_elsewhere(found, &model.body, &motion.poses, motion.origin);
        let lost_here = assessor.status == Status::Lost && relocalizer.detected().is_some_and(elsewhere);
        if !self.is_at_detection(frame, ownership) || !self.move_to_found(frame, ownership, lost_here) {
            return false;
        }
        if self.relocalizer.check.is_new(frame.stamp) && self.restart_at_detection() {
            self.track(frame, ownership);
        } else {
            self.report(frame.stamp, 0, Some(1.0));
        }
        self.is_there()
    }

    /// Removes the pose: no person is there. From the next frame on the tracker searches for one.
    pub(crate) fn stop(&mut self, stamp: f64) {
        self.motion.poses.clear();
        self.motion.stamp = Some(stamp);
        self.estimate = Estimate { stamp, ..Estimate::default() };
    }

    /// Runs the detector where it is due, and moves the body where it is elsewhere: to its detection, or, where a lost body cannot
    /// be detected, to a segment.
    fn relocate(&mut self, frame: &Frame, ownership: OwnershipMask) {
        let Self { config, model, motion, hypotheses, relocalizer, sizes, assessor, .. } = self;
        relocalizer.forget();
        if !config.solver.is_whole_body() {
            return;
        }
        let interrupted = motion.stamp.is_some_and(|last| frame.stamp - last > INTERRUPTION);
        if interrupted {
            assessor.moved();
        }
        let origin = motion.origin;
        let root = origin + motion.expect(&model.body, frame.stamp, config.prediction)[0].translation;
        let suspect = hypotheses.has_excess() || sizes.reported.is_uncertain(&relocalizer.detector.map);
        let reasons = Reasons {
            uncertain: suspect || assessor.is_uncertain(&model.extremities),
            anywhere: interrupted,
            // Beside other persons, what the body does not explain may be theirs.
            large_excess: ownership.others == 0 && hypotheses.has_large_excess(),
        };
        // A lost body is searched for with everybody's detections, see `crate::People`.
        if assessor.status != Status::Lost {
            relocalizer.detect(&model.body, frame, ownership, root, reasons);
            if let Some(last) = motion.stamp.filter(|_| !interrupted && relocalizer.check.is_detected()) {
                // One too far from where the person was tracked last is of somebody else.
                let cost = |found: &PlacedDetection| distance_cost(found.root.distance(root), frame.stamp - last);
                relocalizer.detection.take_if(|found| cost(found).is_infinite());
            }
        }
        if config.relocalization {
            match relocalizer.compare(&model.body, &motion.predicted, motion.origin) {
                Some(DetectionVerdict::Elsewhere) if self.is_at_detection(frame, ownership) => {
                    let moves = self.motion.stamp.is_none() || self.move_to_found(frame, ownership, false);
                    // A new track restarts there, because sizes and scene were learned at the wrong position.
                    if moves && self.relocalizer.check.is_new(frame.stamp) {
                        self.restart_at_detection();
                    }
                    self.relocalizer.forget();
                    // The frame is assessed once, after it is tracked.
                    self.assessor.moved();
                }
                Some(DetectionVerdict::Consistent) => self.update_sizes(),
                Some(DetectionVerdict::Elsewhere) => self.relocalizer.check.confirmed = true,
                Some(DetectionVerdict::Inconsistent) => {}
                None => self.move_to_segment(frame, ownership),
            }
        }
        if self.motion.stamp.is_none() {
            // It verified the start and says no more about the pose.
            self.relocalizer.forget();
        }
    }

    /// Updates the pose with the part of a frame that is given by `ownership`.
    fn track(&mut self, frame: &Frame, ownership: OwnershipMask) {
        let Self { config, model, motion, observer, fit, hypotheses, relocalizer, sizes, assessor, moved_to, .. } =
            self;
        let (known, whole_body) = (motion.stamp.is_some(), config.solver.is_whole_body());
        // Predicted pose, and candidates around it (step 1 of K06 IV-B).
        let time_scale = motion.advance(&model.body, frame.stamp, config.prediction, whole_body);
        let Motion { poses, previous, predicted, origin, .. } = motion;
        observer.begin(frame, ownership, moved_to.as_ref());
        let bounds = body_box(&model.body, poses, config.body_box_margin);
        let observation = observer.gather(frame, *origin, &bounds, ownership, config);
        let setting = Setting { config, observation, previous, time_scale };
        // One with the trunk elsewhere is another person's, or the track is wrong.
        let here = |detected: &Detected| !trunk_is_elsewhere(*detected, &model.body, poses, *origin);
        let detected = relocalizer.detected().filter(here);
        fit.set_detected(detected, &model.body, poses, *origin);
        sizes.set_radius_sigmas(&model.body, fit);
        // Sizes from the first frame, then warm start and ICP steps (steps 2 to 7).
        let mut steps = 0;
        fit.regions.begin(setting.with_model(model).posed(poses));
        if config.hypotheses && whole_body && known {
            steps += hypotheses.branch.follow(setting.with_model(model), fit);
        }
        if sizes.open && sizes.rough {
            steps += fit.run(setting.with_model(model), predicted, poses);
        }
        sizes.initialize(setting, model, poses, fit);
        steps += fit.run(setting.with_model(model), predicted, poses);
        // Alternative hypotheses for arms and legs.
        let improves = config.hypotheses && whole_body && known && assessor.status != Status::Lost;
        if improves {
            steps += hypotheses.improve(setting.with_model(model), fit, poses, predicted, relocalizer.detected());
        }
        // Refinement of the sizes with this frame.
        let lost = assessor.status == Status::Lost;
        sizes.refine_lengths(setting, model, poses, predicted, fit, &relocalizer.detector.map, lost);
        if whole_body {
            sizes.refine_girths(setting, model, poses, fit, |limb| assessor.is_reliable(limb));
        }
        // Assessment: status of the body and its limbs.
        assessor.assess(setting.with_model(model), &fit.correspondences, poses, relocalizer.detected());
        if config.regions {
            fit.regions.learn(frame);
        }
        if improves {
            hypotheses.forget_motion(model, motion);
        }
        motion.commit(frame.stamp);
        self.relocalizer.observe(self.assessor.status, self.observer.silent(frame), &self.motion.poses);
        self.report(frame.stamp, steps, Some(time_scale));
        if self.relocalizer.check.is_false_track() {
            self.stop(frame.stamp);
        }
    }

    /// Whether a detection or a second of tracking confirmed the track.
    pub(crate) fn is_confirmed(&self, stamp: f64) -> bool {
        self.relocalizer.check.is_detected() || !self.relocalizer.check.is_new(stamp)
    }

    /// Checks the frame and the state of the tracker before anything changes.
    pub(crate) fn check(&self, frame: &Frame) -> Result<(), TrackError> {
        if !self.is_started() && !self.can_search() && frame.detections.is_empty() {
            return Err(TrackError::NotInitialized);
        }
        frame.check(&self.model.body, self.motion.stamp)?;
        self.check_colors(frame)
    }

    /// Checks the color pictures of a frame.
    pub(crate) fn check_colors(&self, frame: &Frame) -> Result<(), TrackError> {
        self.fit.regions.check(frame)
    }

    /// Whether the body explains the frame better at the current detection than where it is expected.
    fn is_at_detection(&mut self, frame: &Frame, ownership: OwnershipMask) -> bool {
        let Self { config, model, motion, observer, fit, relocalizer, assessor, .. } = self;
        let own = relocalizer.own_pixels();
        observer.begin(frame, ownership, Some(&own));
        let observation = observer.observation(frame, motion.origin, ownership);
        let previous = if motion.stamp.is_some() { &motion.poses[..] } else { &[] };
        let context = Context { config, model, observation, previous, time_scale: 1.0 };
        let lost = assessor.status == Status::Lost;
        fit.forget_detected();
        let is_there = relocalizer.try_detected(context, fit, &motion.predicted, lost);
        if is_there {
            self.moved_to = Some(own);
        }
        is_there
    }

    /// Moves a lost body that cannot be detected to a segment that it explains better.
    fn move_to_segment(&mut self, frame: &Frame, ownership: OwnershipMask) {
        let Self { config, model, motion, observer, fit, relocalizer, .. } = self;
        if !relocalizer.is_searching() {
            return;
        }
        observer.begin(frame, ownership, None);
        let observation = observer.observation(frame, motion.origin, ownership);
        let context = Context { config, model, observation, previous: &[], time_scale: 1.0 };
        if relocalizer.search(context, fit, &motion.predicted) {
            // Only the body's surface tells that it is there.
            self.move_to_found(frame, ownership, false);
            self.assessor.moved();
        }
    }

    /// Matches and assesses this frame at the poses that a detection or the search found, and moves the body there, if it is not lost
    /// there or `even_lost`. Returns whether it moved; if not, the assessment of where it is stays.
    fn move_to_found(&mut self, frame: &Frame, ownership: OwnershipMask, even_lost: bool) -> bool {
        let Self { config, model, motion, observer, fit, relocalizer, assessor, .. } = self;
        let poses = &relocalizer.found;
        let bounds = body_box(&model.body, poses, config.body_box_margin);
        let observation = observer.gather(frame, motion.origin, &bounds, ownership, config);
        let context = Context { config, model, observation, previous: &[], time_scale: 1.0 };
        fit.match_all(context, poses, config.max_steps, true);
        assessor.set_aside();
        assessor.assess(context, &fit.correspondences, poses, None);
        let moves = even_lost || assessor.status != Status::Lost;
        if moves {
            motion.poses.clone_from_slice(poses);
            self.jump();
        } else {
            assessor.take_back();
            self.moved_to = None;
        }
        moves
    }

    /// Fills the estimate: for a frame `time_scale` after the last one, or, with `None`, for a pose that was set.
    fn report(&mut self, stamp: f64, steps: usize, time_scale: Option<f64>) {
        let Self { config, model, motion, observer, fit, hypotheses, sizes, assessor, uncertainty, estimate, .. } =
            self;
        estimate.fill(&model.body, motion, &fit.correspondences, &observer.candidates);
        (estimate.stamp, estimate.steps) = (stamp, steps);
        let Some(time_scale) = time_scale else {
            assessor.report_status(model, estimate);
            assessor.edges.forget();
            uncertainty.forget();
            estimate.covariances.forget(&model.body);
            return;
        };
        let (body, poses, correspondences) = (&model.body, &motion.poses, &fit.correspondences);
        let (pairs, sizes_found) = (sizes.pairs.as_slice(), sizes.rough);
        let found = FittedPose { model, poses, correspondences, pairs, sizes_found, time_scale, config };
        let branch_distance = |limb: usize| {
            let length = body.limbs()[limb].shape.length();
            hypotheses.branch.end_distance(limb, length, &estimate.world_from_limb[limb])
        };
        assessor.follow_edges(found, branch_distance);
        assessor.report_status(model, estimate);
        let Estimate { limb_status, covariances, .. } = estimate;
        uncertainty.estimate(found, |limb| limb_status[limb] == LimbStatus::Measured, covariances);
        refill(&mut covariances.girths, (0..poses.len()).map(|limb| sizes.girth_sigma(body, limb)));
    }
}

#[cfg(test)]
mod tests;
