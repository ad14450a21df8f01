//! Rendered depth against dense marching, against the exact ray of every limb, and against itself on more threads.
#![allow(clippy::expect_used, clippy::panic)]

use crate::scene;
use crate::shape_support;
use shape_support::{Random, hostile, inside, limb_like, random_shape};
use voodoo_core::Lens;
use voodoo_core::TaperedEllipticCylinder;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Camera};
use voodoo_core::{HumanModel, Joint, Limb};
use voodoo_core::{NO_LIMB, Rendering, Viewpoint};

fn camera(width: usize, height: usize, focal: f64) -> Viewpoint<'static> {
    let intrinsics = [focal, 1.1 * focal, 0.48 * width as f64, 0.53 * height as f64];
    Viewpoint { camera: scene::pinhole(width, height, intrinsics), world_from_sensor: Pose::IDENTITY }
}

/// The ray of a pixel, `z = 1`, sensor frame.
fn ray(view: &Viewpoint, pixel: usize) -> Vec3 {
    let [x, y] = view.camera.pixel_ray(pixel % view.camera.width(), pixel / view.camera.width());
    Vec3::new(x, y, 1.0)
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

/// Every pixel agrees with the nearest exact hit: the same depth to a micrometer, and the limb unless two are level. Where
/// one sees a limb and the other does not, the ray touches it: with the limb a micrometer fatter it hits, slimmer it misses.
fn agrees_with_exact_rays(body: &Body, poses: &[Pose], view: &Viewpoint) -> usize {
    let mut image = Rendering::default();
    image.render(body, poses, view).expect("valid input");
    let mut hits = 0;
    for pixel in 0..view.camera.pixels() {
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
            shape.cast_ray(origin, way).map(|distance| distance / way.length())
        };
        let nearest = |fatter: f64| (0..poses.len()).filter_map(|limb| hit(limb, fatter)).fold(f64::INFINITY, f64::min);
        let exact = nearest(0.0);
        let (depth, limb) = (f64::from(image.depth()[pixel]), image.limb()[pixel]);
        assert_eq!(limb == NO_LIMB, depth == 0.0);
        let depth = if limb == NO_LIMB { f64::INFINITY } else { depth };
        hits += usize::from(limb != NO_LIMB);
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
    hits
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
    let mut hits = 0;
    for _ in 0..60 {
        let mut shapes: Vec<_> = (0..4).map(|_| random_shape(&mut random)).collect();
        shapes.extend(limb_like());
        shapes.extend(hostile().into_iter().take(13));
        let poses: Vec<Pose> = shapes
            .iter()
            .map(|_| Pose::from_parts(random.direction() * random.within(0.0, 3.0), random.pose().rotation))
            .collect();
        hits += agrees_with_exact_rays(&loose(&shapes), &poses, &camera(24, 20, 15.0));
    }
    assert!(hits > 2000, "{hits}");
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
        image.render(&body, &poses, &view).expect("valid input");
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
fn lenses_that_distort_show_what_their_rays_meet_and_nothing_where_they_have_none() {
    let body = Body::human(1.75, HumanModel::Full).expect("a human");
    let poses = scene::bent(&body, Pose::new(Vec3::new(0.1, 0.0, 2.2), Vec3::X * 1.4), 0.4, &mut scene::Noise(33));
    let view = camera(90, 70, 70.0);
    let through = |lens: Lens| {
        let intrinsics = [70.0, 77.0, 43.2, 37.1];
        Camera::new(90, 70, intrinsics, lens).expect("a camera")
    };
    let (mut image, mut other) = (Rendering::default(), Rendering::default());
    image.render(&body, &poses, &view).expect("valid input");
    // As good as a pinhole, whose rays are rounded: they meet the edges elsewhere.
    let straight = through(Lens::PlumbBob([1e-12, 0.0, 0.0, 0.0, 0.0]));
    other.render(&body, &poses, &Viewpoint { camera: &straight, ..view }).expect("valid input");
    let pairs = image.depth().iter().zip(other.depth());
    let off = pairs.filter(|(one, other)| (**one - **other).abs() > 1e-4).count();
    assert!(off < 20, "{off}");
    for lens in [
        Lens::PlumbBob([-0.3, 0.1, 0.002, -0.001, 0.0]),
        Lens::Fisheye([0.02, -0.01, 0.0, 0.0]),
        Lens::InversePlumbBob([0.2, 0.05, 0.0, 0.001, 0.0]),
    ] {
        let camera = through(lens);
        assert!(agrees_with_exact_rays(&body, &poses, &Viewpoint { camera: &camera, ..view }) > 250, "{lens:?}");
    }
    // No direction falls on the corners of this one; a body around the camera is seen everywhere else.
    let blind = through(Lens::PlumbBob([-0.9, 0.0, 0.0, 0.0, 0.0]));
    let around = loose(&[TaperedEllipticCylinder::new(40.0, 30.0, 30.0, 30.0, 30.0).expect("a shape")]);
    let behind = [Pose::from_parts(Vec3::Z * 0.5, voodoo_core::math::Quat::IDENTITY)];
    other.render(&around, &behind, &Viewpoint { camera: &blind, ..view }).expect("valid input");
    let dark = blind.rays().iter().zip(other.limb()).filter(|(ray, _)| ray[0].is_nan());
    assert!(dark.clone().count() > 100 && dark.clone().all(|(_, limb)| *limb == NO_LIMB));
    let lit = blind.rays().iter().zip(other.limb()).filter(|(ray, _)| !ray[0].is_nan());
    assert!(lit.clone().count() > 1000 && lit.clone().all(|(_, limb)| *limb != NO_LIMB));
}

#[test]
fn a_used_buffer_changes_nothing() {
    let body = Body::human(1.75, HumanModel::Full).expect("a human");
    let poses = scene::bent(&body, Pose::new(Vec3::new(0.1, 0.0, 2.2), Vec3::X * 1.4), 0.4, &mut scene::Noise(34));
    let view = camera(160, 121, 140.0);
    let (mut one, mut other) = (Rendering::default(), Rendering::default());
    one.render(&body, &poses, &view).expect("valid input");
    other.render(&body, &poses[..], &camera(13, 7, 9.0)).expect("valid input");
    other.render(&body, &poses, &view).expect("valid input");
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
    image.render(&body, &poses, &view).expect("valid input");
    let kept = image.depth().to_vec();
    let mut lame = poses.clone();
    lame[3].translation.x = f64::NAN;
    let mut skewed = view;
    skewed.world_from_sensor.rotation.x = 3.0;
    for (poses, view, word) in [
        (&poses[1..], view, "one rigid pose a limb"),
        (&lame[..], view, "one rigid pose a limb"),
        (&poses[..], skewed, "a rigid transform"),
    ] {
        let error = image.render(&body, poses, &view).expect_err("bad input");
        assert!(error.to_string().contains(word), "{error}");
        assert_eq!(image.depth(), kept);
    }
}
