//! Joint limits, one-sided and soft: each component of the joint's rotation vector stays in its range.

use super::Term;
use crate::body::{Body, Joint};
use crate::math::{Pose, Quat, ShortestAxis, Vec3};
use crate::terms::normal_equations::NormalEquations;

/// All joints that have limits.
#[derive(Debug)]
pub(crate) struct Limits {
    /// Standard deviation of a violation, radians.
    pub sigma: f64,
}

impl Term for Limits {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        let weight = 1.0 / (self.sigma * self.sigma);
        for (index, limb) in body.limbs().iter().enumerate() {
            let Some((parent, joint)) = &limb.parent else { continue };
            let Some(limits) = &joint.limits else { continue };
            let (world_from_joint, v) = turn_in_joint(joint, &poses[*parent], &poses[index]);
            for (axis, [low, high]) in limits.iter().enumerate() {
                let excess = if v[axis] < *low {
                    v[axis] - low
                } else if v[axis] > *high {
                    v[axis] - high
                } else {
                    continue;
                };
                // d v = J^-1 (relative rotation in the joint frame); one row of the inverse left Jacobian.
                let row = inverse_left_jacobian_row(v, axis);
                normal.joints[index].add_row(weight, world_from_joint * row, excess);
                normal.cost += weight * excess * excess;
            }
        }
    }
}

/// The joint's axes in the world frame, and the rotation vector of its rotation in the joint frame, radians.
pub(super) fn turn_in_joint(joint: &Joint, parent: &Pose, limb: &Pose) -> (Quat, Vec3) {
    let world_from_joint = parent.rotation * joint.parent_from_joint.rotation;
    let turned = world_from_joint.inverse() * limb.rotation * joint.limb_from_joint.rotation;
    (world_from_joint, turned.to_scaled_axis_shortest())
}

/// Row `axis` of the inverse left Jacobian of the rotation vector `v`: `J^-1 = I - [v]/2 + k [v]^2` with
/// `k = (1 - (t/2) cot(t/2)) / t^2`, `t = |v|`.
pub(super) fn inverse_left_jacobian_row(v: Vec3, axis: usize) -> Vec3 {
    let square = v.length_squared();
    let k = if square < 1e-6 {
        1.0 / 12.0
    } else {
        let half = 0.5 * square.sqrt();
        (1.0 - half / half.tan()) / square
    };
    let e = Vec3::AXES[axis];
    // e^T [v] = (e x v)^T up to sign: [v] u = v x u, so e . (v x u) = u . (e x v).
    let first = e.cross(v);
    // e^T [v]^2 u = e . (v x (v x u)) = u . ((e x v) x v)
    let second = first.cross(v);
    e - 0.5 * first + k * second
}
