//! Solves for all limbs at once with elastic bands (K07 section 4). Every limb has a twist of its own. The normal matrix has the
//! structure of the body's tree, so elimination from the leaves to the root takes time linear in the number of limbs.

use std::ops::{AddAssign, SubAssign};

use nalgebra::{Cholesky, Matrix6, Vector6};

use super::{DAMPING, FLOOR, LARGEST_TURN};
use crate::body::kinematics::exp;
use crate::body::{Body, Joint, JointKind};
use crate::math::{Pose, Vec3, reset};
use crate::terms::normal_equations::{LimbBlock, NormalEquations, line};

/// The system of one step, and its solution.
#[derive(Debug, Default)]
pub(crate) struct TreeSolver {
    /// A limb's own block of the matrix, and half the gradient of its twist.
    pub own: Vec<LimbBlock>,
    /// The block of the matrix between a limb (rows) and its parent (columns); unused for the root.
    pub mixed: Vec<Matrix6<f64>>,
    /// The step of every limb's twist (working frame).
    pub twist: Vec<Vector6<f64>>,
}

impl TreeSolver {
    /// One damped step from the normal equations at `poses`, scaled by `stride`; `band_sigma` is the standard deviation of a
    /// band, meters.
    pub(crate) fn step(
        &mut self,
        body: &Body,
        normal: &NormalEquations,
        stride: f64,
        band_sigma: f64,
        poses: &mut [Pose],
    ) {
        self.assemble(body, normal, 1.0 / (band_sigma * band_sigma), poses);
        if !self.solve(body) {
            return;
        }
        let turn = |twist: &Vector6<f64>| twist.fixed_rows::<3>(0).amax();
        let largest = self.twist.iter().map(turn).fold(0.0_f64, f64::max);
        let shrink = stride.min(LARGEST_TURN / largest.max(f64::MIN_POSITIVE));
        for (pose, twist) in poses.iter_mut().zip(&self.twist) {
            *pose = exp(&(twist * shrink)) * *pose;
            pose.rotation = pose.rotation.normalize();
        }
    }

    fn assemble(&mut self, body: &Body, normal: &NormalEquations, strength: f64, poses: &[Pose]) {
        self.own.clone_from(&normal.limbs);
        for block in &mut self.own {
            for i in 0..6 {
                block.h[(i, i)] += DAMPING * block.h[(i, i)] + FLOOR;
            }
        }
        reset(&mut self.mixed, poses.len(), Matrix6::zeros());
        for (child, parent, joint) in body.joints() {
            for end in bands(joint) {
                let on_child = poses[child] * (joint.limb_from_joint * end);
                let on_parent = poses[parent] * (joint.parent_from_joint * end);
                self.add_band([child, parent], strength, on_child, on_parent);
            }
            // The normal equations of the joint's relative rotation `omega_child - omega_parent`.
            let turn = &normal.joints[child];
            self.own[child].g.fixed_rows_mut::<3>(0).add_assign(&turn.g);
            self.own[parent].g.fixed_rows_mut::<3>(0).sub_assign(&turn.g);
            for limb in [child, parent] {
                self.own[limb].h.fixed_view_mut::<3, 3>(0, 0).add_assign(&turn.h);
            }
            self.mixed[child].fixed_view_mut::<3, 3>(0, 0).sub_assign(&turn.h);
        }
    }

    /// A band between `on_child` and `on_parent`: `d = x_child - x_parent`, three rows.
    fn add_band(&mut self, [child, parent]: [usize; 2], strength: f64, on_child: Vec3, on_parent: Vec3) {
        let gap = on_child - on_parent;
        for (axis, d) in Vec3::AXES.into_iter().zip(gap.to_array()) {
            let (moves, follows) = (line(on_child, axis), line(on_parent, axis));
            self.own[child].add_row(strength, &moves, d);
            self.own[parent].add_row(strength, &-follows, d);
            self.mixed[child].ger(-strength, &moves, &follows, 1.0);
        }
    }

    /// Eliminates every limb into its parent, leaves first, then computes the twists from the root on. Returns false, with
    /// unusable twists, when the matrix is not positive definite. Overwrites `own` and `mixed`.
    pub(crate) fn solve(&mut self, body: &Body) -> bool {
        let Self { own, mixed, twist } = self;
        reset(twist, own.len(), Vector6::zeros());
        for limb in (0..own.len()).rev() {
            let Some(factor) = Cholesky::new(own[limb].h) else { return false };
            twist[limb] = -factor.solve(&own[limb].g);
            let Some(parent) = body.parent(limb) else { break };
            // x = -H^-1 g - H^-1 M x_parent; the parent gets the Schur complement.
            let carried = factor.solve(&mixed[limb]);
            own[parent].h -= mixed[limb].tr_mul(&carried);
            own[parent].g += mixed[limb].tr_mul(&twist[limb]);
            mixed[limb] = carried;
        }
        for (limb, parent, _) in body.joints() {
            let follows = mixed[limb] * twist[parent];
            twist[limb] -= follows;
        }
        twist.iter().all(|twist| twist.iter().all(|value| value.is_finite()))
    }
}

/// Ends of the bands that hold a joint together, joint frame. A hinge has two, so that it only rotates about its axis; other
/// joints have one at the center. Strong bands at the four ends of an ellipse would block rotation; joint limits restrict it
/// instead.
fn bands(joint: &Joint) -> impl Iterator<Item = Vec3> + use<> {
    let count = if joint.kind() == JointKind::Hinge { 2 } else { 1 };
    let center = joint.kind() == JointKind::Elliptic;
    joint.band_points().take(count).map(move |end| if center { Vec3::ZERO } else { end })
}
