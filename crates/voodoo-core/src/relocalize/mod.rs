//! Finding a body where a detector sees a person: one that nobody said where it is, a lost one, and one that is elsewhere than it
//! is tracked.
//!
//! The body is put there as the detector sees it and refined; it is taken where it explains the frame no worse by the score of all
//! hypotheses and is not lost itself.

mod detection_check;
mod loss_monitor;
mod occlusion;
mod person_detector;
mod segment_search;
mod tentative_detection;
mod trials;

use crate::association::correspondence::Correspondences;
use crate::body::{Body, Model};
use crate::detect::{Detect, DetectError, Detected, DetectionQuery, JointMap, fit_body, fit_pose, is_sized_like};
use crate::fit::{Context, Fit, UNKNOWN_MOTION};
use crate::math::{Aabb, Pose, Vec3, shifted};
use crate::observation::candidates::{Candidates, body_box};
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::{Frame, Ground};
use crate::observation::observer::Own;
use crate::observation::ownership::OwnershipMask;
pub(crate) use detection_check::DetectionVerdict;
use detection_check::{DetectionCheck, SIGMAS};
pub(crate) use loss_monitor::FrameOutcome;
use loss_monitor::LossMonitor;
use person_detector::PersonDetector;
use segment_search::SegmentSearch;
use tentative_detection::TentativeDetection;
pub(crate) use tentative_detection::{DETECTION_COST, ENOUGH_ODDS, SAME_PERSON};
use trials::Trials;

/// Finds bodies. Remembers what a detector said, and how long the body has been lost.
#[derive(Debug, Default)]
pub(crate) struct Relocalizer {
    loss: LossMonitor,
    candidates: Candidates,
    matched: Correspondences,
    trials: Trials,
    search: SegmentSearch,
    people: PersonDetector,
    check: DetectionCheck,
    tentative: TentativeDetection,
}

impl Relocalizer {
    /// Takes the detector that finds this body.
    pub(crate) fn set_detector(&mut self, detector: Option<Box<dyn Detect>>, body: &Body) {
        self.people.set_detector(detector, body);
    }

    /// The body's limbs or sites have changed.
    pub(crate) fn bind(&mut self, body: &Body) {
        self.people.bind(body);
    }

    /// What the detector's joints are on the body.
    pub(crate) fn map(&self) -> &JointMap {
        self.people.map()
    }

    /// Why the detector could not look, since [`Self::clear_error`].
    pub(crate) fn error(&self) -> Option<&DetectError> {
        self.people.error()
    }

    /// Forgets the detector's last error.
    pub(crate) fn clear_error(&mut self) {
        self.people.clear_error();
    }

    /// Forgets everything that was remembered of an earlier track.
    pub(crate) fn restart(&mut self, model: &Model, poses: &[Pose]) {
        self.loss.restart();
        self.check.restart();
        self.tentative = TentativeDetection::default();
        self.people.bind(&model.body);
        self.people.keep_floor(false);
        self.search.remember(poses);
    }

    /// Whether the body can be found without a pose.
    pub(crate) fn can_detect(&self) -> bool {
        self.people.detects()
    }

    /// A body of a detected person's sizes, or with `known` ones that the model has, and its poses, world frame.
    pub(crate) fn place_body(&self, model: &Model, detected: Detected, known: bool) -> Option<(Body, Vec<Pose>)> {
        if known { Some((model.body.clone(), fit_pose(&model.body, detected)?)) } else { fit_body(model, detected) }
    }

    /// Body and poses of the surest person in a frame.
    pub(crate) fn first_person(&mut self, frame: &Frame, model: &Model) -> Option<(Body, Vec<Pose>)> {
        self.people.detect(&model.body, frame, None, DetectionQuery::Any);
        let place = self.people.place()?;
        if !self.tentative.observe(Some(place)) {
            return None;
        }
        self.tentative = TentativeDetection::default();
        fit_body(model, self.people.detection()?)
    }

    /// The track was started: `auto_initialized` where a detector saw somebody, and nobody had said where.
    pub(crate) fn record_start(&mut self, auto_initialized: bool) {
        self.check.set_auto_initialized(auto_initialized);
        self.people.keep_floor(auto_initialized);
    }

    /// The floor under a body that was found, where nobody tells it; world frame.
    pub(crate) fn floor(&self) -> Option<Ground> {
        self.people.floor
    }

    /// Whether nobody had said where the track starts.
    pub(crate) fn is_auto_initialized(&self) -> bool {
        self.check.is_auto_initialized()
    }

    /// Whether the track was started less than a second ago.
    pub(crate) fn is_new(&self, stamp: f64) -> bool {
        self.check.is_new(stamp)
    }

