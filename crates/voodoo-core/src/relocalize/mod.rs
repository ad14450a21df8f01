//! Verifies a track by detections, and moves the body to one: a body that was lost, or is elsewhere than its track.
//!
//! The body is put at the detected pose and refined. The new pose is adopted if it explains the frame better, by the cost of
//! all terms, and is not itself lost.

mod detection_check;
mod loss_monitor;
mod person_detector;
mod segment_search;
mod trials;

use crate::association::correspondence::Correspondences;
use crate::body::{Body, Model};
use crate::detect::{
    Detect, DetectError, Detected, DetectionQuery, JointMap, PlacedDetection, fit_body, fit_pose, is_sized_like,
};
use crate::fit::{Context, Fit, UNKNOWN_MOTION};
use crate::math::{Aabb, Pose, Vec3, shifted};
use crate::observation::candidates::{Candidates, body_box};
use crate::observation::frame::{Frame, Ground};
use crate::observation::observer::Own;
use crate::observation::ownership::OwnershipMask;
use detection_check::{DetectionCheck, SIGMAS};
pub(crate) use detection_check::{DetectionVerdict, Reasons};
pub(crate) use detection_check::{ENOUGH_ODDS, distance_cost, trunk_is_elsewhere};
pub(crate) use loss_monitor::FrameOutcome;
use loss_monitor::LossMonitor;
use person_detector::PersonDetector;
use segment_search::SegmentSearch;
use trials::Trials;

/// Number of consecutive frames after which a lost body counts as lost.
const PATIENCE: usize = 2;

/// Finds bodies. Stores the evidence of past detections and for how long the body has been lost.
#[derive(Debug, Default)]
pub(crate) struct Relocalizer {
    loss: LossMonitor,
    candidates: Candidates,
    matched: Correspondences,
    trials: Trials,
    search: SegmentSearch,
    people: PersonDetector,
    check: DetectionCheck,
}

impl Relocalizer {
    /// Sets the detector that finds this body, or removes it.
    pub(crate) fn set_detector(&mut self, detector: Option<Box<dyn Detect>>, body: &Body) {
        self.people.set_detector(detector, body);
    }

    /// Rebinds the detector after the body's limbs or sites have changed.
    pub(crate) fn bind(&mut self, body: &Body) {
        self.people.bind(body);
    }

    /// Returns the map from the detector's joints to the body.
    pub(crate) fn map(&self) -> &JointMap {
        self.people.map()
    }

    /// The error of the detector, if it failed since [`Self::clear_error`].
    pub(crate) fn error(&self) -> Option<&DetectError> {
        self.people.error()
    }

    /// Clears the detector's last error.
    pub(crate) fn clear_error(&mut self) {
        self.people.clear_error();
    }

    /// Clears everything that belongs to an earlier track.
    pub(crate) fn restart(&mut self, model: &Model, poses: &[Pose]) {
        self.loss.restart();
        self.check.restart();
        self.people.bind(&model.body);
        self.people.keep_floor(false);
        self.search.remember(poses);
    }

    /// Whether the body can be found without a pose.
    pub(crate) fn can_detect(&self) -> bool {
        self.people.detects()
    }

    /// Takes this detection for the one of this frame.
    pub(crate) fn set_detection(&mut self, detection: PlacedDetection) {
        self.people.set_detection(detection);
    }

    /// Records how the track was started: `auto_initialized` by the detector, or by the user.
    pub(crate) fn record_start(&mut self, auto_initialized: bool) {
        self.check.set_auto_initialized(auto_initialized);
        self.people.keep_floor(auto_initialized);
    }

    /// Returns the floor that the detector found under an auto-initialized body, world frame. It is used where the ground plane
    /// is not given.
    pub(crate) fn floor(&self) -> Option<Ground> {
        self.people.floor
    }

    /// Whether the track was auto-initialized by the detector.
    pub(crate) fn is_auto_initialized(&self) -> bool {
        self.check.is_auto_initialized()
    }

    /// Whether a detection or a second of tracking confirmed the track.
    pub(crate) fn is_confirmed(&self, stamp: f64) -> bool {
        self.check.is_confirmed(stamp)
    }

    /// Notes that a detection elsewhere is somebody else.
    pub(crate) fn confirm(&mut self) {
        self.check.confirm();
    }

    /// Whether a detection confirmed the track.
    pub(crate) fn is_detected(&self) -> bool {
        self.check.is_detected()
    }

    /// Whether the track was started less than a second ago.
    pub(crate) fn is_new(&self, stamp: f64) -> bool {
        self.check.is_new(stamp)
    }

