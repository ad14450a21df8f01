//! The depth contour of the body: pulls a limb's rim towards the edges observed in depth images, outward or inward.

use super::{Term, surface::geman_mcclure};
use crate::association::correspondence::ContourPair;
use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::{NormalEquations, line};

/// Distances of edges along their direction, under the Geman-McClure kernel.
#[derive(Debug)]
pub(crate) struct Contour<'a> {
    /// The pairs.
    pub pairs: &'a [ContourPair],
    /// Information of an edge, 1/m^2.
    pub information: f64,
    /// Scale of the kernel, meters.
    pub scale: f64,
}

impl Term for Contour<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for pair in self.pairs {
            let information = self.information * pair.weight * geman_mcclure(pair.distance, self.scale);
            let row = line(pair.x, pair.normal);
            normal.limbs[pair.limb].add_row(information, &row, -pair.distance);
        }
    }
}