    /// The pose of a body that fits best what a detector saw in this frame, world frame; the body is that of a start, or has the
    /// sizes that the detector saw where they are surely others.
    pub(crate) fn fit_detected(&self, model: &Model, set: &Body) -> Option<(Body, Vec<Pose>)> {
        let detected = self.people.detection()?;
        if is_sized_like(set, detected, SIGMAS) {
            return Some((set.clone(), fit_pose(set, detected)?));
        }
        fit_body(model, detected)
    }

    /// The pose in which a detector saw this body in this frame, world frame.
    pub(crate) fn detected_pose(&self, body: &Body) -> Option<Vec<Pose>> {
        fit_pose(body, self.people.detection()?)
    }

    /// Lets a detector look at a frame where that is due. `root` is where the body is expected, world frame; `limb_suspect`: a limb
    /// was not where it should be in the frame before, or it is `pose_uncertain` whether one was, or the body `lost`.
    pub(crate) fn detect(
        &mut self,
        body: &Body,
        frame: &Frame,
        root: Vec3,
        limb_suspect: bool,
        pose_uncertain: bool,
        lost: bool,
    ) {
        // A body that was found a moment ago may face the other way.
        let often = lost || self.loss.recently_recovered();
        if self.check.is_due(frame.stamp, limb_suspect, pose_uncertain, often) && self.people.detects() {
            let query = if lost { DetectionQuery::Any } else { DetectionQuery::Near(root) };
            self.people.detect(body, frame, None, query);
            // What stands before a hidden body is somebody else.
            self.people.discard(|place| self.loss.occlusion.is_occluder(frame, place));
        } else {
            self.people.forget();
        }
    }

    /// The same for one of several persons: good tracks are looked at, too, and who is lost is not looked for here.
    pub(crate) fn detect_owned(
        &mut self,
        body: &Body,
        frame: &Frame,
        ownership: OwnershipMask,
        root: Vec3,
        lost: bool,
    ) {
        if self.check.is_due(frame.stamp, true, false, false) && !lost && self.people.detects() {
            self.people.detect(body, frame, Some(ownership), DetectionQuery::Near(root));
            self.people.discard(|place| place.distance(root) > SAME_PERSON);
        } else {
            self.people.forget();
        }
    }

    /// What a detector saw in this frame counts for nothing.
    pub(crate) fn forget(&mut self) {
        self.people.forget();
    }

