//! The exact closest point against a dense search, and the properties of its distance and normal.
#![allow(clippy::expect_used)]

use crate::shape_support;
use proptest::prelude::*;
use shape_support::{Random, brute_force, hostile, inside, limb_like, random_shape, shape};
use voodoo_core::math::Vec3;
use voodoo_core::{Region, TaperedEllipticCylinder};

const TOLERANCE: f64 = 1e-6;

/// Checks one query against the dense search: distance, sign, point, normal, region.
fn check(shape: &TaperedEllipticCylinder, q: Vec3, grid: usize) {
    let found = shape.closest_point(q);
    let (distance, point) = brute_force(shape, q, grid);
    let context = || format!("{shape:?} {q:?}: {found:?}, dense search {distance} at {point:?}");
    assert!((found.signed_distance.abs() - distance).abs() < TOLERANCE, "{}", context());
    assert!((found.point.distance(q) - distance).abs() < TOLERANCE, "{}", context());
    assert!((found.normal.length() - 1.0).abs() < 1e-9, "{}", context());
    // The point lies on the surface: its own distance to it, found without our code, is nothing.
    assert!(brute_force(shape, found.point, grid).0 < TOLERANCE, "{}", context());
    if distance > TOLERANCE {
        assert_eq!(found.signed_distance < 0.0, inside(shape, q), "{}", context());
    }
    // Where a neighbor of the query has its foot elsewhere the point is not unique; otherwise it must be the same. The dense
    // search knows the angle only to the square root of the rounding of the distance, hence 2 µm.
    let away = (q - point).normalize_or_zero();
    let unique = [away * -1e-4, Vec3::new(7e-5, 5e-5, -6e-5)]
        .iter()
        .all(|&nudge| brute_force(shape, q + nudge, grid).1.distance(point) < 1e-3);
    if unique && distance > 1e-3 {
        assert!(found.point.distance(point) < 2e-6, "{}", context());
    }
    let on_plane = |z: f64| (found.point.z - z).abs() < 1e-12;
    match found.region {
        Region::Side => assert!(found.point.z >= 0.0 && found.point.z <= shape.length()),
        Region::ProximalCap | Region::ProximalRim => assert!(on_plane(0.0)),
        Region::DistalCap | Region::DistalRim => assert!(on_plane(shape.length())),
    }
}

#[test]
fn agrees_with_a_dense_search_on_limbs() {
    let mut random = Random(1);
    for shape in limb_like() {
        for _ in 0..150 {
            let q = random.query(&shape);
            check(&shape, q, 64);
        }
    }
}

#[test]
fn agrees_with_a_dense_search_on_hostile_shapes() {
    let mut random = Random(2);
    for shape in hostile() {
        for _ in 0..150 {
            let q = random.query(&shape);
            check(&shape, q, 200);
        }
    }
}

#[test]
fn agrees_with_a_dense_search_on_random_shapes() {
    let mut random = Random(3);
    for _ in 0..400 {
        let shape = random_shape(&mut random);
        for _ in 0..4 {
            let q = random.query(&shape);
            check(&shape, q, 100);
        }
    }
}

