//! Rotation matrices as quaternions, and quaternions as Euler angles.

use std::f64::consts::PI;

use super::{Mat3, Quat};

/// Tolerance for the products of rows of a rotation matrix: rounding errors of a few products are a hundred times smaller.
const SKEWED: f64 = 1e-12;
/// Tolerance for gimbal lock: distance of the middle angle from its singular value \[rad\], below which the others are noise.
const LOCKED: f64 = 1e-7;

/// The unit quaternion x, y, z, w of a rotation matrix, whose largest entry is positive.
pub fn quaternion(matrix: &Mat3) -> [f64; 4] {
    let found = Quat::from_mat3(matrix).normalize().to_array();
    let largest =
        found.iter().copied().fold(0.0, |most: f64, entry| if entry.abs() > most.abs() { entry } else { most });
    if largest < 0.0 { found.map(|entry| -entry) } else { found }
}

/// Whether a matrix is only approximately a rotation.
pub fn is_skewed(matrix: &Mat3) -> bool {
    let products = *matrix * matrix.transpose() - Mat3::IDENTITY;
    products.to_cols_array().iter().any(|entry| entry.abs() > SKEWED)
}

/// Angles about moving axes (0, 1, 2: x, y, z; the first rotation first) of a unit quaternion x, y, z, w, as Bernardes and Viollet,
/// "Quaternion to Euler angles conversion", PLOS ONE 2022. Where the first and third axes are parallel, the third angle is zero.
pub fn euler_angles(quaternion: &[f64; 4], order: [usize; 3]) -> [f64; 3] {
    let [k, j, i] = order;
    let (x, y, z, w) = (quaternion[i], quaternion[j], quaternion[3 - i - j], quaternion[3]);
    // Whether i, j and the third axis are a right-handed system.
    let sign = if (j + 3 - i) % 3 == 1 { 1.0 } else { -1.0 };
    let proper = i == k;
    let (a, b, c, d) = if proper { (w, x, y, z * sign) } else { (w - y, x + z * sign, y + w, z * sign - x) };
    let (half_sum, half_difference) = (b.atan2(a), d.atan2(c));
    let middle = 2.0 * c.hypot(d).atan2(a.hypot(b));
    let (first, third) = if middle <= LOCKED {
        (2.0 * half_sum, 0.0)
    } else if middle >= PI - LOCKED {
        (2.0 * half_difference, 0.0)
    } else {
        (half_sum + half_difference, half_sum - half_difference)
    };
    let angles = if proper { [first, middle, third] } else { [sign * first, middle - PI / 2.0, third] };
    angles.map(|angle| if angle.abs() > PI { angle - (2.0 * PI).copysign(angle) } else { angle })
}