    /// What a detector saw in this frame, if it looked.
    pub(crate) fn detected(&self) -> Option<Detected<'_>> {
        self.people.detection()
    }

    /// The pixels in which it saw it.
    pub(crate) fn own_pixels(&self) -> Own<'_> {
        self.people.own_pixels()
    }

    /// Notes what a frame shows where the body's joints are, the root's first, world frame: what hides the body is somebody else.
    pub(crate) fn observe_occlusion(
        &mut self,
        views: DepthViews,
        joints: impl Iterator<Item = Vec3>,
        tracked: bool,
        lost: bool,
    ) {
        self.loss.occlusion.observe(views, joints, tracked, !lost);
    }

    /// What a detector that looked at this frame says of a body at these poses, world frame; of a `new_track` track and of one `among`
    /// several persons also of its arms and legs.
    pub(crate) fn compare(
        &mut self,
        body: &Body,
        world_from_limb: &[Pose],
        lost: bool,
        new_track: bool,
        among: bool,
    ) -> Option<DetectionVerdict> {
        let detected = self.people.detection().filter(|_| lost || self.check.compares())?;
        // A lost body is where a person is seen for sure.
        Some(match lost {
            true if self.tentative.observe(self.people.place()) => DetectionVerdict::Elsewhere,
            true => DetectionVerdict::Inconsistent,
            false => self.check.compare(detected, body, world_from_limb, new_track, among),
        })
    }

    /// Whether nobody is there any more, as frames up to this one say: the body is `lost` for long, or no person.
    pub(crate) fn person_gone(&mut self, stamp: f64, lost: bool) -> bool {
        self.check.person_gone(stamp, lost, self.people.person_odds())
    }

    /// The poses that a detector saw in this frame, refined, where they are no worse than the present ones; working frame. What
    /// `fit` has matched is as before when it returns.
    pub(crate) fn try_detected(
        &mut self,
        context: Context,
        fit: &mut Fit,
        present: &[Pose],
        lost: bool,
    ) -> Option<&[Pose]> {
        let detected = self.people.detection()?;
        let origin = context.observation.origin();
        let mut place = fit_pose(&context.model.body, detected)?;
        place.iter_mut().for_each(|pose| *pose = shifted(pose, origin));
        let (low, high) = (detected.detection.low - origin, detected.detection.high - origin);
        let margin = context.config.body_box_margin;
        let there = Aabb::new(low - Vec3::splat(margin), high + Vec3::splat(margin));
        // What the present pose explains must not be left behind, unless it is `lost` there.
        let here = if lost { there } else { body_box(&context.model.body, present, margin) };
        let bounds = Aabb::new(there.mins.min(here.mins), there.maxs.max(here.maxs));
        // What was believed is tried now: the next time it has to be believed anew.
        self.check.reset_elsewhere();
        self.tentative = TentativeDetection::default();
        fit.swap_matches(&mut self.matched);
        self.candidates.gather(
            context.observation.frame(),
            origin,
            &bounds,
            context.observation.views.backgrounds,
            context.config,
        );
        let observation = context.observation.with(&self.candidates);
        let at = Context { observation, previous: &[], time_scale: UNKNOWN_MOTION, ..context };
        let better = self.trials.try_detection(at, fit, present, &place);
        fit.swap_matches(&mut self.matched);
        better.then(|| self.trials.poses())
    }

    /// In how many of the last frames the body was lost, from the one on in which that is no blur; `None` otherwise.
    pub(crate) fn frames_searched(&self) -> Option<usize> {
        self.loss.frames_searched()
    }

    /// Notes what a frame said of the body at these poses.
    pub(crate) fn observe(&mut self, outcome: FrameOutcome, poses: &[Pose]) {
        self.loss.observe(outcome);
        if outcome.tracked {
            self.search.remember(poses);
        }
    }

    /// Looks for a lost body that no detector sees; its poses where it explains the frame better than at `present`. What `fit` has
    /// matched is as before when it returns.
    pub(crate) fn search(&mut self, context: Context, fit: &mut Fit, present: &[Pose]) -> Option<&[Pose]> {
        let (frame, origin) = (context.observation.frame(), context.observation.origin());
        if self.frames_searched().is_none() || self.people.detects() && !frame.images.is_empty() {
            return None;
        }
        let backgrounds = context.observation.views.backgrounds;
        self.search.segments.find(frame, origin, backgrounds, context.config);
        fit.swap_matches(&mut self.matched);
        let mut found = false;
        let mut index = 0;
        while let Some(segment) = self.search.segment(index).filter(|_| !found) {
            index += 1;
            // What stands before a hidden body is another one.
            let other = self.loss.occlusion.is_occluder(frame, segment.center + origin);
            if other || !self.search.is_body_sized(&context.model.body, segment) {
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
        found.then(|| self.trials.poses())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::{depth, farthest, moved, put_board, standing, turned, with_context, without_background};

    /// Where a lost body of another kind is in the frame after it was found, which was last tracked half a meter beside the
    /// camera's axis.
    fn found(pixels: &[u16]) -> Option<Vec<Pose>> {
        let (model, poses) = standing();
        let present = moved(&poses, -0.5 * Vec3::X);
        let config = without_background();
        let mut relocalizer = Relocalizer::default();
        relocalizer.restart(&model, &present);
        let outcome = |stamp, lost| FrameOutcome { stamp, lost, tracked: !lost, silent: false };
        with_context(pixels, &config, &model, &present, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &present);
            let before = format!("{:?}", fit.correspondences());
            for (stamp, lost) in [(-0.4, false), (-0.3, true)] {
                relocalizer.observe(outcome(stamp, lost), &present);
                assert!(relocalizer.search(context, &mut fit, &present).is_none());
            }
            relocalizer.observe(outcome(-0.2, true), &present);
            let mut found = relocalizer.search(context, &mut fit, &present).map(<[Pose]>::to_vec);
            assert_eq!(format!("{:?}", fit.correspondences()), before);
            // The next two frames, which show the same.
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
    fn a_body_that_no_detector_knows_is_found_a_meter_beside_its_last_place() {
        let (model, poses) = standing();
        for turn in [0.0, 0.4] {
            let place = turned(&moved(&poses, 0.5 * Vec3::X), poses[0].translation + 0.5 * Vec3::X, Vec3::Y, turn);
            let off = farthest(&found(&depth(&model.body, &place)).unwrap(), &place);
            assert!(off < 0.028, "{off} m off");
        }
    }

    #[test]
    fn nothing_is_found_where_nothing_is_visible_or_what_is_visible_is_too_small_or_too_large() {
        let empty = vec![0; depth(&standing().0.body, &standing().1).len()];
        assert_eq!(found(&empty), None);
        for (depth, size) in [(2.6, [0.15, 0.2]), (3.5, [1.9, 1.4])] {
            let mut pixels = empty.clone();
            put_board(&mut pixels, Vec3::new(0.0, 0.0, depth), size);
            assert_eq!(found(&pixels), None, "{size:?}");
        }
    }
}
