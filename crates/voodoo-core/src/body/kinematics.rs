//! The kinematic chain of a body: exact joints. The unknowns are the root's twist and the joint angles (R07 section 2.2).

use std::ops::Range;

use nalgebra::Vector6;

use crate::body::{Body, Joint, JointKind, Limb};
use crate::math::{Pose, Quat, Vec3, refill, reset};

/// Layout of the unknowns of all limbs' joints in the vector of unknowns; the root has six.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Chain {
    /// First unknown of each limb; and the number of all unknowns, which would be the first one of a next limb.
    start: Vec<usize>,
    /// Parent of each limb; the root is its own.
    pub parent: Vec<usize>,
}

impl Chain {
    /// Lays out the unknowns of `body`.
    pub(crate) fn layout(&mut self, body: &Body) {
        refill(&mut self.parent, (0..body.limbs().len()).map(|limb| body.parent(limb).unwrap_or(0)));
        reset(&mut self.start, 1, 0);
        for limb in body.limbs() {
            self.start.push(self.freedoms() + freedoms(limb));
        }
    }

    /// Number of all unknowns.
    pub(crate) fn freedoms(&self) -> usize {
        self.start.last().copied().unwrap_or(0)
    }

    /// The unknowns of a limb.
    pub(crate) fn unknowns(&self, limb: usize) -> Range<usize> {
        self.start[limb]..self.start[limb + 1]
    }

    /// The limb, its parent, and so on up to the root: the limbs whose unknowns move it.
    pub(crate) fn up_from(&self, limb: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(limb), |limb| (*limb > 0).then(|| self.parent[*limb]))
    }
}

/// Number of a limb's degrees of freedom: 6 for the root, 1 for a limb at a hinge, else 3.
pub(crate) fn freedoms(limb: &Limb) -> usize {
    match limb.parent.as_ref().map(|(_, joint)| joint.kind()) {
        None => 6,
        Some(JointKind::Hinge) => 1,
        Some(_) => 3,
    }
}

/// Below this angle, radians, series replace quotients whose numerators lose all digits.
const SMALL_ANGLE: f64 = 1e-4;

/// Axis of a hinge in its joint frame.
pub fn hinge_axis(joint: &Joint) -> Vec3 {
    if joint.semi_axes[0] > 0.0 { Vec3::X } else { Vec3::Y }
}

/// World axes of a joint's degrees of freedom (`exp` of their combination rotates the child), and their number.
pub(crate) fn joint_axes(joint: &Joint, world_from_parent: &Pose) -> ([Vec3; 3], usize) {
    let rotation = world_from_parent.rotation * joint.parent_from_joint.rotation;
    match joint.kind() {
        JointKind::Hinge => ([rotation * hinge_axis(joint), Vec3::ZERO, Vec3::ZERO], 1),
        _ => ([rotation * Vec3::X, rotation * Vec3::Y, rotation * Vec3::Z], 3),
    }
}

/// The spatial twist of a rotation about `axis` through `center` (a screw without pitch, R07 eq. 14).
pub(crate) fn screw(axis: Vec3, center: Vec3) -> Vector6<f64> {
    let v = center.cross(axis);
    Vector6::new(axis.x, axis.y, axis.z, v.x, v.y, v.z)
}

/// Rotation of a joint: joint frame on the parent from joint frame on the limb. For a hinge only the part about its axis.
pub fn joint_turn(joint: &Joint, world_from_parent: &Pose, world_from_limb: &Pose) -> Quat {
    let turn = (world_from_parent.rotation * joint.parent_from_joint.rotation).inverse()
        * (world_from_limb.rotation * joint.limb_from_joint.rotation);
    match joint.kind() {
        JointKind::Hinge => {
            let axis = hinge_axis(joint);
            let along = Vec3::new(turn.x, turn.y, turn.z).dot(axis);
            let twist = Quat::from_xyzw(axis.x * along, axis.y * along, axis.z * along, turn.w);
            if twist.length() > 1e-9 { twist.normalize() } else { Quat::IDENTITY }
        }
        _ => turn,
    }
}

/// Pose of a limb from its parent's pose and the joint's rotation; the joint is closed.
pub fn place(joint: &Joint, world_from_parent: &Pose, turn: Quat) -> Pose {
    *world_from_parent * joint.parent_from_joint * Pose::from_parts(Vec3::ZERO, turn) * joint.limb_from_joint.inverse()
}

/// `exp` of a spatial twist `(omega, v)` (R07 eq. 4, 5) as a pose.
pub fn exp(twist: &Vector6<f64>) -> Pose {
    let omega = Vec3::new(twist[0], twist[1], twist[2]);
    let v = Vec3::new(twist[3], twist[4], twist[5]);
    let angle = omega.length();
    let rotation = Quat::from_scaled_axis(omega);
    // Left Jacobian: I + b [w] + c [w]^2 with b = (1 - cos)/t^2, c = (t - sin)/t^3.
    let (b, c) = if angle < SMALL_ANGLE {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        ((1.0 - angle.cos()) / (angle * angle), (angle - angle.sin()) / (angle * angle * angle))
    };
    let first = omega.cross(v);
    Pose::from_parts(v + b * first + c * omega.cross(first), rotation)
}
