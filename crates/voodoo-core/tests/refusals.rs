//! What is refused, and that a refusal leaves no trace.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::detection::Fixed;
use crate::scene;
use voodoo_core::Value;
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Config, Status, TaperedEllipticCylinder, TrackError, Tracker};
use voodoo_core::{Camera, DetectedPerson};
use voodoo_core::{Cloud, DepthImage, DepthPixels, Frame, Ground, PointSlice, PositionRelation, RayRelation, Scope};
use voodoo_core::{HumanModel, Joint, JointKind, Limb, People, PeopleOptions, Site};

fn started() -> (Tracker, Vec<[f64; 3]>) {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap();
    tracker.reset_pose(&scene::standing(&body)).unwrap();
    (tracker, scene::surface_points(&body, &scene::standing(&body), 400, 0.01, &mut scene::Noise(1)))
}

/// Refuses `bad` after one good frame, naming `what`, and goes on as if it had never come.
#[track_caller]
fn refused(bad: &Frame, what: &str) {
    let ((mut refusing, points), (mut spared, _)) = (started(), started());
    let clouds = [scene::cloud(&points)];
    for tracker in [&mut refusing, &mut spared] {
        tracker.step(&scene::with_cloud(1.0, &clouds)).unwrap();
    }
    let before = scene::bits(refusing.estimate());
    let error = refusing.step(bad).unwrap_err();
    assert!(error.to_string().contains(what), "expected {what:?} in {error}");
    assert_eq!(scene::bits(refusing.estimate()), before, "the refusal changed the estimate");
    for stamp in [2.0, 3.0] {
        let frame = scene::with_cloud(stamp, &clouds);
        let (refusing, spared) = (refusing.step(&frame).unwrap(), spared.step(&frame).unwrap());
        assert_eq!(scene::bits(refusing), scene::bits(spared), "the refusal left a trace");
    }
}

#[test]
fn bad_stamps_are_refused() {
    refused(&Frame::empty(f64::NAN), "stamp");
    refused(&Frame::empty(f64::INFINITY), "stamp");
    refused(&Frame::empty(1.0), "after 1 s");
    refused(&Frame::empty(0.5), "found 0.5 s");
}

#[test]
fn bad_clouds_are_refused() {
    let good = [[2.4, 0.0, 1.0]; 5];
    let base = scene::cloud(&good);
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut points = good;
        points[3][1] = value;
        refused(&scene::with_cloud(2.0, &[base, scene::cloud(&points)]), "points[1].points");
        let single = points.map(|point| point.map(|value| value as f32));
        refused(&scene::with_cloud(2.0, &[Cloud { points: PointSlice::F32(&single), ..base }]), "row 3");
    }
    for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused(&scene::with_cloud(2.0, &[Cloud { weight, ..base }]), "points[0].weight");
    }
    for world_from_sensor in [
        Pose::from_parts(Vec3::new(0.0, f64::NAN, 0.0), Quat::IDENTITY),
        Pose::from_parts(Vec3::ZERO, Quat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
        Pose::from_parts(Vec3::ZERO, Quat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0)),
    ] {
        refused(&scene::with_cloud(2.0, &[Cloud { world_from_sensor, ..base }]), "points[0].world_from_sensor");
    }
    refused(&scene::with_cloud(2.0, &[Cloud { scope: Scope::Limb(10), ..base }]), "points[0].limb");
}

#[test]
fn bad_images_are_refused() {
    let pixels = [2400_u16; 12];
    let camera = Camera::pinhole(4, 3, [100.0, 100.0, 1.5, 1.0]).unwrap();
    let wider = Camera::pinhole(5, 3, [100.0, 100.0, 1.5, 1.0]).unwrap();
    let base = DepthImage {
        pixels: DepthPixels::U16(&pixels),
        camera: &camera,
        meters_per_unit: 0.001,
        world_from_sensor: scene::DepthCamera::world_from_sensor(),
        weight: 1.0,
        source: 0,
    };
    for (image, what) in [
        (DepthImage { camera: &wider, ..base }, "depth[0].image"),
        (DepthImage { pixels: DepthPixels::U16(&[]), ..base }, "depth[0].image"),
        (DepthImage { meters_per_unit: 0.0, ..base }, "depth[0].meters_per_unit"),
        (DepthImage { meters_per_unit: f64::NAN, ..base }, "depth[0].meters_per_unit"),
        (DepthImage { weight: -2.0, ..base }, "depth[0].weight"),
        (
            DepthImage { world_from_sensor: Pose::from_parts(Vec3::NAN, Quat::IDENTITY), ..base },
            "depth[0].world_from_sensor",
        ),
    ] {
        refused(&Frame { images: &[image], ..Frame::empty(2.0) }, what);
    }
}

