//! A camera sees only surfaces that face it: points inside a limb that were matched to its far side belong to its near side.
//!
//! When the model of a limb is too near to the camera by more than its radius, the closest surface point is on the far side, and
//! such matches would hold the limb where it is. They are replaced by the visible point in front of the measured point in the
//! same slice, and pull the limb back. At the contour the two points coincide, so the match changes continuously. Points behind
//! a limb keep their closest point: they may belong to what lies behind it.

use std::ops::Range;

use crate::association::correspondence::LimbMatches;
use crate::math::{Pose, Vec3, vectorized};
use crate::observation::candidates::Candidates;
use crate::observation::pixels::STRETCH;
use crate::shape::{MIN_SIZE, Region, TaperedEllipticCylinder};

/// Moves matches of depth pixels inside a limb from the side that faces away from the camera to the near side.
pub(crate) fn match_visible_side(
    shape: &TaperedEllipticCylinder,
    pose: &Pose,
    candidates: &Candidates,
    max_distance: f64,
    matches: &mut LimbMatches,
) {
    let mut start = 0;
    for (end, camera) in &candidates.cameras {
        // The candidate indices of a limb are ascending.
        let stop = start + matches.candidate[start..].partition_point(|candidate| candidate < end);
        for first in (start..stop).step_by(STRETCH) {
            let last = stop.min(first + STRETCH);
            let away = vectorized!(facing_away(matches, first..last, camera.as_vec3().to_array()));
            if away.iter().fold(0, |any, away| any | u8::from(*away)) == 0 {
                continue;
            }
            let LimbMatches { measured, weight, surface, .. } = &mut *matches;
            for index in (first..last).filter(|index| away[index - first]) {
                let (measured, far) = (measured.get(index), pose.inverse_transform_point(surface.points.get(index)));
                let (place, normal) = near_side(shape, far, pose.rotation.inverse() * (measured - *camera));
                let (place, normal) = (*pose * place, pose.rotation * normal);
                let distance = normal.dot(measured - place);
                surface.points.set(index, place.as_vec3().to_array());
                surface.normals.set(index, normal.as_vec3().to_array());
                surface.signed_distance[index] = distance as f32;
                if distance.abs() > max_distance {
                    weight[index] = 0.0;
                }
            }
        }
        start = stop;
    }
}

/// Which matches of points inside the limb are on the side that faces away from a camera.
#[inline(always)]
fn facing_away(matches: &LimbMatches, range: Range<usize>, [x, y, z]: [f32; 3]) -> [bool; STRETCH] {
    let LimbMatches { measured, weight, surface, .. } = matches;
    let mut away = [false; STRETCH];
    let (px, py, pz) = (&measured.x[range.clone()], &measured.y[range.clone()], &measured.z[range.clone()]);
    let normals = &surface.normals;
    let (nx, ny, nz) = (&normals.x[range.clone()], &normals.y[range.clone()], &normals.z[range.clone()]);
    let (distance, region) = (&surface.signed_distance[range.clone()], &surface.region[range.clone()]);
    let weight = &weight[range.clone()];
    for i in 0..range.len() {
        let along = nx[i] * (px[i] - x) + ny[i] * (py[i] - y) + nz[i] * (pz[i] - z);
        away[i] = (along > 0.0) & (distance[i] < 0.0) & (region[i] == Region::Side) & (weight[i] > 0.0);
    }
    away
}

/// The other end of the chord through a slice, from a surface point along the line of sight (limb frame), and the normal there.
/// In units of the semi-axes the slice is a circle, and the ends of the chord are mirror images.
fn near_side(shape: &TaperedEllipticCylinder, point: Vec3, view: Vec3) -> (Vec3, Vec3) {
    let rates = shape.growth();
    let (a, b) = (shape.a0() + rates[0] * point.z, shape.b0() + rates[1] * point.z);
    let (a, b) = (a.max(MIN_SIZE), b.max(MIN_SIZE));
    let (x, y) = (point.x / a, point.y / b);
    let (u, v) = (view.x / a, view.y / b);
    let square = (u * u + v * v).max(f64::MIN_POSITIVE);
    let along = 2.0 * (x * u + y * v) / square;
    let (x, y) = (x - along * u, y - along * v);
    // Gradient of (X / a)^2 + (Y / b)^2.
    let normal = Vec3::new(x / a, y / b, -(x * x * rates[0] / a + y * y * rates[1] / b));
    (Vec3::new(x * a, y * b, point.z), normal.normalize_or(Vec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_near_side_lies_on_the_surface_before_the_far_one() {
        let shape = TaperedEllipticCylinder::new(0.4, 0.10, 0.05, 0.06, 0.04).unwrap();
        for k in 0..60 {
            let angle = f64::from(k) * 0.1;
            for view in [Vec3::new(0.3, 1.0, 0.2), Vec3::new(-1.0, 0.4, -0.5)] {
                let t = f64::from(k) / 60.0;
                let (a, b) = (0.10 - 0.04 * t, 0.05 - 0.01 * t);
                let far = Vec3::new(a * angle.cos(), b * angle.sin(), 0.4 * t);
                let (near, normal) = near_side(&shape, far, view);
                let exact = shape.closest_point(near);
                assert!(exact.signed_distance.abs() < 1e-12);
                assert!(exact.normal.distance(normal) < 1e-6 || t < 1e-9, "{normal} is not {}", exact.normal);
                // On the line of sight, projected along the axis.
                let chord = near - far;
                assert!((chord.x * view.y - chord.y * view.x).abs() < 1e-12);
                let (back, _) = near_side(&shape, near, view);
                assert!(back.distance(far) < 1e-12);
            }
        }
    }
}
