//! Estimates changes of limb lengths: extends the chain's normal equations by one unknown for every pair of limbs.

use nalgebra::Vector6;

use super::ChainSolver;
use crate::body::{Body, Pair};
use crate::math::{Pose, Vec3, dot, factor, half_substitute, reset, solve_in_place, vectorized};

/// Information that damps the relative change of a length in one frame.
const LENGTH_DAMPING: f64 = 1e4;

impl ChainSolver {
    /// Writes the relative change of length of each pair to `change`: the Gauss-Newton step of the lengths after elimination of
    /// the pose unknowns (Schur complement), damped, and pulled towards the initial value of `change` by `pull`.
    pub(crate) fn lengths(
        &mut self,
        body: &Body,
        poses: &[Pose],
        pairs: &[Pair],
        pull: &[f64],
        change: &mut [f64],
    ) -> bool {
        self.assemble(body, poses, 0.0);
        self.couple(body, poses, pairs);
        if !factor(&mut self.h, self.chain.freedoms()) {
            return false;
        }
        let count = pairs.len();
        self.eliminate(count);
        for row in 0..count {
            self.reduced[row * count + row] += LENGTH_DAMPING + pull[row];
            change[row] = pull[row] * change[row] - self.gradient[row];
        }
        solve_in_place(&mut self.reduced, change, count)
    }

    /// Returns the information of the relative length of each of `pairs` on its own, with the pose unknowns eliminated. Uses the
    /// factorization of [`Self::factor`].
    pub(crate) fn length_information(
        &mut self,
        body: &Body,
        poses: &[Pose],
        pairs: &[Pair],
    ) -> impl Iterator<Item = f64> {
        let count = pairs.len();
        self.couple(body, poses, pairs);
        self.eliminate(count);
        // A NaN leaves no information.
        (0..count).map(move |row| self.reduced[row * count + row].max(0.0))
    }

    /// Computes second derivatives and gradient of the lengths, and the mixed derivatives with the pose unknowns.
    fn couple(&mut self, body: &Body, poses: &[Pose], pairs: &[Pair]) {
        let Self { chain, screws, composite, mixed, reduced, gradient, .. } = self;
        let (n, count) = (chain.freedoms(), pairs.len());
        reset(mixed, count * n, 0.0);
        reset(reduced, count * count, 0.0);
        reset(gradient, count, 0.0);
        let group = |limb: usize| pairs.iter().position(|pair| pair.contains(&limb));
        for limb in 1..composite.len() {
            let Some(row) = group(chain.parent[limb]) else { continue };
            let slider = slide(body, poses, limb);
            let force = composite[limb].0 * slider;
            gradient[row] += slider.dot(&composite[limb].1);
            for ancestor in chain.up_from(limb) {
                for unknown in chain.unknowns(ancestor) {
                    mixed[row * n + unknown] += force.dot(&screws[unknown]);
                }
                if ancestor > 0
                    && let Some(column) = group(chain.parent[ancestor])
                {
                    let value = force.dot(&slide(body, poses, ancestor));
                    reduced[row * count + column] += value;
                    if ancestor != limb {
                        reduced[column * count + row] += value;
                    }
                }
            }
            let is_below = |below: &usize| chain.up_from(*below).any(|ancestor| ancestor == limb);
            for below in (limb + 1..composite.len()).filter(is_below) {
                let force = composite[below].0 * slider;
                for unknown in chain.unknowns(below) {
                    mixed[row * n + unknown] += force.dot(&screws[unknown]);
                }
            }
        }
    }

    /// Eliminates the pose unknowns, whose matrix was factored.
    fn eliminate(&mut self, count: usize) {
        // `step` holds the negative gradient of the pose unknowns.
        let Self { chain, h, step, mixed, reduced, gradient, .. } = self;
        let n = chain.freedoms();
        // With `H = L^T L`, `b^T H^-1 c` is the dot product of the two vectors after half of the substitution.
        vectorized!(half_substitute(h, step, n));
        for row in 0..count {
            vectorized!(half_substitute(h, &mut mixed[row * n..(row + 1) * n], n));
            let own = &mixed[row * n..(row + 1) * n];
            for other in 0..=row {
                let taken = dot(own, &mixed[other * n..(other + 1) * n]);
                reduced[row * count + other] -= taken;
            }
            gradient[row] += dot(own, step);
        }
    }
}

/// Twist of a limb when its parent lengthens: a translation along the parent's axis, as of a sliding joint.
fn slide(body: &Body, poses: &[Pose], limb: usize) -> Vector6<f64> {
    let Some((parent, joint)) = &body.limbs()[limb].parent else { return Vector6::zeros() };
    let own = body.limbs()[*parent].parent.as_ref().map_or(0.0, |(_, joint)| joint.limb_from_joint.translation.z);
    let v = poses[*parent].rotation * Vec3::Z * (joint.parent_from_joint.translation.z - own);
    Vector6::new(0.0, 0.0, 0.0, v.x, v.y, v.z)
}
