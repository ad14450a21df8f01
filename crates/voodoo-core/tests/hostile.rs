//! Input that nobody means: every entry point refuses it or answers in finite numbers, and a refusal changes nothing.
//!
//! Cases are seeded, so that one that fails fails again. `VOODOO_FUZZ_CASES` sets how many (`scripts/fuzz` does),
//! `VOODOO_FUZZ_SEED` where they begin.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use std::time::{Duration, Instant};

use voodoo_core::Value;
use voodoo_core::math::{Aabb, Pose, Quat, Vec3};
use voodoo_core::{Body, Config, Estimate, Status, TaperedEllipticCylinder, Tracker};
use voodoo_core::{Camera, Lens};
use voodoo_core::{
    Cloud, DepthImage, DepthPixels, DetectedPerson, Frame, Ground, PointSlice, PositionRelation, RayRelation, Scope,
};
use voodoo_core::{HumanModel, Joint, Limb, Site};
use voodoo_core::{Rendering, Viewpoint};

/// Cases when nobody says how many: a few seconds.
const CASES: u64 = 6_000;
/// Nothing that is called here may take longer.
const LONGEST: Duration = Duration::from_secs(5);
/// Numbers that break what does not expect them.
const ODD: [f64; 20] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    f64::EPSILON,
    1e300,
    -1e300,
    1e154,
    1e-300,
    1e38,
    1e12,
    -1e9,
    1e6,
    1e-9,
];

/// A source of cases, and among how many numbers one is odd: frames without any are to come through, too.
struct Hostile(scene::Noise, usize);

impl Hostile {
    fn below(&mut self, count: usize) -> usize {
        (self.0.uniform() * count as f64) as usize
    }

    fn rarely(&mut self) -> bool {
        self.below(self.1) == 0
    }

    /// A number of about `size`, and now and then any other.
    fn number(&mut self, size: f64) -> f64 {
        if self.rarely() { ODD[self.below(ODD.len())] } else { size * self.0.normal() }
    }

    fn positive(&mut self, size: f64) -> f64 {
        if self.rarely() { ODD[self.below(ODD.len())] } else { size * (0.05 + self.0.uniform()) }
    }

    fn vector(&mut self, size: f64) -> Vec3 {
        Vec3::new(self.number(size), self.number(size), self.number(size))
    }

    fn pose(&mut self) -> Pose {
        let turn = if self.rarely() {
            Quat::from_xyzw(self.number(1.0), self.number(1.0), self.number(1.0), self.number(1.0))
        } else {
            Quat::from_scaled_axis(self.0.vector(2.0))
        };
        Pose::from_parts(self.vector(1.0), turn)
    }

    fn shape(&mut self) -> Option<TaperedEllipticCylinder> {
        let sizes = [0.4, 0.1, 0.1, 0.1, 0.1].map(|size| self.positive(size));
        TaperedEllipticCylinder::new(sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]).ok()
    }

    fn joint(&mut self) -> Joint {
        Joint {
            name: "j".into(),
            parent_from_joint: self.pose(),
            limb_from_joint: self.pose(),
            semi_axes: [self.positive(0.1), 0.0],
            weight: self.positive(1.0),
            limits: (self.below(2) == 0).then(|| [0; 3].map(|_| [-self.positive(2.0), self.positive(2.0)])),
            motion: self.positive(0.3),
        }
    }

    /// Points near a standing person, an odd one among them here and there.
    fn points(&mut self, good: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut points: Vec<_> = (0..self.below(60)).map(|_| good[self.below(good.len())]).collect();
        if self.below(3) == 0 && !points.is_empty() {
            let (row, axis) = (self.below(points.len()), self.below(3));
            points[row][axis] = self.number(1.0);
        }
        points
    }
}

fn finite(estimate: &Estimate) -> bool {
    let poses = estimate.world_from_limb.iter().all(Pose::is_finite);
    estimate.status == Status::Searching || (poses && estimate.sites.iter().all(|site| site.is_finite()))
}

/// Shapes: the closest point and the first hit of a ray are finite wherever the question is.
fn shapes(from: &mut Hostile) {
    let Some(shape) = from.shape() else { return };
    let (point, direction) = (from.vector(0.5), from.vector(1.0));
    if point.is_finite() && point.abs().max_element() < 1e9 {
        let closest = shape.closest_point(point);
        assert!(closest.point.is_finite() && closest.signed_distance.is_finite(), "{shape:?} {point:?} {closest:?}");
        if let Some(distance) = shape.cast_ray(point, direction) {
            assert!(distance.is_finite(), "{shape:?} {point:?} {direction:?} {distance}");
        }
    }
}

