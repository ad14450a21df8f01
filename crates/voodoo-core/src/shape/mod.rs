//! The shape of a limb: a tapered elliptic cylinder and its closest-point, bounding and ray queries.
//!
//! The axis is +z, from the proximal end `z = 0` to the distal end `z = length`. The semi-axes are linear in `t = z / length`:
//! `a(t) = a0 + (a1 - a0) t` along x and `b(t) = b0 + (b1 - b0) t` along y (the "degenerated cylinder" of K06 and K07).
//! The surface is closed: the side `P(θ, t) = (a(t) cos θ, b(t) sin θ, length t)` and two elliptic caps. The side is ruled:
//! for a fixed θ it is a straight segment, and every query here is built on that. The solid is convex only if
//! `a0 b1 = a1 b0`; nothing here assumes it.
//!
//! | query | file |
//! |---|---|
//! | [`TaperedEllipticCylinder::closest_point`], exact, f64 | `closest` |
//! | [`TaperedEllipticCylinder::closest_points`], many points at once, f32 | `batch`, `kernel` |
//! | [`TaperedEllipticCylinder::approximate_distance`] | `approximate` |
//! | [`TaperedEllipticCylinder::cast_ray`] | `ray` |
//! | [`TaperedEllipticCylinder::aabb`] | here |
//! | [`TaperedEllipticCylinder::contour`], where a camera sees its border | `contour` |
//! | [`TaperedEllipticCylinder::section`], what of it faces a camera | `section` |

mod approximate;
mod batch;
mod closest;
mod contour;
mod kernel;
mod ray;
mod ruling;
mod section;

use crate::error::Unexpected;
use crate::math::{Aabb, Pose, Vec3};

pub use batch::SurfaceBatch;
pub(crate) use section::{FacingSection, Section};

/// Minimum length, meters: the accuracy of the queries. A smaller value is an input error.
pub(crate) const MIN_SIZE: f64 = 1e-6;
/// Maximum length, meters. A larger value is an input error, most likely of units.
const MAX_SIZE: f64 = 1e3;
/// On a rim, the normal is the direction to the query when the query is farther away than this, meters, and the mean of the two
/// adjacent faces' normals when it is nearer.
pub(crate) const RIM_NORMAL_DISTANCE: f64 = 1e-4;

/// The face of the closed surface on which a point lies.
///
/// [`SurfaceBatch`] has an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Region {
    /// The tapered side.
    Side = 0,
    /// The elliptic cap at `z = 0`.
    ProximalCap = 1,
    /// The elliptic cap at `z = length`.
    DistalCap = 2,
    /// The edge between the side and the proximal cap.
    ProximalRim = 3,
    /// The edge between the side and the distal cap.
    DistalRim = 4,
}

/// The point of the surface that is closest to a query, limb frame.
///
/// [`TaperedEllipticCylinder`] has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point on the surface, meters.
    pub point: Vec3,
    /// Outward unit normal there; on a rim a direction in the cone between the normals of the two faces.
    pub normal: Vec3,
    /// Distance from the query to the point, meters, negative inside.
    pub signed_distance: f64,
    /// Face of the surface.
    pub region: Region,
}

/// A tapered elliptic cylinder in its limb frame, meters.
///
/// A semi-axis may be zero at one end (needle tip, wedge), not at both. The type is small and is copied.
///
/// ```
/// use voodoo_core::math::Vec3;
/// use voodoo_core::{Region, TaperedEllipticCylinder};
///
/// let forearm = TaperedEllipticCylinder::new(0.25, 0.05, 0.045, 0.03, 0.025)?;
/// let near = forearm.closest_point(Vec3::new(0.2, 0.0, 0.1));
/// assert_eq!(near.region, Region::Side);
/// assert!((near.signed_distance - 0.1575).abs() < 1e-3);
/// let refused = TaperedEllipticCylinder::new(-0.25, 0.05, 0.05, 0.03, 0.03).unwrap_err();
/// assert_eq!(refused.to_string(), "length: expected 0.000001 to 1000 m, found -0.25");
/// # Ok::<(), voodoo_core::Unexpected>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaperedEllipticCylinder {
    length: f64,
    a0: f64,
    b0: f64,
    a1: f64,
    b1: f64,
}