#[test]
fn bad_sites_and_floors_are_refused() {
    let sites = Body::human(1.75, HumanModel::Papers).unwrap().sites().len();
    let position = PositionRelation { site: 0, position: Vec3::ZERO, weight: 1.0, bias: 0.0, source: 0 };
    for (bad, what) in [
        (PositionRelation { site: sites, ..position }, "positions[0].site"),
        (PositionRelation { position: Vec3::NAN, ..position }, "positions[0].position"),
        (PositionRelation { weight: f64::NAN, ..position }, "positions[0].weight"),
    ] {
        refused(&Frame { positions: &[bad], ..Frame::empty(2.0) }, what);
        let detection = DetectedPerson { positions: &[position, bad], person: 5.0 };
        let what = what.replace("positions[0]", "detections[0].positions[1]");
        refused(&Frame { detections: &[detection], ..Frame::empty(2.0) }, &what);
    }
    let nobody = DetectedPerson { positions: &[position], person: f64::NAN };
    refused(&Frame { detections: &[nobody], ..Frame::empty(2.0) }, "detections[0].person");
    let ray = RayRelation { site: 0, origin: Vec3::ZERO, direction: Vec3::X, weight: 1.0, bias: 0.0, source: 0 };
    for (bad, what) in [
        (RayRelation { site: sites, ..ray }, "rays[0].site"),
        (RayRelation { origin: Vec3::INFINITY, ..ray }, "rays[0].origin"),
        (RayRelation { direction: Vec3::ZERO, ..ray }, "rays[0].direction"),
        (RayRelation { direction: Vec3::NAN, ..ray }, "rays[0].direction"),
        (RayRelation { weight: 0.0, bias: 0.0, ..ray }, "rays[0].weight"),
    ] {
        refused(&Frame { rays: &[bad], ..Frame::empty(2.0) }, what);
    }
    for (normal, offset) in [(Vec3::Z * 2.0, 0.0), (Vec3::NAN, 0.0), (Vec3::Z, f64::NAN)] {
        refused(&Frame { ground: Some(Ground { normal, offset }), ..Frame::empty(2.0) }, "ground");
    }
}

#[test]
fn a_tracker_without_a_pose_searches_and_refuses_every_frame_of_a_body_that_no_detector_knows() {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let new = || Tracker::new(body.clone(), Config::default()).unwrap();
    let mut tracker = new().with_detector(Box::new(Fixed::of(&["l_hip", "r_hip", "l_shoulder", "nose"])));
    let estimate = tracker.step(&Frame::empty(0.0)).unwrap();
    assert_eq!((estimate.status, estimate.stamp, estimate.sites.len()), (Status::Searching, 0.0, 0));
    assert!(matches!(tracker.step(&Frame::empty(0.0)), Err(TrackError::TimeBackwards { .. })));
    let two = Fixed::of(&["l_hip", "r_hip", "nose"]);
    for mut tracker in [new(), new().with_detector(Box::new(two))] {
        assert_eq!(tracker.step(&Frame::empty(0.0)).unwrap_err(), TrackError::NotInitialized);
        assert!(tracker.estimate().stamp.is_nan());
    }
    let tracker = new();
    // No residual of zero before anything was measured.
    assert!(tracker.estimate().stamp.is_nan() && tracker.estimate().mean_squared_distance.is_nan());
}

