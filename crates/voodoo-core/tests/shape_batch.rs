//! The SIMD batch against the exact path and against the dense search.
#![allow(clippy::expect_used)]

use crate::shape_support;
use shape_support::{Random, brute_force, hostile, limb_like, random_shape, shape};
use voodoo_core::math::{Points, Pose, Vec3};
use voodoo_core::{SurfaceBatch, TaperedEllipticCylinder};

const TOLERANCE: f64 = 1e-6;

/// World queries around a shape.
fn queries(shape: &TaperedEllipticCylinder, pose: &Pose, count: usize, random: &mut Random) -> Points {
    let mut points = Points::default();
    for _ in 0..count {
        let world = pose.transform_point(random.query(shape));
        points.push(world.as_vec3().to_array());
    }
    points
}

/// Checks a batch against the exact path; returns the largest error of a distance and of a unique point.
fn check(shape: &TaperedEllipticCylinder, pose: &Pose, queries: &Points) -> (f64, f64) {
    let mut out = SurfaceBatch::default();
    shape.closest_points(pose, queries, &mut out);
    assert_eq!(out.region.len(), queries.len());
    let mut worst = (0f64, 0f64);
    for i in 0..queries.len() {
        let q = pose.inverse_transform_point(queries.get(i));
        let exact = shape.closest_point(q);
        let (point, normal) = (out.points.get(i), out.normals.get(i));
        let context = || format!("{shape:?} {q:?}: {exact:?}, batch {point:?} {normal:?} {}", out.signed_distance[i]);
        let distance = f64::from(out.signed_distance[i]);
        let error = (distance.abs() - exact.signed_distance.abs()).abs();
        assert!(error < TOLERANCE, "{}", context());
        assert!((normal.length() - 1.0).abs() < 1e-5, "{}", context());
        if exact.signed_distance.abs() > TOLERANCE {
            assert_eq!(distance < 0.0, exact.signed_distance < 0.0, "{}", context());
        }
        // The point is on the surface, at that distance, and the same where it is unique.
        let limb = pose.inverse_transform_point(point);
        assert!((limb.distance(q) - distance.abs()).abs() < TOLERANCE, "{}", context());
        assert!(shape.closest_point(limb).signed_distance.abs() < TOLERANCE, "{}", context());
        let apart = limb.distance(exact.point);
        worst.0 = worst.0.max(error);
        let skew = shape.closest_point(q + Vec3::new(3e-5, 2e-5, -2.5e-5)).point;
        let steady = (exact.point - q).normalize_or_zero() * 1e-4;
        let deeper = shape.closest_point(q - steady).point;
        if skew.distance(exact.point) < 2e-4 && deeper.distance(exact.point) < 2e-4 {
            worst.1 = worst.1.max(apart);
            assert!(apart < TOLERANCE, "{apart} {}", context());
            let region = out.region[i];
            if region == exact.region && exact.signed_distance.abs() > 2e-4 {
                let expected = pose.rotation * exact.normal;
                assert!(normal.distance(expected) < 5e-3, "{}", context());
            }
        }
    }
    worst
}

#[test]
fn agrees_with_the_exact_path() {
    let mut random = Random(11);
    let mut worst = (0f64, 0f64);
    let mut run = |shape: &TaperedEllipticCylinder, count: usize| {
        let pose = random.pose();
        let queries = queries(shape, &pose, count, &mut random);
        let found = check(shape, &pose, &queries);
        worst = (worst.0.max(found.0), worst.1.max(found.1));
    };
    for shape in limb_like() {
        run(&shape, 3000);
    }
    for shape in hostile() {
        run(&shape, 1000);
    }
    let mut shapes = Random(12);
    for _ in 0..300 {
        run(&random_shape(&mut shapes), 60);
    }
    println!("batch against exact: distance {:.1e}, point {:.1e} m", worst.0, worst.1);
}

