//! Limbs do not pass through each other: keeps each limb's axis outside of other limbs. Surfaces may overlap, because limbs are
//! soft, and the models are thicker than real limbs.

use super::Term;
use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::terms::normal_equations::NormalEquations;

/// Positions on a limb's axis that are tested for overlap, as fractions of the length: both ends, and two positions between.
const FELT: [f64; 4] = [0.0, 0.35, 0.7, 1.0];
/// Assumed error of `approximate_distance`; the exact distance is only computed within this margin, meters.
const APPROXIMATE: f64 = 0.01;

/// One-sided: `r = max(0, -distance)` for every tested point against every limb that is neither joined to the point's limb nor
/// has the same parent. Such limbs overlap at their joints in any pose.
#[derive(Debug)]
pub(crate) struct Penetration<'a> {
    /// Standard deviation of the overlap, meters.
    pub sigma: f64,
    /// [`crate::TaperedEllipticCylinder::sphere`] of every limb: excludes most pairs, which are far apart.
    pub spheres: &'a [(Vec3, f64)],
}

impl Term for Penetration<'_> {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        let limbs = body.limbs();
        for first in 1..limbs.len() {
            for second in 0..first {
                if overlap(self.spheres[first], self.spheres[second]) && body.are_apart(first, second) {
                    self.add_points(body, poses, [first, second], normal);
                    self.add_points(body, poses, [second, first], normal);
                }
            }
        }
    }
}

impl Penetration<'_> {
    /// Points of `limb` against the surface of `other`.
    fn add_points(&self, body: &Body, poses: &[Pose], [limb, other]: [usize; 2], normal: &mut NormalEquations) {
        let (shape, surface) = (&body.limbs()[limb].shape, &body.limbs()[other].shape);
        let weight = 1.0 / (self.sigma * self.sigma);
        let start = poses[other].inverse_transform_point(poses[limb].translation);
        let along = poses[other].rotation.inverse() * (poses[limb].rotation * Vec3::Z);
        for fraction in FELT {
            let z = fraction * shape.length();
            let local = start + along * z;
            if !surface.local_aabb().contains(local) || surface.approximate_distance(local) > APPROXIMATE {
                continue;
            }
            let found = surface.closest_point(local);
            let overlap = -found.signed_distance;
            if overlap <= 0.0 {
                continue;
            }
            // The distance grows when the point moves along the normal, and when the surface moves against it.
            let row = crate::terms::normal_equations::line(poses[other] * local, poses[other].rotation * found.normal);
            normal.cost += weight * overlap * overlap;
            // The mixed block of the two twists is left out: the system only has blocks of single limbs and joints.
            normal.limbs[limb].add_row(weight, &-row, overlap);
            normal.limbs[other].add_row(weight, &row, overlap);
        }
    }
}

/// Whether two spheres intersect.
fn overlap((from, reach): (Vec3, f64), (to, other_reach): (Vec3, f64)) -> bool {
    (to - from).length_squared() < (reach + other_reach).powi(2)
}
