//! The straight lines (rulings) of the side: for one angle θ the distance from a point is a point-to-segment distance.

use super::TaperedEllipticCylinder;
use crate::math::Vec3;

/// An angle in the first quadrant, stored as cosine and sine, so that queries need no trigonometric functions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angle {
    pub c: f64,
    pub s: f64,
}

impl Angle {
    pub(super) const ZERO: Self = Self { c: 1.0, s: 0.0 };
    pub(super) const RIGHT: Self = Self { c: 0.0, s: 1.0 };

    /// The angle of the vector `(x, y)`, `None` for the zero vector.
    #[inline(always)]
    pub(super) fn from_vector(x: f64, y: f64) -> Option<Self> {
        // Lengths and their products are far from overflow and underflow of the squares, so the slower `hypot` is not needed.
        let norm = (x * x + y * y).sqrt();
        (norm > 0.0 && norm.is_finite()).then(|| Self { c: x / norm, s: y / norm })
    }

    /// Sine of `other - self`: positive when `other` is the larger angle.
    #[inline(always)]
    pub(super) fn sine_to(self, other: Self) -> f64 {
        self.c * other.s - self.s * other.c
    }

    /// The angle half-way to `other`.
    #[inline(always)]
    pub(super) fn middle(self, other: Self) -> Self {
        Self::from_vector(self.c + other.c, self.s + other.s).unwrap_or(self)
    }

    /// This angle plus `atan(d)`.
    #[inline(always)]
    pub(super) fn turned(self, d: f64) -> Self {
        Self::from_vector(self.c - d * self.s, self.s + d * self.c).unwrap_or(self)
    }
}

/// The point of one ruling that is closest to a query, with the derivatives of `g(θ) = min_t |P(θ, t) - q|²`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    pub angle: Angle,
    pub t: f64,
    pub point: Vec3,
    /// `g`, square meters.
    pub squared: f64,
    /// `g'/2 = e · P_θ` with `e = P - q`.
    pub slope: f64,
    /// `g''/2 = |P_θ|² - (e_x a c + e_y b s) - [t free] (P_θ · D + e · D_θ)² / |D|²`.
    pub bend: f64,
}

impl Foot {
    /// The nearer one of two feet.
    #[inline(always)]
    pub(super) fn nearer(self, other: Self) -> Self {
        if other.squared < self.squared { other } else { self }
    }
}

impl TaperedEllipticCylinder {
    /// The foot of `q` (folded to `x, y >= 0`) on the ruling `A + t D` at `angle`.
    #[inline(always)]
    pub(super) fn foot(&self, angle: Angle, q: Vec3) -> Foot {
        let Angle { c, s } = angle;
        let (da, db) = (self.a1 - self.a0, self.b1 - self.b0);
        let start = Vec3::new(self.a0 * c, self.b0 * s, 0.0);
        let along = Vec3::new(da * c, db * s, self.length);
        let free = (q - start).dot(along) / along.length_squared();
        let t = free.clamp(0.0, 1.0);
        let (a, b) = (self.a0 + da * t, self.b0 + db * t);
        let point = Vec3::new(a * c, b * s, self.length * t);
        let e = point - q;
        let tangent = Vec3::new(-a * s, b * c, 0.0);
        let slope = e.dot(tangent);
        let mixed = tangent.dot(along) + e.dot(Vec3::new(-da * s, db * c, 0.0));
        let coupling = if t == free { mixed * mixed / along.length_squared() } else { 0.0 };
        let bend = tangent.length_squared() - (e.x * a * c + e.y * b * s) - coupling;
        Foot { angle, t, point, squared: e.length_squared(), slope, bend }
    }

    /// Outward unit normal of the side, `P_θ × P_t = (b L c, a L s, -(a b' s² + b a' c²))` with `a' = a1 - a0`.
    ///
    /// On a tip (`a = b = 0`) the product vanishes; its limit is used, which is the same for all points of the ruling. On an edge
    /// (`a = 0` or `b = 0`) it can vanish at the edge's ends; there the horizontal direction is used.
    pub(super) fn side_normal(&self, angle: Angle, t: f64) -> Vec3 {
        let Angle { c, s } = angle;
        let (da, db) = (self.a1 - self.a0, self.b1 - self.b0);
        let (mut a, mut b) = (self.a0 + da * t, self.b0 + db * t);
        if a.max(b) < 1e-12 {
            (a, b) = (0.5 * (self.a0 + self.a1), 0.5 * (self.b0 + self.b1));
        }
        self.side_cross([a, b], [c, s]).try_normalize().unwrap_or(Vec3::new(c, s, 0.0))
    }

    /// The product `P_θ × P_t` of [`Self::side_normal`] where the semi-axes are `a` and `b`.
    pub(super) fn side_cross(&self, [a, b]: [f64; 2], [c, s]: [f64; 2]) -> Vec3 {
        let (da, db) = (self.a1 - self.a0, self.b1 - self.b0);
        Vec3::new(b * self.length * c, a * self.length * s, -(a * db * s * s + b * da * c * c))
    }
}
