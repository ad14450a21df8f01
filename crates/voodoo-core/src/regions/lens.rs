//! A camera's picture plane.

use crate::math::Vec3;
use crate::observation::picture::ColorImage;

/// Size and lens of a picture; straight lines are straight in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lens {
    pub width: usize,
    pub height: usize,
    /// `(fx, fy, cx, cy)`, pixels; integer coordinates are pixel centres.
    pub intrinsics: [f64; 4],
}

impl Lens {
    pub(super) fn of(picture: &ColorImage) -> Self {
        let ([fx, fy], [cx, cy]) = (picture.camera.focal(), picture.camera.center());
        Self { width: picture.camera.width(), height: picture.camera.height(), intrinsics: [fx, fy, cx, cy] }
    }

    /// Where a point of the camera's frame is seen, pixels.
    #[inline]
    pub(super) fn project(&self, point: Vec3) -> [f64; 2] {
        let [fx, fy, cx, cy] = self.intrinsics;
        [fx * point.x / point.z + cx, fy * point.y / point.z + cy]
    }

    /// How far a point is seen to move along the unit vector `n` of the picture with its place: pixels a metre, camera frame.
    #[inline]
    pub(super) fn motion(&self, point: Vec3, n: [f64; 2]) -> Vec3 {
        let [fx, fy, ..] = self.intrinsics;
        let (x, y) = (n[0] * fx / point.z, n[1] * fy / point.z);
        Vec3::new(x, y, -(x * point.x + y * point.y) / point.z)
    }
}
