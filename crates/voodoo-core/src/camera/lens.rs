//! Lens models: distortion of directions and its inverse.
//!
//! All functions use normalized coordinates, those of a camera with focal length one: `(x/z, y/z)` of a point, and their
//! distorted position. The formulas and the order of coefficients are those of OpenCV (documentation of `calib3d` and of
//! `fisheye`).

use crate::error::Unexpected;

/// The distortion model of a lens, with its coefficients.
///
/// ```
/// use voodoo_core::Lens;
///
/// let lens = Lens::from_model("plumb_bob", &[-0.25, 0.08, 0.001, -0.002])?; // as in a CameraInfo of ROS
/// assert_eq!(lens, Lens::PlumbBob([-0.25, 0.08, 0.001, -0.002, 0.0]));
/// assert_eq!(Lens::from_model("plumb_bob", &[0.0; 5])?, Lens::Pinhole);
/// # Ok::<(), voodoo_core::Unexpected>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Lens {
    /// No distortion.
    #[default]
    Pinhole,
    /// Brown-Conrady: `k1 k2 p1 p2 k3`.
    PlumbBob([f64; 5]),
    /// Brown-Conrady with a denominator, thin prism and tilted sensor: `k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty`.
    Rational([f64; 14]),
    /// Kannala-Brandt on the angle to the optical axis: `k1 k2 k3 k4`. With all zero it is the equidistant lens, not a pinhole.
    Fisheye([f64; 4]),
    /// Brown-Conrady from distorted to undistorted coordinates, as RealSense calibrates its color cameras: `k1 k2 p1 p2 k3`.
    InversePlumbBob([f64; 5]),
}

/// Maximum number of Newton iterations; approximately ten are needed near the border of a lens's domain, three elsewhere.
const NEWTON_STEPS: usize = 60;
/// Minimum fraction to which a step is halved.
const LEAST_FRACTION: f64 = 1e-4;
/// Error below which an inverse counts as found: a millionth of a pixel at a focal length of 1e6 pixels, for coordinates up to
/// one.
const ACCEPTED: f64 = 1e-12;
/// Margin of rays inside the domain, as a factor of its squared radius: they are still inside when rounded to single precision.
const INSIDE: f64 = 1.0 - 1e-6;

impl Lens {
    /// The lens of a `sensor_msgs/CameraInfo`: its `distortion_model` and `d`. Missing trailing coefficients are zero.
    ///
    /// Supported are `plumb_bob` (0, 4 or 5 coefficients), `rational_polynomial` (0, 8, 12 or 14), `equidistant` (0 or 4), and
    /// `inverse_plumb_bob` (0, 4 or 5). Polynomials whose coefficients are all zero give a pinhole.
    ///
    /// # Errors
    /// [`Unexpected`] when the model is unknown or the number of coefficients does not fit it.
    pub fn from_model(model: &str, coefficients: &[f64]) -> Result<Self, Unexpected> {
        let (counts, expected, lens): (&[usize], &'static str, Self) = match model {
            "plumb_bob" => (&[0, 4, 5], "0, 4 or 5 coefficients", Self::PlumbBob(padded(coefficients))),
            "inverse_plumb_bob" => (&[0, 4, 5], "0, 4 or 5 coefficients", Self::InversePlumbBob(padded(coefficients))),
            "rational_polynomial" => {
                (&[0, 8, 12, 14], "0, 8, 12 or 14 coefficients", Self::Rational(padded(coefficients)))
            }
            "equidistant" => (&[0, 4], "0 or 4 coefficients", Self::Fisheye(padded(coefficients))),
            _ => {
                let expected = "plumb_bob, rational_polynomial, equidistant or inverse_plumb_bob";
                return Err(Unexpected::new("camera model", expected, format_args!("{model:?}")));
            }
        };
        let found = format_args!("{} for {model}: {coefficients:?}", coefficients.len());
        Unexpected::unless(counts.contains(&coefficients.len()), "camera distortion", expected, found)?;
        let straight = coefficients.iter().all(|value| *value == 0.0) && model != "equidistant";
        Ok(if straight { Self::Pinhole } else { lens })
    }