#[test]
fn a_refused_reset_changes_nothing() {
    let (mut tracker, points) = started();
    tracker.step(&scene::with_cloud(1.0, &[scene::cloud(&points)])).unwrap();
    let before = scene::bits(tracker.estimate());
    let body = tracker.body().clone();
    let underdetermined = |error: TrackError| error.to_string().contains("three positions that do not lie on a line");
    assert!(underdetermined(tracker.reset(&[(0, Vec3::ZERO)], true).unwrap_err()));
    let line = [0, 1, 2].map(|index| (index, Vec3::Z * index as f64));
    assert!(underdetermined(tracker.reset(&line, true).unwrap_err()));
    assert!(tracker.reset(&[(99, Vec3::ZERO)], true).unwrap_err().to_string().contains("99"));
    assert!(tracker.reset(&[(0, Vec3::NAN); 3], true).unwrap_err().to_string().contains("humanoid_root"));
    let millimeters: Vec<_> = sites_of(&tracker).into_iter().map(|(site, place)| (site, place * 1000.0)).collect();
    assert!(tracker.reset(&millimeters, true).unwrap_err().to_string().contains("found 1000.0000 times"));
    assert!(tracker.reset_pose(&[Pose::IDENTITY]).unwrap_err().to_string().contains("10 limbs"));
    assert!(tracker.scale(0.0).is_err() && tracker.scale(f64::NAN).is_err());
    assert!(tracker.remove_limb("torso").is_err() && tracker.remove_limb("tail").is_err());
    assert_eq!(tracker.body(), &body);
    assert_eq!(scene::bits(tracker.estimate()), before);
}

fn sites_of(tracker: &Tracker) -> Vec<(usize, Vec3)> {
    tracker.estimate().sites.iter().copied().enumerate().collect()
}

fn limb(name: &str, parent: Option<usize>) -> Limb {
    let joint = Joint {
        name: format!("{name}_joint"),
        parent_from_joint: Pose::IDENTITY,
        limb_from_joint: Pose::IDENTITY,
        semi_axes: [0.0; 2],
        weight: 1.0,
        limits: None,
        motion: 0.3,
    };
    Limb {
        name: name.into(),
        shape: TaperedEllipticCylinder::new(0.3, 0.05, 0.05, 0.04, 0.04).unwrap(),
        parent: parent.map(|parent| (parent, joint)),
        match_caps: [true; 2],
    }
}

fn with_joint(change: impl Fn(&mut Joint)) -> Vec<Limb> {
    let mut limbs = vec![limb("a", None), limb("b", Some(0))];
    if let Some((_, joint)) = &mut limbs[1].parent {
        change(joint);
    }
    limbs
}

#[test]
fn bad_bodies_are_refused_by_key() {
    let refused = |limbs: Vec<Limb>, sites: Vec<Site>, what: &str| {
        let error = Body::new("thing", limbs, sites).unwrap_err().to_string();
        assert!(error.contains(what), "expected {what:?} in {error}");
    };
    let site = |name: &str, limb, position| Site { name: name.into(), limb, position };
    assert!(Body::new("thing", with_joint(|_| {}), vec![site("s", 1, Vec3::ZERO)]).is_ok());
    assert_eq!(
        Body::new("thing", vec![], vec![]).unwrap_err().to_string(),
        "body: expected at least one limb, found none"
    );
    let many = vec![Body::human(1.75, HumanModel::Papers).unwrap().limbs()[0].clone(); 1_001];
    let error = Body::new("thing", many, vec![]).unwrap_err().to_string();
    assert_eq!(error, "body: expected at most 1,000 limbs and 10,000 sites, found 1001 and 0");
    refused(vec![limb("", None)], vec![], "a name");
    refused(vec![limb("a", None), limb("a", Some(0))], vec![], "limbs.a");
    refused(vec![limb("a", None), limb("b", None)], vec![], "limbs.b.parent");
    refused(vec![limb("a", Some(0))], vec![], "limbs.a.parent");
    refused(vec![limb("a", None), limb("b", Some(2)), limb("c", Some(0))], vec![], "limbs.b.parent");
    refused(with_joint(|joint| joint.weight = 0.0), vec![], "limbs.b.joint.weight");
    refused(with_joint(|joint| joint.weight = f64::NAN), vec![], "limbs.b.joint.weight");
    refused(with_joint(|joint| joint.semi_axes[1] = -0.1), vec![], "limbs.b.joint.semi_axes");
    refused(with_joint(|joint| joint.semi_axes[0] = f64::INFINITY), vec![], "limbs.b.joint.semi_axes");
    refused(with_joint(|joint| joint.parent_from_joint.translation.x = f64::NAN), vec![], "parent_from_joint");
    refused(with_joint(|joint| joint.limb_from_joint.rotation.w = 3.0), vec![], "limb_from_joint");
    refused(with_joint(|_| {}), vec![site("s", 2, Vec3::ZERO)], "sites.s.limb");
    refused(with_joint(|_| {}), vec![site("s", 0, Vec3::NAN)], "sites.s.position");
    refused(with_joint(|_| {}), vec![site("s", 0, Vec3::ZERO), site("s", 1, Vec3::ZERO)], "sites.s");
    for stature in [0.29, 3.01, f64::NAN, -1.7] {
        assert!(Body::human(stature, HumanModel::Papers).unwrap_err().to_string().contains("stature"));
    }
}

