//! Rendered depth against dense marching, against the exact ray of every limb, and against itself on more threads.
#![allow(clippy::expect_used, clippy::panic)]

use crate::scene;
use crate::shape_support;
use shape_support::{Random, hostile, inside, limb_like, random_shape};
use voodoo_core::Body;
use voodoo_core::body::{HumanModel, Joint, Limb};
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::shape::TaperedEllipticCylinder;
use voodoo_core::visibility::render::{NO_LIMB, Rendering, Viewpoint};

fn camera(width: usize, height: usize, focal: f64) -> Viewpoint<'static> {
    Viewpoint {
        width,
        height,
        intrinsics: [focal, 1.1 * focal, 0.48 * width as f64, 0.53 * height as f64],
        rays: None,
        world_from_sensor: Pose::IDENTITY,
    }
}

/// The ray of a pixel, `z = 1`, sensor frame.
fn ray(view: &Viewpoint, pixel: usize) -> Vec3 {
    if let Some(rays) = view.rays {
        return Vec3::new(f64::from(rays[pixel][0]), f64::from(rays[pixel][1]), 1.0);
    }
    let [fx, fy, cx, cy] = view.intrinsics;
    let (column, row) = (pixel % view.width, pixel / view.width);
    Vec3::new((column as f64 - cx) / fx, (row as f64 - cy) / fy, 1.0)
}

/// Limbs without kinship: each shape stands where its pose says.
fn loose(shapes: &[TaperedEllipticCylinder]) -> Body {
    let joint = || Joint {
        name: "j".into(),
        parent_from_joint: Pose::IDENTITY,
        limb_from_joint: Pose::IDENTITY,
        semi_axes: [0.0; 2],
        weight: 1.0,
        limits: None,
        motion: 0.3,
    };
    let limb = |(index, shape): (usize, &TaperedEllipticCylinder)| Limb {
        name: index.to_string(),
        shape: *shape,
        parent: (index > 0).then(|| (0, joint())),
        match_caps: [true; 2],
    };
    Body::new("loose", shapes.iter().enumerate().map(limb).collect(), Vec::new()).expect("a valid body")
}

/// Every pixel agrees with the nearest exact hit: the same depth to a micrometre, and the limb unless two are level. Where
/// one sees a limb and the other does not, the ray touches it: with the limb a micrometre fatter it hits, slimmer it misses.
fn agrees_with_exact_rays(body: &Body, poses: &[Pose], view: &Viewpoint) -> usize {
    let mut image = Rendering::default();
    image.render(body, poses, view, None).expect("valid input");
    let mut seen = 0;
    for pixel in 0..view.width * view.height {
        let direction = ray(view, pixel);
        let hit = |limb: usize, fatter: f64| {
            let shape = body.limbs()[limb].shape;
            let [a0, b0, a1, b1] =
                [shape.a0(), shape.b0(), shape.a1(), shape.b1()].map(|axis| (axis + fatter).max(0.0));
            let length = shape.length() + fatter;
            let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1).ok()?;
            let limb_from_world = poses[limb].inverse();
            let origin = limb_from_world * view.world_from_sensor.translation + Vec3::Z * 0.5 * fatter;
            let way = limb_from_world.rotation * (view.world_from_sensor.rotation * direction);
            shape.cast_ray(origin, way, f64::INFINITY).map(|hit| hit.distance / way.length())
        };
        let nearest = |fatter: f64| (0..poses.len()).filter_map(|limb| hit(limb, fatter)).fold(f64::INFINITY, f64::min);
        let exact = nearest(0.0);
        let (depth, limb) = (f64::from(image.depth()[pixel]), image.limb()[pixel]);
        assert_eq!(limb == NO_LIMB, depth == 0.0);
        let depth = if limb == NO_LIMB { f64::INFINITY } else { depth };
        seen += usize::from(limb != NO_LIMB);
        let close = |a: f64, b: f64| a == b || (a - b).abs() < 2e-6 * a.min(b).max(1.0);
        if close(depth, exact) {
            if limb != NO_LIMB {
                let own = hit(usize::from(limb), 0.0).unwrap_or(f64::INFINITY);
                assert!(close(own, exact), "pixel {pixel} shows limb {limb} at {own}, the nearest is at {exact}");
            }
            continue;
        }
        // Fat and slim limbs bracket a grazing ray.
        let (fat, slim) = (nearest(2e-6), nearest(-2e-6));
        assert!(
            fat <= depth + 1e-5 && depth <= slim + 1e-5,
            "pixel {pixel} of {view:?}: {depth} of limb {limb}, exactly {exact}, between {fat} and {slim}; {body:?} {poses:?}"
        );
    }
    seen
}