    /// The `distortion_model` that [`Lens::from_model`] accepts for this lens.
    pub fn model(&self) -> &'static str {
        match self {
            Self::Pinhole | Self::PlumbBob(_) => "plumb_bob",
            Self::Rational(_) => "rational_polynomial",
            Self::Fisheye(_) => "equidistant",
            Self::InversePlumbBob(_) => "inverse_plumb_bob",
        }
    }

    /// The coefficients.
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::Pinhole => &[],
            Self::PlumbBob(k) | Self::InversePlumbBob(k) => k,
            Self::Rational(k) => k,
            Self::Fisheye(k) => k,
        }
    }

    /// Square of the radius up to which the radial part grows with the radius: beyond it, two directions have the same image. The
    /// radius is in undistorted coordinates, for [`Lens::InversePlumbBob`] in distorted ones.
    pub(super) fn domain(&self) -> f64 {
        match self {
            Self::Pinhole => f64::INFINITY,
            Self::PlumbBob(k) | Self::InversePlumbBob(k) => polynomial_domain(k),
            Self::Rational(k) => polynomial_domain(k),
            Self::Fisheye([k1, k2, k3, k4]) => {
                let squared_angle = first_root(&[1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3, 9.0 * k4]);
                let angle = squared_angle.sqrt();
                if angle < std::f64::consts::FRAC_PI_2 { angle.tan() * angle.tan() } else { f64::INFINITY }
            }
        }
    }

    /// Distorts `(x/z, y/z)`; `None` outside of its domain.
    #[inline(never)]
    pub(super) fn distorted(&self, at: [f64; 2], domain: f64) -> Option<[f64; 2]> {
        let within = at[0] * at[0] + at[1] * at[1] <= domain;
        match self {
            Self::Pinhole => Some(at),
            Self::PlumbBob(k) => within.then(|| bend(k, at)),
            Self::Rational(k) => within.then(|| bend(k, at)),
            Self::Fisheye(k) => within.then(|| fisheye(k, at)),
            Self::InversePlumbBob(k) => unbend(k, at, domain),
        }
    }

    /// Inverts the distortion; `None` for positions outside the image of the domain.
    pub(super) fn undistorted(&self, at: [f64; 2], domain: f64) -> Option<[f64; 2]> {
        match self {
            Self::Pinhole => Some(at),
            Self::PlumbBob(k) => unbend(k, at, INSIDE * domain),
            Self::Rational(k) => unbend(k, at, INSIDE * domain),
            Self::Fisheye(k) => fisheye_inverse(k, at, INSIDE * domain),
            Self::InversePlumbBob(k) => {
                (at[0] * at[0] + at[1] * at[1] <= INSIDE * domain).then(|| bend(k, at)).filter(|_| grows(k, at))
            }
        }
    }

    /// Jacobian of [`Lens::distorted`], row by row.
    pub(super) fn derivative(&self, at: [f64; 2], domain: f64) -> Option<[[f64; 2]; 2]> {
        let within = at[0] * at[0] + at[1] * at[1] <= domain;
        match self {
            Self::Pinhole => Some([[1.0, 0.0], [0.0, 1.0]]),
            Self::PlumbBob(k) => within.then(|| bend_derivative(k, at)),
            Self::Rational(k) => within.then(|| bend_derivative(k, at)),
            Self::Fisheye(k) => within.then(|| fisheye_derivative(k, at)),
            Self::InversePlumbBob(k) => {
                let [[a, b], [c, d]] = bend_derivative(k, unbend(k, at, domain)?);
                let determinant = a * d - b * c;
                Some([[d / determinant, -b / determinant], [-c / determinant, a / determinant]])
            }
        }
    }
}

