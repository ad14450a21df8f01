//! Axis-aligned bounding boxes, and bounding spheres.

use super::TaperedEllipticCylinder;
use crate::math::{Aabb, Pose, Vec3};

impl TaperedEllipticCylinder {
    /// The tight axis-aligned box in the limb frame, meters.
    pub fn local_aabb(&self) -> Aabb {
        let (a, b) = (self.a0.max(self.a1), self.b0.max(self.b1));
        Aabb::new(Vec3::new(-a, -b, 0.0), Vec3::new(a, b, self.length))
    }

    /// The tight axis-aligned box in the frame `world`, meters.
    ///
    /// The side is ruled between the end ellipses, so the solid lies in their convex hull, and an ellipse reaches
    /// `sqrt((a u_x)² + (b u_y)²)` beyond its center along a unit vector `u` of the limb frame.
    pub fn aabb(&self, world_from_limb: &Pose) -> Aabb {
        let x = world_from_limb.rotation * Vec3::X;
        let y = world_from_limb.rotation * Vec3::Y;
        let reach = |a: f64, b: f64| {
            let squared = (x * a) * (x * a) + (y * b) * (y * b);
            Vec3::new(squared.x.sqrt(), squared.y.sqrt(), squared.z.sqrt())
        };
        let (start, end) =
            (world_from_limb.translation, world_from_limb.transform_point(Vec3::new(0.0, 0.0, self.length)));
        let (first, last) = (reach(self.a0, self.b0), reach(self.a1, self.b1));
        Aabb::new((start - first).min(end - last), (start + first).max(end + last))
    }

    /// Center and radius, meters, of a sphere around the solid in the frame `world`.
    pub(crate) fn sphere(&self, world_from_limb: &Pose) -> (Vec3, f64) {
        let half = 0.5 * self.length;
        let radius = self.max_radius();
        (*world_from_limb * (Vec3::Z * half), half.hypot(radius))
    }
}