#[test]
fn agrees_with_the_exact_ray_of_every_limb() {
    let mut random = Random(31);
    let mut noise = scene::Noise(31);
    for model in [HumanModel::Papers, HumanModel::Full] {
        let body = Body::human(1.75, model).expect("a human");
        for _ in 0..12 {
            let root = Pose::new(
                Vec3::new(random.within(-0.3, 0.3), 0.1, random.within(1.2, 4.0)),
                random.pose().rotation.to_scaled_axis(),
            );
            let poses = scene::bent(&body, root, 0.6, &mut noise);
            let mut view = camera(72, 56, 52.0);
            // The same scene from elsewhere: poses and camera move together.
            let moved = random.pose();
            view.world_from_sensor = moved;
            let poses: Vec<Pose> = poses.iter().map(|pose| moved * *pose).collect();
            assert!(agrees_with_exact_rays(&body, &poses, &view) > 40);
        }
    }
    // Any shape anywhere: beside, behind and around the camera too.
    let mut seen = 0;
    for _ in 0..60 {
        let mut shapes: Vec<_> = (0..4).map(|_| random_shape(&mut random)).collect();
        shapes.extend(limb_like());
        shapes.extend(hostile().into_iter().take(13));
        let poses: Vec<Pose> = shapes
            .iter()
            .map(|_| Pose::from_parts(random.direction() * random.within(0.0, 3.0), random.pose().rotation))
            .collect();
        seen += agrees_with_exact_rays(&loose(&shapes), &poses, &camera(24, 20, 15.0));
    }
    assert!(seen > 2000, "{seen}");
}

#[test]
fn agrees_with_dense_marching() {
    let mut random = Random(32);
    let mut noise = scene::Noise(32);
    let body = Body::human(1.75, HumanModel::Papers).expect("a human");
    let mut compared = 0;
    for _ in 0..6 {
        let poses = scene::bent(&body, Pose::new(Vec3::new(0.0, 0.0, 2.0), random.direction() * 2.0), 0.5, &mut noise);
        let view = camera(64, 48, 60.0);
        let mut image = Rendering::default();
        image.render(&body, &poses, &view, None).expect("valid input");
        let world_to_limb: Vec<Pose> = poses.iter().map(Pose::inverse).collect();
        let solid = |depth: f64, direction: Vec3| {
            let point = direction * depth;
            body.limbs().iter().zip(&world_to_limb).any(|(limb, pose)| inside(&limb.shape, *pose * point))
        };
        for pixel in (0..64 * 48).step_by(7) {
            let direction = ray(&view, pixel);
            let step = 4e-4;
            let found = (1..8000).map(|k| f64::from(k) * step).find(|depth| solid(*depth, direction));
            let depth = f64::from(image.depth()[pixel]);
            match found {
                Some(marched) => {
                    compared += 1;
                    // The march may step over a corner, so it may be late; it is never early.
                    assert!(depth > 0.0 && depth <= marched + 1e-6, "pixel {pixel}: {depth}, marched {marched}");
                    assert!(solid(depth + 2e-6, direction) || depth > marched - step - 1e-6);
                }
                None if depth > 0.0 => {
                    // Stepped over: the ray is inside for less than a step.
                    assert!(
                        (1..50).any(|k| solid(depth + f64::from(k) * 1e-7, direction))
                            && !solid(depth + step, direction)
                    );
                }
                None => {}
            }
        }
    }
    assert!(compared > 200, "{compared}");
}