fn padded<const N: usize>(coefficients: &[f64]) -> [f64; N] {
    std::array::from_fn(|index| coefficients.get(index).copied().unwrap_or(0.0))
}

/// A coefficient, zero where a shorter model has none.
#[inline(always)]
fn term<const N: usize>(k: &[f64; N], index: usize) -> f64 {
    if index < N { k[index] } else { 0.0 }
}

/// Evaluates the polynomial models.
#[inline]
fn bend<const N: usize>(k: &[f64; N], [x, y]: [f64; 2]) -> [f64; 2] {
    let r2 = x * x + y * y;
    let (r4, r6) = (r2 * r2, r2 * r2 * r2);
    let (a1, a2, a3) = (2.0 * x * y, r2 + 2.0 * x * x, r2 + 2.0 * y * y);
    let upper = 1.0 + k[0] * r2 + k[1] * r4 + k[4] * r6;
    let (mut u, mut v) = (x * upper, y * upper);
    if N > 5 {
        let lower = 1.0 / (1.0 + term(k, 5) * r2 + term(k, 6) * r4 + term(k, 7) * r6);
        (u, v) = (x * upper * lower, y * upper * lower);
    }
    (u, v) = (u + k[2] * a1 + k[3] * a2, v + k[2] * a3 + k[3] * a1);
    if N > 8 {
        u = u + term(k, 8) * r2 + term(k, 9) * r4;
        v = v + term(k, 10) * r2 + term(k, 11) * r4;
    }
    match tilt(k) {
        Some(tilt) => {
            let [u, v, w] = tilt.map(|row| row[0] * u + row[1] * v + row[2]);
            [u / w, v / w]
        }
        None => [u, v],
    }
}

/// Jacobian of [`bend`].
fn bend_derivative<const N: usize>(k: &[f64; N], [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
    let r2 = x * x + y * y;
    let [upper, upper_slope] = cubic([k[0], k[1], k[4]], r2);
    let [lower, lower_slope] = cubic([term(k, 5), term(k, 6), term(k, 7)], r2);
    let (radial, slope) = (upper / lower, (upper_slope * lower - upper * lower_slope) / (lower * lower));
    let (p1, p2) = (k[2], k[3]);
    let prism = [8, 10].map(|first| 2.0 * (term(k, first) + 2.0 * term(k, first + 1) * r2));
    let shared = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
    let mut rows = [
        [radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + prism[0] * x, shared + prism[0] * y],
        [shared + prism[1] * x, radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + prism[1] * y],
    ];
    if let Some(tilt) = tilt(k) {
        let mut flat = *k;
        (flat[N - 2], flat[N - 1]) = (0.0, 0.0);
        let [u, v] = bend(&flat, [x, y]);
        let [image_x, image_y, w] = tilt.map(|row| row[0] * u + row[1] * v + row[2]);
        let [by_x, by_y] = [0, 1].map(|axis| tilt.map(|row| row[0] * rows[0][axis] + row[1] * rows[1][axis]));
        let of = |observed: f64, coordinate: usize| [by_x, by_y].map(|by| (by[coordinate] - observed / w * by[2]) / w);
        rows = [of(image_x, 0), of(image_y, 1)];
    }
    rows
}

/// `1 + a s + b s^2 + c s^3` and its derivative.
fn cubic([a, b, c]: [f64; 3], s: f64) -> [f64; 2] {
    [1.0 + s * (a + s * (b + s * c)), a + s * (2.0 * b + 3.0 * s * c)]
}

/// The homography of a tilted sensor; `None` without tilt.
fn tilt<const N: usize>(k: &[f64; N]) -> Option<[[f64; 3]; 3]> {
    let (tx, ty) = (term(k, 12), term(k, 13));
    if tx == 0.0 && ty == 0.0 {
        return None;
    }
    let ((sx, cx), (sy, cy)) = (tx.sin_cos(), ty.sin_cos());
    // Rotated about x, then about y, and projected back onto the plane at z = 1.
    let turn = [[cy, sy * sx, -sy * cx], [0.0, cx, sx], [sy, -cy * sx, cy * cx]];
    let depth = turn[2][2];
    let row = |axis: usize| [0, 1, 2].map(|column| depth * turn[axis][column] - turn[axis][2] * turn[2][column]);
    Some([row(0), row(1), turn[2]])
}

/// Whether the mapping preserves orientation at a point.
fn grows<const N: usize>(k: &[f64; N], at: [f64; 2]) -> bool {
    let [[a, b], [c, d]] = bend_derivative(k, at);
    a > 0.0 && a * d - b * c > 0.0
}

/// The point within the domain that [`bend`] maps to `target`: Newton's method starting at `target`, with steps that are halved
/// until they reduce the error and stay within the domain.
fn unbend<const N: usize>(k: &[f64; N], target: [f64; 2], domain: f64) -> Option<[f64; 2]> {
    let square = target[0] * target[0] + target[1] * target[1];
    if !square.is_finite() {
        return None;
    }
    let inside = 0.9 * domain;
    let shrink = if square > inside { (inside / square).sqrt() } else { 1.0 };
    let mut at = target.map(|value| shrink * value);
    let miss = |at: [f64; 2]| {
        let [x, y] = bend(k, at);
        [x - target[0], y - target[1]]
    };
    let size = |off: [f64; 2]| off[0].hypot(off[1]);
    let mut off = miss(at);
    'newton: for _ in 0..NEWTON_STEPS {
        let [[a, b], [c, d]] = bend_derivative(k, at);
        let determinant = a * d - b * c;
        let step = [(d * off[0] - b * off[1]) / determinant, (a * off[1] - c * off[0]) / determinant];
        let mut fraction = 1.0;
        while fraction > LEAST_FRACTION {
            let next = [at[0] - fraction * step[0], at[1] - fraction * step[1]];
            let left = miss(next);
            if next[0] * next[0] + next[1] * next[1] <= domain && size(left) < size(off) {
                (at, off) = (next, left);
                continue 'newton;
            }
            fraction *= 0.5;
        }
        break;
    }
    (size(off) <= ACCEPTED * (1.0 + square.sqrt()) && grows(k, at)).then_some(at)
}

