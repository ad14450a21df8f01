//! Covariances of limbs and joints, from the inverse of the information of the chain's unknowns.

use nalgebra::{Matrix6, Vector6};

use super::ChainSolver;
use crate::body::Body;
use crate::math::{Pose, Vec3, factor, refill};
use crate::terms::normal_equations::line;

impl ChainSolver {
    /// Assembles the limbs' information at `poses`, lets `add` change its lower triangle over all unknowns, and factors the result,
    /// from which covariances follow. Returns false when it is not positive definite.
    pub(crate) fn factor(&mut self, body: &Body, poses: &[Pose], add: impl FnOnce(&mut [f64])) -> bool {
        self.assemble(body, poses, 0.0);
        add(&mut self.h);
        factor(&mut self.h, self.chain.freedoms())
    }

    /// Covariance of a limb's pose about the `origin` of its frame: rotation in world axes (radians), then translation (meters).
    pub(crate) fn of_limb(&mut self, limb: usize, origin: Vec3) -> Matrix6<f64> {
        self.covariance(limb, |_, screw| {
            let moves = Vec3::AXES.map(|axis| line(origin, axis).dot(screw));
            [screw[0], screw[1], screw[2], moves[0], moves[1], moves[2]]
        })
    }

    /// Covariance of the unknowns of a limb's own joint, in their order; for the root: of its rotation, then of its translation.
    pub(crate) fn of_joint(&mut self, limb: usize) -> Matrix6<f64> {
        let own = self.chain.unknowns(limb);
        self.covariance(limb, |unknown, _| {
            let number = unknown.checked_sub(own.start);
            std::array::from_fn(|index| if number == Some(index) { 1.0 } else { 0.0 })
        })
    }

    /// Covariance of six sums of the unknowns that move a limb. `derivatives` returns those of all six with respect to an unknown,
    /// of which the twist is given.
    fn covariance(&mut self, limb: usize, derivatives: impl Fn(usize, &Vector6<f64>) -> [f64; 6]) -> Matrix6<f64> {
        let Self { chain, screws, h, rows, moving, .. } = self;
        let n = chain.freedoms();
        rows.resize(n, [0.0; 6]);
        refill(moving, chain.up_from(limb).flat_map(|limb| chain.unknowns(limb).rev()));
        for unknown in &*moving {
            rows[*unknown] = derivatives(*unknown, &screws[*unknown]);
        }
        // Solves `L^T y = b` for the six columns; with `H = L^T L`, `b^T H^-1 b = y^T y`.
        let mut covariance = Matrix6::zeros();
        for (place, unknown) in moving.iter().enumerate() {
            let l = &h[unknown * n..unknown * n + unknown + 1];
            let row = rows[*unknown].map(|value| value / l[*unknown]);
            for other in &moving[place + 1..] {
                let factor = l[*other];
                for (value, known) in rows[*other].iter_mut().zip(&row) {
                    *value -= factor * known;
                }
            }
            for (j, right) in row.iter().enumerate() {
                for (i, left) in row.iter().enumerate() {
                    covariance[(i, j)] += left * right;
                }
            }
        }
        covariance
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use nalgebra::DMatrix;

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
        let mut spread = ChainSolver::default();
        spread.normal.clear(poses.len());
        for (limb, own) in spread.normal.limbs.iter_mut().enumerate() {
            own.h = block(limb);
        }
        spread.chain.layout(body);
        let n = spread.chain.freedoms();
        let own: Vec<f64> = (0..n).map(|index| 1.0 + (index % 5) as f64).collect();
        let add = |h: &mut [f64]| h.iter_mut().step_by(n + 1).zip(&own).for_each(|(value, own)| *value += own);
        assert!(spread.factor(body, &poses, add));
        let ChainSolver { chain, screws, .. } = &spread;
        // The dense reference: every limb's twist as a matrix over all unknowns.
        let moves = |limb: usize, unknown: usize| {
            let mut ancestor = limb;
            loop {
                if chain.unknowns(ancestor).contains(&unknown) {
                    return true;
                }
                if ancestor == 0 {
                    return false;
                }
                ancestor = chain.parent[ancestor];
            }
        };
        let twist = |limb: usize| DMatrix::from_fn(6, n, |row, k| if moves(limb, k) { screws[k][row] } else { 0.0 });
        let mut h = DMatrix::from_fn(n, n, |i, j| if i == j { own[i] + 1e-6 } else { 0.0 });
        for limb in 0..poses.len() {
            let j = twist(limb);
            h += j.transpose() * DMatrix::from_fn(6, 6, |i, j| block(limb)[(i, j)]) * &j;
        }
        let inverse = h.try_inverse().unwrap();
        let twists: Vec<DMatrix<f64>> = (0..poses.len()).map(twist).collect();
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
            }) * &twists[limb];
            let dense = &at * &inverse * at.transpose();
            let found = spread.of_limb(limb, x);
            let scale = dense.amax();
            for i in 0..6 {
                for j in 0..6 {
                    assert!((found[(i, j)] - dense[(i, j)]).abs() < 1e-9 * scale, "limb {limb}: {i}, {j}");
                }
            }
            let (joint, own) = (spread.of_joint(limb), spread.chain.unknowns(limb));
            for i in 0..own.len() {
                for j in 0..own.len() {
                    let dense = inverse[(own.start + i, own.start + j)];
                    assert!((joint[(i, j)] - dense).abs() < 1e-9 * inverse.amax(), "joint {limb}: {i}, {j}");
                }
            }
        }
    }
}
