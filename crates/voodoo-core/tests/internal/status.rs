//! What images prove of limbs, and whether what is seen is round.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use super::scene;
use std::f64::consts::{FRAC_PI_3, PI, TAU};

use voodoo_core::Body;
use voodoo_core::body::HumanModel;
use voodoo_core::body::two_bone::TwoBone;
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::observation::background::Backgrounds;
use voodoo_core::observation::depth_view::{DepthViews, find_segmented};
use voodoo_core::observation::frame::{DepthImage, DepthPixels, Frame};
use voodoo_core::visibility::limb_support::{LimbSupport, measure_support};
use voodoo_core::visibility::render::{Rendering, Viewpoint};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const INTRINSICS: [f64; 4] = [275.0, 275.0, 159.5, 119.5];

/// The standing person with an arm turned about its shoulder, the whole arm alike.
fn turned(body: &Body, arm: &TwoBone, turn: Quat) -> Vec<Pose> {
    let mut poses = scene::standing(body);
    let root = arm.root(body, &poses);
    for limb in arm.limbs() {
        let pose = poses[limb];
        poses[limb] = Pose::from_parts(root + turn * (pose.translation - root), turn * pose.rotation);
    }
    poses
}

/// The two arms: chains that hang on the upper part of the body.
fn arms(body: &Body) -> Vec<TwoBone> {
    TwoBone::from_body(body).into_iter().filter(|chain| body.limbs()[chain.upper].name.ends_with("arm")).collect()
}

/// Depth of the body from one place, millimeters, nothing behind it.
fn shoot(body: &Body, poses: &[Pose], world_from_sensor: Pose) -> Vec<u16> {
    let view = Viewpoint { camera: scene::pinhole(WIDTH, HEIGHT, INTRINSICS), world_from_sensor };
    let mut image = Rendering::default();
    image.render(body, poses, &view).unwrap();
    image.depth().iter().map(|depth| (depth * 1000.0).round() as u16).collect()
}

/// The front camera, and one that looks at the person's back from as far.
fn cameras() -> [Pose; 2] {
    let front = scene::DepthCamera::world_from_sensor();
    let center = Vec3::new(2.4, 0.0, 0.0);
    let about = Quat::from_axis_angle(Vec3::Z, PI);
    let back = Pose::from_parts(center + about * (front.translation - center), about * front.rotation);
    [front, back]
}

/// Runs `ask` with the views of these images.
fn with_views<T>(shots: &[(Vec<u16>, Pose)], ask: impl FnOnce(DepthViews) -> T) -> T {
    let images: Vec<DepthImage> = shots
        .iter()
        .map(|(pixels, world_from_sensor)| DepthImage {
            pixels: DepthPixels::U16(pixels),
            camera: scene::pinhole(WIDTH, HEIGHT, INTRINSICS),
            meters_per_unit: 0.001,
            world_from_sensor: *world_from_sensor,
            weight: 1.0,
            source: 0,
        })
        .collect();
    let frame = Frame { images: &images, ..Frame::empty(0.0) };
    let mut segmented = Vec::new();
    find_segmented(&frame, &mut segmented);
    ask(DepthViews {
        frame: &frame,
        ownership: crate::testing::everything(&Backgrounds::default()),
        segmented: &segmented,
        origin: Vec3::ZERO,
    })
}

fn proofs(body: &Body, poses: &[Pose], shots: &[(Vec<u16>, Pose)]) -> Vec<LimbSupport> {
    let mut found = Vec::new();
    with_views(shots, |views| {
        measure_support(views, body, poses, &TwoBone::from_body(body), &mut Vec::new(), &mut found);
    });
    found
}

