//! Decides when the detector runs for a tracked person, and whether it finds the person elsewhere or facing the other way.

use crate::body::Body;
use crate::detect::{Detected, Detection};
use crate::math::{Pose, Vec3};

/// Time for which a track is new, seconds.
pub(crate) const NEW_TRACK_AGE: f64 = 1.0;
/// Interval between detections of a new or uncertain track, seconds: a detection takes as long as a frame or two. Several
/// persons share those of uncertain tracks.
const EVERY: f64 = 0.12;
/// A detection is elsewhere when its trunk or legs have at least this mean distance from the tracked ones, meters. Other
/// skeletons have hips and ankles 10 cm from those that a detector reports. It is also the largest distance of detected ankles
/// from the floor under a person.
pub(super) const ELSEWHERE: f64 = 0.15;
/// The mean distance must also exceed this multiple of the detection's mean standard deviation, which is large for persons who
/// occlude each other even if the detection is right.
pub(super) const SIGMAS: f64 = 3.5;
/// Sum of log odds from which on a track is not a person.
const FALSE_TRACK_ODDS: f64 = 12.0;
/// Sum of log odds from which on a detection is confirmed as a person, or as being elsewhere than the track. No single detection
/// of a tracked person contributes more. Also the cost at which somebody confirmed is new rather than one who was here before, nats.
pub(crate) const ENOUGH_ODDS: f64 = 4.0;

/// Standard deviation of the distance between a detection and the place where the same person was tracked last, meters: of both
/// places, and of what a person moves in a second.
const DISTANCE_SIGMA: [f64; 2] = [0.2, 1.2];

/// Extent of the area in which somebody else may appear, meters.
const APPEARS: f64 = 4.0;

/// Returns the cost of a person's being detected `distance` meters from where they were tracked `elapsed` seconds before, nats: by
/// the density there of where they may be by now, and of where somebody else may appear. Beyond two standard deviations it is
/// infinite: that is somebody else.
pub(crate) fn distance_cost(distance: f64, elapsed: f64) -> f64 {
    let sigma = DISTANCE_SIGMA[0] + DISTANCE_SIGMA[1] * elapsed;
    let far = distance / sigma;
    if far > 2.0 { f64::INFINITY } else { 0.5 * far * far + 2.0 * (sigma / APPEARS).min(1.0).ln() }
}

/// What the frame before gave as reasons to run the detector.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reasons {
    /// A limb was not supported in its pose, or it was uncertain whether one was, or the frame showed more than the body explains.
    pub(crate) uncertain: bool,
    /// The body may be anywhere.
    pub(crate) anywhere: bool,
    /// The person's surface is not that of the body, for example in a skirt: every frame needs a detection.
    pub(crate) large_excess: bool,
}

/// Result of comparing a detection with the tracked pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DetectionVerdict {
    /// The detection agrees with the tracked pose.
    Consistent,
    /// It disagrees, but the evidence is not yet enough to try the detected position.
    Inconsistent,
    /// The body is elsewhere: the detected position is to be tried.
    Elsewhere,
}

/// Whether the trunk was detected elsewhere than at these poses, whose frame has its origin at `origin` in the world.
pub(crate) fn trunk_is_elsewhere(detected: Detected, body: &Body, poses: &[Pose], origin: Vec3) -> bool {
    // The mean distance of detected joints from the tracked ones, and the mean of their standard deviations, meters.
    let (mut apart, mut spread, mut count) = (0.0, 0.0, 0.0_f64);
    for joint in &detected.map.trunk {
        if let (Some(detected), Some(site)) = (detected.joint(*joint), detected.map.site(*joint)) {
            let tracked: Vec3 = body.site_position(poses, site) + origin;
            apart += detected.position.distance(tracked);
            spread += detected.sigma;
            count += 1.0;
        }
    }
    let [apart, spread] = [apart, spread].map(|sum| sum / count.max(1.0));
    apart > ELSEWHERE && apart > SIGMAS * spread
}

