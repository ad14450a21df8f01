//! Covariances of limbs and joints, from the inverse of the information of the chain's unknowns.

use nalgebra::Matrix6;

use super::ChainSolver;
use crate::body::Body;
use crate::math::{Pose, Vec3, factor, refill};
use crate::terms::normal_equations::{NormalEquations, line};

/// Columns of the half-solved system, one row per unknown.
#[derive(Debug, Default)]
pub(crate) struct Spread {
    rows: Vec<[f64; 6]>,
    /// Unknowns that move the queried limb, last one first.
    moving: Vec<usize>,
}

impl ChainSolver {
    /// Assembles the limbs' information at `poses`, adds `own` to the diagonal, and factors the result for [`Spread`]. Returns
    /// false when it is not positive definite.
    pub(crate) fn factor_information(
        &mut self,
        body: &Body,
        normal: &NormalEquations,
        poses: &[Pose],
        own: &[f64],
    ) -> bool {
        self.assemble(body, normal, poses, 0.0);
        let n = self.chain.freedoms;
        for (index, information) in own.iter().enumerate() {
            self.h[index * n + index] += information;
        }
        factor(&mut self.h, n)
    }

    /// Adds the limbs' information to `known`, a lower triangle over all unknowns, and factors the sum for [`Spread`].
    pub(crate) fn factor_added(
        &mut self,
        body: &Body,
        normal: &NormalEquations,
        poses: &[Pose],
        known: &mut [f64],
    ) -> bool {
        self.assemble(body, normal, poses, 0.0);
        known.iter_mut().zip(&self.h).for_each(|(known, added)| *known += added);
        self.h.copy_from_slice(known);
        factor(&mut self.h, self.chain.freedoms)
    }
}

impl Spread {
    /// Covariance of a limb's pose about the `origin` of its frame: rotation in world axes (radians), then translation (meters).
    pub(crate) fn of_limb(&mut self, solver: &ChainSolver, limb: usize, origin: Vec3) -> Matrix6<f64> {
        self.list(solver, limb);
        for unknown in &self.moving {
            let screw = &solver.screws[*unknown];
            let row = &mut self.rows[*unknown];
            for axis in 0..3 {
                row[axis] = screw[axis];
                row[3 + axis] = line(origin, Vec3::AXES[axis]).dot(screw);
            }
        }
        self.solve_half(solver);
        self.gram()
    }

    /// Covariance of the unknowns of a limb's own joint, in their order; for the root: of its rotation, then of its translation.
    pub(crate) fn of_joint(&mut self, solver: &ChainSolver, limb: usize) -> Matrix6<f64> {
        self.list(solver, limb);
        for unknown in &self.moving {
            self.rows[*unknown] = [0.0; 6];
        }
        for (own, unknown) in solver.chain.unknowns(limb).enumerate() {
            self.rows[unknown][own] = 1.0;
        }
        self.solve_half(solver);
        self.gram()
    }

    /// `Y^T Y` of the solved columns.
    fn gram(&self) -> Matrix6<f64> {
        let mut gram = Matrix6::zeros();
        for unknown in &self.moving {
            let row = &self.rows[*unknown];
            for (j, right) in row.iter().enumerate() {
                for (i, left) in row.iter().enumerate() {
                    gram[(i, j)] += left * right;
                }
            }
        }
        gram
    }

    /// Lists the unknowns that move a limb.
    fn list(&mut self, solver: &ChainSolver, limb: usize) {
        let chain = &solver.chain;
        self.rows.resize(chain.freedoms, [0.0; 6]);
        refill(&mut self.moving, chain.up_from(limb).flat_map(|limb| chain.unknowns(limb).rev()));
    }