/// Square of the radius up to which the radial part of a polynomial model grows and its denominator is positive.
fn polynomial_domain<const N: usize>(k: &[f64; N]) -> f64 {
    let upper = [1.0, k[0], k[1], k[4]];
    let lower = [1.0, term(k, 5), term(k, 6), term(k, 7)];
    // The numerator of the derivative of r U(s) / L(s) with respect to r, where s = r^2: U L + 2 s (U' L - U L').
    let mut growth = [0.0; 7];
    for (i, u) in upper.iter().enumerate() {
        for (j, l) in lower.iter().enumerate() {
            growth[i + j] += (1.0 + 2.0 * (i as f64 - j as f64)) * u * l;
        }
    }
    first_root(&growth).min(first_root(&lower))
}

/// The smallest positive root of a polynomial (constant term first) that is positive at zero; infinite without one.
fn first_root(polynomial: &[f64]) -> f64 {
    positive_roots(polynomial).first().copied().unwrap_or(f64::INFINITY)
}

/// The positive points where a polynomial changes its sign, ascending: at most one between neighboring roots of its derivative.
fn positive_roots(polynomial: &[f64]) -> Vec<f64> {
    /// Maximum squared radius for any lens: a direction one degree from the camera plane has a radius of 57.
    const LARGEST_SQUARED_RADIUS: f64 = 1e9;
    let Some(degree) = polynomial.iter().rposition(|value| *value != 0.0).filter(|degree| *degree > 0) else {
        return Vec::new();
    };
    let value = |s: f64| polynomial[..=degree].iter().rev().fold(0.0, |sum, factor| sum * s + factor);
    let derivative: Vec<f64> = (1..=degree).map(|power| power as f64 * polynomial[power]).collect();
    let mut edges = vec![0.0];
    edges.extend(positive_roots(&derivative));
    edges.push(LARGEST_SQUARED_RADIUS);
    let mut roots = Vec::new();
    for edge in edges.windows(2) {
        let (mut low, mut high) = (edge[0], edge[1]);
        let rising = value(low) < 0.0;
        if (value(high) < 0.0) == rising {
            continue;
        }
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if (value(middle) < 0.0) == rising {
                low = middle;
            } else {
                high = middle;
            }
        }
        roots.push(low);
    }
    roots
}

