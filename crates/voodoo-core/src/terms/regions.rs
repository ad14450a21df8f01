//! Edges of color regions (R07 section 3): each is a distance along one direction, with the information of its colors.

use super::Term;
use crate::association::correspondence::RegionPair;
use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::{NormalEquations, line};

/// All edges.
#[derive(Debug)]
pub(crate) struct Regions<'a> {
    /// The edges.
    pub pairs: &'a [RegionPair],
}

impl Term for Regions<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for pair in self.pairs {
            let row = line(pair.x, pair.normal);
            normal.limbs[pair.limb].add_row(pair.information, &row, -pair.distance);
        }
    }
}
