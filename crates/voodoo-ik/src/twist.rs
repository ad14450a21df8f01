//! Rotations of ball joints, and their derivatives.

use voodoo_core::math::{Quat, Vec3};

/// Rotation of a rotation vector and the two factors of its left Jacobian `I + b [v] + c [v]^2`, `b = (1 - cos t)/t^2`,
/// `c = (t - sin t)/t^3`.
pub(super) fn turn(v: Vec3) -> (Quat, f64, f64) {
    let square = v.length_squared();
    if square < 1e-6 {
        let half = 0.5 - square / 48.0;
        let rotation = Quat::from_xyzw(v.x * half, v.y * half, v.z * half, 1.0 - square / 8.0).normalize();
        return (rotation, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0);
    }
    let angle = square.sqrt();
    let (sine, cosine) = (0.5 * angle).sin_cos();
    let k = sine / angle;
    // 1 - cos t = 2 sin^2(t/2), sin t = 2 sin(t/2) cos(t/2)
    let c = (angle - 2.0 * sine * cosine) / (square * angle);
    (Quat::from_xyzw(v.x * k, v.y * k, v.z * k, cosine), 2.0 * sine * sine / square, c)
}
