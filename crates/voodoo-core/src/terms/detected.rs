//! Joints that a detector found in the frame.

use super::sites::APART;
use super::{PATCH, Term};
use crate::association::correspondence::DetectedPair;
use crate::body::{Body, Site};
use crate::math::{Mat3, Pose};
use crate::terms::normal_equations::NormalEquations;

/// Scale of the kernel, in standard deviations: five in space. A joint that is sure and far off is wrong.
const FAR_SIGMAS: f64 = 8.66;
/// Greatest cost of a joint, unexplained patches; and the distance that costs nothing, in standard deviations along an axis: the
/// length of a deviation in space.
const ELSEWHERE_COST: f64 = 25.0;
const WITHIN_SIGMAS: f64 = 1.7;

/// All detected joints.
#[derive(Debug)]
pub(crate) struct DetectedJoints<'a> {
    /// The pairs.
    pub pairs: &'a [DetectedPair],
}

impl Term for DetectedJoints<'_> {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        for DetectedPair { site, p, sigma, information } in self.pairs {
            let Site { limb, position, .. } = body.sites()[*site];
            let x = poses[limb] * position;
            let r = x - *p;
            let far = r.length_squared() / (FAR_SIGMAS * FAR_SIGMAS * sigma * sigma);
            let information = information / ((1.0 + far) * (1.0 + far));
            normal.limbs[limb].add_point(&(Mat3::IDENTITY * information), x, r);
        }
    }

    fn cost(&self, body: &Body, poses: &[Pose], limb: usize) -> f64 {
        let cost = |pair: &DetectedPair| {
            let off = (poses[limb] * body.sites()[pair.site].position).distance(pair.p) - WITHIN_SIGMAS * pair.sigma;
            PATCH * ELSEWHERE_COST * (off.max(0.0) / APART).powi(2).min(1.0)
        };
        self.pairs.iter().filter(|pair| body.sites()[pair.site].limb == limb).map(cost).sum()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::testing::{moved, standing};

    #[test]
    fn a_joint_costs_nothing_within_its_deviation_and_a_limited_amount_far_off() {
        let (model, poses) = standing();
        let cost = |off: f64| {
            let Site { limb, position, .. } = model.body.sites()[3];
            let pair = DetectedPair { site: 3, p: poses[limb] * position, sigma: 0.05, information: 1.0 };
            let shifted = moved(&poses, off * Vec3::Y);
            (0..poses.len())
                .map(|limb| DetectedJoints { pairs: &[pair] }.cost(&model.body, &shifted, limb))
                .sum::<f64>()
        };
        assert_eq!(cost(WITHIN_SIGMAS * 0.05), 0.0);
        assert!((cost(WITHIN_SIGMAS * 0.05 + 0.05) - 0.25 * 3.0).abs() < 1e-9 && (cost(1.0) - 3.0).abs() < 1e-9);
    }
}
