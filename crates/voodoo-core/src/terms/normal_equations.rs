//! Normal equations of the whole body: terms add to them, and whole-body solvers solve them.
//!
//! A limb moves by a spatial twist `(omega, v)` about the working frame's origin: a point `x` fixed to it moves by `omega x x +
//! v`. A joint rotates by the relative angular motion `omega_child - omega_parent`, in world axes. The cost is `sum w r^2`; `h =
//! sum w J^T J`, `g = sum w J^T r`, and the step is `-h^-1 g`.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::math::{Mat3, Vec3, reset};

/// Normal equations of one limb's twist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LimbBlock {
    /// Information of the twist.
    pub h: Matrix6<f64>,
    /// Half the gradient.
    pub g: Vector6<f64>,
}

/// Normal equations of the relative rotation of one joint (the joint of a limb to its parent).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct JointBlock {
    /// Information of the rotation.
    pub h: Matrix3<f64>,
    /// Half the gradient.
    pub g: Vector3<f64>,
}

/// The whole system.
#[derive(Clone, Debug, Default)]
pub(crate) struct NormalEquations {
    /// One block per limb.
    pub limbs: Vec<LimbBlock>,
    /// One block per limb, for its joint; unused for the root.
    pub joints: Vec<JointBlock>,
}

impl NormalEquations {
    /// Clears the system for `limbs` limbs.
    pub(crate) fn clear(&mut self, limbs: usize) {
        reset(&mut self.limbs, limbs, LimbBlock::default());
        reset(&mut self.joints, limbs, JointBlock::default());
    }
}

/// The moment `x x n` and the direction `n`: derivative of `n . x` with respect to the twist.
pub(crate) fn line(x: Vec3, n: Vec3) -> Vector6<f64> {
    let m = x.cross(n);
    Vector6::new(m.x, m.y, m.z, n.x, n.y, n.z)
}

impl LimbBlock {
    /// Adds one scalar residual.
    pub(crate) fn add_row(&mut self, weight: f64, jacobian: &Vector6<f64>, residual: f64) {
        self.h.syger(weight, jacobian, jacobian, 1.0);
        self.h.fill_upper_triangle_with_lower_triangle();
        self.g.axpy(weight * residual, jacobian, 1.0);
    }

    /// Adds a vector residual `r` of a point at `x` with information `w`.
    pub(crate) fn add_point(&mut self, information: &Mat3, x: Vec3, r: Vec3) {
        // Rows of J = [-[x]x, I], one per world axis.
        let rows = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| line(x, axis));
        let force = *information * r;
        for i in 0..3 {
            self.g.axpy(force[i], &rows[i], 1.0);
            for j in 0..3 {
                self.h.ger(information.col(j)[i], &rows[i], &rows[j], 1.0);
            }
        }
    }
}

impl JointBlock {
    /// Adds a vector residual `r` of the relative rotation with information `weight` and unit derivative.
    pub(crate) fn add_turn(&mut self, weight: f64, r: Vec3) {
        self.h += Matrix3::identity() * weight;
        self.g += Vector3::new(r.x, r.y, r.z) * weight;
    }

    /// Adds a scalar residual with derivative `axis`.
    pub(crate) fn add_row(&mut self, weight: f64, axis: Vec3, residual: f64) {
        let row = Vector3::new(axis.x, axis.y, axis.z);
        self.h += weight * row * row.transpose();
        self.g += weight * residual * row;
    }
}