/// The angle in the image for an angle to the optical axis (Kannala and Brandt), and its derivative.
fn image_angle([k1, k2, k3, k4]: &[f64; 4], angle: f64) -> [f64; 2] {
    let s = angle * angle;
    let slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)));
    [angle * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))), slope]
}

#[inline]
fn fisheye(k: &[f64; 4], [x, y]: [f64; 2]) -> [f64; 2] {
    let r = (x * x + y * y).sqrt();
    let scale = if r > 1e-8 { image_angle(k, r.atan())[0] / r } else { 1.0 };
    [x * scale, y * scale]
}

fn fisheye_derivative(k: &[f64; 4], [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
    let square = x * x + y * y;
    let r = square.sqrt();
    if r <= 1e-8 {
        return [[1.0, 0.0], [0.0, 1.0]];
    }
    let [angle, slope] = image_angle(k, r.atan());
    let (across, along) = (angle / r, slope / (1.0 + square));
    let (cos, sin) = (x / r, y / r);
    let mixed = (along - across) * cos * sin;
    [[across + (along - across) * cos * cos, mixed], [mixed, across + (along - across) * sin * sin]]
}

/// Newton's method on the angle within a shrinking bracket: the angle in the image grows with it.
fn fisheye_inverse(k: &[f64; 4], at: [f64; 2], domain: f64) -> Option<[f64; 2]> {
    let target = at[0].hypot(at[1]);
    let (mut low, mut high) = (0.0, domain.sqrt().atan());
    if !(target <= image_angle(k, high)[0]) {
        return None;
    }
    if target < 1e-12 {
        return Some(at);
    }
    let mut angle = target.min(high);
    for _ in 0..NEWTON_STEPS {
        let [value, slope] = image_angle(k, angle);
        if value == target {
            break;
        }
        if value < target {
            low = angle
        } else {
            high = angle
        }
        let before = angle;
        let next = before - (value - target) / slope;
        angle = if next > low && next < high { next } else { 0.5 * (low + high) };
        if (angle - before).abs() <= f64::EPSILON * before {
            break;
        }
    }
    let scale = angle.tan() / target;
    (scale > 0.0 && scale.is_finite()).then(|| at.map(|value| value * scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_found_between_those_of_the_derivative() {
        // (1 - s)(2 - s)(5 - s), and a polynomial without a positive root.
        let found = positive_roots(&[10.0, -17.0, 8.0, -1.0]);
        assert!(found.len() == 3 && found.iter().zip([1.0, 2.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        assert_eq!(first_root(&[1.0, 3.0, 0.5]), f64::INFINITY);
        assert_eq!(first_root(&[1.0]), f64::INFINITY);
    }

    #[test]
    fn a_barrel_lens_folds_where_its_radius_stops_growing() {
        // r (1 - 0.3 r^2) is greatest at r^2 = 1 / 0.9.
        let lens = Lens::PlumbBob([-0.3, 0.0, 0.0, 0.0, 0.0]);
        let domain = lens.domain();
        assert!((domain - 1.0 / 0.9).abs() < 1e-12, "{domain}");
        assert!(lens.distorted([1.0, 0.0], domain).is_some() && lens.distorted([1.06, 0.0], domain).is_none());
        assert_eq!(lens.undistorted([0.71, 0.0], domain), None, "no direction falls there");
        assert_eq!(Lens::Fisheye([0.0; 4]).domain(), f64::INFINITY);
    }
}
