//! Verifies a track by detections, and moves the body to one: a body that was lost, or is elsewhere than its track.
//!
//! The body is put at the detected pose and refined. The new pose is adopted if it explains the frame better, by the cost of
//! all terms, and is not itself lost.

mod detection_check;
mod segment_search;
mod trials;

use crate::association::correspondence::Correspondences;
use crate::body::{Body, Model};
use crate::detect::{
    BoundDetector, Detected, DetectionQuery, PlacedDetection, Surroundings, fit_body, fit_pose, is_sized_like,
};
use crate::fit::{Context, Fit, UNKNOWN_MOTION};
use crate::math::{Aabb, Pose, Vec3, refill, shifted};
use crate::observation::candidates::{Candidates, body_box};
use crate::observation::frame::{Frame, Ground};
use crate::observation::observer::Observation;
use crate::observation::ownership::OwnershipMask;
use crate::observation::segments::Segments;
use crate::tracker::estimate::Status;
use detection_check::{DetectionCheck, ELSEWHERE, SIGMAS};
pub(crate) use detection_check::{
    DetectionVerdict, ENOUGH_ODDS, NEW_TRACK_AGE, Reasons, distance_cost, trunk_is_elsewhere,
};
use trials::{Trials, try_at};

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
    pub(crate) image: usize,
    /// The floor that the detector found under an auto-initialized body, world frame. It is used where the ground plane is not
    /// given.
    pub(crate) floor: Option<Ground>,
    pub(crate) check: DetectionCheck,
    /// Number of consecutive frames in which the body was lost.
    lost: usize,
    candidates: Candidates,
    matched: Correspondences,
    trials: Trials,
    /// The poses that a detection or the search found last, working frame.
    pub(crate) found: Vec<Pose>,
    segments: Segments,
    /// The last tracked poses, or those that were set, and these turned.
    tracked: Vec<Pose>,
    turned: Vec<Pose>,
}

impl Relocalizer {
    /// Clears everything that belongs to an earlier track.
    pub(crate) fn restart(&mut self, model: &Model, poses: &[Pose]) {
        self.check = DetectionCheck::default();
        self.floor = None;
        self.detector.bind(&model.body);
        self.set_tracked(poses);
    }

    /// Takes over the poses of a body that counts as tracked.
    pub(crate) fn set_tracked(&mut self, poses: &[Pose]) {
        self.lost = 0;
        refill(&mut self.tracked, poses.iter().copied());
    }

    /// Returns the body and its poses, world frame, that fit best the detection of this frame. The body is `set`, the one that is
    /// known, or has the detected sizes where none is or these clearly differ. Also returns whether it is `set`.
    pub(crate) fn fit_detected(&self, model: &Model, set: Option<&Body>) -> Option<(Body, Vec<Pose>, bool)> {
        let detected = self.detected()?;
        if let Some(set) = set.filter(|set| is_sized_like(set, detected, SIGMAS)) {
            return Some((set.clone(), fit_pose(set, detected)?, true));
        }
        let (body, poses) = fit_body(&model.reference_body, detected)?;
        Some((body, poses, false))
    }

