//! Edges of color regions (R07 section 3): each is a distance along one direction, with the information of its colors.

use super::{PATCH, Term};
use crate::association::correspondence::RegionPair;
use crate::body::Body;
use crate::math::Pose;
use crate::regions::{ColorRegions, Posed};
use crate::terms::normal_equations::{NormalEquations, line};

/// All edges.
#[derive(Debug)]
pub(crate) struct Regions<'a> {
    /// The edges.
    pub pairs: &'a [RegionPair],
    /// The images, where they compare poses.
    pub colors: Option<Colors<'a>>,
}

/// The color images of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Colors<'a> {
    /// What is known of the colors, and the limbs drawn last: the whole body, or those that are not compared.
    pub regions: &'a ColorRegions,
    /// The frame, and the body as it was matched to it.
    pub posed: Posed<'a>,
}

impl Term for Regions<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for pair in self.pairs {
            let row = line(pair.x, pair.normal);
            normal.limbs[pair.limb].add_row(pair.information, &row, -pair.distance);
        }
    }

    fn cost(&self, body: &Body, poses: &[Pose], limb: usize) -> f64 {
        let Some(Colors { regions, posed }) = self.colors else { return 0.0 };
        let [gained, _] = regions.pixel_gain(Posed { body, poses, ..posed }, limb);
        -PATCH * gained
    }
}