/// Bodies: what is accepted stands upright in finite numbers.
fn bodies(from: &mut Hostile) {
    let limbs = (0..1 + from.below(5))
        .filter_map(|index| {
            let known = index + usize::from(from.rarely());
            let parent = (index > 0).then(|| (from.below(known), from.joint()));
            Some(Limb { name: format!("limb{index}"), shape: from.shape()?, parent, match_caps: [true; 2] })
        })
        .collect();
    let sites = (0..from.below(4)).map(|index| Site {
        name: format!("site{index}"),
        limb: from.below(4),
        position: from.vector(0.3),
    });
    let Ok(body) = Body::new("any", limbs, sites.collect()) else { return };
    assert!(body.rest_pose(Pose::IDENTITY).iter().all(Pose::is_finite), "{body:?}");
    if let Ok(scaled) = body.scaled(from.positive(1.0)) {
        assert!(scaled.rest_pose(Pose::IDENTITY).iter().all(Pose::is_finite), "{scaled:?}");
    }
}

/// Configurations: an entry is refused or stays as it was said.
fn configurations(from: &mut Hostile) {
    let mut config = Config::default();
    let field = &Config::FIELDS[from.below(Config::FIELDS.len())];
    let value = match from.below(4) {
        0 => Value::Float(from.number(10.0)),
        1 => Value::Boolean(true),
        2 => Value::String("chain".into()),
        _ => Value::Float(ODD[from.below(ODD.len())]),
    };
    let before = config.clone();
    if config.set(field.name, value.clone()).is_err() {
        assert_eq!(config, before, "{} {value:?}", field.name);
    }
}

/// A lens, or what cannot be one.
fn lens(from: &mut Hostile) -> Lens {
    match from.below(6) {
        0 => Lens::PlumbBob(std::array::from_fn(|_| from.number(0.3))),
        1 => Lens::Rational(std::array::from_fn(|_| from.number(0.3))),
        2 => Lens::Fisheye(std::array::from_fn(|_| from.number(0.3))),
        3 => Lens::InversePlumbBob(std::array::from_fn(|_| from.number(0.3))),
        _ => Lens::Pinhole,
    }
}

/// Predicted images: every pixel is a depth or none.
fn renderings(from: &mut Hostile, body: &Body, standing: &[Pose]) {
    let [width, height] = [[0, 1, 7, 16, usize::MAX][from.below(5)], [0, 1, 5, 12, 1 << 40][from.below(5)]];
    let intrinsics = [from.positive(20.0), from.positive(20.0), from.number(8.0), from.number(6.0)];
    let lens = lens(from);
    let Ok(camera) = Camera::new(width, height, intrinsics, lens) else { return };
    let view = Viewpoint { camera: &camera, world_from_sensor: from.pose() };
    let mut image = Rendering::default();
    if image.render(body, standing, &view).is_ok() {
        assert!(image.depth().iter().all(|depth| *depth >= 0.0), "{view:?}");
    }
}

