//! Small persons, and persons whose stature is known.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Detect, Detection, DetectionQuery, HumanModel, Surroundings};
use voodoo_detect::{Detector, JOINTS};

const CAMERA: scene::DepthCamera = scene::DepthCamera { width: 212, height: 120, focal: 160.0 };

/// Returns a person who stands still at a distance, meters, turned by an angle about the vertical, and its detections.
fn seen(stature: f64, distance: f64, turn: f64, mut detector: Detector) -> (Body, Vec<Pose>, Vec<Detection>) {
    let body = Body::human(stature, HumanModel::Measured).unwrap();
    let turned = Quat::from_axis_angle(Vec3::Z, turn);
    let low = scene::standing(&body)[0].translation.z;
    let poses = body.rest_pose(Pose::from_parts(Vec3::new(distance, 0.0, low), turned));
    let (pixels, _) = CAMERA.shoot(&body, &poses, 0.004, &mut scene::Noise(5));
    let around = Surroundings { up: Some(Vec3::Z), ..Surroundings::default() };
    let found = detector.detect(&CAMERA.image(&pixels), &around, DetectionQuery::All).unwrap();
    (body, poses, found)
}

/// Returns the detection of a person 2.5 m in front of the camera, and the mean error of its joints, meters.
fn detected(stature: f64, detector: Detector) -> (Detection, f64) {
    let (body, poses, found) = seen(stature, 2.5, 2.6, detector);
    assert_eq!(found.len(), 1, "{stature} m");
    let error = |(name, joint): (&&str, &Option<voodoo_core::DetectedJoint>)| {
        joint.unwrap().position.distance(body.site_position(&poses, body.site_index(name).unwrap()))
    };
    let mean = JOINTS.iter().zip(&found[0].joints).map(error).sum::<f64>() / JOINTS.len() as f64;
    (found[0].clone(), mean)
}

fn stature(detection: &Detection) -> [f64; 2] {
    *detection.lengths.last().unwrap()
}

#[test]
fn who_stands_still_is_found_from_all_sides() {
    for stature in [0.9, 1.05, 1.2, 1.4, 1.6, 1.75, 2.0] {
        let found = (0..12).filter(|turn| {
            let turn = f64::from(*turn) * std::f64::consts::TAU / 12.0 + 0.1;
            !seen(stature, 3.0, turn, Detector::new()).2.is_empty()
        });
        assert!(found.count() > 10, "{stature} m");
    }
}

#[test]
fn children_are_found_as_precisely_as_adults() {
    for expected in [0.9, 1.05, 1.3, 1.75] {
        let (detection, mean) = detected(expected, Detector::new());
        let [reported, _] = stature(&detection);
        assert!(
            (reported / expected).ln().abs() < 0.1 && mean < 0.045,
            "{expected} m: {reported} m, joints {mean} m off"
        );
    }
}

#[test]
fn lengths_follow_a_known_stature_as_far_as_it_is_known() {
    let (unknown, _) = detected(1.05, Detector::new());
    let ([reported, own], told) = (stature(&unknown), 1.2);
    let with = |sigma| stature(&detected(1.05, Detector::new().with_stature(told, sigma)).0);
    let [known, sigma] = with(0.01);
    assert!((known / told).ln().abs() < 0.02 && sigma < 0.01, "{known} m, {sigma}");
    let [vague, sigma] = with(0.5);
    assert!(
        (vague / told).ln().abs() > 0.5 * (reported / told).ln().abs() && sigma > 0.5 * own,
        "{vague} m of {reported}"
    );
}