/// The long run: `cargo test --release -- --ignored`.
#[test]
#[ignore = "half a minute in release"]
fn agrees_with_a_dense_search_on_very_many_shapes() {
    let mut random = Random(4);
    for _ in 0..20_000 {
        let shape = random_shape(&mut random);
        for _ in 0..5 {
            let q = random.query(&shape);
            check(&shape, q, 200);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn agrees_with_a_dense_search(
        length in 0.001..1.0f64,
        axes in prop::array::uniform4(prop_oneof![Just(0.0), 0.001..0.3f64, Just(0.1)]),
        q in prop::array::uniform3(-1.0..1.0f64),
    ) {
        let [a0, b0, a1, b1] = axes;
        if let Ok(shape) = TaperedEllipticCylinder::new(length, a0, b0, a1, b1) {
            check(&shape, Vec3::from_array(q), 100);
        } else {
            prop_assert!(a0.max(a1) == 0.0 || b0.max(b1) == 0.0);
        }
    }
}

#[test]
fn gradient_of_the_distance_is_the_normal() {
    let mut random = Random(5);
    let step = 1e-5;
    let mut checked = 0;
    for shape in limb_like().into_iter().chain(hostile().into_iter().take(13)) {
        for _ in 0..300 {
            let q = random.query(&shape);
            let found = shape.closest_point(q);
            // Near the surface a rim has a mean normal, and on the medial axis there is no gradient.
            if found.signed_distance.abs() < 2e-4 {
                continue;
            }
            let mut gradient = Vec3::ZERO;
            let mut smooth = true;
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let (ahead, behind) = (shape.closest_point(q + axis * step), shape.closest_point(q - axis * step));
                smooth &= ahead.point.distance(behind.point) < 10.0 * step;
                gradient += axis * (ahead.signed_distance - behind.signed_distance) / (2.0 * step);
            }
            if smooth {
                checked += 1;
                assert!(gradient.distance(found.normal) < 2e-3, "{shape:?} {q:?}: {gradient:?} {found:?}");
            }
        }
    }
    assert!(checked > 3000, "only {checked} queries were off the medial axis");
}

#[test]
fn normal_is_defined_on_the_surface() {
    let mut random = Random(6);
    for shape in limb_like().into_iter().chain(hostile()) {
        for _ in 0..200 {
            let q = shape_support::surface_point(&shape, &mut random);
            let found = shape.closest_point(q);
            assert!(found.signed_distance.abs() < 1e-9, "{shape:?} {q:?} {found:?}");
            assert!((found.normal.length() - 1.0).abs() < 1e-9, "{shape:?} {q:?} {found:?}");
            let outwards = found.normal.dot(q - Vec3::Z * 0.5 * shape.length());
            assert!(outwards > -1e-9 || shape.length() < 0.1 || shape.a0() != shape.a1(), "{shape:?} {q:?} {found:?}");
        }
    }
}

#[test]
fn known_answers_on_a_circular_cylinder() {
    let cylinder = shape([0.4, 0.1, 0.1, 0.1, 0.1]);
    for (q, distance, region, normal) in [
        (Vec3::new(0.3, 0.0, 0.2), 0.2, Region::Side, Vec3::X),
        (Vec3::new(0.0, -0.05, 0.2), -0.05, Region::Side, Vec3::NEG_Y),
        (Vec3::new(0.02, 0.0, -0.1), 0.1, Region::ProximalCap, Vec3::NEG_Z),
        (Vec3::new(0.02, 0.0, 0.39), -0.01, Region::DistalCap, Vec3::Z),
        (Vec3::new(0.13, 0.0, 0.44), 0.05, Region::DistalRim, Vec3::new(0.6, 0.0, 0.8)),
        (Vec3::new(0.0, 0.14, -0.03), 0.05, Region::ProximalRim, Vec3::new(0.0, 0.8, -0.6)),
    ] {
        let found = cylinder.closest_point(q);
        assert!((found.signed_distance - distance).abs() < 1e-12, "{found:?}");
        assert_eq!(found.region, region);
        assert!(found.normal.distance(normal) < 1e-9, "{found:?}");
    }
}

#[test]
fn approximate_distance_is_near_the_exact_one() {
    let mut random = Random(7);
    let mut errors = Vec::new();
    for shape in limb_like() {
        for _ in 0..1000 {
            let q = shape_support::surface_point(&shape, &mut random) + random.direction() * random.within(0.0, 0.05);
            errors.push((shape.approximate_distance(q) - shape.closest_point(q).signed_distance).abs());
        }
    }
    errors.sort_by(f64::total_cmp);
    let at = |fraction: f64| errors[(fraction * (errors.len() - 1) as f64) as usize];
    println!("approximate distance: median {:.2e}, 95 % {:.2e}, max {:.2e} m", at(0.5), at(0.95), at(1.0));
    assert!(at(0.5) < 5e-4 && at(0.95) < 3e-3 && at(1.0) < 3e-2);
    for shape in hostile() {
        for _ in 0..200 {
            let q = random.query(&shape);
            assert!(shape.approximate_distance(q).is_finite(), "{shape:?} {q:?}");
        }
    }
}

#[test]
fn bad_parameters_are_refused_by_name() {
    for (sizes, name) in [
        ([0.0, 0.1, 0.1, 0.1, 0.1], "length"),
        ([f64::NAN, 0.1, 0.1, 0.1, 0.1], "length"),
        ([0.3, -0.1, 0.1, 0.1, 0.1], "a0"),
        ([0.3, 0.1, f64::INFINITY, 0.1, 0.1], "b0"),
        ([0.3, 0.1, 0.1, f64::NAN, 0.1], "a1"),
        ([0.3, 0.1, 0.1, 0.1, 2000.0], "b1"),
        ([0.3, 0.0, 0.1, 0.0, 0.1], "a1"),
        ([0.3, 0.0, 0.0, 0.0, 0.0], "a0"),
    ] {
        let [length, a0, b0, a1, b1] = sizes;
        let error = TaperedEllipticCylinder::new(length, a0, b0, a1, b1).expect_err("refused");
        assert!(error.to_string().contains(name), "{error}");
    }
    let limb = shape([0.3, 0.1, 0.1, 0.1, 0.1]);
    assert!(limb.closest_point(Vec3::new(f64::NAN, 0.0, 0.0)).signed_distance.is_nan());
}
