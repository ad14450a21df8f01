//! When a detector looks at a tracked person, and whether it sees the person elsewhere or the other way round.

use super::belief::ENOUGH_ODDS;
use crate::body::Body;
use crate::detect::Detected;
use crate::hypotheses::APART;
use crate::math::{Pose, Vec3};

/// A track is looked after for so long from its start on, seconds. A body that has been lost for so long is gone, and who was hidden
/// is waited for so long; a limb that is elsewhere is looked at as seldom.
pub(super) const YOUNG: f64 = 1.0;
/// Seconds from one look at a young, lost or unsure track to the next: a look costs as much as a frame or two.
const EVERY: f64 = 0.09;
/// A detection is elsewhere when its trunk or legs are this far from the tracked ones in the mean, metres: other skeletons have hips
/// and ankles 10 cm from where a detector tells them. Its ankles are as near to the floor on which somebody stands.
pub(super) const ELSEWHERE: f64 = 0.15;
/// And by so many of its own standard deviations; those of people who hide each other are large although it is right.
pub(super) const SIGMAS: f64 = 3.5;
/// From this sum of log odds on what is tracked is no person.
const NOBODY: f64 = 12.0;

/// What a detection says of where the body is tracked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// It is there.
    There,
    /// It is not, and it is too early to try the detection's place.
    NotThere,
    /// It is elsewhere: the detection's place is to be tried.
    Elsewhere,
}

/// Mean distance of detected joints from the tracked ones, and mean of their standard deviations, metres.
fn apart(detected: Detected, body: &Body, world_from_limb: &[Pose], joints: &[usize]) -> [f64; 2] {
    let (mut apart, mut spread, mut count) = (0.0, 0.0, 0.0_f64);
    for joint in joints {
        if let (Some(seen), Some(site)) = (detected.joint(*joint), detected.map.site(*joint)) {
            let tracked: Vec3 = body.site_position(world_from_limb, site);
            apart += seen.position.distance(tracked);
            spread += seen.sigma;
            count += 1.0;
        }
    }
    [apart, spread].map(|sum| sum / count.max(1.0))
}

/// What detections said of a track.
#[derive(Debug, Default)]
pub(super) struct Doubt {
    /// The tracker found it by itself: nobody said where it is.
    found_itself: bool,
    /// When it was started, seconds.
    since: Option<f64>,
    /// When a detector looked last, and when it did for more than a limb in doubt, seconds; whether it does so in this frame.
    looked: Option<f64>,
    looked_after: Option<f64>,
    weighs: bool,
    /// Whether the last look saw the person where somebody said it is.
    agreed: bool,
    /// Log odds that the person is elsewhere, and that what is tracked is none.
    elsewhere: f64,
    nobody: f64,
    /// Since when the body has been lost, seconds.
    lost_since: Option<f64>,
}

impl Doubt {
    /// A new track.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// Whether nobody said where it is.
    pub(super) fn found_itself(&mut self, itself: bool) {
        self.found_itself = itself;
    }

    /// Whether nobody said where it is.
    pub(super) fn itself(&self) -> bool {
        self.found_itself
    }

    /// Whether the track was started less than a second ago.
    pub(super) fn young(&self, stamp: f64) -> bool {
        self.since.is_none_or(|since| stamp - since < YOUNG)
    }

    /// Whether what a detector sees in this frame is weighed against the pose. Of a young track only some looks are, since it may
    /// start anew by them and forget how it moved; the others are for limbs in doubt.
    pub(super) fn weighs(&self) -> bool {
        self.weighs
    }

    /// Counts a frame; whether a detector shall look at it. `doubtful`: a limb is not where it should be; `unsure`: it is in doubt if
    /// one is; `lost`: the body is.
    pub(super) fn due(&mut self, stamp: f64, doubtful: bool, unsure: bool, lost: bool) -> bool {
        let young = self.young(stamp);
        self.since = self.since.or(Some(stamp));
        let waited = |looked: Option<f64>, every: f64| looked.is_none_or(|looked| stamp - looked >= every);
        // A given start that was seen right is looked after half as often.
        let after = if self.agreed && !lost { 2.0 * EVERY } else { EVERY };
        let looks_after = young && waited(self.looked_after, after);
        let every = if unsure || lost { EVERY } else { YOUNG };
        let due = looks_after || (doubtful || unsure || lost) && waited(self.looked, every);
        self.weighs = looks_after || !young;
        if looks_after {
            self.looked_after = Some(stamp);
        }
        if due {
            self.looked = Some(stamp);
        }
        due
    }

