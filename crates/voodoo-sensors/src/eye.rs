//! A camera of pictures: where it stands, and without distortion where a place is in its picture.

use crate::body_view::Matrix;
use voodoo_core::math::Vec3;

/// A camera, by its pose and what a pinhole of it would be.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    /// Its pose.
    pub world_from_sensor: Matrix,
    /// Focal lengths and middle, pixels.
    pub intrinsics: [f64; 4],
}

impl Eye {
    /// Focal length, pixels.
    pub fn focal(&self) -> f64 {
        (self.intrinsics[0] * self.intrinsics[1]).sqrt()
    }

    /// Focal point in the world, metres.
    pub fn origin(&self) -> Vec3 {
        self.column(3)
    }

    /// Optical axis in the world.
    pub fn axis(&self) -> Vec3 {
        self.column(2)
    }

    fn column(&self, column: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|row| self.world_from_sensor[row][column]))
    }

    /// A place of the world in the camera's frame, metres.
    pub fn in_sensor(&self, place: Vec3) -> Vec3 {
        let offset = place - self.origin();
        Vec3::from_array([0, 1, 2].map(|column| offset.dot(self.column(column))))
    }

    /// Column and row of a place in the camera's frame; for a lens without distortion.
    pub fn pixel(&self, place: Vec3) -> [f64; 2] {
        let [fx, fy, cx, cy] = self.intrinsics;
        [place.x / place.z * fx + cx, place.y / place.z * fy + cy]
    }

    /// `(x/z, y/z)` of a pixel; for a lens without distortion.
    pub fn undistorted(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [fx, fy, cx, cy] = self.intrinsics;
        [(u - cx) / fx, (v - cy) / fy]
    }

    /// Unit vector in the world through `(x/z, y/z)`.
    pub fn direction(&self, [x, y]: [f64; 2]) -> Vec3 {
        (x * self.column(0) + y * self.column(1) + self.column(2)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ray_behind_a_pixel_leads_to_what_is_seen_there() {
        let world_from_sensor =
            [[0.0, 0.0, 1.0, 0.5], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.2], [0.0, 0.0, 0.0, 1.0]];
        let eye = Eye { world_from_sensor, intrinsics: [300.0, 310.0, 159.5, 119.5] };
        let place = Vec3::new(2.5, 0.3, 1.7);
        let inside = eye.in_sensor(place);
        assert!((inside - Vec3::new(-0.3, -0.5, 2.0)).length() < 1e-12);
        let direction = eye.direction(eye.undistorted(eye.pixel(inside)));
        let found = eye.origin() + direction * (inside.z / direction.dot(eye.axis()));
        assert!((found - place).length() < 1e-12);
    }
}
