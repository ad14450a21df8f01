//! Measures which parts of an arm or leg the cameras observe and only that limb explains, and whether the surface that a body was
//! fitted to is round where its limbs are.
//!
//! An arm placed on the trunk fits the trunk's points, and every camera observes some surface there, so neither confirms its
//! pose. A point on its surface does if no other part of the posed body occludes it, the camera observes a surface there, and the
//! body would leave that surface unexplained without this arm. Limbs of the same arm or leg do not compete with each other: they
//! overlap at their joint.
//!
//! Points explained to a few centimeters and limbs observed at their depths hardly rule out a flat object as large as a person, such
//! as a cupboard. But the surface of a body recedes from the camera between the middle of a limb and its rims; that of a door does
//! not.

use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::math::{Pose, Vec3, refill, reset};
use crate::observation::depth_view::{DepthView, DepthViews};
use crate::visibility::EXPLAINED;
use crate::visibility::evidence::{Patches, limb_visibility_in};
use crate::visibility::render::LimbRaycaster;
use crate::visibility::surface::{PatchVisibility, SurfacePlace, surface_rows};
use crate::visibility::{ACROSS_LIMB, ALONG_LIMB, OVERLAP};

/// Evidence of the cameras on a limb.
///
/// `own` and `free_space` are fractions of the points on its surface that face a camera. Of several cameras, the largest fraction
/// counts for each. The first value is for the whole limb, with each point weighted by its distance from the proximal joint: this is
/// its lever on the distal joint, and a point at the proximal joint does not constrain the limb's direction. The second is for the
/// points in the outer two fifths alone: a limb that is hidden in the trunk from its middle on may end anywhere in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LimbSupport {
    /// Fraction observed at the predicted depth and explained by no limb of the trunk or of another arm or leg.
    pub own: [f64; 2],
    /// Fraction that violates free space.
    pub free_space: [f64; 2],
    /// Whether any image gives evidence for or against the limb.
    pub known: bool,
    /// Its patches in all images, those that other limbs hide among the occluded ones.
    pub patches: Patches,
}

impl LimbSupport {
    /// Returns the evidence for the limb minus the evidence against it.
    pub(crate) fn net_support(&self) -> [f64; 2] {
        [self.own[0] - self.free_space[0], self.own[1] - self.free_space[1]]
    }
}

/// Evaluates the upper and lower limbs of all `chains`, and counts the patches of every limb; `supports` gets one entry per limb,
/// `raycasters` is working memory.
///
/// Returns how far the observed surface recedes between the middle of limbs and their rims, relative to the model: approximately
/// one on a body, zero on a plane: the sums of the least-squares factor's numerator and denominator, m^2. The factor is between both
/// over all sections where the middle and the rims are observed near the model. The two rims are averaged, so that the direction of
/// a limb relative to the camera has no effect.
pub(crate) fn measure_support(
    views: DepthViews,
    body: &Body,
    poses: &[Pose],
    chains: &[TwoBone],
    raycasters: &mut Vec<LimbRaycaster>,
    supports: &mut Vec<LimbSupport>,
) -> [f64; 2] {
    reset(supports, poses.len(), LimbSupport::default());
    let (mut product, mut square) = (0.0, 0.0);
    for view in views.iter() {
        refill(raycasters, LimbRaycaster::of_body(body, poses, view.working_from_camera));
        for (limb, support) in supports.iter_mut().enumerate() {
            let hidden = |point| is_hidden(raycasters, limb, point);
            let measure_round = |places: [SurfacePlace; 3]| {
                let depths = places.map(|place| Some([place.point.z, place.depth_within(2.0 * EXPLAINED)?]));
                if let [Some(left), Some(middle), Some(right)] = depths {
                    let [expected, measured] = [0, 1].map(|kind| 0.5 * (left[kind] + right[kind]) - middle[kind]);
                    product += expected * measured;
                    square += expected * expected;
                }
            };
            let (own, pose) = (&body.limbs()[limb], &poses[limb]);
            support.patches.add(limb_visibility_in(&view, own, pose, hidden, measure_round));
        }
        for chain in chains {
            for limb in [chain.upper, chain.lower] {
                let in_view = support_in_view(&view, &poses[limb], limb, chain, raycasters);
                let support = &mut supports[limb];
                for part in 0..2 {
                    support.own[part] = support.own[part].max(in_view.own[part]);
                    support.free_space[part] = support.free_space[part].max(in_view.free_space[part]);
                }
                support.known |= in_view.known;
            }
        }
    }
    [product, square]
}

/// Whether another limb hides a point of a limb, camera frame.
fn is_hidden(raycasters: &[LimbRaycaster], limb: usize, point: Vec3) -> bool {
    let hides = |other: &LimbRaycaster| other.depth_before(point) < point.z - OVERLAP;
    raycasters.iter().enumerate().any(|(other, caster)| other != limb && hides(caster))
}

/// Returns the evidence of one camera on a limb of a chain.
fn support_in_view(
    view: &DepthView,
    working_from_limb: &Pose,
    limb: usize,
    chain: &TwoBone,
    raycasters: &[LimbRaycaster],
) -> LimbSupport {
    let camera_from_limb = view.working_from_camera.inverse() * *working_from_limb;
    let mut support = LimbSupport::default();
    let outer_sections = ALONG_LIMB.iter().filter(|t| **t > 0.5).count();
    for (t, _, points) in surface_rows(&raycasters[limb].shape, &camera_from_limb, ACROSS_LIMB) {
        // The weights of all points sum to one, in the whole limb and in the outer part.
        let lever = t / (ALONG_LIMB.iter().sum::<f64>() * ACROSS_LIMB.len() as f64);
        let outer = if t > 0.5 { 1.0 / (outer_sections * ACROSS_LIMB.len()) as f64 } else { 0.0 };
        let count = |fractions: &mut [f64; 2]| *fractions = [fractions[0] + lever, fractions[1] + outer];
        for place in points.map(|point| SurfacePlace::observed(view, point)) {
            let (sight, point) = (place.sight(), place.point);
            if sight == PatchVisibility::Unknown {
                continue;
            }
            support.known = true;
            if is_hidden(raycasters, limb, point) {
                continue;
            }
            if sight == PatchVisibility::FreeSpace {
                count(&mut support.free_space);
            } else if let Some(z) = place.depth_within(EXPLAINED) {
                let mut unrelated = raycasters.iter().enumerate().filter(|(other, _)| !chain.has(*other));
                if !unrelated.any(|(_, other)| (other.depth_before(point) - z).abs() < EXPLAINED) {
                    count(&mut support.own);
                }
            }
        }
    }
    support
}