    /// Whether the detection of this frame may be of a body of these sizes.
    pub(crate) fn detects_sizes_of(&self, body: &Body) -> bool {
        self.people.detection().is_none_or(|detected| is_sized_like(body, detected, SIGMAS))
    }

    /// Returns the body and its poses, world frame, that fit best the detection of this frame. The body is `set`, the one that is
    /// known, or has the detected sizes where none is or these clearly differ.
    pub(crate) fn fit_detected(&self, model: &Model, set: Option<&Body>) -> Option<(Body, Vec<Pose>)> {
        let detected = self.people.detection()?;
        match set.filter(|set| is_sized_like(set, detected, SIGMAS)) {
            Some(set) => Some((set.clone(), fit_pose(set, detected)?)),
            None => fit_body(model, detected),
        }
    }

    /// Runs the detector on the owned part of a frame where that is due. `root` is the expected position of the body, world frame.
    pub(crate) fn detect(
        &mut self,
        body: &Body,
        frame: &Frame,
        ownership: OwnershipMask,
        root: Vec3,
        reasons: Reasons,
    ) {
        if self.check.is_due(frame.stamp, reasons, ownership.others) && self.people.detects() {
            let query = if reasons.anywhere { DetectionQuery::Any } else { DetectionQuery::Near(root) };
            self.people.detect(body, frame, ownership, query);
        } else {
            self.people.forget();
        }
    }

    /// Drops the detection of this frame if it is too far from a position, world frame, to be of a person who was tracked `elapsed`
    /// seconds before.
    pub(crate) fn forget_somebody_else(&mut self, root: Vec3, elapsed: f64) {
        self.people.forget_somebody_else(root, elapsed);
    }

    /// Drops the detection of this frame.
    pub(crate) fn forget(&mut self) {
        self.people.forget();
    }

