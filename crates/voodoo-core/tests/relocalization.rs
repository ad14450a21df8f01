//! A body that is lost says so, and is found again somewhere else.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use voodoo_core::Frame;
use voodoo_core::HumanModel;
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Config, Estimate, Status};

const CAMERA: scene::DepthCamera = scene::DepthCamera { width: 160, height: 124, focal: 145.0 };

/// The standing person moved and turned about its own axis.
fn moved(body: &Body, shift: Vec3, turn: f64) -> Vec<Pose> {
    let standing = scene::standing(body);
    let (center, turn) = (standing[0].translation, Quat::from_axis_angle(Vec3::Z, turn));
    let place =
        |pose: &Pose| Pose::from_parts(center + shift + turn * (pose.translation - center), turn * pose.rotation);
    standing.iter().map(place).collect()
}

/// Ten frames standing, ten of a covered camera, ten at another place 0.9 m aside; every estimate.
fn cover_and_move(config: Config) -> (Body, Vec<Estimate>) {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let mut noise = scene::Noise(3);
    let mut tracker = crate::tracker(body.clone(), config).unwrap();
    tracker.reset_pose(&scene::standing(&body)).unwrap();
    let mut found = Vec::new();
    for index in 0..30 {
        let aside = if index < 20 { 0.0 } else { 0.9 };
        let (mut pixels, _) = CAMERA.shoot(&body, &moved(&body, Vec3::Y * aside, 0.3), 0.01, &mut noise);
        if (10..20).contains(&index) {
            pixels.fill(0);
        }
        let images = [CAMERA.image(&pixels)];
        let frame = Frame { images: &images, ..Frame::empty(f64::from(index) / 30.0) };
        found.push(tracker.step(&frame).unwrap().clone());
    }
    (body, found)
}

#[test]
fn lost_at_once_and_found_at_once_elsewhere() {
    let (body, found) = cover_and_move(Config::default());
    assert!(found[1..10].iter().all(|estimate| estimate.status == Status::Tracking));
    assert!(found[10..20].iter().all(|estimate| estimate.status == Status::Lost));
    assert!(found[20..].iter().all(|estimate| estimate.status != Status::Lost));
    assert!(found[23..].iter().all(|estimate| estimate.status == Status::Tracking));
    let truth = moved(&body, Vec3::Y * 0.9, 0.3);
    for name in ["l_shoulder", "r_shoulder", "l_wrist", "r_wrist", "l_knee", "r_ankle"] {
        let site = body.site_index(name).unwrap();
        let off = (found[29].sites[site] - body.site_position(&truth, site)).length();
        assert!(off < 0.05, "{name} is off by {off} m");
    }
    // Without the search it stays where it was, and says so.
    let (_, without) = cover_and_move(scene::with(Config::default(), |config| config.relocalization = false));
    assert_eq!(without[29].status, Status::Lost);
}

#[test]
fn finding_is_the_same_on_every_run_and_for_any_number_of_threads() {
    let bits = |config| -> Vec<Vec<u64>> { cover_and_move(config).1.iter().map(scene::bits).collect() };
    let first = bits(Config::default());
    assert_eq!(first, bits(Config::default()));
    assert_eq!(first, bits(scene::with(Config::default(), |config| config.threads = 2)));
}

#[test]
fn sizes_of_a_second_reset_start_from_the_body_as_given() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let mut noise = scene::Noise(5);
    // A person 15 % thicker than the model: the first frame's girths are fitted to it.
    let mut thick = body.clone();
    for limb in body.limbs() {
        let s = limb.shape;
        let shape = voodoo_core::TaperedEllipticCylinder::new(
            s.length(),
            1.15 * s.a0(),
            1.15 * s.b0(),
            1.15 * s.a1(),
            1.15 * s.b1(),
        );
        thick = thick.with_shape(&limb.name, shape.unwrap()).unwrap();
    }
    let poses = scene::standing(&body);
    let positions: Vec<(usize, Vec3)> =
        (0..body.sites().len()).map(|site| (site, body.site_position(&poses, site))).collect();
    let (pixels, _) = CAMERA.shoot(&thick, &poses, 0.005, &mut noise);
    let images = [CAMERA.image(&pixels)];
    let frame = Frame { images: &images, ..Frame::empty(0.0) };
    let mut tracker = crate::tracker(body.clone(), Config::default()).unwrap();
    tracker.reset(&positions, true).unwrap();
    let given = tracker.body().clone();
    tracker.step(&frame).unwrap();
    let fitted = tracker.body().clone();
    assert_ne!(fitted, given, "no girth was fitted");
    tracker.reset(&positions, true).unwrap();
    assert_eq!(*tracker.body(), given);
    // Keeping the sizes keeps those that were fitted.
    tracker.step(&frame).unwrap();
    tracker.reset(&positions, false).unwrap();
    assert_eq!(*tracker.body(), fitted);
}
