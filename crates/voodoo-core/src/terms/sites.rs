//! Named sites with positions and rays (method section 1): `(x - p)^T W (x - p)` under a robust kernel.

use super::{Term, surface::geman_mcclure};
use crate::association::correspondence::Correspondences;
use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::NormalEquations;

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
            let (rho, kernel) = geman_mcclure(r.length(), self.scale);
            normal.cost += pair.weight * self.information * rho;
            normal.limbs[pair.limb].add_point(&(pair.information * (self.information * kernel)), pair.x, r);
        }
    }
}
