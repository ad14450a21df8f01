//! The contour of the side as observed by a camera, in closed form.
//!
//! With `a' = a1 - a0`, `b' = b1 - b0` and the camera's center `C` in the limb frame, the point `P(θ, t)` lies on the contour where
//! the ray touches the surface, `(P - C) · (P_θ × P_t) = 0`:
//! `L a b - L (b C_x cos θ + a C_y sin θ) + (C_z - L t) (a b' sin² θ + b a' cos² θ) = 0`.
//! Where both axes taper equally (`m = a'/a = b'/b`), `cos(θ - θ0) = (1 + m (C_z - L t) / L) / hypot(C_x / a, C_y / b)` with
//! `θ0 = atan2(C_y / b, C_x / a)`, which gives two straight lines. Otherwise this solution is the start of one Newton step.

use super::TaperedEllipticCylinder;
use crate::math::Vec3;

/// When the camera looks along the limb, the two lines meet. Above this cosine of their half angle, the contour is uncertain.
const ALONG: f64 = 0.98;
/// Tapers that differ by less than this count as equal.
const ALIKE: f64 = 1e-9;

impl TaperedEllipticCylinder {
    /// The two points of the contour at the fraction `t` of the length, observed from `camera` (limb frame, meters), each with the
    /// outward normal of the surface there, of any length above zero: the ray from the camera lies in the tangent plane. `None` if
    /// the camera looks along the limb or is inside it. The first point is on the side of smaller angles about the axis.
    pub(crate) fn contour(&self, t: f64, camera: Vec3) -> Option<[[Vec3; 2]; 2]> {
        let (da, db) = (self.a1 - self.a0, self.b1 - self.b0);
        let (a, b) = (self.a0 + t * da, self.b0 + t * db);
        if a.min(b) < super::MIN_SIZE {
            return None;
        }
        let ahead = camera.z / self.length - t;
        let (x, y) = (camera.x / a, camera.y / b);
        let across = (x * x + y * y).sqrt();
        let cosine = (1.0 + 0.5 * (da / a + db / b) * ahead) / across;
        if !(cosine.abs() <= ALONG) {
            return None;
        }
        let sine = (1.0 - cosine * cosine).sqrt();
        let (x, y) = (x / across, y / across);
        let exact = (da * b - db * a).abs() < ALIKE;
        Some([-sine, sine].map(|sine| {
            // Cosine and sine of θ0 -+ the half angle.
            let (mut c, mut s) = (x * cosine - y * sine, y * cosine + x * sine);
            if !exact {
                let value = a * b - (b * camera.x * c + a * camera.y * s) + ahead * (a * db * s * s + b * da * c * c);
                let slope = b * camera.x * s - a * camera.y * c + 2.0 * ahead * s * c * (a * db - b * da);
                let step = -value / slope;
                let norm = (1.0 + step * step).sqrt();
                (c, s) = ((c - step * s) / norm, (s + step * c) / norm);
            }
            [Vec3::new(a * c, b * s, t * self.length), self.side_cross([a, b], [c, s])]
        }))
    }

    /// The point of an end's rim at an angle given by its cosine and sine, and the direction of the rim there. `None` unless the
    /// point is on the contour observed from `camera` (limb frame, meters): one of the two adjacent faces is visible, the other
    /// is not.
    pub(crate) fn rim_contour(&self, distal: bool, [c, s]: [f64; 2], camera: Vec3) -> Option<[Vec3; 2]> {
        let (a, b, z) = if distal { (self.a1, self.b1, self.length) } else { (self.a0, self.b0, 0.0) };
        let point = Vec3::new(a * c, b * s, z);
        let side = self.side_cross([a, b], [c, s]);
        let cap = if distal { camera.z > z } else { camera.z < z };
        ((side.dot(camera - point) > 0.0) != cap).then_some([point, Vec3::new(-a * s, b * c, 0.0)])
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    prop_compose! {
        /// A limb whose aspect changes by up to 15 % and whose side is at most 45 degrees steep, and a camera beside it.
        fn limb_and_camera()(length in 0.1..0.6, a0 in 0.03..0.2, aspect in 0.6..1.6, taper in 0.6..1.5, change in 0.85..1.15, away in 1.5..6.0, round in 0.0..std::f64::consts::TAU, rise in -0.6..0.6)
            -> (TaperedEllipticCylinder, Vec3) {
            let (b0, a1, b1) = (a0 * aspect, a0 * taper, a0 * aspect * taper * change);
            let length = f64::max(length, f64::max(f64::abs(a1 - a0), f64::abs(b1 - b0)));
            let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1).unwrap();
            let (sin, cos) = f64::sin_cos(round);
            (shape, Vec3::new(away * cos, away * sin, 0.5 * length + rise * away))
        }
    }

