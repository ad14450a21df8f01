//! Whether what a body was put on is round where its limbs are: a cupboard of a person's size is not.
//!
//! Points explained to a few centimetres and limbs seen where they are say little against a flat thing as large as a person. But
//! from the middle of a limb towards its rims the surface of a body falls away from the camera, that of a door does not.

use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::observation::depth_view::{DepthViews, Pixel};

/// Places along a limb, and how far across it, in shares of its radius, the rims are looked at.
const ALONG: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
const RIM: f64 = 0.7;
/// What is seen farther than this from the model's surface is something else, metres.
const NEAR: f64 = 0.08;
/// Fewer places say nothing.
const LEAST: usize = 20;

/// By how much the seen surface falls away from the cameras between the middle of limbs and their rims, in units of what the
/// model's does: about one on a body, zero on a plane; `None` when the images show too little of it.
///
/// The least-squares factor between both over all places where middle and rims are seen near the model. Half the sum of the
/// two rims is taken, so that a limb that points towards the camera, or is seen aslant, falls away no more than another.
pub fn roundness(views: DepthViews, body: &Body, poses: &[Pose]) -> Option<f64> {
    let (mut product, mut square, mut count) = (0.0, 0.0, 0);
    for view in views.iter() {
        let camera_from_working = view.working_from_camera.inverse();
        for (limb, pose) in body.limbs().iter().zip(poses) {
            let shape = &limb.shape;
            let camera_from_limb = camera_from_working * *pose;
            for t in ALONG {
                let (a, b) = (shape.a0() + t * (shape.a1() - shape.a0()), shape.b0() + t * (shape.b1() - shape.b0()));
                let axis = Vec3::new(0.0, 0.0, t * shape.length());
                let sight = camera_from_limb.inverse_transform_vector(-(camera_from_limb * axis));
                let Some(ahead) = sight.with_z(0.0).try_normalize() else { continue };
                let side = Vec3::new(-ahead.y, ahead.x, 0.0);
                let depths = |across: f64| {
                    let place = ahead * (1.0 - across * across).sqrt() + side * across;
                    let point = camera_from_limb * (axis + Vec3::new(a * place.x, b * place.y, 0.0));
                    match view.at(point) {
                        Pixel::Foreground(z) if (z - point.z).abs() < NEAR => Some([point.z, z]),
                        _ => None,
                    }
                };
                if let (Some(middle), Some(left), Some(right)) = (depths(0.0), depths(-RIM), depths(RIM)) {
                    let [expected, seen] = [0, 1].map(|kind| 0.5 * (left[kind] + right[kind]) - middle[kind]);
                    product += expected * seen;
                    square += expected * expected;
                    count += 1;
                }
            }
        }
    }
    (count >= LEAST && square > 0.0).then(|| product / square)
}