    /// Weighs a detection against the pose, world frame: by the trunk, and by legs and arms of a `young` track or one
    /// `among` several; what it says.
    pub(super) fn weigh(
        &mut self,
        detected: Detected,
        body: &Body,
        world_from_limb: &[Pose],
        young: bool,
        among: bool,
    ) -> Seen {
        let sigmas = if among { 0.0 } else { SIGMAS };
        let elsewhere = |joints: &[usize], least: f64| {
            let [apart, spread] = apart(detected, body, world_from_limb, joints);
            apart > least && apart > sigmas * spread
        };
        let limbs = young || among;
        let Detected { detection, map } = detected;
        let limbs_are = limbs && (elsewhere(map.legs(), ELSEWHERE) || elsewhere(map.arms(), APART));
        if elsewhere(map.trunk(), ELSEWHERE) || limbs_are {
            self.elsewhere += detection.person.min(detection.facing.map_or(f64::INFINITY, f64::abs)).min(ENOUGH_ODDS);
            self.agreed = false;
            return if self.elsewhere >= ENOUGH_ODDS { Seen::Elsewhere } else { Seen::NotThere };
        }
        self.elsewhere = 0.0;
        self.agreed = !self.found_itself && !among;
        Seen::There
    }

    /// Notes what a frame said: whether the body was lost, and what a detector says of what stands where it is tracked. Whether
    /// there is nobody any more.
    pub(super) fn nobody(&mut self, stamp: f64, lost: bool, verdict: Option<f64>) -> bool {
        self.lost_since = if lost { self.lost_since.or(Some(stamp)) } else { None };
        if let Some(person) = verdict {
            self.nobody = (self.nobody - person.clamp(-ENOUGH_ODDS, ENOUGH_ODDS)).max(0.0);
        }
        self.nobody >= NOBODY || self.found_itself && self.lost_since.is_some_and(|since| stamp - since >= YOUNG)
    }

    /// What was seen elsewhere was tried.
    pub(super) fn tried(&mut self) {
        self.elsewhere = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, HumanModel};
    use crate::detect::{DetectedJoint, Detection, JointMap};
    use crate::math::Quat;

    #[test]
    fn young_and_lost_tracks_are_looked_at_often_and_good_ones_never() {
        let count = |from: f64, [doubtful, unsure, lost]: [bool; 3]| {
            let mut doubt = Doubt::default();
            doubt.due(0.0, false, false, false);
            (1..=27).filter(|frame| doubt.due(from + f64::from(*frame) / 30.0, doubtful, unsure, lost)).count()
        };
        let none = [false; 3];
        assert_eq!([count(0.0, none), count(2.0, [false, false, true]), count(2.0, [false, true, false])], [9; 3]);
        assert_eq!([count(2.0, [true, false, false]), count(2.0, none)], [1, 0]);
    }

    #[test]
    fn a_given_start_that_proves_right_is_looked_at_half_as_often_and_one_that_was_found_as_often_as_ever() {
        let body = Body::human(1.75, HumanModel::Full).unwrap_or_else(|error| unreachable!("{error}"));
        let poses = body.rest_pose(Pose::IDENTITY);
        let looks = |itself| {
            let mut doubt = Doubt::default();
            doubt.found_itself(itself);
            let (detection, map) = (Detection::default(), JointMap::default());
            let nothing = Detected { detection: &detection, map: &map };
            let agree = |doubt: &mut Doubt| doubt.weigh(nothing, &body, &poses, true, false);
            let due = |doubt: &mut Doubt, frame: i32| doubt.due(f64::from(frame) / 30.0, false, false, false);
            (0..30).filter(|frame| due(&mut doubt, *frame) && agree(&mut doubt) == Seen::There).count()
        };
        assert_eq!([false, true].map(looks), [5, 10]);
    }

    #[test]
    fn what_is_turned_about_or_elsewhere_is_tried_and_what_is_where_it_is_seen_is_not() {
        let body = Body::human(1.75, HumanModel::Full).unwrap_or_else(|error| unreachable!("{error}"));
        let names: Vec<String> = body.sites().iter().map(|site| site.name.clone()).collect();
        let map = JointMap::new(&body, &names, &[]);
        let seen_at = |root: Pose, sigma: f64| {
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
            let seen = seen_at(root, sigma);
            let seen = Detected { detection: &seen, map: &map };
            [false, true].map(|among| Doubt::default().weigh(seen, &body, &tracked, false, among) == Seen::Elsewhere)
        };
        assert_eq!([about, aside, near].map(|root| tried(root, 0.05)), [[true; 2], [true; 2], [false; 2]]);
        assert_eq!(tried(aside, 0.2), [false, true], "unsure of it");
    }

    #[test]
    fn a_body_that_found_itself_is_gone_when_it_is_lost_for_long_and_any_that_is_no_person() {
        let mut doubt = Doubt::default();
        assert!(!(0..100).any(|frame| doubt.nobody(f64::from(frame) / 30.0, true, None)), "somebody said where it is");
        doubt.found_itself(true);
        assert!(doubt.nobody(100.0 / 30.0, true, None));
        assert!(!doubt.nobody(4.0, false, None), "it is back");
        let mut doubt = Doubt::default();
        assert!((0..4).any(|frame| doubt.nobody(f64::from(frame), false, Some(-4.0))));
        let mut doubt = Doubt::default();
        assert!(!(0..40).any(|frame| doubt.nobody(
            f64::from(frame),
            false,
            Some(if frame % 2 == 0 { -4.0 } else { 4.0 })
        )));
    }
}