    /// Returns the detection of this frame, if there is one.
    pub(crate) fn detected(&self) -> Option<Detected<'_>> {
        self.people.detection()
    }

    /// Returns the pixels of the detection.
    pub(crate) fn own_pixels(&self) -> Own<'_> {
        self.people.own_pixels()
    }

    /// Compares the detection of this frame with a body at these poses, working frame, whose origin is at `origin` in the world.
    pub(crate) fn compare(&mut self, body: &Body, poses: &[Pose], origin: Vec3) -> Option<DetectionVerdict> {
        let detected = self.people.detection()?;
        Some(self.check.compare(detected, body, poses, origin))
    }

    /// Whether the track is not a person, by the detections up to this frame.
    pub(crate) fn is_false_track(&mut self) -> bool {
        self.check.is_false_track(self.people.person_odds())
    }

    /// Returns whether the detected poses of this frame, refined, explain the frame better than the present ones; working frame.
    /// The matches of `fit` are restored before it returns.
    pub(crate) fn try_detected(&mut self, context: Context, fit: &mut Fit, present: &[Pose], lost: bool) -> bool {
        let Some(detected) = self.people.detection() else { return false };
        let origin = context.observation.origin();
        let Some(mut place) = fit_pose(&context.model.body, detected) else { return false };
        place.iter_mut().for_each(|pose| *pose = shifted(pose, origin));
        let (low, high) = (detected.detection.low - origin, detected.detection.high - origin);
        let margin = context.config.body_box_margin;
        let there = Aabb::new(low - Vec3::splat(margin), high + Vec3::splat(margin));
        // Points that the present pose explains must not be left unexplained, unless the body is `lost` there.
        let here = if lost { there } else { body_box(&context.model.body, present, margin) };
        let bounds = Aabb::new(there.mins.min(here.mins), there.maxs.max(here.maxs));
        // The detection is tried now, so another trial needs new evidence.
        self.check.reset_elsewhere();
        fit.swap_matches(&mut self.matched);
        self.candidates.gather(
            context.observation.frame(),
            origin,
            &bounds,
            context.observation.views.backgrounds,
            context.config,
        );
        let observation = context.observation.with(&self.candidates);
        // Before its first frame the body is where it was set, and what is beside it may be scene.
        let first = context.previous.is_empty();
        let mut fitted = present.to_vec();
        if !first {
            fit.run(Context { observation, ..context }, present, &mut fitted);
        }
        let at = Context { observation, previous: &[], time_scale: UNKNOWN_MOTION, ..context };
        let better = self.trials.try_at(at, fit, &fitted, &place) && !self.trials.is_somebody_else(at, &fitted);
        fit.swap_matches(&mut self.matched);
        better
    }

    /// The poses that a detection or the search found last, working frame.
    pub(crate) fn found(&self) -> &[Pose] {
        self.trials.poses()
    }

    /// Returns for how many frames the lost body has been searched: the count starts at the frame from which on a loss is not
    /// just a blurred image. `None` if the body is not searched for.
    pub(crate) fn frames_searched(&self) -> Option<usize> {
        self.loss.frames_searched()
    }

    /// Updates with the outcome of a frame for the body at these poses.
    pub(crate) fn observe(&mut self, outcome: FrameOutcome, poses: &[Pose]) {
        self.loss.observe(outcome);
        if outcome.tracked {
            self.search.remember(poses);
        }
    }

    /// Searches for a lost body that the detector cannot find. Returns whether it explains the frame better there than at
    /// `present`. The matches of `fit` are restored before it returns.
    pub(crate) fn search(&mut self, context: Context, fit: &mut Fit, present: &[Pose]) -> bool {
        let (frame, origin) = (context.observation.frame(), context.observation.origin());
        if self.frames_searched().is_none() || self.people.detects() && !frame.images.is_empty() {
            return false;
        }
        let backgrounds = context.observation.views.backgrounds;
        self.search.segments.find(frame, origin, backgrounds, context.config);
        fit.swap_matches(&mut self.matched);
        let mut found = false;
        let mut index = 0;
        while let Some(segment) = self.search.segment(index).filter(|_| !found) {
            index += 1;
            if !self.search.is_body_sized(&context.model.body, segment) {
                continue;
            }
            let margin = Vec3::splat(context.config.body_box_margin);
            let bounds = Aabb::new(segment.low - margin, segment.high + margin);
            self.candidates.gather(frame, origin, &bounds, backgrounds, context.config);
            let observation = context.observation.with(&self.candidates);
            let at = Context { observation, previous: &[], time_scale: UNKNOWN_MOTION, ..context };
            found = self.search.try_segment(segment, at, fit, &mut self.trials, present);
        }
        fit.swap_matches(&mut self.matched);
        found
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::{depth, farthest, moved, put_board, standing, turned, with_context, without_background};

    /// Returns the poses of a lost body of another kind two frames after it was found. It was last tracked half a meter beside
    /// the camera's axis.
    fn found(pixels: &[u16]) -> Option<Vec<Pose>> {
        let (model, poses) = standing();
        let present = moved(&poses, -0.5 * Vec3::X);
        let config = without_background();
        let mut relocalizer = Relocalizer::default();
        relocalizer.restart(&model, &present);
        let outcome = |lost: bool| FrameOutcome { lost, tracked: !lost, silent: false };
        with_context(pixels, &config, &model, &present, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &present);
            let before = format!("{:?}", fit.correspondences());
            for lost in [false, true] {
                relocalizer.observe(outcome(lost), &present);
                assert!(!relocalizer.search(context, &mut fit, &present));
            }
            relocalizer.observe(outcome(true), &present);
            let found = relocalizer.search(context, &mut fit, &present);
            let mut found = found.then(|| relocalizer.found().to_vec());
            assert_eq!(format!("{:?}", fit.correspondences()), before);
            // Two more frames with the same image.
            for _ in 0..2 {
                found.iter_mut().for_each(|poses| {
                    let predicted = poses.clone();
                    with_context(pixels, &config, &model, &predicted, |context| fit.run(context, &predicted, poses));
                });
            }
            found
        })
    }

    #[test]
    fn a_body_without_detector_is_found_a_meter_from_its_last_position() {
        let (model, poses) = standing();
        for turn in [0.0, 0.4] {
            let place = turned(&moved(&poses, 0.5 * Vec3::X), poses[0].translation + 0.5 * Vec3::X, Vec3::Y, turn);
            let off = farthest(&found(&depth(&model.body, &place)).unwrap(), &place);
            assert!(off < 0.028, "error of {off} m");
        }
    }

    #[test]
    fn nothing_is_found_in_an_empty_image_or_at_a_segment_of_another_size() {
        let empty = vec![0; depth(&standing().0.body, &standing().1).len()];
        assert_eq!(found(&empty), None);
        for (depth, size) in [(2.6, [0.15, 0.2]), (3.5, [1.9, 1.4])] {
            let mut pixels = empty.clone();
            put_board(&mut pixels, Vec3::new(0.0, 0.0, depth), size);
            assert_eq!(found(&pixels), None, "{size:?}");
        }
    }
}