/// Evidence of detections about a track, and when the detector is due.
#[derive(Debug, Default)]
pub(crate) struct DetectionCheck {
    /// The track was auto-initialized by the detector.
    pub(crate) auto_initialized: bool,
    /// Stamp of the start, seconds.
    since: Option<f64>,
    /// Stamp of the last detection that counted, seconds.
    last_detection: Option<f64>,
    /// Log odds that the object at the queried position is a person; the largest over all images of this frame.
    pub(super) person_odds: Option<f64>,
    /// Whether the detection of this frame counts against the track's being a person: those of following frames are alike.
    counts: bool,
    /// Whether a detection agreed with the track, or one elsewhere was of somebody else.
    pub(crate) confirmed: bool,
    /// Log odds that the person is elsewhere, and that the tracked object is not a person.
    pub(super) elsewhere: f64,
    false_track: f64,
}

impl DetectionCheck {
    /// Whether a detection confirmed the track.
    pub(crate) fn is_detected(&self) -> bool {
        self.auto_initialized || self.confirmed
    }

    /// Whether the track was started less than a second ago.
    pub(crate) fn is_new(&self, stamp: f64) -> bool {
        self.since.is_none_or(|since| stamp - since < NEW_TRACK_AGE)
    }

    /// The frame after a loss needs a detection: a body among others may come back at another person.
    pub(super) fn expire(&mut self) {
        self.last_detection = None;
    }

    /// Counts a frame and returns whether the detector is due for a person beside so many others.
    pub(super) fn is_due(&mut self, stamp: f64, reasons: Reasons, others: usize) -> bool {
        let Reasons { uncertain, anywhere, large_excess } = reasons;
        let new_track = self.is_new(stamp);
        self.since = self.since.or(Some(stamp));
        // A person who may be elsewhere does not share detections.
        let sharing = if self.elsewhere > 0.0 { 0 } else { others };
        let waited = |wait: f64| self.last_detection.is_none_or(|last| stamp - last >= wait);
        self.counts = new_track && waited(EVERY) || (uncertain || anywhere) && waited(EVERY * (1.0 + sharing as f64));
        if self.counts {
            self.last_detection = Some(stamp);
        }
        self.counts || large_excess
    }

    /// Compares a detection with the trunk at these poses, whose frame has its origin at `origin` in the world.
    pub(super) fn compare(
        &mut self,
        detected: Detected,
        body: &Body,
        poses: &[Pose],
        origin: Vec3,
    ) -> DetectionVerdict {
        if !trunk_is_elsewhere(detected, body, poses, origin) {
            self.elsewhere = 0.0;
            self.confirmed = true;
            return DetectionVerdict::Consistent;
        }
        let Detection { person, facing, .. } = detected.detection;
        self.elsewhere += person.min(facing.map_or(f64::INFINITY, f64::abs)).clamp(0.0, ENOUGH_ODDS);
        if self.elsewhere >= ENOUGH_ODDS { DetectionVerdict::Elsewhere } else { DetectionVerdict::Inconsistent }
    }

    /// Updates with the log odds that the object at the tracked position is a person. Returns whether it is none.
    pub(crate) fn is_false_track(&mut self) -> bool {
        if let Some(person) = self.person_odds.filter(|_| self.counts) {
            self.false_track = (self.false_track - person.clamp(-ENOUGH_ODDS, ENOUGH_ODDS)).max(0.0);
        }
        self.false_track >= FALSE_TRACK_ODDS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, HumanModel};
    use crate::detect::{DetectedJoint, Detection, JointMap};
    use crate::math::Quat;

    #[test]
    fn new_lost_and_uncertain_tracks_are_checked_often_and_confident_ones_never() {
        let count = |from: f64, reasons: Reasons, others: usize| {
            let mut check = DetectionCheck::default();
            check.is_due(0.0, Reasons::default(), others);
            (1..=28).filter(|frame| check.is_due(from + f64::from(*frame) / 30.0, reasons, others)).count()
        };
        let none = Reasons::default();
        let [uncertain, anywhere] = [Reasons { uncertain: true, ..none }, Reasons { anywhere: true, ..none }];
        let counts = [count(0.0, none, 0), count(2.0, uncertain, 0), count(2.0, anywhere, 0), count(2.0, none, 0)];
        assert_eq!(counts, [7, 7, 7, 0]);
        assert_eq!([count(0.0, none, 3), count(2.0, uncertain, 1), count(2.0, uncertain, 3)], [7, 4, 2]);
    }