    /// Solves `L^T y = b` for six columns; with `H = L^T L`, `b^T H^-1 b = y^T y`. Only unknowns that move the limb take part.
    fn solve_half(&mut self, solver: &ChainSolver) {
        let n = solver.chain.freedoms;
        for (place, unknown) in self.moving.iter().enumerate() {
            let l = &solver.h[unknown * n..unknown * n + unknown + 1];
            let row = self.rows[*unknown].map(|value| value / l[*unknown]);
            self.rows[*unknown] = row;
            for other in &self.moving[place + 1..] {
                let factor = l[*other];
                for (value, known) in self.rows[*other].iter_mut().zip(&row) {
                    *value -= factor * known;
                }
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use nalgebra::{DMatrix, Vector6};

    use super::*;
    use crate::testing::{raised, standing};

    /// A positive definite block that differs from limb to limb.
    fn block(limb: usize) -> Matrix6<f64> {
        let root = Matrix6::from_fn(|i, j| ((limb * 31 + i * 7 + j * 13) % 17) as f64 - 8.0);
        root * root.transpose() * 3.0 + Matrix6::identity()
    }

    #[test]
    fn limbs_and_joints_have_the_covariance_of_the_dense_inverse() {
        let (model, poses) = standing();
        let (poses, _) = raised(&model, &poses, 0.3);
        let body = &model.body;
        let mut normal = NormalEquations::default();
        normal.clear(poses.len());
        for (limb, own) in normal.limbs.iter_mut().enumerate() {
            own.h = block(limb);
        }
        let mut system = ChainSolver::default();
        system.chain.layout(body);
        let n = system.chain.freedoms;
        let own: Vec<f64> = (0..n).map(|index| 1.0 + (index % 5) as f64).collect();
        assert!(system.factor_information(body, &normal, &poses, &own));
        // The dense reference: every limb's twist as a matrix over all unknowns.
        let moves = |limb: usize, unknown: usize| {
            let mut ancestor = limb;
            loop {
                let start = system.chain.start[ancestor];
                if (start..start + system.chain.count[ancestor]).contains(&unknown) {
                    return true;
                }
                if ancestor == 0 {
                    return false;
                }
                ancestor = system.chain.parent[ancestor];
            }
        };
        let twist =
            |limb: usize| DMatrix::from_fn(6, n, |row, k| if moves(limb, k) { system.screws[k][row] } else { 0.0 });
        let mut h = DMatrix::from_fn(n, n, |i, j| if i == j { own[i] + 1e-6 } else { 0.0 });
        for limb in 0..poses.len() {
            let j = twist(limb);
            h += j.transpose() * DMatrix::from_fn(6, 6, |i, j| block(limb)[(i, j)]) * &j;
        }
        let inverse = h.try_inverse().unwrap();
        let mut spread = Spread::default();
        for limb in 0..poses.len() {
            // Moved to the limb frame: its origin moves by `v + omega x origin`.
            let x = poses[limb].translation;
            let at = DMatrix::from_fn(6, 6, |row, column| match row {
                0..3 => f64::from(u8::from(row == column)),
                _ => {
                    let unit = Vector6::ith(column, 1.0);
                    let (omega, v) = (Vec3::new(unit[0], unit[1], unit[2]), Vec3::new(unit[3], unit[4], unit[5]));
                    (v + omega.cross(x))[row - 3]
                }
            }) * twist(limb);
            let dense = &at * &inverse * at.transpose();
            let found = spread.of_limb(&system, limb, x);
            let scale = dense.amax();
            for i in 0..6 {
                for j in 0..6 {
                    assert!((found[(i, j)] - dense[(i, j)]).abs() < 1e-9 * scale, "limb {limb}: {i}, {j}");
                }
            }
            let (start, joint) = (system.chain.start[limb], spread.of_joint(&system, limb));
            for i in 0..system.chain.count[limb] {
                for j in 0..system.chain.count[limb] {
                    let dense = inverse[(start + i, start + j)];
                    assert!((joint[(i, j)] - dense).abs() < 1e-9 * inverse.amax(), "joint {limb}: {i}, {j}");
                }
            }
        }
    }
}
