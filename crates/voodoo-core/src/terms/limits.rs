//! Joint limits, one-sided and soft: each component of the joint's rotation vector stays in its range.

use super::Term;
use crate::body::Body;
use crate::math::{Pose, Quat, Vec3, rotation_vector};
use crate::terms::normal_equations::NormalEquations;

/// Greatest cost of a joint, nats: limits differ between persons.
const LARGEST_LIMIT_COST: f64 = 3.0;

/// Standard deviation of a violation, radians: 3 degrees.
const LIMIT_SIGMA: f64 = 0.05;

/// All joints that have limits.
#[derive(Debug)]
pub(crate) struct Limits;

impl Term for Limits {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        let weight = 1.0 / (LIMIT_SIGMA * LIMIT_SIGMA);
        add_angles(body, poses, normal, |angle, [low, high]| {
            let excess = angle - angle.clamp(low, high);
            (excess.abs() > 0.0).then_some((weight, excess))
        });
    }

    fn cost(&self, body: &Body, poses: &[Pose], limb: usize) -> f64 {
        let Some((limits, _, v)) = limited_turn(body, poses, limb) else { return 0.0 };
        let excess = |(axis, [low, high]): (usize, &[f64; 2])| (low - v[axis]).max(v[axis] - high).max(0.0);
        let squares: f64 = limits.iter().enumerate().map(|limit| (excess(limit) / LIMIT_SIGMA).powi(2)).sum();
        (0.5 * squares).min(LARGEST_LIMIT_COST)
    }
}

/// Adds a row for every component of the rotation of every joint with limits. `row` returns weight and residual for the component
/// and its limits.
pub(super) fn add_angles(
    body: &Body,
    poses: &[Pose],
    normal: &mut NormalEquations,
    row: impl Fn(f64, [f64; 2]) -> Option<(f64, f64)>,
) {
    for limb in 0..poses.len() {
        let Some((limits, world_from_joint, v)) = limited_turn(body, poses, limb) else { continue };
        for (axis, limits) in limits.iter().enumerate() {
            let Some((weight, residual)) = row(v[axis], *limits) else { continue };
            // d v = J^-1 (relative rotation in the joint frame); one row of the inverse left Jacobian.
            normal.joints[limb].add_row(weight, world_from_joint * inverse_left_jacobian_row(v, axis), residual);
        }
    }
}

/// The limits of a limb's joint, the joint's axes in the world frame, and the rotation vector of its rotation in the joint frame,
/// radians; `None` without limits.
fn limited_turn<'a>(body: &'a Body, poses: &[Pose], limb: usize) -> Option<(&'a [[f64; 2]; 3], Quat, Vec3)> {
    let (parent, joint) = body.limbs()[limb].parent.as_ref()?;
    let limits = joint.limits.as_ref()?;
    let world_from_joint = poses[*parent].rotation * joint.parent_from_joint.rotation;
    let turned = world_from_joint.inverse() * poses[limb].rotation * joint.limb_from_joint.rotation;
    Some((limits, world_from_joint, rotation_vector(turned)))
}

/// Row `axis` of the inverse left Jacobian of the rotation vector `v`: `J^-1 = I - [v]/2 + k [v]^2` with
/// `k = (1 - (t/2) cot(t/2)) / t^2`, `t = |v|`.
fn inverse_left_jacobian_row(v: Vec3, axis: usize) -> Vec3 {
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::kinematics::{hinge_axis, place};
    use crate::testing::{first_arm, standing};

    #[test]
    fn a_hyperextended_elbow_costs_its_squared_violation_up_to_the_greatest_cost() {
        let (model, poses) = standing();
        let elbow = model.extremities[first_arm(&model)].lower;
        let (parent, joint) = model.body.limbs()[elbow].parent.as_ref().unwrap();
        let [[least, _], ..] = joint.limits.unwrap();
        let term = Limits;
        assert!(term.cost(&model.body, &poses, elbow) < 1e-9);
        for (beyond, expected) in [(0.05, 0.5), (0.1, 2.0), (0.4, LARGEST_LIMIT_COST)] {
            let mut bent = poses.clone();
            bent[elbow] = place(joint, &poses[*parent], Quat::from_axis_angle(hinge_axis(joint), least - beyond));
            let cost = term.cost(&model.body, &bent, elbow);
            assert!((cost - expected).abs() < 1e-6, "{cost} for {beyond}");
        }
    }
}
