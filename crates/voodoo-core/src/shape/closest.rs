//! The exact closest point: a safeguarded Newton iteration in θ, started from as many basins as the shape can have.

use super::ruling::{Angle, Foot};
use super::{RIM_NORMAL_DISTANCE, Region, SurfacePoint, TaperedEllipticCylinder};
use crate::math::Vec3;

/// Number of intervals of the scan over the quadrant.
const SCAN: usize = 16;
/// `cos(k π / 32)`, k = 0..=16; the sines are the same numbers backwards.
const COSINES: [f64; SCAN + 1] = [
    1.0,
    0.9951847266721969,
    0.9807852804032304,
    0.9569403357322088,
    0.9238795325112867,
    0.881921264348355,
    0.8314696123025452,
    0.773010453362737,
    std::f64::consts::FRAC_1_SQRT_2,
    0.6343932841636455,
    0.5555702330196022,
    0.4713967368259977,
    0.38268343236508984,
    0.29028467725446233,
    0.19509032201612825,
    0.09801714032956063,
    0.0,
];
/// Minimum ratio of the semi-axes for which the scan is stretched towards the sharp tips of an ellipse.
const SHARPEST: f64 = 1e-3;

/// Minimum ratio of `g''/2` to `|P_θ|²` at which a minimum counts as distinct; the ratio falls to 0 at the medial axis.
pub(super) const DISTINCT: f64 = 0.3;
/// Largest [`TaperedEllipticCylinder::aspect_change`] at which a distinct minimum is the only one.
pub(super) const ONE_BASIN: f64 = 0.05;

impl TaperedEllipticCylinder {
    /// The closest point of the closed surface to `q`, limb frame, meters.
    ///
    /// For a query folded to `x, y >= 0`, the closest point of the side minimizes `g(θ) = min_t |P(θ, t) - q|²` on a quadrant,
    /// where `g'(0) <= 0 <= g'(π/2)`. Newton's iteration, kept in a bracket by bisection, always ends in a minimum. `g` has only
    /// one minimum when `a0 b1 = a1 b0` and no end is nearly a tip, and also when these products differ little and the minimum is
    /// distinct. Otherwise a scan finds the basins first. The caps are compared where the query projects into them. Where several
    /// points are equally near (on the medial axis), one of them is returned.
    ///
    /// A query that is not finite gives a point and a distance that are NaN.
    pub fn closest_point(&self, q: Vec3) -> SurfacePoint {
        if !q.is_finite() {
            return SurfacePoint { point: Vec3::NAN, normal: Vec3::Z, signed_distance: f64::NAN, region: Region::Side };
        }
        self.nearest_face(q, self.closest_on_side(Vec3::new(q.x.abs(), q.y.abs(), q.z)))
    }

    /// The closest point, given the closest point of the side: a cap may be nearer.
    fn nearest_face(&self, q: Vec3, side: Foot) -> SurfacePoint {
        let mut squared = side.squared;
        let mut cap = None;
        for (z, a, b, region, normal) in [
            (0.0, self.a0, self.b0, Region::ProximalCap, Vec3::NEG_Z),
            (self.length, self.a1, self.b1, Region::DistalCap, Vec3::Z),
        ] {
            let within = (q.x * b).powi(2) + (q.y * a).powi(2) <= (a * b).powi(2);
            let height = (q.z - z).powi(2);
            if within && height <= squared && a > 0.0 && b > 0.0 {
                squared = height;
                cap = Some((Vec3::new(q.x, q.y, z), region, normal));
            }
        }
        let distance = squared.sqrt();
        let sign = if self.contains(q) { -1.0 } else { 1.0 };
        let signed_distance = sign * distance;
        if let Some((point, region, normal)) = cap {
            return SurfacePoint { point, normal, signed_distance, region };
        }
        let unfold = Vec3::new(1f64.copysign(q.x), 1f64.copysign(q.y), 1.0);
        let point = side.point * unfold;
        let side_normal = self.side_normal(side.angle, side.t) * unfold;
        let (region, cap_normal) = if side.t <= 0.0 {
            (Region::ProximalRim, Vec3::NEG_Z)
        } else if side.t >= 1.0 {
            (Region::DistalRim, Vec3::Z)
        } else {
            (Region::Side, side_normal)
        };
        let normal = if region == Region::Side {
            side_normal
        } else if distance > RIM_NORMAL_DISTANCE {
            (q - point) / signed_distance
        } else {
            (side_normal + cap_normal).normalize_or(cap_normal)
        };
        SurfacePoint { point, normal, signed_distance, region }
    }

    /// `|a0 b1 - a1 b0| / (a0 b1 + a1 b0)`: 0 when the two end ellipses have one aspect (the solid is convex), 1 at most.
    pub(super) fn aspect_change(&self) -> f64 {
        let (first, second) = (self.a0 * self.b1, self.a1 * self.b0);
        if first == second { 0.0 } else { (first - second).abs() / (first + second) }
    }