#[test]
fn an_arm_turned_away_any_way_proves_less_than_half() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let [front, _] = cameras();
    for arm in arms(&body) {
        // Half way up, off the trunk; then any way about the shoulder by what moves the elbow by twelve centimeters.
        let outwards = Vec3::Y * arm.root(&body, &scene::standing(&body)).y.signum();
        let raised = Quat::from_axis_angle(Vec3::NEG_Z.cross(outwards), 0.9);
        let true_poses = turned(&body, &arm, raised);
        let shots = [(shoot(&body, &true_poses, front), front)];
        let right = proofs(&body, &true_poses, &shots);
        let elbow = body.limbs()[arm.lower].parent.as_ref().unwrap().1.parent_from_joint.translation;
        let down = (true_poses[arm.upper] * elbow - arm.root(&body, &true_poses)).normalize();
        for step in 0..24 {
            let angle = TAU * f64::from(step) / 24.0;
            let axis = Quat::from_axis_angle(down, angle) * down.any_orthonormal_vector();
            let off = 2.0 * (0.06 / arm.lengths[0]).asin();
            let wrong = turned(&body, &arm, Quat::from_axis_angle(axis, off) * raised);
            let moved = (wrong[arm.upper] * elbow - true_poses[arm.upper] * elbow).length();
            assert!((moved - 0.12).abs() < 0.01, "the elbow moved by {moved} m");
            let found = proofs(&body, &wrong, &shots);
            for limb in [arm.upper, arm.lower] {
                let (good, bad) = (right[limb].net_support(), found[limb].net_support());
                assert!(good[0] > 0.8 && good[1] > 0.8, "{good:?}");
                assert!(bad[0] < 0.5 * good[0], "turned about {axis:?}: {bad:?} of {good:?}");
            }
        }
    }
}

#[test]
fn what_another_limb_hides_counts_as_occluded() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let [front, _] = cameras();
    let mut poses = scene::standing(&body);
    let neck = body.limb_index("neck").unwrap();
    let seen = |poses: &[Pose]| {
        let patches = proofs(&body, poses, &[(shoot(&body, poses, front), front)])[neck].patches;
        patches.occluded / patches.front_facing
    };
    let upright = seen(&poses);
    // The neck lies in the head, whose surface is less than the tolerance of the depth image before it.
    poses[neck].translation = poses[body.limb_index("head").unwrap()].translation;
    let inside = seen(&poses);
    assert!(upright < 0.5 && inside > 0.9, "{upright} {inside}");
}

#[test]
fn what_one_camera_cannot_prove_another_can() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let [front, back] = cameras();
    let arm = &arms(&body)[0];
    // The hand behind the back, beyond its middle, the elbow where the front camera sees least of the forearm.
    let poses = (0..6).map(|swivel| {
        let mut poses = scene::standing(&body);
        let aside = arm.root(&body, &poses).y;
        arm.reach(&body, &mut poses, Vec3::new(2.4 + 0.25, -0.5 * aside, 1.0), f64::from(swivel) * FRAC_PI_3);
        poses
    });
    let shots = |poses: &[Pose]| [front, back].map(|camera| (shoot(&body, poses, camera), camera));
    let proof = |poses: &[Pose]| proofs(&body, poses, &shots(poses)[..1])[arm.lower];
    let poses = poses.min_by(|a, b| proof(a).own[1].total_cmp(&proof(b).own[1])).unwrap();
    let (alone, both) = (proof(&poses), proofs(&body, &poses, &shots(&poses))[arm.lower]);
    assert!(alone.known && alone.own[1] < 0.05, "{alone:?}");
    assert!(both.own[1] > 0.5 && both.free_space[1] < 0.05, "{both:?}");
    // No image, no word.
    assert_eq!(proofs(&body, &poses, &[])[arm.lower], LimbSupport::default());
}

fn roundness(views: DepthViews, body: &Body, poses: &[Pose]) -> [f64; 2] {
    measure_support(views, body, poses, &[], &mut Vec::new(), &mut Vec::new())
}

#[test]
fn a_body_is_round_and_a_door_is_not() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let [front, back] = cameras();
    let poses = scene::standing(&body);
    for camera in [front, back] {
        let [product, square] =
            with_views(&[(shoot(&body, &poses, camera), camera)], |views| roundness(views, &body, &poses));
        assert!((product / square - 1.0).abs() < 0.15, "{product} / {square}");
        // Upright, and one that stands aslant.
        for slope in [0.0, 0.4] {
            let door = |index: usize| {
                let x = ((index % WIDTH) as f64 - INTRINSICS[2]) / INTRINSICS[0];
                (1000.0 * 2.33 / (1.0 - slope * x)).round() as u16
            };
            let pixels = (0..WIDTH * HEIGHT).map(door).collect();
            let [product, square] = with_views(&[(pixels, camera)], |views| roundness(views, &body, &poses));
            assert!((product / square).abs() < 0.1, "slope {slope}: {product} / {square}");
        }
        let empty = with_views(&[(vec![0; WIDTH * HEIGHT], camera)], |views| roundness(views, &body, &poses));
        assert_eq!(empty, [0.0; 2]);
    }
}
