//! What named sites say about a configuration of an arm or leg.

use crate::association::correspondence::SitePair;
use crate::body::two_bone::TwoBone;
use crate::math::{Pose, Vec3};
use crate::tracker::Tracker;

/// A site this far from its measurement contradicts it wholly, metres.
const APART: f64 = 0.10;

impl Tracker {
    /// Cost of the sites on a chain that are not where they were seen, in unexplained patches: one for each unit of weight.
    pub(crate) fn sites_missed(&self, chain: &TwoBone, poses: &[Pose]) -> f64 {
        let pairs = self.correspondences.sites.iter().filter(|pair| chain.limbs().any(|limb| limb == pair.limb));
        pairs.map(|pair| missed(pair, poses[pair.limb] * self.poses[pair.limb].inverse_transform_point(pair.x))).sum()
    }

    /// The same of all sites, where the body is.
    pub(crate) fn all_sites_missed(&self) -> f64 {
        self.correspondences.sites.iter().map(|pair| missed(pair, pair.x)).sum()
    }
}

/// Cost of one site at `x`.
fn missed(pair: &SitePair, x: Vec3) -> f64 {
    // Across a ray alone, where only a ray is known.
    let apart = (pair.across * (x - pair.p)).length() - pair.bias;
    pair.base_weight * (apart.max(0.0) / APART).powi(2).min(1.0)
}
