//! The logarithm of rigid motions (R07 eq. 6-9); its inverse is [`voodoo_core::exp`].

use nalgebra::Vector6;

use voodoo_core::math::{Pose, Quat, ShortestAxis, Vec3};

/// The twist `(omega, v)`, `omega` at most pi long, with `exp(log(T)) = T` (R07 eq. 8, 9).
///
/// R07 inverts `A = (I - exp(theta w^)) w^ + w w^T theta`. For a unit axis `w` and `theta v` instead of `v` that inverse is
/// `I - [omega]/2 + k [omega]^2` with `k = (1 - (theta/2) cot(theta/2)) / theta^2`. It has no division by zero at 0 (a series is
/// used there) and none at pi, where R07's formula for the axis, which divides by `sin(theta)`, breaks down.
pub fn log(pose: &Pose) -> Vector6<f64> {
    let omega = rotation_vector(pose.rotation);
    let t = pose.translation;
    let first = omega.cross(t);
    let v = t - 0.5 * first + inverse_factor(omega.length_squared()) * omega.cross(first);
    Vector6::new(omega.x, omega.y, omega.z, v.x, v.y, v.z)
}

/// Rotation vector of the shorter rotation, at most pi long; exact to rounding at 0 and at pi.
pub(super) fn rotation_vector(rotation: Quat) -> Vec3 {
    rotation.to_scaled_axis_shortest()
}

/// `(1 - (t/2) cot(t/2)) / t^2` as a function of the squared angle.
fn inverse_factor(square: f64) -> f64 {
    if square < 1e-4 {
        1.0 / 12.0 + square / 720.0 + square * square / 30240.0
    } else {
        let half = 0.5 * square.sqrt();
        (1.0 - half * half.cos() / half.sin()) / square
    }
}

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
