//! Ray casting against the closed surface.

use super::ruling::Angle;
use super::{Region, TaperedEllipticCylinder};
use crate::math::Vec3;

/// The point at which a ray enters the solid, limb frame.
///
/// ```
/// use voodoo_core::math::Vec3;
/// use voodoo_core::{Region, TaperedEllipticCylinder};
///
/// let forearm = TaperedEllipticCylinder::new(0.25, 0.05, 0.05, 0.05, 0.05)?;
/// let hit = forearm.cast_ray(Vec3::new(1.0, 0.0, 0.1), -Vec3::X, 2.0).ok_or("no hit")?;
/// assert!((hit.distance - 0.95).abs() < 1e-9 && hit.region == Region::Side);
/// assert_eq!(forearm.cast_ray(Vec3::new(1.0, 0.0, 0.3), -Vec3::X, 2.0), None); // beyond the distal cap
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance from the origin of the ray, meters.
    pub distance: f64,
    /// The point on the surface, meters.
    pub point: Vec3,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// Face of the surface: side or cap.
    pub region: Region,
}

/// A polynomial of degree 4 at most, constant term first.
type Quartic = [f64; 5];

impl TaperedEllipticCylinder {
    /// The first point at which a ray passes from outside to inside, limb frame, at most `max_distance` meters away.
    ///
    /// `direction` need not be a unit vector. Returns `None` when the ray misses, only touches the surface, or is not finite. A
    /// ray that starts inside is followed out of the solid and may enter it again, because the solid is not convex.
    ///
    /// Between the cap planes the solid is `F = (x b)² + (y a)² - (a b)² < 0`; x, y, a and b are linear along the ray, so F is a
    /// quartic. The roots of each derivative are isolated by the roots of the next derivative. They divide the ray into intervals
    /// on which F is monotone. The first interval with a change from `F >= 0` to `F < 0` contains the hit, which is found by
    /// bisection. No root can be missed.
    pub fn cast_ray(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> Option<RayHit> {
        let direction = direction.try_normalize()?;
        if !origin.is_finite() || max_distance.is_nan() {
            return None;
        }
        let (near, far, through_cap) = self.cross_box(origin, direction, max_distance)?;
        let base = origin + direction * near;
        let span = far - near;
        let at = |u: f64| {
            let mut point = base + direction * (u * span);
            point.z = point.z.clamp(0.0, self.length);
            point
        };
        let inside = |u: f64| self.ellipse_sign(at(u)) < 0.0;
        if let Some(proximal) = through_cap
            && inside(0.0)
        {
            let (z, normal, region) = if proximal {
                (0.0, Vec3::NEG_Z, Region::ProximalCap)
            } else {
                (self.length, Vec3::Z, Region::DistalCap)
            };
            return Some(RayHit { distance: near, point: Vec3::new(base.x, base.y, z), normal, region });
        }
        let (turns, count) = turning_points(&self.level_along(base, direction * span));
        let mut start = 0.0;
        let mut was_inside = inside(0.0);
        for end in turns.into_iter().take(count).chain([1.0]) {
            let is_inside = inside(end);
            if is_inside && !was_inside {
                let u = bisect(start, end, inside);
                let point = at(u);
                return Some(RayHit {
                    distance: near + u * span,
                    point,
                    normal: self.normal_at(point),
                    region: Region::Side,
                });
            }
            (start, was_inside) = (end, is_inside);
        }
        None
    }

    /// Distances at which a ray of unit direction enters and leaves the box around the shape, meters from its origin; and whether
    /// it enters through a cap plane: `Some(true)` for the proximal one, `Some(false)` for the distal one. `None` when it misses.
    fn cross_box(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> Option<(f64, f64, Option<bool>)> {
        let (mut near, mut far) = (0.0, max_distance);
        let mut through_cap = None;
        // The box is enlarged laterally, so that F > 0 where the ray enters it through a side.
        let size = self.local_aabb().maxs * 1.001;
        for (axis, min, max) in [(0, -size.x, size.x), (1, -size.y, size.y), (2, 0.0, self.length)] {
            let (start, rate) = (origin[axis], direction[axis]);
            if rate == 0.0 {
                if start <= min || start >= max {
                    return None;
                }
                continue;
            }
            let (first, last) = if rate > 0.0 { (min, max) } else { (max, min) };
            let entry = (first - start) / rate;
            if entry >= near {
                near = entry;
                through_cap = (axis == 2).then_some(rate > 0.0);
            }
            far = f64::min(far, (last - start) / rate);
        }
        if near > far {
            return None;
        }
        Some((near, far, through_cap))
    }

    /// Outward normal at a point of the side.
    fn normal_at(&self, point: Vec3) -> Vec3 {
        let (a, b) = self.semi_axes(point.z);
        let angle = Angle::from_vector(point.x.abs() * b, point.y.abs() * a)
            .or(Angle::from_vector(point.x.abs(), point.y.abs()))
            .unwrap_or(Angle::ZERO);
        let normal = self.side_normal(angle, (point.z / self.length).clamp(0.0, 1.0));
        Vec3::new(normal.x.copysign(point.x), normal.y.copysign(point.y), normal.z)
    }

    /// The coefficients of `F` along `base + u step`.
    fn level_along(&self, base: Vec3, step: Vec3) -> Quartic {
        let rate = 1.0 / self.length;
        let (da, db) = ((self.a1 - self.a0) * rate, (self.b1 - self.b0) * rate);
        let a = [self.a0 + da * base.z, da * step.z];
        let b = [self.b0 + db * base.z, db * step.z];
        let product = |p: [f64; 2], q: [f64; 2]| [p[0] * q[0], p[0] * q[1] + p[1] * q[0], p[1] * q[1]];
        let mut level = [0.0; 5];
        for (part, sign) in
            [(product([base.x, step.x], b), 1.0), (product([base.y, step.y], a), 1.0), (product(a, b), -1.0)]
        {
            for (i, p) in part.into_iter().enumerate() {
                for (j, q) in part.into_iter().enumerate() {
                    level[i + j] += sign * p * q;
                }
            }
        }
        level
    }
}

fn value(polynomial: &Quartic, u: f64) -> f64 {
    polynomial.iter().rev().fold(0.0, |sum, c| sum * u + c)
}

fn derivative(polynomial: &Quartic) -> Quartic {
    let [_, c1, c2, c3, c4] = *polynomial;
    [c1, 2.0 * c2, 3.0 * c3, 4.0 * c4, 0.0]
}

/// The points in (0, 1), ascending, between which the polynomial is monotone.
fn turning_points(polynomial: &Quartic) -> ([f64; 3], usize) {
    let first = derivative(polynomial);
    let second = derivative(&first);
    let third = derivative(&second);
    // The third derivative is linear, so it changes sign at most once. Each derivative's roots split the intervals for the one
    // below.
    let mut roots = [0.0; 3];
    let mut count = 0;
    for function in [&third, &second, &first] {
        let knots = roots;
        let mut found = 0;
        let mut start = 0.0;
        for end in knots.into_iter().take(count).chain([1.0]) {
            let positive = value(function, start) > 0.0;
            if positive != (value(function, end) > 0.0) && found < 3 {
                roots[found] = bisect(start, end, |u| (value(function, u) > 0.0) != positive);
                found += 1;
            }
            start = end;
        }
        count = found;
    }
    (roots, count)
}

/// The end of the interval from `start` to `end` on which `after` is false; it must be true at `end`.
fn bisect(mut start: f64, mut end: f64, after: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = 0.5 * (start + end);
        if middle <= start || middle >= end || end - start < 1e-17 {
            return end;
        }
        if after(middle) {
            end = middle;
        } else {
            start = middle;
        }
    }
}
