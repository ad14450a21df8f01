//! Girths from the first frame: the named joints fix pose and lengths, the points around them how thick each limb is and
//! where its surface lies about the line of its joints.

use nalgebra::{Matrix3, Vector3};

use crate::correspondence::LimbMatches;
use crate::geometry::{Pose, Vec3};

/// Standard deviation of the shift of a limb's surface against its joints (metres) and of its relative girth: what
/// anthropometry leaves open between persons, clothes and definitions of joint centres.
const SHIFT_SIGMA: f64 = 0.03;
const GIRTH_SIGMA: f64 = 0.10;
/// Scatter of a surface point about the model, and how many independent ones a limb shows at most: neighbours err alike.
const POINT_SIGMA: f64 = 0.015;
const INDEPENDENT: f64 = 30.0;
/// Fewer matched points than this tell nothing.
const ENOUGH: usize = 15;

/// Change of a limb's surface in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GirthFit {
    /// Shift across the axis, metres; z is 0.
    pub shift: Vec3,
    /// Factor of all semi-axes.
    pub girth: f64,
}

/// One Gauss-Newton step for shift and girth from the matches of one limb: `d = n . shift + (girth - 1) n . (x, y, 0)` for a
/// point at signed distance `d` whose closest point `(x, y, z)` has the normal `n` (limb frame), robust (Cauchy) and drawn
/// to `total`, the change made so far, being none.
pub fn girth_step(matches: &LimbMatches, working_from_limb: &Pose, total: &GirthFit) -> Option<GirthFit> {
    let (points, _) = matches.accepted();
    if points < ENOUGH {
        return None;
    }
    let mut h = Matrix3::zeros();
    let mut b = Vector3::zeros();
    for index in 0..matches.weight.len() {
        if matches.weight[index] <= 0.0 {
            continue;
        }
        let distance = f64::from(matches.surface.signed_distance[index]);
        let foot = working_from_limb.inverse_transform_point(matches.surface.points.get(index));
        let normal = working_from_limb.inverse_transform_vector(matches.surface.normals.get(index));
        let row = Vector3::new(normal.x, normal.y, normal.x * foot.x + normal.y * foot.y);
        let scale = distance / (2.0 * POINT_SIGMA);
        let weight = 1.0 / (1.0 + scale * scale);
        h += weight * row * row.transpose();
        b += weight * distance * row;
    }
    let information = (INDEPENDENT / points as f64).min(1.0) / (POINT_SIGMA * POINT_SIGMA);
    let prior = Vector3::new(SHIFT_SIGMA, SHIFT_SIGMA, GIRTH_SIGMA).map(|sigma| 1.0 / (sigma * sigma));
    let h = h * information + Matrix3::from_diagonal(&prior);
    let b = b * information - prior.component_mul(&Vector3::new(total.shift.x, total.shift.y, total.girth - 1.0));
    let step = h.cholesky()?.solve(&b);
    step.iter()
        .all(|value| value.is_finite())
        .then(|| GirthFit { shift: Vec3::new(step.x, step.y, 0.0), girth: 1.0 + step.z })
}
