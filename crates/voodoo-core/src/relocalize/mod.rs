//! Verifies a track by detections, and moves the body to one: a body that was lost, or is elsewhere than its track.
//!
//! The body is put at the detected pose and refined. The new pose is adopted if it explains the frame better, by the cost of
//! all terms, and is not itself lost.

mod detection_check;
mod person_detector;
mod segment_search;
mod trials;

use crate::association::correspondence::Correspondences;
use crate::body::{Body, Model};
use crate::detect::{BoundDetector, Detected, PlacedDetection, fit_body, fit_pose, is_sized_like};
use crate::fit::{Context, Fit, UNKNOWN_MOTION};
use crate::math::{Aabb, Pose, Vec3, shifted};
use crate::observation::candidates::{Candidates, body_box};
use crate::observation::frame::Ground;
use crate::observation::observer::Observation;
use crate::tracker::estimate::Status;
use detection_check::{DetectionCheck, SIGMAS};
pub(crate) use detection_check::{DetectionVerdict, Reasons};
pub(crate) use detection_check::{ENOUGH_ODDS, distance_cost, trunk_is_elsewhere};
use segment_search::SegmentSearch;
use trials::Trials;

/// Number of consecutive frames after which a lost body counts as lost.
const PATIENCE: usize = 2;

/// Finds bodies. Stores the evidence of past detections and for how long the body has been lost.
#[derive(Debug, Default)]
pub(crate) struct Relocalizer {
    /// The detector of persons, bound to the body.
    pub(crate) detector: BoundDetector,
    /// The detection of this frame.
    pub(crate) detection: Option<PlacedDetection>,
    /// Number of the image with the detection.
    image: usize,
    /// Log odds that the object at the queried position is a person; the largest over all images.
    person_odds: Option<f64>,
    /// The floor that the detector found under an auto-initialized body, world frame. It is used where the ground plane is not
    /// given.
    pub(crate) floor: Option<Ground>,
    pub(crate) check: DetectionCheck,
    /// Number of consecutive frames in which the body was lost.
    lost: usize,
    candidates: Candidates,
    matched: Correspondences,
    trials: Trials,
    search: SegmentSearch,
}

impl Relocalizer {
    /// Clears everything that belongs to an earlier track.
    pub(crate) fn restart(&mut self, model: &Model, poses: &[Pose]) {
        self.lost = 0;
        self.check = DetectionCheck::default();
        self.detector.bind(&model.body);
        self.floor = None;
        self.search.remember(poses);
    }

    /// Whether the detection of this frame may be of a body of these sizes.
    pub(crate) fn detects_sizes_of(&self, body: &Body) -> bool {
        self.detected().is_none_or(|detected| is_sized_like(body, detected, SIGMAS))
    }

    /// Returns the body and its poses, world frame, that fit best the detection of this frame. The body is `set`, the one that is
    /// known, or has the detected sizes where none is or these clearly differ.
    pub(crate) fn fit_detected(&self, model: &Model, set: Option<&Body>) -> Option<(Body, Vec<Pose>)> {
        let detected = self.detected()?;
        match set.filter(|set| is_sized_like(set, detected, SIGMAS)) {
            Some(set) => Some((set.clone(), fit_pose(set, detected)?)),
            None => fit_body(&model.reference_body, detected),
        }
    }

    /// Compares the detection of this frame with a body at these poses, working frame, whose origin is at `origin` in the world.
    pub(crate) fn compare(&mut self, body: &Body, poses: &[Pose], origin: Vec3) -> Option<DetectionVerdict> {
        let Self { detector, detection, check, .. } = self;
        let detected = Detected { detection: &detection.as_ref()?.detection, map: &detector.map };
        Some(check.compare(detected, body, poses, origin))
    }

    /// Whether the track is not a person, by the detections up to this frame.
    pub(crate) fn is_false_track(&mut self) -> bool {
        self.check.is_false_track(self.person_odds)
    }

