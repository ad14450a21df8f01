//! Cost of the distances of sites from their measured positions.

use crate::association::correspondence::SitePair;
use crate::body::two_bone::TwoBone;
use crate::fit::Matched;
use crate::math::{Pose, Vec3};

/// Distance from a measured or predicted position at which a position counts as different, meters: half the length of a hand.
pub(crate) const APART: f64 = 0.10;

/// Cost of the sites on an arm or leg that are away from their measured positions, in unexplained patches: at most the weight of
/// each site. The sites were matched at `matched.poses` and are evaluated at `poses`.
pub(super) fn extremity_landmark_cost(matched: Matched, chain: &TwoBone, poses: &[Pose]) -> f64 {
    let pairs = matched.correspondences.sites.iter().filter(|pair| chain.limbs().any(|limb| limb == pair.limb));
    pairs
        .map(|pair| landmark_cost(pair, poses[pair.limb] * matched.poses[pair.limb].inverse_transform_point(pair.x)))
        .sum()
}

/// The same cost of all sites of the body, at the poses where they were matched.
pub(crate) fn body_landmark_cost(matched: Matched) -> f64 {
    matched.correspondences.sites.iter().map(|pair| landmark_cost(pair, pair.x)).sum()
}

/// Cost of one site at `x`.
fn landmark_cost(pair: &SitePair, x: Vec3) -> f64 {
    // Where only a ray was measured, `across` projects onto the plane perpendicular to it.
    let apart = (pair.across * (x - pair.p)).length() - pair.bias;
    pair.base_weight * (apart.max(0.0) / APART).powi(2).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::association::correspondence::Correspondences;
    use crate::math::Mat3;
    use crate::testing::{first_arm, moved, standing};

    /// A site at the origin of a limb frame that was measured at offset `off` from it.
    fn truth(poses: &[Pose], limb: usize, off: Vec3) -> SitePair {
        let x = poses[limb].translation;
        let (across, information) = (Mat3::IDENTITY, 2.0 * Mat3::IDENTITY);
        SitePair { limb, x, p: x + off, weight: 2.0, base_weight: 2.0, bias: 0.0, across, information, source: 0 }
    }

    #[test]
    fn a_site_costs_at_most_its_weight_and_only_in_its_own_arm_or_leg() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let cost = |pair: SitePair| {
            let correspondences = Correspondences { sites: vec![pair], ..Correspondences::default() };
            let matched = Matched { correspondences: &correspondences, poses: &poses };
            let costs = model.extremities.iter().map(|chain| extremity_landmark_cost(matched, chain, &poses));
            let own = extremity_landmark_cost(matched, arm, &poses);
            assert_eq!(costs.sum::<f64>(), own, "no cost in other arms and legs");
            assert_eq!(body_landmark_cost(matched), own);
            own
        };
        let right = truth(&poses, arm.lower, Vec3::ZERO);
        assert_eq!(cost(right), 0.0);
        assert!((cost(truth(&poses, arm.lower, 0.5 * APART * Vec3::Y)) - 2.0 * 0.25).abs() < 1e-9);
        assert_eq!(cost(truth(&poses, arm.lower, 3.0 * APART * Vec3::Y)), 2.0, "at most the weight");
        // Distances within the bias and along the ray cost nothing.
        let off = truth(&poses, arm.lower, 0.5 * APART * Vec3::Z);
        assert_eq!(cost(SitePair { bias: APART, ..off }), 0.0);
        assert_eq!(cost(SitePair { across: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.0)), ..off }), 0.0);
    }

    #[test]
    fn a_site_is_evaluated_at_the_other_poses() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let shift = 0.5 * APART * Vec3::X;
        let correspondences =
            Correspondences { sites: vec![truth(&poses, arm.upper, shift)], ..Correspondences::default() };
        let matched = Matched { correspondences: &correspondences, poses: &poses };
        assert!(extremity_landmark_cost(matched, arm, &moved(&poses, shift)) < 1e-12);
        assert!((extremity_landmark_cost(matched, arm, &moved(&poses, -shift)) - 2.0).abs() < 1e-9);
    }
}
