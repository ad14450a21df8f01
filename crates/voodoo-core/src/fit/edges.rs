//! Color regions in the loop of a frame: edges along color contours, learning of colors, and what only one limb explains.

use super::{Context, Fit};
use crate::math::Pose;

impl Fit {
    /// Learns the colors in new cameras at the predicted pose.
    pub(crate) fn begin_regions(&mut self, context: Context, poses: &[Pose]) {
        if context.config.regions {
            self.regions.begin(context.observation.frame(), context.posed(poses));
        }
    }

    /// Searches for every color edge separately on both sides of a limb: the pairs determine its width.
    pub(crate) fn match_single_edges(&mut self, context: Context, poses: &[Pose]) {
        let Self { regions, correspondences, .. } = self;
        correspondences.regions.clear();
        if context.config.regions {
            let (frame, posed) = (context.observation.frame(), context.posed(poses));
            regions.find_single_edges(frame, posed, &mut correspondences.regions);
        }
    }

    /// Learns colors at the fitted pose.
    pub(crate) fn learn_regions(&mut self, context: Context) {
        if context.config.regions {
            self.regions.learn(context.observation.frame());
        }
    }

    pub(super) fn find_regions(&mut self, context: Context, poses: &[Pose], step: usize) {
        let Self { regions, correspondences, .. } = self;
        correspondences.regions.clear();
        correspondences.region_support.clear();
        let frame = context.observation.frame();
        if context.config.regions && !frame.colors.is_empty() {
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
