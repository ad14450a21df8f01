//! Color regions in the loop of a frame: edges along color contours, learning of colors, and what only one limb explains.

use super::{Context, Fit};
use crate::math::Pose;

impl Fit {
    /// Searches for every color edge separately on both sides of a limb: the pairs determine its width.
    pub(crate) fn match_single_edges(&mut self, context: Context, poses: &[Pose]) {
        self.regions.find_single_edges(context.posed(poses), &mut self.correspondences.regions);
    }

    pub(super) fn find_regions(&mut self, context: Context, poses: &[Pose], step: usize) {
        let Self { regions, correspondences, .. } = self;
        correspondences.regions.clear();
        correspondences.region_support.clear();
        if !context.observation.frame().colors.is_empty() {
            regions.find(context.posed(poses), step, |limb| context.uses_edges(limb), correspondences);
        }
    }

    /// Measures what every limb of the arms and legs explains where colors compare poses.
    pub(super) fn measure_pixel_gains(&mut self, context: Context, poses: &[Pose]) {
        if context.compares_colors() {
            let supports = &mut self.correspondences.region_support;
            self.regions.pixel_gains(context.posed(poses), &context.model.extremities, supports);
        }
    }
}