    /// Bound of the angle between a ray through a point of the contour and the tangent plane there, as a sine: the error after
    /// one Newton step.
    ///
    /// With `f(θ)` the equation of the contour divided by `a b`, `u = |a'/a - b'/b| |C_z - L t| / L` the difference of the
    /// tapers, and the start at the solution for equal tapers: `f <= u / 2` there and `|f'| >= across sine - u`, so that the step
    /// is at most `h` long and leaves `max|f''| h² / 2`. The step is the tangent of an angle, which is shorter than it by
    /// `h³ / 3`. `None`: no bound for the step.
    fn newton_leaves(shape: &TaperedEllipticCylinder, t: f64, camera: Vec3, away: f64) -> Option<f64> {
        let (da, db) = (shape.a1 - shape.a0, shape.b1 - shape.b0);
        let (a, b) = (shape.a0 + t * da, shape.b0 + t * db);
        let ahead = camera.z / shape.length - t;
        let (across, varied) = ((camera.x / a).hypot(camera.y / b), ((da / a - db / b) * ahead).abs());
        let cosine = ((1.0 + 0.5 * (da / a + db / b) * ahead) / across).abs();
        let slope = across * (1.0 - cosine * cosine).sqrt() - varied;
        let h = 0.5 * varied / slope;
        let bent = across * (cosine + h) + 2.0 * varied;
        // With equal tapers there is no step.
        let exact = (da * b - db * a).abs() < ALIKE;
        let left = if exact { 0.5 * varied } else { 0.5 * bent * h * h + (across + varied) * h * h * h / 3.0 };
        (slope > 0.0).then(|| left * a.max(b) / away + 1e-12)
    }

    /// A test oracle independent of the formula: a ray slightly outside the contour's point misses the limb, and one slightly
    /// inside hits it. At mid-height the end caps do not interfere.
    fn check(shape: &TaperedEllipticCylinder, t: f64, camera: Vec3) -> Result<(), TestCaseError> {
        let Some(points) = shape.contour(t, camera) else { return Ok(()) };
        for [point, normal] in points {
            let normal = normal.normalize();
            let away = (point - camera).length();
            let aslant = (point - camera).dot(normal).abs() / away;
            let Some(most) = newton_leaves(shape, t, camera, away) else { continue };
            prop_assert!(aslant <= most, "the ray meets the surface at {aslant}, more than {most}");
            let passes = |off: f64| {
                let towards = (point + off * normal - camera).normalize();
                shape.cast_ray(camera, towards).is_none()
            };
            // On a cone observed obliquely the ray may still touch nearer the thick end: a saddle is no wider than this.
            prop_assert!(!passes(-5e-4), "inside");
            prop_assert!(passes(5e-4), "outside");
        }
        Ok(())
    }

    #[test]
    fn a_steep_cone_whose_axes_taper_unalike_has_its_contour() {
        let shape = TaperedEllipticCylinder::new(0.1, 0.196, 0.277, 0.117, 0.141).unwrap();
        check(&shape, 0.3, Vec3::new(-0.442, 1.433, -0.776)).unwrap();
    }

    proptest! {
        #[test]
        fn rays_just_outside_the_contour_miss_the_limb_and_those_just_inside_hit_it((shape, camera) in limb_and_camera(), t in 0.3..0.7) {
            check(&shape, t, camera)?;
        }

        #[test]
        fn the_points_lie_on_the_surface_to_both_sides((shape, camera) in limb_and_camera(), t in 0.0..1.0) {
            let Some([first, second]) = shape.contour(t, camera) else { return Ok(()) };
            for [point, _] in [first, second] {
                prop_assert!(shape.closest_point(point).signed_distance.abs() < 1e-9);
            }
            let across = |point: Vec3| camera.x * point.y - camera.y * point.x;
            prop_assert!(across(first[0]) < 0.0 && across(second[0]) > 0.0);
        }
    }

    #[test]
    fn a_camera_along_a_limb_or_inside_it_has_no_side_lines_but_a_rim() {
        let shape = TaperedEllipticCylinder::new(0.4, 0.06, 0.05, 0.05, 0.04).unwrap();
        assert_eq!(shape.contour(0.5, Vec3::new(0.01, 0.0, 3.0)), None);
        assert_eq!(shape.contour(0.5, Vec3::new(0.0, 0.0, 0.2)), None);
        let rim = |camera: Vec3, distal| {
            let limb_and_camera = |k: usize| {
                let (s, c) = f64::sin_cos(k as f64 * std::f64::consts::FRAC_PI_4);
                shape.rim_contour(distal, [c, s], camera).is_some()
            };
            (0..8).filter(|k| limb_and_camera(*k)).count()
        };
        // From the side, half of each rim bounds the image; from the axis direction all of the nearer rim does, because the sides
        // are hidden.
        assert_eq!((rim(Vec3::new(3.0, 0.1, 0.2), true), rim(Vec3::new(3.0, 0.1, 0.2), false)), (4, 4));
        assert_eq!(rim(Vec3::new(0.0, 0.0, 0.41), true), 8);
    }
}
