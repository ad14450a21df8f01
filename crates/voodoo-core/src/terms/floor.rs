//! Keeps the ends of limbs above the ground plane. The constraint is soft, as between limbs: the given or estimated plane may
//! have a small error.

use super::{LARGEST_COST, OVERLAP_SIGMA, Term};
use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::observation::frame::Ground;
use crate::terms::normal_equations::{NormalEquations, line};

/// One-sided: `r = max(0, -height)` for the distal end of every limb's axis.
#[derive(Debug)]
pub(crate) struct Floor {
    /// The ground plane, in the frame of the poses.
    pub plane: Ground,
}

impl Term for Floor {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        let weight = 1.0 / (OVERLAP_SIGMA * OVERLAP_SIGMA);
        for (index, (limb, pose)) in body.limbs().iter().zip(poses).enumerate() {
            let end = *pose * (Vec3::Z * limb.shape.length());
            let depth = -self.plane.height(end);
            if depth > 0.0 {
                normal.limbs[index].add_row(weight, &-line(end, self.plane.normal), depth);
            }
        }
    }

    fn cost(&self, body: &Body, poses: &[Pose], limb: usize) -> f64 {
        let end = poses[limb] * (Vec3::Z * body.limbs()[limb].shape.length());
        (0.5 * (self.plane.height(end).min(0.0) / OVERLAP_SIGMA).powi(2)).min(LARGEST_COST)
    }
}
