//! A color camera and its pose.

use voodoo_core::math::{Affine3, Vec3};
use voodoo_core::{Camera, Unexpected};

/// A camera and its pose.
#[derive(Clone, Copy, Debug)]
pub struct Eye<'a> {
    /// Pose of the camera.
    pub world_from_sensor: Affine3,
    /// Its calibration.
    pub camera: &'a Camera,
}

impl Eye<'_> {
    /// Focal length, pixels.
    pub fn focal(&self) -> f64 {
        let [fx, fy] = self.camera.focal();
        (fx * fy).sqrt()
    }

    /// Checks that an image has as many pixels as the camera.
    pub(crate) fn check(&self, name: &str, expected: &'static str, pixels: usize) -> Result<(), Unexpected> {
        let found = format_args!("{pixels} for {} pixels", self.camera.pixels());
        Unexpected::unless(pixels == self.camera.pixels(), name, expected, found)
    }

    /// Focal point in the world, meters.
    pub fn origin(&self) -> Vec3 {
        self.world_from_sensor.translation
    }

    /// Optical axis in the world.
    pub fn axis(&self) -> Vec3 {
        self.world_from_sensor.matrix3.z_axis
    }

    /// A world position in the camera frame, meters.
    pub fn in_sensor(&self, place: Vec3) -> Vec3 {
        self.world_from_sensor.matrix3.mul_transpose_vec3(place - self.origin())
    }

    /// Column and row of a position in the camera frame; NaN where it is not visible.
    pub fn pixel(&self, place: Vec3) -> [f64; 2] {
        self.camera.project(place).unwrap_or([f64::NAN; 2])
    }

    /// Position in the world at `(x/z, y/z)` and the depth z, meters.
    pub fn place(&self, [x, y]: [f64; 2], z: f64) -> Vec3 {
        self.origin() + z * (self.world_from_sensor.matrix3 * Vec3::new(x, y, 1.0))
    }

    /// Unit vector in the world through a pixel; NaN where the lens model has no ray for it.
    pub fn direction(&self, pixel: [f64; 2]) -> Vec3 {
        let [x, y] = self.camera.ray(pixel).unwrap_or([f64::NAN; 2]);
        (self.world_from_sensor.matrix3 * Vec3::new(x, y, 1.0)).normalize()
    }

    /// Distance of a world position from the ray along a unit vector, meters.
    pub(crate) fn distance_from_ray(&self, place: Vec3, direction: Vec3) -> f64 {
        let offset = place - self.origin();
        (offset - offset.dot(direction).max(0.0) * direction).length()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use voodoo_core::Lens;
    use voodoo_core::math::Mat3;

    #[test]
    fn the_ray_behind_a_pixel_leads_to_what_is_visible_there() {
        let axes = Mat3::from_cols(-Vec3::Y, -Vec3::Z, Vec3::X);
        let world_from_sensor = Affine3::from_mat3_translation(axes, Vec3::new(0.5, 0.0, 1.2));
        let lens = Lens::PlumbBob([-0.2, 0.05, 0.001, 0.0, 0.0]);
        let camera = Camera::new(320, 240, [300.0, 310.0, 159.5, 119.5], lens).unwrap();
        let eye = Eye { world_from_sensor, camera: &camera };
        let place = Vec3::new(2.5, 0.3, 1.7);
        let inside = eye.in_sensor(place);
        assert!((inside - Vec3::new(-0.3, -0.5, 2.0)).length() < 1e-12);
        let direction = eye.direction(eye.pixel(inside));
        let found = eye.origin() + direction * (inside.z / direction.dot(eye.axis()));
        assert!((found - place).length() < 1e-12);
    }
}
