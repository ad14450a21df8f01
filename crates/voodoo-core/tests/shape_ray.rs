//! Rays and boxes against dense marching and sampling.
#![allow(clippy::expect_used, clippy::panic)]

use crate::shape_support;
use shape_support::{Random, brute_force, hostile, inside, limb_like, random_shape, shape, surface_point};
use voodoo_core::TaperedEllipticCylinder;
use voodoo_core::math::{Pose, Vec3};

/// The first stretch of a dense march that goes from outside to inside.
fn march(shape: &TaperedEllipticCylinder, origin: Vec3, direction: Vec3, max: f64, step: f64) -> Option<f64> {
    let mut was_inside = inside(shape, origin);
    let mut distance = 0.0;
    while distance < max {
        distance += step;
        let is_inside = inside(shape, origin + direction * distance);
        if is_inside && !was_inside {
            return Some(distance);
        }
        was_inside = is_inside;
    }
    None
}

fn check(shape: &TaperedEllipticCylinder, random: &mut Random) {
    let step = 2e-4;
    let target = surface_point(shape, random) * random.within(0.0, 1.2);
    let origin = target + random.direction() * random.within(0.0, 0.8);
    let direction = if random.unit() < 0.2 { random.direction() } else { (target - origin).normalize_or(Vec3::X) };
    let max = 2.0;
    let found = shape.cast_ray(origin, direction * random.within(0.1, 10.0));
    let marched = march(shape, origin, direction, max, step);
    let context = || format!("{shape:?} from {origin:?} along {direction:?}: {found:?}, marched {marched:?}");
    if let Some(hit) = found {
        let [point, deep] = [hit, hit + 1e-9].map(|distance| origin + direction * distance);
        assert!(hit >= 0.0, "{}", context());
        assert!(brute_force(shape, point, 64).0 < 1e-8, "{}", context());
        // The ray goes in there, and the solid begins.
        assert!(inside(shape, deep) || brute_force(shape, deep, 64).0 < 1e-8, "{}", context());
    }
    match (found, marched) {
        // The march may step over a thin part, so it may only be late.
        (Some(hit), Some(distance)) => assert!(hit <= distance + 1e-9, "{}", context()),
        (None, Some(_)) => panic!("missed: {}", context()),
        (_, None) => {}
    }
    if let Some(hit) = found {
        // No entry before the hit.
        let before = march(shape, origin, direction, hit.min(max) - 1.01 * step, step);
        assert!(before.is_none(), "{}", context());
    }
}

#[test]
fn agrees_with_dense_marching() {
    let mut random = Random(21);
    for shape in limb_like().into_iter().chain(hostile().into_iter().take(13)) {
        for _ in 0..100 {
            check(&shape, &mut random);
        }
    }
    for _ in 0..500 {
        let shape = random_shape(&mut random);
        check(&shape, &mut random);
    }
}

#[test]
fn known_hits() {
    let limb = shape([0.4, 0.1, 0.05, 0.1, 0.05]);
    let cast =
        |origin: [f64; 3], direction: [f64; 3]| limb.cast_ray(Vec3::from_array(origin), Vec3::from_array(direction));
    for (origin, direction, distance) in [
        ([1.0, 0.0, 0.2], [-2.0, 0.0, 0.0], 0.9),
        ([0.05, 0.0, -1.0], [0.0, 0.0, 1.0], 1.0),
        ([0.05, 0.0, 1.0], [0.0, 0.0, -1.0], 0.6),
    ] {
        assert!((cast(origin, direction).expect("a hit") - distance).abs() < 1e-12);
    }
    for (origin, direction) in [
        ([1.0, 0.0, 0.2], [1.0, 0.0, 0.0]),
        ([1.0, 0.0, 0.2], [0.0, 0.0, 0.0]),
        ([f64::NAN, 0.0, 0.2], [1.0, 0.0, 0.0]),
        ([1.0, 0.0, 0.2], [f64::NAN, 0.0, 0.0]),
        ([0.0, 0.0, 0.2], [1.0, 0.0, 0.0]),
        ([0.2, 0.0, 0.2], [0.0, 0.0, 1.0]),
    ] {
        assert_eq!(cast(origin, direction), None);
    }
}

#[test]
fn a_ray_that_starts_inside_may_enter_again() {
    // The side of an aspect flip is concave: a chord can leave it and come back.
    let flip = shape([0.4, 0.2, 0.01, 0.01, 0.2]);
    let mut random = Random(22);
    let mut again = 0;
    for _ in 0..3000 {
        let origin = surface_point(&flip, &mut random) * 0.98 + Vec3::Z * 0.004;
        let direction = (surface_point(&flip, &mut random) - origin).normalize_or(Vec3::X);
        if inside(&flip, origin) {
            let found = flip.cast_ray(origin, direction);
            again += usize::from(found.is_some());
            if let Some(marched) = march(&flip, origin, direction, 2.0, 2e-4) {
                let distance = found.expect("the march entered again");
                assert!(distance <= marched + 1e-9);
            }
        }
    }
    assert!(again > 20, "{again}");
}

#[test]
fn boxes_contain_the_surface_and_are_tight() {
    let mut random = Random(23);
    for shape in limb_like().into_iter().chain(hostile()) {
        for pose in [Pose::IDENTITY, random.pose(), random.pose()] {
            let bounds = shape.aabb(&pose);
            if pose == Pose::IDENTITY {
                let local = shape.local_aabb();
                assert!(bounds.mins.distance(local.mins) < 1e-15 && bounds.maxs.distance(local.maxs) < 1e-15);
            }
            let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            for k in 0..4000 {
                let angle = std::f64::consts::TAU * f64::from(k) / 2000.0;
                let point = pose.transform_point(shape_support::side(&shape, angle, f64::from(k / 2000)));
                (low, high) = (low.min(point), high.max(point));
            }
            for _ in 0..500 {
                let point = pose.transform_point(surface_point(&shape, &mut random));
                assert!((point - bounds.mins).min_element() > -1e-12 && (bounds.maxs - point).min_element() > -1e-12);
            }
            assert!((bounds.mins - low).abs().max_element() < 2e-6, "{shape:?}");
            assert!((bounds.maxs - high).abs().max_element() < 2e-6, "{shape:?}");
        }
    }
}
