//! What named sites say about a configuration of an arm or leg.

use crate::association::correspondence::SitePair;
use crate::body::two_bone::TwoBone;
use crate::fit::Matched;
use crate::math::{Pose, Vec3};

/// A site this far from its measurement contradicts it wholly, metres: about a hand's length.
const APART: f64 = 0.10;

/// Cost of the sites on an arm or leg that are not where they were seen, in unexplained patches: one for each unit of weight.
/// The sites were matched at `matched.poses`, and are looked at where `poses` would put them.
pub fn extremity_landmark_cost(matched: Matched, chain: &TwoBone, poses: &[Pose]) -> f64 {
    let pairs = matched.correspondences.sites.iter().filter(|pair| chain.limbs().any(|limb| limb == pair.limb));
    pairs
        .map(|pair| landmark_cost(pair, poses[pair.limb] * matched.poses[pair.limb].inverse_transform_point(pair.x)))
        .sum()
}

/// The same of all sites, where they were matched.
pub fn body_landmark_cost(matched: Matched) -> f64 {
    matched.correspondences.sites.iter().map(|pair| landmark_cost(pair, pair.x)).sum()
}

/// Cost of one site at `x`.
fn landmark_cost(pair: &SitePair, x: Vec3) -> f64 {
    // Across a ray alone, where only a ray is known.
    let apart = (pair.across * (x - pair.p)).length() - pair.bias;
    pair.base_weight * (apart.max(0.0) / APART).powi(2).min(1.0)
}