    /// Returns whether the detected poses of this frame, refined, explain the frame better than the present ones; working frame.
    /// The matches of `fit` are restored before it returns.
    pub(crate) fn try_detected(&mut self, context: Context, fit: &mut Fit, present: &[Pose], lost: bool) -> bool {
        let Some(detected) = self.detected() else { return false };
        let origin = context.observation.origin();
        let Some(mut place) = fit_pose(&context.model.body, detected) else { return false };
        place.iter_mut().for_each(|pose| *pose = shifted(pose, origin));
        let margin = context.config.body_box_margin;
        let Aabb { mins, maxs } = detected.detection.bounds;
        let there = Aabb::new(mins - origin, maxs - origin).enlarged(margin);
        // Points that the present pose explains must not be left unexplained, unless the body is `lost` there.
        let here = if lost { there } else { body_box(&context.model.body, present, margin) };
        let bounds = there.union(here);
        // The detection is tried now, so another trial needs new evidence.
        self.check.elsewhere = 0.0;
        fit.swap_matches(&mut self.matched);
        self.candidates.gather(context.observation.views, &bounds, context.config);
        let observation = Observation { candidates: &self.candidates, ..context.observation };
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
        &self.trials.poses
    }

    /// Whether the lost body is searched for: from the frame on from which a loss is not just a blurred image.
    pub(crate) fn is_searching(&self) -> bool {
        self.lost >= PATIENCE
    }

    /// Updates with the status of the body, at these poses, after a frame. It is `silent` if known depth cameras gave no image, so
    /// that it is no evidence that the body left.
    pub(crate) fn observe(&mut self, status: Status, silent: bool, poses: &[Pose]) {
        if status == Status::Lost {
            self.lost += usize::from(!silent);
        } else if status == Status::Tracking || !self.is_searching() {
            self.lost = 0;
        }
        if status == Status::Tracking {
            self.search.remember(poses);
        }
    }

    /// Searches for a lost body that the detector cannot find. Returns whether it explains the frame better there than at
    /// `present`. The matches of `fit` are restored before it returns.
    pub(crate) fn search(&mut self, context: Context, fit: &mut Fit, present: &[Pose]) -> bool {
        let views = context.observation.views;
        if !self.is_searching() || self.detector.knows && !views.frame.images.is_empty() {
            return false;
        }
        self.search.segments.find(views, context.config);
        fit.swap_matches(&mut self.matched);
        let found = (0..self.search.segments.found.len()).any(|index| {
            let segment = self.search.segments.found[index];
            self.search.is_body_sized(&context.model.body, segment) && {
                let bounds = segment.bounds.enlarged(context.config.body_box_margin);
                self.candidates.gather(views, &bounds, context.config);
                let observation = Observation { candidates: &self.candidates, ..context.observation };
                let at = Context { observation, previous: &[], time_scale: UNKNOWN_MOTION, ..context };
                self.search.try_segment(segment, at, fit, &mut self.trials, present)
            }
        });
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
        with_context(pixels, &config, &model, &present, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &present);
            let before = format!("{:?}", fit.correspondences);
            for status in [Status::Tracking, Status::Lost] {
                relocalizer.observe(status, false, &present);
                assert!(!relocalizer.search(context, &mut fit, &present));
            }
            relocalizer.observe(Status::Lost, false, &present);
            let found = relocalizer.search(context, &mut fit, &present);
            let mut found = found.then(|| relocalizer.found().to_vec());
            assert_eq!(format!("{:?}", fit.correspondences), before);
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

    /// Whether the body is searched for after frames with these states of it.
    fn after(frames: &[Status], silent: bool) -> bool {
        let mut relocalizer = Relocalizer::default();
        frames.iter().for_each(|status| relocalizer.observe(*status, silent, &[]));
        relocalizer.is_searching()
    }

    #[test]
    fn a_body_is_searched_for_from_the_second_lost_frame_on() {
        let searched = |frames| after(&[Status::Lost].repeat(frames), false);
        assert_eq!([1, 2, 3, 4].map(searched), [false, true, true, true]);
    }

    #[test]
    fn a_single_lost_frame_is_ignored_and_frames_without_images_do_not_count() {
        assert!(!after(&[Status::Tracking, Status::Lost, Status::Tracking, Status::Lost], false));
        assert!(!after(&[Status::Lost; 20], true));
    }

    #[test]
    fn a_tracked_body_is_no_longer_lost_and_a_degraded_one_is() {
        let back = |last| after(&[Status::Lost, Status::Lost, last], false);
        assert_eq!([Status::Tracking, Status::Degraded].map(back), [false, true]);
    }
}