/// The long run: `cargo test --release -- --ignored`.
#[test]
#[ignore = "half a minute in release"]
fn agrees_with_the_exact_path_on_very_many_shapes() {
    let mut random = Random(13);
    let mut worst = (0f64, 0f64);
    for n in 0..40_000 {
        let mut shape = random_shape(&mut random);
        if n % 2 == 0 {
            // Not too unlike an aspect: the shapes that the SIMD lanes really treat.
            let (a0, b0, scale) = (shape.a0(), shape.b0(), random.within(0.1, 1.5));
            let ends = [a0 * scale, b0 * scale * random.within(0.68, 1.47)];
            if a0.min(b0) > 0.0 {
                shape = shape_support::shape([shape.length(), a0, b0, ends[0], ends[1]]);
            }
        }
        let pose = random.pose();
        let queries = queries(&shape, &pose, 100, &mut random);
        let found = check(&shape, &pose, &queries);
        worst = (worst.0.max(found.0), worst.1.max(found.1));
    }
    println!("batch against exact: distance {:.1e}, point {:.1e} m", worst.0, worst.1);
}

#[test]
fn agrees_with_a_dense_search() {
    let mut random = Random(14);
    for shape in limb_like() {
        let pose = random.pose();
        let queries = queries(&shape, &pose, 150, &mut random);
        let mut out = SurfaceBatch::default();
        shape.closest_points(&pose, &queries, &mut out);
        for i in 0..queries.len() {
            let q = pose.inverse_transform_point(queries.get(i));
            let (distance, _) = brute_force(&shape, q, 64);
            assert!((f64::from(out.signed_distance[i]).abs() - distance).abs() < TOLERANCE);
            assert!((out.points.get(i).distance(queries.get(i)) - distance).abs() < TOLERANCE);
        }
    }
}

#[test]
fn a_result_does_not_depend_on_its_place_or_company() {
    let mut random = Random(15);
    let pose = random.pose();
    for shape in limb_like().into_iter().chain(hostile()) {
        let all = queries(&shape, &pose, 101, &mut random);
        let mut together = SurfaceBatch::default();
        shape.closest_points(&pose, &all, &mut together);
        let mut part = SurfaceBatch::default();
        for (start, end) in [(0, 1), (1, 2), (7, 40), (99, 101), (100, 101), (50, 50)] {
            let mut chosen = Points::default();
            (start..end).for_each(|index| chosen.push([all.x[index], all.y[index], all.z[index]]));
            shape.closest_points(&pose, &chosen, &mut part);
            assert_eq!(part.region.len(), end - start);
            for i in start..end {
                let (here, there) = (i - start, i);
                assert_eq!(part.points.get(here), together.points.get(there));
                assert_eq!(part.normals.get(here), together.normals.get(there));
                assert_eq!(part.signed_distance[here], together.signed_distance[there]);
                assert_eq!(part.region[here], together.region[there]);
            }
        }
    }
}

#[test]
fn memory_is_kept_between_batches() {
    let mut random = Random(16);
    let limb = shape([0.25, 0.05, 0.045, 0.03, 0.027]);
    let points = queries(&limb, &Pose::IDENTITY, 500, &mut random);
    let mut out = SurfaceBatch::default();
    limb.closest_points(&Pose::IDENTITY, &points, &mut out);
    let before = (out.points.x.as_ptr(), out.region.as_ptr());
    let few = queries(&limb, &Pose::IDENTITY, 20, &mut random);
    limb.closest_points(&Pose::IDENTITY, &few, &mut out);
    limb.closest_points(&Pose::IDENTITY, &points, &mut out);
    assert_eq!(before, (out.points.x.as_ptr(), out.region.as_ptr()));
}

#[test]
fn a_query_that_is_not_a_number_stays_visible() {
    let limb = shape([0.25, 0.05, 0.045, 0.03, 0.027]);
    let mut points = Points::default();
    points.push([f32::NAN, 0.0, 0.0]);
    points.push([0.1, 0.0, 0.1]);
    points.push([f32::INFINITY, 0.0, 0.0]);
    let mut out = SurfaceBatch::default();
    limb.closest_points(&Pose::IDENTITY, &points, &mut out);
    assert!(out.signed_distance[0].is_nan() && out.points.x[0].is_nan() && out.normals.z[0] == 1.0);
    assert!(out.signed_distance[1].is_finite());
    assert!(out.signed_distance[2].is_nan());
}
