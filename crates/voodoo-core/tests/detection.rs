//! Detectors of other joints than the shipped one's, handed in: starts, failures, and what cannot be meant.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use voodoo_core::DepthImage;
use voodoo_core::HumanModel;
use voodoo_core::PeopleOptions;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Config, Frame, People, Status, Tracker};
use voodoo_core::{Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Surroundings};

const CAMERA: scene::DepthCamera = scene::DepthCamera { width: 160, height: 124, focal: 145.0 };
const FIVE: [&str; 5] = ["humanoid_root", "l_shoulder", "r_shoulder", "l_ankle", "r_ankle"];

/// Sees persons where it is told, if the image shows anything there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fixed {
    pub joints: Vec<String>,
    pub lengths: Vec<String>,
    pub found: Vec<(Vec3, Detection)>,
    pub fails: bool,
}

impl Fixed {
    /// Sees nobody.
    pub(crate) fn of(joints: &[&str]) -> Self {
        Self { joints: joints.iter().map(|name| (*name).to_owned()).collect(), ..Self::default() }
    }

    /// Sees this body; joints that it has not are nowhere.
    fn seeing(mut self, body: &Body, poses: &[Pose]) -> Self {
        let place = |name: &String| Some(body.site_position(poses, body.site_index(name).ok()?));
        let joint = |name| place(name).map(|position| DetectedJoint { position, sigma: 0.03, visible: 1.0 });
        self.found.push((poses[0].translation, Detection::new(self.joints.iter().map(joint).collect(), 6.0)));
        self
    }
}

impl Detect for Fixed {
    fn joints(&self) -> Vec<String> {
        self.joints.clone()
    }

    fn lengths(&self) -> Vec<String> {
        self.lengths.clone()
    }

    fn fresh(&self) -> Box<dyn Detect> {
        Box::new(self.clone())
    }

    fn detect(
        &mut self,
        image: &DepthImage,
        around: &Surroundings,
        _query: DetectionQuery,
    ) -> Result<Vec<Detection>, DetectError> {
        if self.fails {
            return Err("out of order".into());
        }
        let mut depth = Vec::new();
        around.open_depth(image, &mut depth);
        let displays = |root: Vec3| {
            let point = |index: usize| image.world_from_sensor * image.back_project(index, depth[index]);
            let within = |index: usize| (point(index) - root).abs().max_element() < 0.9;
            (0..depth.len()).filter(|index| depth[*index] > 0.0 && depth[*index] < 3.0 && within(*index)).count() > 100
        };
        Ok(self.found.iter().filter(|(root, _)| displays(*root)).map(|(_, observed)| observed.clone()).collect())
    }
}

/// The greatest distance of a tracked site from the truth, meters.
fn farthest(tracker: &Tracker, body: &Body, poses: &[Pose]) -> f64 {
    let sites = tracker.estimate().sites.iter().enumerate();
    sites.map(|(site, place)| place.distance(body.site_position(poses, site))).fold(0.0, f64::max)
}

/// Shows a tracker an image so many times.
fn feed(tracker: &mut Tracker, pixels: &[u16], frames: std::ops::Range<i32>) {
    let images = [CAMERA.image(pixels)];
    for frame in frames {
        tracker.step(&Frame { images: &images, ..Frame::empty(f64::from(frame) / 30.0) }).unwrap();
    }
}

#[test]
fn a_detector_of_five_joints_starts_a_body_from_nothing_and_names_that_the_body_lacks_are_ignored() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let (pixels, _) = CAMERA.shoot(&body, &poses, 0.005, &mut scene::Noise(3));
    let nose = [&FIVE[..], &["nose"]].concat();
    // Without the root among them, it is where the other joints put it.
    for joints in [&FIVE[..], &nose, &FIVE[1..]] {
        let detector = Fixed::of(joints).seeing(&body, &poses);
        let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap().with_detector(Box::new(detector));
        feed(&mut tracker, &pixels, 0..10);
        assert_eq!(tracker.estimate().status, Status::Tracking, "{joints:?}");
        let off = farthest(&tracker, &body, &poses);
        assert!(off < 0.08, "{joints:?}: {off} m off");
    }
}

