//! Edges in images: those of the body's contour in depth images pull a limb's rim towards them, outward or inward; those of color
//! regions (R07 section 3) have the information of their colors.

use super::{Term, surface::geman_mcclure};
use crate::association::correspondence::EdgePair;
use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::{NormalEquations, line};

/// Distances of edges along their direction, under the Geman-McClure kernel.
#[derive(Debug)]
pub(crate) struct Edges<'a> {
    /// The pairs.
    pub pairs: &'a [EdgePair],
    /// Scale of the kernel, meters; infinite for none.
    pub scale: f64,
}

impl Term for Edges<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for pair in self.pairs {
            let information = pair.information * geman_mcclure(pair.distance, self.scale);
            let row = line(pair.x, pair.normal);
            normal.limbs[pair.limb].add_row(information, &row, -pair.distance);
        }
    }
}