#[test]
fn a_table_of_rays_gives_the_image_of_the_pinhole_and_nan_sees_nothing() {
    let body = Body::human(1.75, HumanModel::Full).expect("a human");
    let poses = scene::bent(&body, Pose::new(Vec3::new(0.1, 0.0, 2.2), Vec3::X * 1.4), 0.4, &mut scene::Noise(33));
    let view = camera(90, 70, 70.0);
    let mut table: Vec<[f32; 2]> = (0..90 * 70)
        .map(|pixel| {
            let direction = ray(&view, pixel);
            [direction.x as f32, direction.y as f32]
        })
        .collect();
    let blind = 35 * 90 + 43;
    let (mut image, mut other) = (Rendering::default(), Rendering::default());
    image.render(&body, &poses, &view, None).expect("valid input");
    assert!(image.limb()[blind] != NO_LIMB);
    table[blind] = [f32::NAN; 2];
    other.render(&body, &poses, &Viewpoint { rays: Some(&table), ..view }, None).expect("valid input");
    assert_eq!((other.depth()[blind], other.limb()[blind]), (0.0, NO_LIMB));
    let pairs = image.depth().iter().zip(other.depth());
    let off = pairs.filter(|(one, other)| (**one - **other).abs() > 1e-4).count();
    // The rounded rays meet the edges elsewhere.
    assert!(off < 20, "{off}");
    let bent: Vec<[f32; 2]> =
        table.iter().map(|[x, y]| [x * (1.0 - 0.2 * (x * x + y * y)), y * (1.0 - 0.2 * (x * x + y * y))]).collect();
    let bent: Vec<[f32; 2]> = bent.iter().map(|ray| if ray[0].is_nan() { [9.0, 9.0] } else { *ray }).collect();
    assert!(agrees_with_exact_rays(&body, &poses, &Viewpoint { rays: Some(&bent), ..view }) > 250);
}

#[test]
fn threads_and_a_used_buffer_change_nothing() {
    let body = Body::human(1.75, HumanModel::Full).expect("a human");
    let poses = scene::bent(&body, Pose::new(Vec3::new(0.1, 0.0, 2.2), Vec3::X * 1.4), 0.4, &mut scene::Noise(34));
    let view = camera(160, 121, 140.0);
    let (mut one, mut other) = (Rendering::default(), Rendering::default());
    one.render(&body, &poses, &view, None).expect("valid input");
    other.render(&body, &poses[..], &camera(13, 7, 9.0), None).expect("valid input");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("threads");
    other.render(&body, &poses, &view, Some(&pool)).expect("valid input");
    assert_eq!(one.depth(), other.depth());
    assert_eq!(one.limb(), other.limb());
    assert_eq!(other.width(), 160);
}

#[test]
fn refuses_what_it_cannot_use_and_keeps_the_last_image() {
    let body = Body::human(1.75, HumanModel::Papers).expect("a human");
    let poses = body.rest_pose(Pose::new(Vec3::Z * 2.0, Vec3::X * 1.5));
    let view = camera(32, 24, 30.0);
    let mut image = Rendering::default();
    image.render(&body, &poses, &view, None).expect("valid input");
    let kept = image.depth().to_vec();
    let mut lame = poses.clone();
    lame[3].translation.x = f64::NAN;
    let rays = [[0.0_f32; 2]; 5];
    let mut skewed = view;
    skewed.world_from_sensor.rotation.x = 3.0;
    for (poses, view, word) in [
        (&poses[1..], view, "one rigid pose a limb"),
        (&lame[..], view, "one rigid pose a limb"),
        (&poses[..], Viewpoint { width: 0, ..view }, "1 to 33554432 pixels"),
        (&poses[..], Viewpoint { width: 100_000, height: 100_000, ..view }, "1 to 33554432 pixels"),
        (&poses[..], Viewpoint { width: usize::MAX, ..view }, "1 to 33554432 pixels"),
        (&poses[..], Viewpoint { intrinsics: [0.0, 1.0, 1.0, 1.0], ..view }, "positive focal lengths"),
        (&poses[..], Viewpoint { intrinsics: [1.0, 1.0, f64::NAN, 1.0], ..view }, "finite centre"),
        (&poses[..], Viewpoint { rays: Some(&rays), ..view }, "one ray a pixel"),
        (&poses[..], skewed, "a rigid transform"),
    ] {
        let error = image.render(&body, poses, &view, None).expect_err("bad input");
        assert!(error.to_string().contains(word), "{error}");
        assert_eq!(image.depth(), kept);
    }
}