/// Any frame: refused without a trace, or answered in finite numbers.
fn step(from: &mut Hostile, tracker: &mut Tracker, good: &[[f64; 3]], stamp: &mut f64) {
    let points = from.points(good);
    let cloud = Cloud {
        points: PointSlice::F64(&points),
        world_from_sensor: if from.below(4) == 0 { from.pose() } else { Pose::IDENTITY },
        weight: from.positive(1.0),
        scope: [Scope::Free, Scope::Body, Scope::Limb(from.below(12))][from.below(3)],
        source: from.below(3) as u16,
    };
    let pixels: Vec<f32> = (0..48).map(|_| from.number(2.0).abs() as f32).collect();
    let width = if from.rarely() { from.below(9) } else { 8 };
    let intrinsics = [from.positive(10.0), from.positive(10.0), from.number(4.0), from.number(3.0)];
    let lens = lens(from);
    let Ok(camera) = Camera::new(width, 6, intrinsics, lens) else { return };
    let image = DepthImage {
        pixels: DepthPixels::F32(&pixels),
        camera: &camera,
        meters_per_unit: from.positive(1.0),
        world_from_sensor: if from.below(4) == 0 { from.pose() } else { scene::DepthCamera::world_from_sensor() },
        weight: from.positive(1.0),
        source: 0,
    };
    let (site, weight, bias) = (from.below(14), from.positive(10.0), from.positive(0.1));
    let position = PositionRelation { site, position: from.vector(2.0), weight, bias, source: 1 };
    let ray = RayRelation { site, origin: from.vector(2.0), direction: from.vector(1.0), weight, bias, source: 1 };
    let mut frame = Frame::empty(*stamp + if from.rarely() { from.number(1.0) } else { 0.033 });
    let joints: Vec<PositionRelation> = (0..from.below(8))
        .map(|_| PositionRelation { site: from.below(14), position: from.vector(2.0), ..position })
        .collect();
    let detections = [DetectedPerson { positions: &joints, person: from.number(9.0) }; 2];
    let (clouds, images, positions, rays) = ([cloud], [image], [position], [ray]);
    match from.below(7) {
        4 => frame.detections = &detections[..from.below(3)],
        0 => frame.images = &images,
        1 => frame.positions = &positions,
        2 => frame.rays = &rays,
        3 => (frame.clouds, frame.positions) = (&clouds, &positions),
        _ => frame.clouds = &clouds,
    }
    let boxes = [Aabb { mins: from.vector(1.0), maxs: from.vector(2.0) }];
    if from.rarely() {
        frame.excluded = &boxes;
        frame.ground = Some(Ground { normal: from.vector(1.0), offset: from.number(1.0) });
    }
    let before = scene::bits(tracker.estimate());
    if tracker.step(&frame).is_err() {
        assert_eq!(scene::bits(tracker.estimate()), before, "a refusal left a trace: {frame:?}");
    } else {
        *stamp = frame.stamp;
        assert!(finite(tracker.estimate()), "{:?} after {frame:?}", tracker.estimate());
    }
}

/// Changes of the body and of its pose.
fn edit(from: &mut Hostile, tracker: &mut Tracker) {
    let before = scene::bits(tracker.estimate());
    let limbs = ["l_forearm", "torso", "box", "nobody"];
    let limb = limbs[from.below(limbs.len())];
    let changed = match from.below(6) {
        0 => tracker.scale(from.positive(1.0)).is_ok(),
        1 => from.shape().is_some_and(|shape| tracker.set_shape(limb, shape).is_ok()),
        2 => from.shape().is_some_and(|shape| {
            let sites = vec![("end".to_owned(), from.vector(0.2))];
            tracker.add_limb("box", limb, shape, from.joint(), sites).is_ok()
        }),
        3 => tracker.remove_limb("box").is_ok(),
        4 => {
            let count = from.below(9);
            let positions: Vec<_> = (0..count).map(|_| (from.below(9), from.vector(1.0))).collect();
            tracker.reset(&positions, from.below(2) == 0).is_ok()
        }
        _ => {
            let poses: Vec<Pose> = (0..10 + usize::from(from.rarely())).map(|_| from.pose()).collect();
            tracker.reset_pose(&poses).is_ok()
        }
    };
    assert!(finite(tracker.estimate()), "{:?}", tracker.estimate());
    if !changed {
        assert_eq!(scene::bits(tracker.estimate()), before, "a refusal left a trace");
    }
}

fn of_environment(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

#[test]
fn hostile_input_is_refused_or_answered_in_finite_numbers() {
    let (cases, seed) = (of_environment("VOODOO_FUZZ_CASES", CASES), of_environment("VOODOO_FUZZ_SEED", 0));
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let standing = scene::standing(&body);
    let good = scene::surface_points(&body, &standing, 400, 0.01, &mut scene::Noise(1));
    let started = || {
        let mut tracker = crate::tracker(body.clone(), Config::default()).unwrap();
        tracker.reset_pose(&standing).unwrap();
        tracker
    };
    let (mut tracker, mut stamp) = (started(), 0.0);
    for case in seed..seed + cases {
        let mut from =
            Hostile(scene::Noise(case.wrapping_mul(0x2545_f491_4f6c_dd1d)), [6, 40, 400][(case / 16 % 3) as usize]);
        // A body that was pulled far away is brought back, so that most frames meet a person.
        if case % 64 == 0 {
            (tracker, stamp) = (started(), 0.0);
        }
        let began = Instant::now();
        match case % 16 {
            0..=2 => step(&mut from, &mut tracker, &good, &mut stamp),
            3 if case % 64 > 48 => edit(&mut from, &mut tracker),
            4 => renderings(&mut from, &body, &standing),
            5 => bodies(&mut from),
            6 => configurations(&mut from),
            _ => shapes(&mut from),
        }
        assert!(began.elapsed() < LONGEST, "case {case} took {:?}", began.elapsed());
    }
}
