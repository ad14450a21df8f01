//! Free space: a limb's surface does not lie where a camera observes something behind it.

use super::PATCH;
use crate::body::Limb;
use crate::math::Pose;
use crate::observation::depth_view::DepthViews;
use crate::visibility::evidence::limb_visibility;

/// Cost of a patch that violates free space, in unexplained patches.
const VIOLATION: f64 = 0.6;

/// Cost of the patches of a limb's surface that violate free space, nats. They move no limb: [`super::Contour`] moves it to the edge of
/// what is observed.
pub(crate) fn free_space_cost(views: DepthViews, limb: &Limb, pose: &Pose) -> f64 {
    VIOLATION * PATCH * limb_visibility(views, limb, pose).free_space
}