    /// Whether neither end is nearly a tip. All θ meet in a tip, so `g` has a plateau where the tip is nearest.
    pub(super) fn is_blunt(&self) -> bool {
        let (first, last) = (self.a0.max(self.b0), self.a1.max(self.b1));
        first.min(last) > 0.2 * first.max(last)
    }

    /// The closest point of the side with its rims, for a query with `x, y >= 0`.
    fn closest_on_side(&self, q: Vec3) -> Foot {
        let guessed = self.refine(Angle::ZERO, self.guess(q), Angle::RIGHT, q);
        let Angle { c, s } = guessed.angle;
        let (a, b) = self.semi_axes(guessed.t * self.length);
        let is_distinct = guessed.bend >= DISTINCT * ((a * s).powi(2) + (b * c).powi(2));
        let one_basin = self.aspect_change() <= ONE_BASIN && self.is_blunt();
        if one_basin && (self.aspect_change() < 1e-12 || is_distinct) {
            return guessed;
        }
        let mut best = self.scan(None, q).nearer(guessed);
        for (a, b) in [(self.a0, self.b0), (self.a1, self.b1)] {
            let ratio = a.min(b) / a.max(b).max(f64::MIN_POSITIVE);
            if ratio < 0.5 {
                // Equal steps in the normal's direction instead of θ: dense at the tips of a flat ellipse.
                let floor = SHARPEST * a.max(b);
                best = best.nearer(self.scan(Some(Angle { c: a.max(floor), s: b.max(floor) }), q));
            }
        }
        best
    }

    /// The best local minimum found from the angles φ, or `(stretch.c cos φ, stretch.s sin φ)`, φ in equal steps.
    fn scan(&self, stretch: Option<Angle>, q: Vec3) -> Foot {
        let feet: [Foot; SCAN + 1] = std::array::from_fn(|k| {
            let (c, s) = (COSINES[k], COSINES[SCAN - k]);
            let angle = match stretch {
                Some(stretch) => Angle::from_vector(c * stretch.c, s * stretch.s).unwrap_or(Angle::ZERO),
                None => Angle { c, s },
            };
            self.foot(angle, q)
        });
        let mut best = feet[0];
        for k in 0..=SCAN {
            let (before, after) = (feet[k.saturating_sub(1)], feet[(k + 1).min(SCAN)]);
            best = best.nearer(feet[k]);
            if before.squared.min(after.squared) >= feet[k].squared {
                best = best.nearer(self.refine(before.angle, feet[k].angle, after.angle, q));
            }
        }
        best
    }

    /// A starting angle: the direction `(x/a, y/b)` of the slice, then one step over the evolute of its ellipse.
    fn guess(&self, q: Vec3) -> Angle {
        // Excludes the ends, because a tip has no ellipse.
        let (a, b) = self.semi_axes(q.z.clamp(0.1 * self.length, 0.9 * self.length));
        let near = Angle::from_vector(q.x * b, q.y * a).unwrap_or(Angle { c: 0.8, s: 0.6 });
        let focus = a * a - b * b;
        let x = a * q.x - focus * near.c.powi(3);
        let y = b * q.y + focus * near.s.powi(3);
        let start = Angle::from_vector(x.max(0.0), y.max(0.0)).unwrap_or(near);
        // An end of the quadrant may be a maximum of g; start beside it.
        Angle::from_vector(start.c.max(1e-9), start.s.max(1e-9)).unwrap_or(near)
    }

    /// The minimum of `g` between two angles by Newton's iteration with bisection; returns the best foot found.
    fn refine(&self, mut low: Angle, start: Angle, mut high: Angle, q: Vec3) -> Foot {
        let scale = self.max_radius();
        let mut foot = self.foot(start, q);
        let mut best = foot;
        let mut last_step = f64::INFINITY;
        for _ in 0..120 {
            if foot.slope > 0.0 {
                high = foot.angle;
            } else {
                low = foot.angle;
            }
            let step = -foot.slope / foot.bend;
            let converging = foot.bend > 0.0 && step.abs() < 0.5 * last_step;
            if foot.slope == 0.0 && foot.bend >= 0.0
                || converging && step.abs() * scale < 1e-14
                || low.sine_to(high) * scale < 1e-15
            {
                break;
            }
            let mut next = foot.angle.turned(step);
            if !converging || low.sine_to(next) <= 0.0 || next.sine_to(high) <= 0.0 {
                next = low.middle(high);
                last_step = low.sine_to(high);
            } else {
                last_step = step.abs();
            }
            foot = self.foot(next, q);
            best = best.nearer(foot);
        }
        // Near the minimum g is flat to rounding; the last iterate has the better angle, so keep it unless it is worse.
        if foot.squared <= best.squared * (1.0 + 1e-12) { foot } else { best }
    }
}
