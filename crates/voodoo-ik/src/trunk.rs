//! The trunk and other limbs, which no bone may enter. Silhouettes do not detect this: an arm inside the trunk satisfies them as
//! well as one in front of it or behind it, and so does a leg inside the other one.

use super::model::Kinematics;
use voodoo_core::TaperedEllipticCylinder;
use voodoo_core::math::{Pose, Vec3};

/// A bone stays this fraction of its radius outside the trunk: flesh is compressible, and the model's limbs are stiffer than a
/// back.
const CLEARANCE: f64 = 0.5;

/// A limb that no bone may enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trunk {
    /// The link that carries it; `None` for a limb that is not part of the chain.
    pub link: Option<usize>,
    /// Its pose in the frame of the link, or else in the world.
    pub pose: Pose,
    /// Its shape.
    pub shape: TaperedEllipticCylinder,
}

impl Trunk {
    /// Its pose in the world.
    pub(super) fn pose(&self, at: &Kinematics) -> Pose {
        self.link.map_or(self.pose, |link| at.poses[link] * self.pose)
    }

    /// How deep a point with flesh of a radius around it lies inside, meters (approximate, from the ellipse's level function),
    /// and the derivative with respect to the point, in the trunk's frame.
    pub(super) fn depth(&self, x: Vec3, radius: f64) -> (f64, Vec3) {
        let shape = &self.shape;
        let t = x.z / shape.length();
        if !(0.0..=1.0).contains(&t) {
            return (0.0, Vec3::ZERO);
        }
        let (slope_a, slope_b) = (shape.a1() - shape.a0(), shape.b1() - shape.b0());
        let (a, b) = (shape.a0() + t * slope_a, shape.b0() + t * slope_b);
        let (p, q) = (x.x / a, x.y / b);
        let level = p.hypot(q).max(1e-6);
        let thickness = shape.a0().min(shape.a1()).min(shape.b0()).min(shape.b1());
        let depth = thickness * (1.0 - level) + CLEARANCE * radius;
        if depth <= 0.0 {
            return (0.0, Vec3::ZERO);
        }
        let along = -(p * p * slope_a / a + q * q * slope_b / b) / shape.length();
        (depth, -thickness / level * Vec3::new(p / a, q / b, along))
    }
}
