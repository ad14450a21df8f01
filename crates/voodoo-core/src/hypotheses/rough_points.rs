//! Points at the poses of a rough hypothesis: their distances from limbs, without associating them.

use crate::body::Body;
use crate::math::{Aabb, Points, Pose};
use crate::shape::TaperedEllipticCylinder;
use crate::terms::unexplained;
use crate::visibility::EXPLAINED;

/// Maximum number of points for the rough cost; the time is proportional to it.
pub(crate) const ROUGH_SAMPLE: usize = 400;
/// Tolerance of the rough cost for points, in those of a refined pose: refinement pulls nearby points and limbs together.
const TOLERANCE: f64 = 2.0;

/// Updates the distances `least` of points to the nearest of several limbs with one more limb. `distances` is working memory.
pub(crate) fn explain(
    body: &Body,
    limb: usize,
    poses: &[Pose],
    points: &Points,
    least: &mut [f32],
    distances: &mut Vec<f32>,
) {
    body.limbs()[limb].shape.approximate_distances(&poses[limb], points, distances);
    for (least, distance) in least.iter_mut().zip(distances.iter()) {
        *least = least.min(distance.abs());
    }
}

/// Whether a limb may explain a point within a bounding box, with the tolerance of the rough cost.
pub(super) fn may_explain(shape: &TaperedEllipticCylinder, pose: &Pose, bounds: Aabb) -> bool {
    let (middle, radius) = shape.sphere(pose);
    let gap = (middle - middle.max(bounds.mins).min(bounds.maxs)).length() - radius;
    // The approximate distance is smaller than the true one where a cross-section is flat.
    let flatness = |a: f64, b: f64| a.min(b) / a.max(b).max(f64::MIN_POSITIVE);
    gap * flatness(shape.a0(), shape.b0()).min(flatness(shape.a1(), shape.b1())) <= TOLERANCE * EXPLAINED
}

/// Cost of points at these distances from the nearest limb of a rough pose, nats.
pub(super) fn rough_cost(distances: &[f32], weights: &[f64]) -> f64 {
    distances.iter().zip(weights).map(|(distance, weight)| weight * unexplained(f64::from(*distance) / TOLERANCE)).sum()
}
