//! Color regions in the loop of a frame: edges along color contours, learning of colors, and what only one limb explains.

use super::{Context, Fit};
use crate::math::Pose;

impl Fit {
    /// Searches for every color edge separately on both sides of a limb: the pairs determine its width.
    pub(crate) fn match_single_edges(&mut self, context: Context, poses: &[Pose]) {
        let (frame, posed) = (context.observation.frame(), context.posed(poses));
        self.regions.find_single_edges(frame, posed, &mut self.correspondences.regions);
    }

    pub(super) fn find_regions(&mut self, context: Context, poses: &[Pose], step: usize) {
        let Self { regions, correspondences, .. } = self;
        correspondences.regions.clear();
        correspondences.region_support.clear();
        let frame = context.observation.frame();
        if !frame.colors.is_empty() {
            regions.find(frame, context.posed(poses), step, |limb| context.uses_edges(limb), correspondences);
        }
    }

    /// Measures what every limb of the arms and legs explains where colors compare poses.
    pub(super) fn measure_pixel_gains(&mut self, context: Context, poses: &[Pose]) {
        if context.compares_colors() {
            let (frame, chains) = (context.observation.frame(), &context.model.extremities);
            let supports = &mut self.correspondences.region_support;
            self.regions.pixel_gains(frame, context.posed(poses), chains, supports);
        }
    }
}
