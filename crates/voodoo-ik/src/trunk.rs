//! The trunk and other limbs, which no bone may enter. Silhouettes do not detect this: an arm inside the trunk satisfies them as
//! well as one in front of it or behind it, and so does a leg inside the other one.

use super::model::Kinematics;
use voodoo_core::TaperedEllipticCylinder;
use voodoo_core::math::{Pose, Vec3};

/// A bone stays this fraction of its radius outside the trunk: flesh is compressible, and the model's limbs are stiffer than a
/// back.
const CLEARANCE: f64 = 0.5;

/// What carries a limb that no bone may enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Carrier {
    /// The base of the chain.
    Base,
    /// A link of the chain.
    Link(usize),
    /// It is not part of the chain and has this pose in the world.
    World(Pose),
}

/// A limb that no bone may enter: a tapered elliptic cylinder along z of its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trunk {
    /// What carries it.
    pub carrier: Carrier,
    /// Length, meters.
    pub length: f64,
    /// Semi-axes along x at both ends.
    pub a: [f64; 2],
    /// Semi-axes along y at both ends.
    pub b: [f64; 2],
}

impl Trunk {
    /// A limb's shape on a carrier.
    pub fn new(shape: &TaperedEllipticCylinder, carrier: Carrier) -> Self {
        Self { carrier, length: shape.length(), a: [shape.a0(), shape.a1()], b: [shape.b0(), shape.b1()] }
    }

    /// Its pose.
    pub(super) fn pose(&self, at: &Kinematics) -> Pose {
        match self.carrier {
            Carrier::Base => at.base,
            Carrier::Link(link) => at.poses[link],
            Carrier::World(pose) => pose,
        }
    }

    /// How deep a point with flesh of a radius around it lies inside, meters (approximate, from the ellipse's level function),
    /// and the derivative with respect to the point, in the trunk's frame.
    pub(super) fn depth(&self, x: Vec3, radius: f64) -> (f64, Vec3) {
        let t = x.z / self.length;
        if !(0.0..=1.0).contains(&t) {
            return (0.0, Vec3::ZERO);
        }
        let (slope_a, slope_b) = (self.a[1] - self.a[0], self.b[1] - self.b[0]);
        let (a, b) = (self.a[0] + t * slope_a, self.b[0] + t * slope_b);
        let (p, q) = (x.x / a, x.y / b);
        let level = p.hypot(q).max(1e-6);
        let thickness = self.a[0].min(self.a[1]).min(self.b[0]).min(self.b[1]);
        let depth = thickness * (1.0 - level) + CLEARANCE * radius;
        if depth <= 0.0 {
            return (0.0, Vec3::ZERO);
        }
        let along = -(p * p * slope_a / a + q * q * slope_b / b) / self.length;
        (depth, -thickness / level * Vec3::new(p / a, q / b, along))
    }
}
