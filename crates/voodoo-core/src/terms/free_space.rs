//! Free space: a limb's surface does not lie where a camera observes something behind it.

use super::{PATCH, Term};
use crate::body::Body;
use crate::math::Pose;
use crate::observation::depth_view::DepthViews;
use crate::visibility::evidence::limb_visibility;

/// Cost of a patch that violates free space, in unexplained patches.
const VIOLATION: f64 = 0.6;

/// Patches of the surface that violate free space. It moves none: [`super::Contour`] moves a limb to the edge of what is observed.
#[derive(Debug)]
pub(crate) struct FreeSpace<'a> {
    /// The depth images.
    pub views: DepthViews<'a>,
}

impl Term for FreeSpace<'_> {
    fn cost(&self, body: &Body, poses: &[Pose], limb: usize) -> f64 {
        VIOLATION * PATCH * limb_visibility(self.views, &body.limbs()[limb], &poses[limb]).free_space
    }
}
