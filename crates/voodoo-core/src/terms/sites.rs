//! Named sites with positions and rays (method section 1): `(x - p)^T W (x - p)` under a robust kernel.

use super::{PATCH, Term, surface::geman_mcclure};
use crate::association::correspondence::{Correspondences, SitePair};
use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::NormalEquations;

/// Distance from a measured or predicted position at which a position counts as different, meters: half the length of a hand.
pub(crate) const APART: f64 = 0.10;

/// All site pairs; `scale` is the kernel's, meters.
#[derive(Debug)]
pub(crate) struct Sites<'a> {
    /// The pairs.
    pub correspondences: &'a Correspondences,
    /// Information of a pair of weight one, 1/m^2.
    pub information: f64,
    /// Scale of the kernel, meters.
    pub scale: f64,
    /// Whether to include sites with a bias: a site with a constant error can move a limb, but cannot measure its length.
    pub biased: bool,
}

impl Term for Sites<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for pair in self.correspondences.sites.iter().filter(|pair| self.biased || pair.bias <= 0.0) {
            let r = pair.x - pair.p;
            let kernel = geman_mcclure(r.length(), self.scale);
            normal.limbs[pair.limb].add_point(&(pair.across * pair.weight * (self.information * kernel)), pair.x, r);
        }
    }

    /// A site away from its measurement costs as much as unexplained patches of its weight.
    fn cost(&self, _body: &Body, poses: &[Pose], limb: usize) -> f64 {
        let apart = |pair: &SitePair| {
            // Where only a ray was measured, `across` projects onto the plane perpendicular to it.
            let off = (pair.across * (poses[limb] * pair.local - pair.p)).length() - pair.bias;
            PATCH * pair.base_weight * (off.max(0.0) / APART).powi(2).min(1.0)
        };
        self.correspondences.sites.iter().filter(|pair| pair.limb == limb).map(apart).sum()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::math::{Mat3, Vec3};
    use crate::testing::{first_arm, moved, standing};

    #[test]
    fn a_site_costs_at_most_its_weight_in_patches_at_the_poses_that_are_asked_for() {
        let (model, poses) = standing();
        let limb = model.extremities[first_arm(&model)].lower;
        // The origin of the limb's frame, measured at an offset.
        let pair = |off: Vec3| {
            let x = poses[limb].translation;
            let (local, p, across) = (Vec3::ZERO, x + off, Mat3::IDENTITY);
            SitePair { limb, local, x, p, weight: 2.0, base_weight: 2.0, bias: 0.0, across, source: 0 }
        };
        let cost_at = |pair: SitePair, poses: &[Pose]| {
            let correspondences = Correspondences { sites: vec![pair], ..Correspondences::default() };
            let sites = Sites { correspondences: &correspondences, information: 1.0, scale: 1.0, biased: true };
            let all: Vec<f64> = (0..poses.len()).map(|limb| sites.cost(&model.body, poses, limb)).collect();
            assert_eq!(all.iter().sum::<f64>(), all[limb], "no cost of other limbs");
            all[limb] / PATCH
        };
        let cost = |pair: SitePair| cost_at(pair, &poses);
        assert!(cost(pair(Vec3::ZERO)) == 0.0 && (cost(pair(3.0 * APART * Vec3::Y)) - 2.0).abs() < 1e-12);
        assert!((cost(pair(0.5 * APART * Vec3::Y)) - 2.0 * 0.25).abs() < 1e-9);
        // Distances within the bias and along the ray cost nothing.
        let off = pair(0.5 * APART * Vec3::Z);
        assert_eq!(cost(SitePair { bias: APART, ..off }), 0.0);
        assert_eq!(cost(SitePair { across: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.0)), ..off }), 0.0);
        let shift = 0.5 * APART * Vec3::X;
        assert!(cost_at(pair(shift), &moved(&poses, shift)) < 1e-12);
        assert!((cost_at(pair(shift), &moved(&poses, -shift)) - 2.0).abs() < 1e-9);
    }
}
