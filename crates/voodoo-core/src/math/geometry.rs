//! The geometry types and conventions of the project.
//!
//! Points and rotations are glam's. nalgebra is used for small matrices and decompositions only.
//!
//! Conventions, fixed here for the whole project:
//! * a transform is named `a_from_b` and maps coordinates in `b` to coordinates in `a`;
//! * a twist is `(omega, v)`, radians and meters, and perturbs on the left: `T' = exp(xi) T`.

use glam::DMat4;
pub use glam::{DAffine3 as Affine3, DMat3 as Mat3, DQuat as Quat, DVec3 as Vec3};
use std::ops::Mul;

/// A rigid transform: a rotation, then a translation.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pose {
    /// A unit quaternion.
    pub rotation: Quat,
    /// The position of the transformed origin, meters.
    pub translation: Vec3,
}

impl Pose {
    /// The identity transform.
    pub const IDENTITY: Self = Self { rotation: Quat::IDENTITY, translation: Vec3::ZERO };

    /// A pose from its rotation and translation.
    #[inline]
    pub fn from_parts(translation: Vec3, rotation: Quat) -> Self {
        Self { rotation, translation }
    }

    /// A translation alone, meters.
    #[inline]
    pub fn from_translation(translation: Vec3) -> Self {
        Self::from_parts(translation, Quat::IDENTITY)
    }

    /// A pose from a translation, meters, and a rotation vector, radians.
    #[inline]
    pub fn new(translation: Vec3, rotation_vector: Vec3) -> Self {
        Self::from_parts(translation, Quat::from_scaled_axis(rotation_vector))
    }

    /// The inverse transform.
    #[inline]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: rotation * (-self.translation) }
    }

    /// `self.inverse() * other`, with one rounding error less.
    #[inline]
    pub fn inv_mul(&self, other: &Self) -> Self {
        let rotation = self.rotation.inverse();
        Self { translation: rotation * (other.translation - self.translation), rotation: rotation * other.rotation }
    }

    /// Transforms a point.
    #[inline]
    pub fn transform_point(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// Transforms a point by the inverse.
    #[inline]
    pub fn inverse_transform_point(&self, point: Vec3) -> Vec3 {
        self.rotation.inverse() * (point - self.translation)
    }

    /// Whether all numbers are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.rotation.is_finite() && self.translation.is_finite()
    }
}

impl Mul for Pose {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation: self.translation + self.rotation * other.translation,
        }
    }
}

impl Mul<Vec3> for Pose {
    type Output = Vec3;

