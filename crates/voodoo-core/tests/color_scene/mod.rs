//! Pictures of a posed body from four calibrated cameras around it, the same on every run: each pair of limbs has a color of its
//! own, the room is patterned, and pixels are noisy.
#![allow(dead_code, missing_docs, clippy::unwrap_used, reason = "shared by tests, none of which uses all of it")]

use std::sync::LazyLock;

use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
use voodoo_core::{Body, Camera};
use voodoo_core::{ColorImage, ColorPixels};
use voodoo_core::{DepthImage, DepthPixels};
use voodoo_core::{NO_LIMB, Rendering, Viewpoint};

pub(crate) const CAMERAS: usize = 4;
pub(crate) const WIDTH: usize = 240;
pub(crate) const HEIGHT: usize = 200;
static CAMERA: LazyLock<Camera> =
    LazyLock::new(|| Camera::pinhole(WIDTH, HEIGHT, [200.0, 200.0, 119.5, 99.5]).unwrap());

/// Where a camera stands: 3 m from the body, 1.2 m high.
pub(crate) fn world_from_camera(camera: usize) -> Pose {
    let (sin, cos) = f64::sin_cos(0.3 + std::f64::consts::FRAC_PI_2 * camera as f64);
    let place = Vec3::new(3.0 * cos, 3.0 * sin, 1.2);
    let forward = (Vec3::new(0.0, 0.0, 0.95) - place).normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let rotation = Quat::from_mat3(&Mat3::from_cols(right, forward.cross(right), forward));
    Pose::from_parts(place, rotation.normalize())
}

/// The body in the middle, standing.
pub(crate) fn standing(body: &Body) -> Vec<Pose> {
    body.rest_pose(Pose::from_parts(Vec3::new(0.0, 0.0, 0.485 * 1.75), Quat::IDENTITY))
}

fn rendered(body: Option<(&Body, &[Pose])>, camera: usize) -> Rendering {
    let world_from_sensor = world_from_camera(camera);
    let view = Viewpoint { camera: &CAMERA, world_from_sensor };
    let mut rendering = Rendering::default();
    if let Some((body, poses)) = body {
        rendering.render(body, poses, &view).unwrap();
    }
    rendering
}

/// Depths that a camera would see, meters: the body before a wall.
pub(crate) fn depth_of(body: &Body, poses: &[Pose], camera: usize) -> Vec<f32> {
    rendered(Some((body, poses)), camera).depth().iter().map(|z| if *z > 0.0 && *z < 5.0 { *z } else { 5.0 }).collect()
}

pub(crate) fn depth_picture(depth: &[f32], camera: usize) -> DepthImage<'_> {
    DepthImage {
        pixels: DepthPixels::F32(depth),
        camera: &CAMERA,
        meters_per_unit: 1.0,
        world_from_sensor: world_from_camera(camera),
        weight: 1.0,
        source: CAMERAS as u16,
    }
}

/// What a camera sees of the posed body; of the room alone with `body` none.
pub(crate) fn shoot(body: Option<(&Body, &[Pose])>, camera: usize) -> Vec<[u8; 3]> {
    let rendering = rendered(body, camera);
    let mut state = 7 + camera as u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as i32 % 9 - 4
    };
    let color = |limb: u16| -> [i32; 3] {
        let Some((body, _)) = body else { return [0; 3] };
        let name = body.limbs()[usize::from(limb)].name.as_str();
        match name.trim_start_matches("l_").trim_start_matches("r_") {
            "pelvis" | "thigh" => [40, 60, 140],
            "thorax" | "clavicle" | "upperarm" => [180, 40, 50],
            "calf" | "forearm" | "hand" | "neck" => [190, 140, 110],
            "head" => [60, 45, 35],
            _ => [20, 20, 25],
        }
    };
    let pixel = |index: usize| {
        let limb = if body.is_some() { rendering.limb()[index] } else { NO_LIMB };
        let base = if limb == NO_LIMB {
            let (column, row) = (index % WIDTH, index / WIDTH);
            if (column / 16 + row / 12) % 2 == 0 { [120, 150, 110] } else { [150, 160, 150] }
        } else {
            color(limb)
        };
        base.map(|value| (value + noise()).clamp(0, 255) as u8)
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

pub(crate) fn picture(pixels: &[[u8; 3]], camera: usize, stamp: f64) -> ColorImage<'_> {
    ColorImage {
        pixels: ColorPixels::Color(pixels),
        camera: &CAMERA,
        world_from_sensor: world_from_camera(camera),
        stamp,
        number: camera as u16,
        source: camera as u16,
    }
}