    #[test]
    fn among_others_the_frame_after_a_loss_is_checked_and_soon_again_who_may_be_elsewhere() {
        let uncertain = Reasons { uncertain: true, ..Reasons::default() };
        let mut check = DetectionCheck { since: Some(-2.0), ..DetectionCheck::default() };
        let due = |check: &mut DetectionCheck, stamp| check.is_due(stamp, uncertain, 3);
        assert!(due(&mut check, 0.0) && !due(&mut check, 0.2));
        check.expire();
        assert!(due(&mut check, 0.3) && !due(&mut check, 0.5));
        check.elsewhere = 0.5 * ENOUGH_ODDS;
        assert!(!due(&mut check, 0.3 + 0.5 * EVERY) && due(&mut check, 0.5));
    }

    #[test]
    fn an_unlike_person_is_detected_in_every_frame_and_few_of_these_count_against_the_person() {
        let reasons = Reasons { uncertain: true, large_excess: true, ..Reasons::default() };
        let mut check = DetectionCheck::default();
        check.is_due(0.0, Reasons::default(), 0);
        let mut counted = 0;
        for frame in 1..=27 {
            assert!(check.is_due(2.0 + f64::from(frame) / 30.0, reasons, 0));
            counted += usize::from(check.counts);
        }
        assert_eq!(counted, 7);
    }

    #[test]
    fn a_detection_that_is_reversed_or_elsewhere_is_tried_and_a_consistent_one_is_not() {
        let body = Body::human(1.75, HumanModel::Full).unwrap_or_else(|error| unreachable!("{error}"));
        let names: Vec<String> = body.sites().iter().map(|site| site.name.clone()).collect();
        let map = JointMap::new(&body, &names, &[]);
        let detection_at = |root: Pose, sigma: f64| {
            let poses = body.rest_pose(root);
            let place = |site| body.site_position(&poses, site);
            let joint = |site| Some(DetectedJoint { position: place(site), sigma, visible: 1.0 });
            let joints = (0..names.len()).map(joint).collect();
            Detection { person: 5.0, facing: Some(6.0), joints, ..Detection::default() }
        };
        let tracked = body.rest_pose(Pose::IDENTITY);
        let about = Pose::from_parts(Vec3::ZERO, Quat::from_rotation_z(std::f64::consts::PI));
        let aside = Pose::from_parts(0.4 * Vec3::X, Quat::IDENTITY);
        let near = Pose::from_parts(0.09 * Vec3::X, Quat::IDENTITY);
        let tried = |root, sigma| {
            let detection = detection_at(root, sigma);
            let detection = Detected { detection: &detection, map: &map };
            DetectionCheck::default().compare(detection, &body, &tracked, Vec3::ZERO) == DetectionVerdict::Elsewhere
        };
        assert_eq!([about, aside, near].map(|root| tried(root, 0.05)), [true, true, false]);
        assert!(!tried(aside, 0.2), "within the uncertainty of the detection");
        // One that is no person does not count against another.
        let mut check = DetectionCheck::default();
        let verdicts = [f64::NEG_INFINITY, 5.0].map(|person| {
            let detection = Detection { person, ..detection_at(aside, 0.05) };
            check.compare(Detected { detection: &detection, map: &map }, &body, &tracked, Vec3::ZERO)
        });
        assert_eq!(verdicts, [DetectionVerdict::Inconsistent, DetectionVerdict::Elsewhere]);
    }

    #[test]
    fn a_track_that_is_no_person_ends_and_one_that_is_mostly_a_person_does_not() {
        let ends = |odds: &[f64]| {
            let mut check = DetectionCheck { counts: true, ..DetectionCheck::default() };
            odds.iter().any(|person| {
                check.person_odds = Some(*person);
                check.is_false_track()
            })
        };
        assert!(ends(&[-4.0; 4]) && !ends(&[-4.0, 4.0].repeat(20)));
    }
}
