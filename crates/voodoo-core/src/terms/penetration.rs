//! Limbs do not pass through each other: keeps each limb's axis outside of other limbs. Surfaces may overlap, because limbs are
//! soft, and the models are thicker than real limbs.

use super::{LARGEST_COST, OVERLAP_SIGMA, Term};
use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::terms::normal_equations::{NormalEquations, line};

/// Positions on a limb's axis that are tested for overlap, as fractions of the length: both ends, and two positions between.
const FELT: [f64; 4] = [0.0, 0.35, 0.7, 1.0];
/// Assumed error of `approximate_distance`; the exact distance is only computed within this margin, meters.
const APPROXIMATE: f64 = 0.01;

/// One-sided: `r = max(0, -distance)` for every tested point against every limb that is neither joined to the point's limb nor
/// has the same parent. Such limbs overlap at their joints in any pose.
#[derive(Debug)]
pub(crate) struct Penetration<'a> {
    /// [`crate::TaperedEllipticCylinder::sphere`] of every limb: excludes most pairs, which are far apart.
    pub spheres: &'a [(Vec3, f64)],
}

impl Term for Penetration<'_> {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        let weight = 1.0 / (OVERLAP_SIGMA * OVERLAP_SIGMA);
        for first in 1..poses.len() {
            for second in 0..first {
                if !overlap(self.spheres[first], self.spheres[second]) || !body.are_apart(first, second) {
                    continue;
                }
                for [limb, other] in [[first, second], [second, first]] {
                    each_overlap(body, poses, [limb, other], |place, normal_there, overlap| {
                        // The distance grows when the point moves along the normal, and when the surface moves against it.
                        let row = line(place, normal_there);
                        // The mixed block of the two twists is left out: the system only has blocks of single limbs and joints.
                        normal.limbs[limb].add_row(weight, &-row, overlap);
                        normal.limbs[other].add_row(weight, &row, overlap);
                    });
                }
            }
        }
    }

    /// Twice the negative log-likelihood that `OVERLAP_SIGMA` gives: so fitted to right and wrong poses of rendered people.
    fn cost(&self, body: &Body, poses: &[Pose], limb: usize) -> f64 {
        let sphere = |limb: usize| body.limbs()[limb].shape.sphere(&poses[limb]);
        let (own, mut squares) = (sphere(limb), 0.0);
        for other in (0..poses.len()).filter(|other| body.are_apart(limb, *other)) {
            if overlap(own, sphere(other)) {
                each_overlap(body, poses, [limb, other], |_, _, depth| squares += (depth / OVERLAP_SIGMA).powi(2));
            }
        }
        squares.min(LARGEST_COST)
    }
}

/// Calls `each` with every tested point of `limb` that lies inside `other`, the normal of the surface of `other` there, and the
/// depth, meters.
fn each_overlap(body: &Body, poses: &[Pose], [limb, other]: [usize; 2], mut each: impl FnMut(Vec3, Vec3, f64)) {
    let (shape, surface) = (&body.limbs()[limb].shape, &body.limbs()[other].shape);
    let start = poses[other].inverse_transform_point(poses[limb].translation);
    let along = poses[other].rotation.inverse() * (poses[limb].rotation * Vec3::Z);
    for fraction in FELT {
        let z = fraction * shape.length();
        let local = start + along * z;
        if !surface.local_aabb().contains(local) || surface.approximate_distance(local) > APPROXIMATE {
            continue;
        }
        let found = surface.closest_point(local);
        if found.signed_distance < 0.0 {
            each(poses[other] * local, poses[other].rotation * found.normal, -found.signed_distance);
        }
    }
}

/// Whether two spheres intersect.
fn overlap((from, reach): (Vec3, f64), (to, other_reach): (Vec3, f64)) -> bool {
    (to - from).length_squared() < (reach + other_reach).powi(2)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::{first_arm, standing};

    #[test]
    fn an_arm_inside_the_trunk_has_a_cost_and_one_beside_it_has_none() {
        let (model, poses) = standing();
        let (body, chain) = (&model.body, &model.extremities[first_arm(&model)]);
        let cost = |poses: &[Pose]| -> f64 {
            chain.limbs().map(|limb| Penetration { spheres: &[] }.cost(body, poses, limb)).sum()
        };
        assert_eq!(cost(&poses), 0.0);
        let mut inside = poses.clone();
        chain.reach(body, &mut inside, 0.5 * (poses[0].translation + chain.root(body, &poses)), 0.0);
        // The depth of every tested point, one by one.
        let mut expected = 0.0;
        for limb in chain.limbs() {
            for fraction in FELT {
                let place = inside[limb] * (fraction * body.limbs()[limb].shape.length() * Vec3::Z);
                for other in (0..inside.len()).filter(|other| body.are_apart(limb, *other)) {
                    let shape = &body.limbs()[other].shape;
                    let distance = shape.closest_point(inside[other].inverse_transform_point(place)).signed_distance;
                    expected += (distance.min(0.0) / 0.03).powi(2);
                }
            }
        }
        assert!(expected > 1.0 && (cost(&inside) - expected).abs() < 1e-9, "{} of {expected} nats", cost(&inside));
    }
}