impl TaperedEllipticCylinder {
    /// A shape from its length and its semi-axes along x and y at `z = 0` (`a0`, `b0`) and `z = length` (`a1`, `b1`), meters.
    ///
    /// # Errors
    /// [`Unexpected`] when a value is not a number, negative or above 1000 m, or the length below 1e-6 m; and when `a0` and
    /// `a1`, or `b0` and `b1`, are both below 1e-6 m, so that the solid would have no interior.
    pub fn new(length: f64, a0: f64, b0: f64, a1: f64, b1: f64) -> Result<Self, Unexpected> {
        for (name, min, value) in
            [("length", MIN_SIZE, length), ("a0", 0.0, a0), ("b0", 0.0, b0), ("a1", 0.0, a1), ("b1", 0.0, b1)]
        {
            let expected = format_args!("{min} to {MAX_SIZE} m");
            Unexpected::unless((min..=MAX_SIZE).contains(&value), name, expected, value)?;
        }
        for (what, first, last) in [("a0 and a1", a0, a1), ("b0 and b1", b0, b1)] {
            let expected = format_args!("at least {MIN_SIZE} m at one end, so that the limb is not flat");
            Unexpected::unless(first.max(last) >= MIN_SIZE, what, expected, format_args!("{first} and {last}"))?;
        }
        Ok(Self { length, a0, b0, a1, b1 })
    }

    /// Length along z, meters.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Semi-axis along x at the proximal end, meters.
    pub fn a0(&self) -> f64 {
        self.a0
    }

    /// Semi-axis along y at the proximal end, meters.
    pub fn b0(&self) -> f64 {
        self.b0
    }

    /// Semi-axis along x at the distal end, meters.
    pub fn a1(&self) -> f64 {
        self.a1
    }

    /// Semi-axis along y at the distal end, meters.
    pub fn b1(&self) -> f64 {
        self.b1
    }

    /// The semi-axes `(a, b)` of the slice at height `z`, clamped to the ends, meters.
    fn semi_axes(&self, z: f64) -> (f64, f64) {
        let t = (z / self.length).clamp(0.0, 1.0);
        (self.a0 + (self.a1 - self.a0) * t, self.b0 + (self.b1 - self.b0) * t)
    }

    /// `(x b)² + (y a)² - (a b)²` at the slice of `q`: negative inside the ellipse, positive outside; needs no division.
    fn ellipse_sign(&self, q: Vec3) -> f64 {
        let (a, b) = self.semi_axes(q.z);
        (q.x * b).powi(2) + (q.y * a).powi(2) - (a * b).powi(2)
    }

    /// Growth of the semi-axes along x and y per meter of the axis.
    pub(crate) fn growth(&self) -> [f64; 2] {
        [(self.a1 - self.a0) / self.length, (self.b1 - self.b0) / self.length]
    }

    /// The largest semi-axis, meters.
    pub(crate) fn max_radius(&self) -> f64 {
        self.a0.max(self.a1).max(self.b0).max(self.b1)
    }

    /// The shape with its length and its semi-axes `(a0, b0, a1, b1)` multiplied by factors.
    pub(crate) fn stretched(&self, length: f64, [a0, b0, a1, b1]: [f64; 4]) -> Result<Self, Unexpected> {
        Self::new(self.length * length, self.a0 * a0, self.b0 * b0, self.a1 * a1, self.b1 * b1)
    }

    /// Whether `q` is strictly inside the solid.
    pub(crate) fn contains(&self, q: Vec3) -> bool {
        q.z > 0.0 && q.z < self.length && self.ellipse_sign(q) < 0.0
    }

    /// The tight axis-aligned box in the limb frame, meters.
    pub fn local_aabb(&self) -> Aabb {
        let (a, b) = (self.a0.max(self.a1), self.b0.max(self.b1));
        Aabb::new(Vec3::new(-a, -b, 0.0), Vec3::new(a, b, self.length))
    }

    /// The tight axis-aligned box in the frame `world`, meters.
    ///
    /// The side is ruled between the end ellipses, so the solid lies in their convex hull, and an ellipse reaches
    /// `sqrt((a u_x)² + (b u_y)²)` beyond its center along a unit vector `u` of the limb frame.
    pub fn aabb(&self, world_from_limb: &Pose) -> Aabb {
        let x = world_from_limb.rotation * Vec3::X;
        let y = world_from_limb.rotation * Vec3::Y;
        let reach = |a: f64, b: f64| {
            let squared = (x * a) * (x * a) + (y * b) * (y * b);
            Vec3::new(squared.x.sqrt(), squared.y.sqrt(), squared.z.sqrt())
        };
        let (start, end) =
            (world_from_limb.translation, world_from_limb.transform_point(Vec3::new(0.0, 0.0, self.length)));
        let (first, last) = (reach(self.a0, self.b0), reach(self.a1, self.b1));
        Aabb::new((start - first).min(end - last), (start + first).max(end + last))
    }

    /// Center and radius, meters, of a sphere around the solid in the frame `world`.
    pub(crate) fn sphere(&self, world_from_limb: &Pose) -> (Vec3, f64) {
        let half = 0.5 * self.length;
        let radius = self.max_radius();
        (*world_from_limb * (Vec3::Z * half), half.hypot(radius))
    }
}
