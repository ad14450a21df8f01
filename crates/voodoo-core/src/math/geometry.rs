//! The one vocabulary for 3-D geometry.
//!
//! Points, rotations and poses are the glam types that parry uses, taken through parry so that both always agree on the
//! version. nalgebra is used for linear algebra only (eigen-problems, Cholesky) and only inside `solver`.
//!
//! Conventions, fixed here for the whole project:
//! * a transform is named `a_from_b` and maps coordinates in `b` to coordinates in `a`;
//! * a twist is `(omega, v)`, radians and metres, and perturbs on the left: `T' = exp(xi) T`.

pub use parry3d_f64::bounding_volume::Aabb;
pub use parry3d_f64::glamx::{DMat3 as Mat3, DPose3 as Pose, DQuat as Quat, DVec3 as Vec3};

/// No place lies farther from its origin, metres: three times as far as the Moon. Beyond, squares and products of coordinates
/// have no digits left for a body, and at last are infinite.
pub const FARTHEST: f64 = 1e9;

/// Whether a place can be meant: no coordinate is NaN or beyond [`FARTHEST`].
pub fn is_place(place: Vec3) -> bool {
    place.abs().cmple(Vec3::splat(FARTHEST)).all()
}

/// Whether a pose can be meant: a place, and a unit quaternion.
pub fn is_rigid(pose: &Pose) -> bool {
    is_place(pose.translation) && pose.rotation.is_finite() && (pose.rotation.length() - 1.0).abs() < 1e-6
}

/// A pose as the rows of a 4x4 matrix.
pub fn matrix(pose: &Pose) -> [[f64; 4]; 4] {
    let rows = Mat3::from_quat(pose.rotation).transpose().to_cols_array_2d();
    let t = pose.translation;
    let row = |index: usize, shift: f64| [rows[index][0], rows[index][1], rows[index][2], shift];
    [row(0, t.x), row(1, t.y), row(2, t.z), [0.0, 0.0, 0.0, 1.0]]
}

/// Single-precision points as a structure of arrays, the layout the SIMD kernels read. Metres.
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

/// Rotation vector of the shorter way round.
pub trait ShortestAxis {
    /// At most pi long.
    fn to_scaled_axis_shortest(self) -> Vec3;
}

impl ShortestAxis for Quat {
    fn to_scaled_axis_shortest(self) -> Vec3 {
        let q = if self.w < 0.0 { -self } else { self };
        let v = Vec3::new(q.x, q.y, q.z);
        let sine = v.length();
        if sine < 1e-9 { 2.0 * v } else { v * (2.0 * sine.atan2(q.w) / sine) }
    }
}

/// The transform into the working frame, whose origin is `origin` in the world.
pub fn shifted(world_from_sensor: &Pose, origin: Vec3) -> Pose {
    Pose::from_parts(world_from_sensor.translation - origin, world_from_sensor.rotation)
}