    #[inline]
    fn mul(self, point: Vec3) -> Vec3 {
        self.transform_point(point)
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aabb {
    /// The corner with the smallest coordinates, meters.
    pub mins: Vec3,
    /// The corner with the largest.
    pub maxs: Vec3,
}

impl Aabb {
    /// The empty box: its union with another box is the other box.
    pub(crate) const EMPTY: Self = Self { mins: Vec3::MAX, maxs: Vec3::MIN };

    /// The box between two corners.
    #[inline]
    pub fn new(mins: Vec3, maxs: Vec3) -> Self {
        Self { mins, maxs }
    }

    /// The bounding box of points.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |all, point| all.union(Self::new(point, point)))
    }

    /// The smallest box that contains both.
    pub fn union(self, other: Self) -> Self {
        Self { mins: self.mins.min(other.mins), maxs: self.maxs.max(other.maxs) }
    }

    /// The box with all sides moved outward by `margin` meters.
    pub(crate) fn enlarged(self, margin: f64) -> Self {
        Self { mins: self.mins - margin, maxs: self.maxs + margin }
    }

    /// The center.
    #[inline]
    pub fn center(&self) -> Vec3 {
        self.mins.midpoint(self.maxs)
    }

    /// Lengths of the sides.
    #[inline]
    pub fn extents(&self) -> Vec3 {
        self.maxs - self.mins
    }

    /// Whether a point lies in the box or on it.
    #[inline]
    pub fn contains(&self, point: Vec3) -> bool {
        !(point.cmplt(self.mins) | point.cmpgt(self.maxs)).any()
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        let (low, high) = (self.mins, self.maxs);
        std::array::from_fn(|corner| {
            let pick = |axis: usize| if (corner >> axis) & 1 == 1 { high[axis] } else { low[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }
}

/// Maximum distance of a position from its origin, meters: three times the distance to the Moon. Beyond it, squares and products
/// of coordinates have no digits left for a body, and finally overflow.
const FARTHEST: f64 = 1e9;

/// What is expected of a position.
pub(crate) const PLACE: &str = "finite meters, 1e9 at most";

/// Whether a position is valid: no coordinate is NaN or beyond [`FARTHEST`].
pub(crate) fn is_place(place: Vec3) -> bool {
    place.abs().cmple(Vec3::splat(FARTHEST)).all()
}

/// Whether a pose is valid: a valid position and a unit quaternion.
pub(crate) fn is_rigid(pose: &Pose) -> bool {
    is_place(pose.translation) && pose.rotation.is_finite() && (pose.rotation.length() - 1.0).abs() < 1e-6
}

/// A pose as the rows of a 4x4 matrix.
pub fn matrix(pose: &Pose) -> [[f64; 4]; 4] {
    DMat4::from_rotation_translation(pose.rotation, pose.translation).transpose().to_cols_array_2d()
}

/// Single-precision points as a structure of arrays, the layout the SIMD kernels read. Meters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// First coordinates.
    pub x: Vec<f32>,
    /// Second coordinates.
    pub y: Vec<f32>,
    /// Third coordinates.
    pub z: Vec<f32>,
}

impl Points {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// True when there is no point.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Removes all points and keeps the memory.
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
    }

    /// Makes room for `len` points in all.
    pub fn reserve(&mut self, len: usize) {
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.reserve(len.saturating_sub(axis.len()));
        }
    }

    /// Sets the number of points; new ones are zero.
    pub fn resize(&mut self, len: usize) {
        self.x.resize(len, 0.0);
        self.y.resize(len, 0.0);
        self.z.resize(len, 0.0);
    }

    /// Appends a point.
    pub fn push(&mut self, point: [f32; 3]) {
        self.x.push(point[0]);
        self.y.push(point[1]);
        self.z.push(point[2]);
    }

    /// The point at `index`, in double precision.
    pub fn get(&self, index: usize) -> Vec3 {
        Vec3::new(f64::from(self.x[index]), f64::from(self.y[index]), f64::from(self.z[index]))
    }

    /// Replaces the point at `index`.
    pub fn set(&mut self, index: usize, point: [f32; 3]) {
        self.x[index] = point[0];
        self.y[index] = point[1];
        self.z[index] = point[2];
    }
}

/// Rotation vector of the shorter rotation, at most pi long; exact to rounding at 0 and at pi.
pub fn rotation_vector(rotation: Quat) -> Vec3 {
    let q = if rotation.w < 0.0 { -rotation } else { rotation };
    let v = Vec3::new(q.x, q.y, q.z);
    let sine = v.length();
    if sine < 1e-9 { 2.0 * v } else { v * (2.0 * sine.atan2(q.w) / sine) }
}

/// The rotation after `now`, by a multiple of the rotation from `before` to `now`.
pub(crate) fn extrapolated_rotation(before: Quat, now: Quat, factor: f64) -> Quat {
    let motion = rotation_vector(now * before.inverse());
    Quat::from_scaled_axis(factor * motion) * now
}

/// The pose after `now`, by a multiple of the motion from `before` to `now`.
pub(crate) fn extrapolated(before: &Pose, now: &Pose, factor: f64) -> Pose {
    let translation = now.translation + factor * (now.translation - before.translation);
    Pose::from_parts(translation, extrapolated_rotation(before.rotation, now.rotation, factor))
}

/// The transform into the working frame, whose origin is `origin` in the world.
pub(crate) fn shifted(world_from_sensor: &Pose, origin: Vec3) -> Pose {
    Pose::from_parts(world_from_sensor.translation - origin, world_from_sensor.rotation)
}