#[test]
fn whoever_comes_is_not_taken_for_the_one_who_leaves() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let aside = Pose::from_translation(0.9 * Vec3::Y);
    let other: Vec<Pose> = poses.iter().map(|pose| aside * *pose).collect();
    let mut noise = scene::Noise(3);
    let [alone, beside] = [&poses, &other].map(|poses| CAMERA.shoot(&body, poses, 0.005, &mut noise).0);
    let both: Vec<u16> = alone.iter().zip(&beside).map(|(a, b)| *a.min(b)).collect();
    let detector = Fixed::of(&FIVE).seeing(&body, &poses).seeing(&body, &other);
    let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap().with_detector(Box::new(detector));
    tracker.reset_pose(&poses).unwrap();
    feed(&mut tracker, &alone, 0..10);
    feed(&mut tracker, &both, 10..25);
    assert_eq!(tracker.estimate().status, Status::Tracking);
    feed(&mut tracker, &beside, 25..60);
    assert_eq!(tracker.estimate().status, Status::Lost);
    let root = tracker.estimate().world_from_limb[0].translation;
    assert!(root.distance(poses[0].translation) < 0.3, "{root} is not where the person was");
    // Who comes back is tracked again.
    feed(&mut tracker, &both, 60..75);
    assert_eq!(tracker.estimate().status, Status::Tracking);
    assert!(farthest(&tracker, &body, &poses) < 0.1);
}

#[test]
fn joints_are_those_of_the_body_after_its_limbs_were_edited() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let (pixels, _) = CAMERA.shoot(&body, &poses, 0.005, &mut scene::Noise(3));
    let detector = Fixed::of(&FIVE).seeing(&body, &poses);
    let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap().with_detector(Box::new(detector));
    // Sites of the hands are gone; those after them have other numbers.
    for hand in ["l_hand", "r_hand"] {
        tracker.remove_limb(hand).unwrap();
    }
    assert!(tracker.can_search() && tracker.body().sites().len() < body.sites().len());
    feed(&mut tracker, &pixels, 0..10);
    assert_eq!(tracker.estimate().status, Status::Tracking);
    for name in FIVE {
        let truth = body.site_position(&poses, body.site_index(name).unwrap());
        let off = tracker.estimate().sites[tracker.body().site_index(name).unwrap()].distance(truth);
        assert!(off < 0.08, "{name} is {off} m off");
    }
    tracker.remove_limb("l_thigh").unwrap();
    tracker.remove_limb("r_thigh").unwrap();
    assert!(tracker.can_search(), "root and shoulders fix the pose");
    tracker.remove_limb("l_upperarm").unwrap();
    assert_eq!(tracker.can_search(), tracker.body().site_index("l_shoulder").is_ok());
}

#[test]
fn lengths_that_are_reported_set_the_sizes_and_others_stay_as_they_were_given() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let (pixels, _) = CAMERA.shoot(&body, &poses, 0.005, &mut scene::Noise(3));
    let config = scene::with(Config::default(), |config| {
        config.fit_lengths = false;
        config.fit_girths = false;
    });
    let started = |lengths: &[(&str, f64)]| {
        let mut detector =
            Fixed::of(&["l_shoulder", "r_shoulder", "l_hip", "r_hip", "l_knee", "r_knee", "l_ankle", "r_ankle"]);
        detector.lengths = lengths.iter().map(|(name, _)| (*name).to_owned()).collect();
        let mut detector = detector.seeing(&body, &poses);
        detector.found[0].1.lengths = lengths.iter().map(|(_, length)| [*length, 0.02]).collect();
        let mut tracker = Tracker::new(body.clone(), config.clone()).unwrap().with_detector(Box::new(detector));
        feed(&mut tracker, &pixels, 0..1);
        let shape = |name: &str| tracker.body().limbs()[body.limb_index(name).unwrap()].shape.length();
        ["l_thigh", "r_thigh", "l_calf"].map(shape)
    };
    let given =
        ["l_thigh", "r_thigh", "l_calf"].map(|name| body.limbs()[body.limb_index(name).unwrap()].shape.length());
    let rest = body.rest_pose(Pose::IDENTITY);
    let at = |name: &str| body.site_position(&rest, body.site_index(name).unwrap());
    let thigh = at("l_hip").distance(at("l_knee"));
    let ratios = |found: [f64; 3]| [0, 1, 2].map(|limb: usize| found[limb] / given[limb]);
    assert!(ratios(started(&[("finger", 0.1)])).iter().all(|ratio| *ratio == 1.0), "no length that is known");
    let [left, right, calf] = ratios(started(&[("thigh", 0.9 * thigh), ("finger", 0.1)]));
    // The body is scaled as a whole by what its limbs tell together, then limb by limb.
    assert!(
        (left - 0.9).abs() < 0.01 && (right - 0.9).abs() < 0.01 && (calf - 1.0).abs() < 0.05,
        "{left} {right} {calf}"
    );
}