    /// Compares the detection of this frame with a body at these poses, working frame, whose origin is at `origin` in the world.
    pub(crate) fn compare(&mut self, body: &Body, poses: &[Pose], origin: Vec3) -> Option<DetectionVerdict> {
        let Self { detector, detection, check, .. } = self;
        let detected = Detected { detection: &detection.as_ref()?.detection, map: &detector.map };
        Some(check.compare(detected, body, poses, origin))
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
        let better = try_at(at, fit, &fitted, &place, &mut self.found)
            && !self.trials.is_somebody_else(at, &fitted, &self.found);
        fit.swap_matches(&mut self.matched);
        better
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
            self.check.expire();
        } else if status == Status::Tracking || !self.is_searching() {
            self.lost = 0;
        }
        if status == Status::Tracking {
            refill(&mut self.tracked, poses.iter().copied());
        }
    }

    /// Drops the detection of this frame.
    pub(crate) fn forget(&mut self) {
        (self.detection, self.check.person_odds) = (None, None);
    }

    /// Returns the detection of this frame, if there is one.
    pub(crate) fn detected(&self) -> Option<Detected<'_>> {
        self.detection.as_ref().map(|detection| Detected { detection: &detection.detection, map: &self.detector.map })
    }

    /// Returns the index of the image and the pixels of the detection.
    pub(crate) fn own_pixels(&self) -> (usize, Vec<usize>) {
        let found = self.detection.as_ref();
        (self.image, found.map_or_else(Vec::new, |found| found.detection.pixels.clone()))
    }

    /// Records how the track was started: `auto_initialized` by the detector, whose detection tells the floor, or by the user.
    pub(crate) fn record_start(&mut self, auto_initialized: bool) {
        self.check.auto_initialized = auto_initialized;
        self.floor = self.detected().filter(|_| auto_initialized).and_then(floor_under);
    }

    /// Runs the detector on the owned part of a frame where that is due; the detection of the frame before was forgotten. `root` is
    /// the expected position of the body, world frame.
    pub(crate) fn detect(
        &mut self,
        body: &Body,
        frame: &Frame,
        ownership: OwnershipMask,
        root: Vec3,
        reasons: Reasons,
    ) {
        if !self.check.is_due(frame.stamp, reasons, ownership.others) || !self.detector.knows {
            return;
        }
        let query = if reasons.anywhere { DetectionQuery::Any } else { DetectionQuery::Near(root) };
        for (number, image) in frame.images.iter().enumerate() {
            let (owners, own) = (ownership.owners(number), Some(ownership.own));
            let around =
                Surroundings { ground: frame.ground, excluded: frame.excluded, owners, own, ..Surroundings::default() };
            for found in self.detector.detect(body, image, &around, query) {
                // Of several images the nearest detection counts, or the most confident one.
                let cost = |found: &PlacedDetection| match query {
                    DetectionQuery::Near(place) => found.root.distance(place),
                    _ => -found.detection.person,
                };
                if self.detection.as_ref().is_none_or(|best| cost(&found) < cost(best)) {
                    (self.image, self.detection) = (number, Some(found));
                }
            }
            if let (DetectionQuery::Near(place), Some((person, bounds))) = (query, self.detector.nearest())
                && bounds.contains(place)
            {
                self.check.person_odds = Some(self.check.person_odds.map_or(person, |before| before.max(person)));
            }
        }
    }
}

/// Returns the floor on which a detected person stands. A plane at another height than the ankles, such as a table, is not the
/// floor.
fn floor_under(detection: Detected) -> Option<Ground> {
    detection.detection.floor.filter(|floor| {
        let above = detection.ankles().map(|ankle| floor.height(ankle.position));
        above.fold(f64::INFINITY, f64::min).abs() < ELSEWHERE
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::detect::{DetectedJoint, Detection, JointMap};
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
            fit.match_last(context, &present, true);
            let before = format!("{:?}", fit.correspondences);
            for status in [Status::Tracking, Status::Lost] {
                relocalizer.observe(status, false, &present);
                assert!(!relocalizer.is_searching());
            }
            relocalizer.observe(Status::Lost, false, &present);
            let found = relocalizer.search(context, &mut fit, &present);
            let mut found = found.then(|| relocalizer.found.clone());
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

    #[test]
    fn a_plane_at_the_ankles_is_the_floor_and_one_at_another_height_is_not() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let names = ["l_ankle", "r_ankle", "l_shoulder"].map(String::from);
        let map = JointMap::new(&body, &names, &[]);
        let is_kept = |offset: f64, ankle: f64| {
            let joint = |z| Some(DetectedJoint { position: Vec3::new(2.0, 0.0, z), sigma: 0.05, visible: 1.0 });
            let floor = Some(Ground { normal: Vec3::Z, offset });
            let detection =
                Detection { joints: [ankle, ankle, 1.0].map(joint).to_vec(), floor, ..Detection::default() };
            floor_under(Detected { detection: &detection, map: &map }).is_some()
        };
        assert!(is_kept(0.0, 0.08) && is_kept(-0.3, -0.25));
        assert!(!is_kept(0.7, 0.08) && !is_kept(0.0, 0.6));
    }
}
