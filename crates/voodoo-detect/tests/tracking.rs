//! What the shipped detector knows, and a person who is found without a start.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use voodoo_core::HumanModel;
use voodoo_core::math::Vec3;
use voodoo_core::{Body, Config, Frame, Status, TrackError};
use voodoo_core::{Detect, DetectionQuery, Surroundings};
use voodoo_detect::{Detector, JOINTS, LENGTHS};

const CAMERA: scene::DepthCamera = scene::DepthCamera { width: 160, height: 124, focal: 145.0 };

#[test]
fn a_tracker_without_a_pose_searches_and_refuses_every_frame_of_a_body_that_the_detector_does_not_know() {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let mut tracker = crate::tracker(body.clone(), Config::default()).unwrap();
    let estimate = tracker.step(&Frame::empty(0.0)).unwrap();
    assert_eq!((estimate.status, estimate.stamp, estimate.sites.len()), (Status::Searching, 0.0, 0));
    assert!(matches!(tracker.step(&Frame::empty(0.0)), Err(TrackError::TimeBackwards { .. })));
    let sites = body.sites().iter().filter(|site| site.name != "l_hand").cloned().collect();
    let unknown = Body::new("unknown", body.limbs().to_vec(), sites).unwrap();
    let mut tracker = crate::tracker(unknown, Config::default()).unwrap();
    assert_eq!(tracker.step(&Frame::empty(0.0)).unwrap_err(), TrackError::NotInitialized);
}

#[test]
fn a_person_is_found_without_a_start_and_so_are_joints_lengths_and_pixels() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let (pixels, observed) = CAMERA.shoot(&body, &poses, 0.005, &mut scene::Noise(3));
    let image = CAMERA.image(&pixels);
    let mut detector = Detector::new();
    let found = detector.detect(&image, &Surroundings::default(), DetectionQuery::All).unwrap();
    let [person] = &found[..] else { panic!("{} persons", found.len()) };
    assert_eq!([person.joints.len(), person.lengths.len()], [JOINTS.len(), LENGTHS.len()]);
    for (name, joint) in JOINTS.iter().zip(&person.joints) {
        let site = body.site_index(name).unwrap();
        let off = joint.unwrap().position.distance(body.site_position(&poses, site));
        assert!(off < 0.15, "{name} is {off} m off");
    }
    assert!((person.pixels.len() as f64 / observed as f64 - 1.0).abs() < 0.2, "{} of {observed}", person.pixels.len());
    assert!(detector.nearest().is_some_and(|(odds, _)| odds == person.person));
    // The same in a tracker.
    let mut tracker = crate::tracker(body.clone(), Config::default()).unwrap();
    let images = [image];
    for frame in 0..10 {
        tracker.step(&Frame { images: &images, ..Frame::empty(f64::from(frame) / 30.0) }).unwrap();
    }
    assert_eq!(tracker.estimate().status, Status::Tracking);
    let site = body.site_index("humanoid_root").unwrap();
    let off: Vec3 = tracker.estimate().sites[site] - body.site_position(&poses, site);
    assert!(off.length() < 0.1, "{off}");
}

#[test]
fn weights_of_another_network_are_refused() {
    assert!(Detector::with_weights(b"voodoo person 1\n\n").is_err());
    assert!(Detector::with_weights(b"nothing").is_err());
}
