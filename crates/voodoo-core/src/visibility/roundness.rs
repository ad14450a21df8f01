//! Checks whether the surface that a body was fitted to is round where its limbs are; a cupboard of a person's size is not.
//!
//! Points explained to a few centimeters and limbs observed at their depths hardly rule out a flat object as large as a person.
//! But the surface of a body recedes from the camera between the middle of a limb and its rims; that of a door does not.

use crate::body::Body;
use crate::math::Pose;
use crate::observation::depth_view::DepthViews;
use crate::visibility::ACROSS_LIMB;
use crate::visibility::EXPLAINED;
use crate::visibility::surface::surface_rows;

/// Returns how far the observed surface recedes between the middle of limbs and their rims, relative to the model: approximately
/// one on a body, zero on a plane: the sums of the least-squares factor's numerator and denominator, m^2.
///
/// The factor is between both over all sections where the middle and the rims are observed near the model. The two rims are
/// averaged, so that the direction of a limb relative to the camera has no effect.
pub(crate) fn roundness(views: DepthViews, body: &Body, poses: &[Pose]) -> [f64; 2] {
    let (mut product, mut square) = (0.0, 0.0);
    for view in views.iter() {
        let camera_from_working = view.working_from_camera.inverse();
        for (limb, pose) in body.limbs().iter().zip(poses) {
            let camera_from_limb = camera_from_working * *pose;
            for row in surface_rows(&limb.shape, &camera_from_limb) {
                let depths = row.places(&view, [0.0, ACROSS_LIMB[0], ACROSS_LIMB[4]]).map(|place| {
                    let z = place.depth_within(2.0 * EXPLAINED)?;
                    Some([place.point.z, z])
                });
                if let [Some(middle), Some(left), Some(right)] = depths {
                    let [expected, measured] = [0, 1].map(|kind| 0.5 * (left[kind] + right[kind]) - middle[kind]);
                    product += expected * measured;
                    square += expected * expected;
                }
            }
        }
    }
    [product, square]
}
