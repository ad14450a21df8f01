//! What unit tests of several crates share: a depth camera at the world's origin that looks along z, and a body before it.
#![allow(
    dead_code,
    missing_docs,
    clippy::unwrap_used,
    reason = "a test stops at the first surprise, and none uses all of it"
)]

use std::sync::LazyLock;

use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Camera, DepthImage, DepthPixels, Rendering, Viewpoint};

/// The camera.
static CAMERA: LazyLock<Camera> = LazyLock::new(|| Camera::pinhole(160, 124, [145.0, 145.0, 79.5, 61.5]).unwrap());

/// Depth of the wall behind the body, millimeters.
pub(crate) const WALL: u16 = 4500;

/// A body that stands 2.6 m before the camera and faces it.
pub(crate) fn stand(body: &Body) -> Vec<Pose> {
    // The body's x looks forward and z up; the camera's y points down.
    let upright = Quat::from_axis_angle(Vec3::X, std::f64::consts::FRAC_PI_2);
    let faces = Quat::from_axis_angle(Vec3::Z, -std::f64::consts::FRAC_PI_2);
    body.rest_pose(Pose::from_parts(Vec3::new(0.0, 0.1, 2.6), upright * faces))
}

/// Depth in millimeters, as the camera sees a posed body before nothing.
pub(crate) fn depth(body: &Body, poses: &[Pose]) -> Vec<u16> {
    let mut rendering = Rendering::default();
    let view = Viewpoint { camera: &CAMERA, world_from_sensor: Pose::IDENTITY };
    rendering.render(body, poses, &view).unwrap();
    rendering.depth().iter().map(|depth| (depth * 1000.0) as u16).collect()
}

/// The same before a wall.
pub(crate) fn before_wall(body: &Body, poses: &[Pose]) -> Vec<u16> {
    depth(body, poses).into_iter().map(|depth| if depth == 0 { WALL } else { depth }).collect()
}

/// Puts a board that faces the camera before what an image shows; half its width and height, meters.
pub(crate) fn put_board(pixels: &mut [u16], center: Vec3, [width, height]: [f64; 2]) {
    for (index, pixel) in pixels.iter_mut().enumerate() {
        let [x, y] = CAMERA.pixel_ray(index % CAMERA.width(), index / CAMERA.width()).map(|ray| center.z * ray);
        let depth = (1000.0 * center.z) as u16;
        if (x - center.x).abs() < width && (y - center.y).abs() < height && (*pixel == 0 || depth < *pixel) {
            *pixel = depth;
        }
    }
}

/// A depth image of the camera, in millimeters.
pub(crate) fn millimeters(pixels: &[u16]) -> DepthImage<'_> {
    DepthImage {
        pixels: DepthPixels::U16(pixels),
        camera: &CAMERA,
        meters_per_unit: 0.001,
        world_from_sensor: Pose::IDENTITY,
        weight: 1.0,
        source: 0,
    }
}
