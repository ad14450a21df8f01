//! Colour regions in the loop of a frame: edges along contours, what is learnt, and what only one limb explains.

use super::{Context, Fit};
use crate::math::Pose;
use crate::regions::{Posed, Regions, steps};

impl Fit {
    /// Colours of limbs and surroundings.
    pub(crate) fn regions(&self) -> &Regions {
        &self.regions
    }

    /// The same, to change.
    pub(crate) fn regions_mut(&mut self) -> &mut Regions {
        &mut self.regions
    }

    /// Learns the colours of new cameras where the body is expected.
    pub(crate) fn begin_regions(&mut self, context: Context, poses: &[Pose]) {
        if context.config.regions {
            self.regions.begin(context.seen.frame(), posed(context, poses));
        }
    }

    /// Looks for every edge of colours by itself, both sides of a limb apart: pairs that tell how wide it is.
    pub(crate) fn match_outline(&mut self, context: Context, poses: &[Pose]) {
        let Self { regions, correspondences, .. } = self;
        correspondences.regions.clear();
        if context.config.regions {
            let (frame, posed) = (context.seen.frame(), posed(context, poses));
            regions.find_outline(frame, posed, &mut correspondences.regions);
        }
    }

    /// Learns colours where the body was found.
    pub(crate) fn learn_regions(&mut self, context: Context) {
        if context.config.regions {
            self.regions.learn(context.seen.frame());
        }
    }

    pub(super) fn find_regions(&mut self, context: Context, poses: &[Pose], step: usize) {
        let left = steps(self.far).saturating_sub(step + 1);
        let Self { regions, correspondences, .. } = self;
        correspondences.regions.clear();
        correspondences.region_support.clear();
        let frame = context.seen.frame();
        if context.config.regions && !frame.colors.is_empty() {
            regions.find(frame, posed(context, poses), left, |limb| context.wants_edges(limb), correspondences);
        }
    }

    /// What every limb of the arms and legs explains of pictures that are all there is.
    pub(super) fn claim_regions(&mut self, context: Context, poses: &[Pose]) {
        if context.pictures_alone() {
            let Self { regions, correspondences, .. } = self;
            let chains = &context.model.extremities;
            regions.claim_all(context.seen.frame(), posed(context, poses), chains, &mut correspondences.region_support);
        }
    }
}

fn posed<'a>(context: Context<'a>, poses: &'a [Pose]) -> Posed<'a> {
    Posed { body: &context.model.body, poses, previous: context.previous, origin: context.seen.origin() }
}
