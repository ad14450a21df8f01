//! Edges of color regions (R07 section 3): each is a distance along one direction, with the information of its colors.

use super::{PATCH, Term};
use crate::association::correspondence::RegionPair;
use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::observation::frame::Frame;
use crate::regions::{Backdrop, ColorRegions, PixelGain, Posed};
use crate::terms::normal_equations::{NormalEquations, line};

/// All edges.
#[derive(Debug)]
pub(crate) struct Regions<'a> {
    /// The edges.
    pub pairs: &'a [RegionPair],
    /// The images, where they compare poses.
    pub colors: Option<Colors<'a>>,
}

/// The color images of a frame, and the limbs drawn in them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Colors<'a> {
    /// What is known of the colors.
    pub regions: &'a ColorRegions,
    /// The frame.
    pub frame: &'a Frame<'a>,
    /// The poses of the previous frame, working frame.
    pub previous: &'a [Pose],
    /// The working frame's origin in the world.
    pub origin: Vec3,
    /// Label images: of the whole body, or of the limbs that are not compared.
    pub backdrop: &'a Backdrop,
}

impl Colors<'_> {
    /// What a limb explains of the images.
    pub(crate) fn pixel_gain(&self, body: &Body, poses: &[Pose], limb: usize) -> PixelGain {
        let Self { regions, frame, previous, origin, backdrop } = *self;
        regions.pixel_gain(frame, Posed { body, poses, previous, origin }, limb, backdrop)
    }
}

impl Term for Regions<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for pair in self.pairs {
            let row = line(pair.x, pair.normal);
            normal.limbs[pair.limb].add_row(pair.information, &row, -pair.distance);
        }
    }

    fn cost(&self, body: &Body, poses: &[Pose], limb: usize) -> f64 {
        -PATCH * self.colors.map_or(0.0, |colors| colors.pixel_gain(body, poses, limb).gained)
    }
}