#[test]
fn joints_have_the_bands_of_their_kind() {
    for (semi_axes, kind, count) in [
        ([0.0, 0.0], JointKind::Universal, 1),
        ([0.02, 0.0], JointKind::Hinge, 2),
        ([0.0, 0.02], JointKind::Hinge, 2),
        ([0.02, 0.03], JointKind::Elliptic, 4),
    ] {
        let limbs = with_joint(|joint| joint.semi_axes = semi_axes);
        let joint = &limbs[1].parent.as_ref().unwrap().1;
        let points: Vec<Vec3> = joint.band_points().collect();
        assert_eq!((joint.kind(), points.len()), (kind, count));
        assert!(points.iter().sum::<Vec3>().length() < 1e-12, "the bands lie about the center");
        for point in points {
            let (a, b) = (point.x.abs(), point.y.abs());
            assert!([a, b] == [0.0; 2] || [a, 0.0] == [semi_axes[0], b] || [0.0, b] == [a, semi_axes[1]]);
        }
    }
    let human = Body::human(1.75, HumanModel::Papers).unwrap();
    let bands: usize =
        human.limbs().iter().filter_map(|limb| Some(limb.parent.as_ref()?.1.band_points().count())).sum();
    assert_eq!((human.limbs().len(), bands), (10, 4 + 2 * (1 + 2 + 4 + 2)), "neck; shoulders, elbows, hips, knees");
}

#[test]
fn configuration_entries_keep_their_ranges() {
    let defaults = toml::Table::try_from(Config::default()).unwrap();
    for field in Config::FIELDS {
        let default = &defaults[field.name];
        let number = |number: f64| match default {
            Value::Integer(_) if number.is_finite() => Value::Integer(number as i64),
            _ => Value::Float(number),
        };
        let mut config = Config::default();
        let mut set = |value: Value| config.set(field.name, value);
        assert!(set(default.clone()).is_ok());
        if let Some((low, high)) = field.range {
            assert!(set(number(low)).is_ok() && set(number(high)).is_ok(), "{}", field.name);
            for bad in [low - 1.0, high + 1.0, f64::NAN, f64::INFINITY] {
                assert_eq!(set(number(bad)).unwrap_err().what, field.name);
            }
        }
        match default {
            Value::Integer(_) => assert!(set(1.5.into()).is_err()),
            Value::String(_) => assert!(set("surely not".into()).is_err()),
            Value::Boolean(_) => assert!(set(1.0.into()).is_err()),
            _ => assert!(set("1".into()).is_err()),
        }
        assert!(!field.doc.is_empty());
    }
    let unknown = Config::default().set("color", true).unwrap_err();
    assert_eq!(unknown.to_string(), "key: expected one of the configuration, found \"color\"");
}

#[test]
fn numbers_outside_their_range_and_poses_of_another_body_are_refused() {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let mut config = Config::default();
    config.sampling_factor = 0;
    let error = Tracker::new(body.clone(), config).unwrap_err();
    assert_eq!(error.to_string(), "sampling_factor: expected a number from 1 to 1000, found Integer(0)");
    let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap();
    let mut poses = scene::standing(&body);
    poses.push(poses[0]);
    let error = tracker.segment(&Frame::empty(0.0), Some(&poses)).unwrap_err();
    assert!(error.to_string().contains("11 poses for 10 limbs"), "{error}");
}

#[test]
fn what_was_measured_on_one_of_several_persons_has_the_stamp_of_the_frame() {
    let (body, options) = (Body::human(1.75, HumanModel::Papers).unwrap(), PeopleOptions::default());
    let mut people = People::new(body, Config::default(), options).unwrap();
    let error = people.step(&Frame::empty(1.0), &[(1, Frame::empty(2.0))]).unwrap_err();
    assert_eq!(error.to_string(), "stamp of what was measured on person 1: expected 1, found 2");
    people.step(&Frame::empty(1.0), &[(1, Frame::empty(1.0))]).unwrap();
}
