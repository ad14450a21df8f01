//! Ray casting against the closed surface.

use super::TaperedEllipticCylinder;
use crate::math::Vec3;

/// A polynomial of degree 4 at most, constant term first.
type Quartic = [f64; 5];

impl TaperedEllipticCylinder {
    /// Distance in meters at which a ray first passes from outside to inside, limb frame.
    ///
    /// `direction` need not be a unit vector. Returns `None` when the ray misses, only touches the surface, or is not finite. A
    /// ray that starts inside is followed out of the solid and may enter it again, because the solid is not convex.
    ///
    /// Between the cap planes the solid is `F = (x b)² + (y a)² - (a b)² < 0`; x, y, a and b are linear along the ray, so F is a
    /// quartic. The roots of each derivative are isolated by the roots of the next derivative. They divide the ray into intervals
    /// on which F is monotone. The first interval with a change from `F >= 0` to `F < 0` contains the hit, which is found by
    /// bisection. No root can be missed.
    ///
    /// ```
    /// use voodoo_core::TaperedEllipticCylinder;
    /// use voodoo_core::math::Vec3;
    ///
    /// let forearm = TaperedEllipticCylinder::new(0.25, 0.05, 0.05, 0.05, 0.05)?;
    /// let distance = forearm.cast_ray(Vec3::new(1.0, 0.0, 0.1), -Vec3::X).ok_or("no hit")?;
    /// assert!((distance - 0.95).abs() < 1e-9);
    /// assert_eq!(forearm.cast_ray(Vec3::new(1.0, 0.0, 0.3), -Vec3::X), None); // beyond the distal cap
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn cast_ray(&self, origin: Vec3, direction: Vec3) -> Option<f64> {
        let direction = direction.try_normalize()?;
        if !origin.is_finite() {
            return None;
        }
        let (near, far, through_cap) = self.cross_box(origin, direction)?;
        let base = origin + direction * near;
        let span = far - near;
        let at = |u: f64| {
            let mut point = base + direction * (u * span);
            point.z = point.z.clamp(0.0, self.length);
            point
        };
        let inside = |u: f64| self.ellipse_sign(at(u)) < 0.0;
        let mut was_inside = inside(0.0);
        if through_cap && was_inside {
            return Some(near);
        }
        let (turns, count) = turning_points(&self.level_along(base, direction * span));
        let mut start = 0.0;
        for end in turns.into_iter().take(count).chain([1.0]) {
            let is_inside = inside(end);
            if is_inside && !was_inside {
                return Some(near + bisect(start, end, inside) * span);
            }
            (start, was_inside) = (end, is_inside);
        }
        None
    }

    /// Distances at which a ray of unit direction enters and leaves the box around the shape, meters from its origin; and whether
    /// it enters through a cap plane. `None` when it misses.
    fn cross_box(&self, origin: Vec3, direction: Vec3) -> Option<(f64, f64, bool)> {
        let (mut near, mut far) = (0.0, f64::INFINITY);
        let mut through_cap = false;
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
                (near, through_cap) = (entry, axis == 2);
            }
            far = f64::min(far, (last - start) / rate);
        }
        (near <= far).then_some((near, far, through_cap))
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