#[test]
fn a_detector_that_fails_leaves_the_step_as_it_would_be_without_detections_and_reports_why() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let (pixels, _) = CAMERA.shoot(&body, &poses, 0.005, &mut scene::Noise(3));
    let images = [CAMERA.image(&pixels)];
    let run = |detector: Fixed| {
        let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap().with_detector(Box::new(detector));
        tracker.reset_pose(&poses).unwrap();
        let mut bits = Vec::new();
        let mut errors = Vec::new();
        for frame in 0..4 {
            tracker.step(&Frame { images: &images, ..Frame::empty(f64::from(frame)) }).unwrap();
            bits.push(scene::bits(tracker.estimate()));
            errors.push(tracker.detector_error().map(ToString::to_string));
        }
        (bits, errors)
    };
    let (silent, none) = run(Fixed::of(&FIVE));
    let (failing, errors) = run(Fixed { fails: true, ..Fixed::of(&FIVE) });
    assert_eq!(silent, failing);
    assert!(none.iter().all(Option::is_none));
    assert_eq!(errors[0].as_deref(), Some("out of order"));
}

#[test]
fn what_cannot_be_meant_is_a_failure_that_names_it() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let (pixels, _) = CAMERA.shoot(&body, &poses, 0.005, &mut scene::Noise(3));
    let good = Fixed::of(&FIVE).seeing(&body, &poses);
    type Wrong = fn(&mut Detection);
    let wrongs: [(&str, Wrong); 7] = [
        ("detection[0].joints: expected 5", |observed| observed.joints.truncate(2)),
        ("detection[0].joints[1]: expected finite", |observed| {
            observed.joints[1].as_mut().unwrap().position.x = f64::NAN
        }),
        ("detection[0].joints[0].sigma: expected finite meters > 0", |observed| {
            observed.joints[0].as_mut().unwrap().sigma = 0.0
        }),
        ("detection[0].lengths: expected 0", |observed| observed.lengths = vec![[1.0, 0.1]]),
        ("detection[0].person and facing", |observed| observed.person = f64::NAN),
        ("detection[0].bounds", |observed| observed.bounds.maxs = Vec3::INFINITY),
        ("detection[0].pixels: expected indices below 19840", |observed| observed.pixels = vec![usize::MAX]),
    ];
    for (words, wrong) in wrongs {
        let mut detector = good.clone();
        wrong(&mut detector.found[0].1);
        let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap().with_detector(Box::new(detector));
        feed(&mut tracker, &pixels, 0..3);
        let error = tracker.detector_error().map(ToString::to_string).unwrap_or_default();
        assert!(error.starts_with(words), "{error}");
        assert_eq!(tracker.estimate().status, Status::Searching, "{words}");
    }
}

#[test]
fn several_persons_are_found_by_any_detector_and_without_one_who_is_added_is_followed() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let places = [-0.6, 0.6].map(|aside| -> Vec<Pose> {
        let moved = |pose: &Pose| Pose::from_parts(pose.translation + aside * Vec3::Y, pose.rotation);
        scene::standing(&body).iter().map(moved).collect()
    });
    let mut pixels = vec![u16::MAX; CAMERA.width * CAMERA.height];
    for poses in &places {
        let (observed, _) = CAMERA.shoot(&body, poses, 0.002, &mut scene::Noise(4));
        pixels.iter_mut().zip(observed).for_each(|(all, pixel)| *all = pixel.min(*all));
    }
    let images = [CAMERA.image(&pixels)];
    let step = |people: &mut People, frames: i32| {
        for frame in 0..frames {
            people.step(&Frame { images: &images, ..Frame::empty(f64::from(frame) / 15.0) }, &[]).unwrap();
        }
    };
    let roots = |people: &People| -> Vec<Vec3> {
        people.present().map(|(_, tracker)| tracker.estimate().world_from_limb[0].translation).collect()
    };
    let new = || People::new(body.clone(), Config::default(), PeopleOptions::default()).unwrap();
    let mut people =
        new().with_detector(Box::new(Fixed::of(&FIVE).seeing(&body, &places[0]).seeing(&body, &places[1])));
    step(&mut people, 12);
    let found = roots(&people);
    assert_eq!(found.len(), 2, "{found:?}");
    for poses in &places {
        assert!(found.iter().any(|root| root.distance(poses[0].translation) < 0.1), "{found:?}");
    }
    let mut failing = new().with_detector(Box::new(Fixed { fails: true, ..Fixed::of(&FIVE) }));
    step(&mut failing, 1);
    assert_eq!(failing.detector_error().map(ToString::to_string).as_deref(), Some("out of order"));
    let mut given = new();
    let positions: Vec<(usize, Vec3)> =
        (0..body.sites().len()).map(|site| (site, body.site_position(&places[0], site))).collect();
    assert!(given.add(&positions[..1], true).is_err(), "one position fixes no pose");
    assert_eq!(given.add(&positions, false).unwrap(), 1);
    step(&mut given, 3);
    let found = roots(&given);
    assert!(found.len() == 1 && found[0].distance(places[0][0].translation) < 0.1, "{found:?}");
}
