//! Independent oracles for the shape: written from the definition of the surface alone, by dense search.
#![allow(clippy::expect_used, dead_code)]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use voodoo_core::TaperedEllipticCylinder;
use voodoo_core::math::{Pose, Vec3};

/// Splitmix64: random numbers that are the same everywhere.
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn direction(&mut self) -> Vec3 {
        let (z, angle) = (self.within(-1.0, 1.0), self.within(0.0, TAU));
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * angle.cos(), r * angle.sin(), z)
    }

    pub(crate) fn pose(&mut self) -> Pose {
        let axis = self.direction() * self.within(0.0, PI);
        let translation = self.direction() * self.within(0.0, 4.0);
        Pose::new(translation, axis)
    }

    /// A query: near the surface, anywhere around, or on a plane of symmetry or the axis.
    pub(crate) fn query(&mut self, shape: &TaperedEllipticCylinder) -> Vec3 {
        let t = self.unit();
        let surface = side(shape, self.within(0.0, TAU), t);
        match (self.unit() * 8.0) as usize {
            0..=2 => surface + self.direction() * self.within(0.0, 0.05),
            3 => self.direction() * self.within(0.0, 1.5) + Vec3::Z * shape.length() * t,
            4 => Vec3::new(0.0, 0.0, self.within(-0.5, shape.length() + 0.5)),
            5 => surface * Vec3::new(0.0, self.within(0.0, 3.0), 1.0),
            6 => surface * Vec3::new(self.within(0.0, 3.0), 0.0, 1.0),
            _ => surface * Vec3::new(self.unit(), self.unit(), 1.0),
        }
    }
}

pub(crate) fn shape(sizes: [f64; 5]) -> TaperedEllipticCylinder {
    let [length, a0, b0, a1, b1] = sizes;
    TaperedEllipticCylinder::new(length, a0, b0, a1, b1).expect("a valid shape")
}

/// The limbs of a grown person, roughly.
pub(crate) fn limb_like() -> Vec<TaperedEllipticCylinder> {
    [
        [0.55, 0.16, 0.11, 0.19, 0.12],
        [0.22, 0.075, 0.095, 0.075, 0.095],
        [0.30, 0.06, 0.055, 0.045, 0.042],
        [0.25, 0.05, 0.045, 0.03, 0.027],
        [0.45, 0.09, 0.095, 0.06, 0.062],
        [0.42, 0.06, 0.065, 0.04, 0.042],
    ]
    .map(shape)
    .to_vec()
}

/// Degenerate and hostile shapes.
pub(crate) fn hostile() -> Vec<TaperedEllipticCylinder> {
    [
        [0.3, 0.1, 0.1, 0.1, 0.1],
        [0.3, 0.1, 0.1, 0.0, 0.0],
        [0.3, 0.0, 0.0, 0.1, 0.05],
        [0.3, 0.1, 0.08, 1e-9, 1e-9],
        [0.3, 0.1, 0.002, 0.1, 0.002],
        [0.3, 0.1, 0.001, 0.05, 0.002],
        [0.4, 0.15, 0.05, 0.05, 0.15],
        [0.4, 0.2, 0.01, 0.01, 0.2],
        [0.3, 0.1, 0.1, 0.0, 0.1],
        [0.3, 0.0, 0.1, 0.1, 0.0],
        [0.001, 0.1, 0.08, 0.12, 0.06],
        [1.0, 0.001, 0.001, 0.3, 0.2],
        [0.05, 0.02, 0.02, 0.3, 0.3],
        [1e-6, 1e-6, 1e-6, 1e-6, 1e-6],
    ]
    .map(shape)
    .to_vec()
}

/// Any shape: limb-like, prism, cone or with unrelated ends.
pub(crate) fn random_shape(random: &mut Random) -> TaperedEllipticCylinder {
    let length = random.within(0.02, 0.8);
    let mut axis = || 10f64.powf(random.within(-2.5, -0.6));
    let [a0, b0, a1, b1] = [axis(), axis(), axis(), axis()];
    match (random.unit() * 5.0) as usize {
        0 => shape([length, a0, b0, a0, b0]),
        1 => shape([length, a0, b0, 0.5 * a0, 0.5 * b0]),
        2 => shape([length, a0, b0, 0.0, 0.0]),
        3 => shape([length, a0, a0 * 0.8, a1, a1 * 0.75]),
        _ => shape([length, a0, b0, a1, b1]),
    }
}

/// `P(θ, t)` of the side.
pub(crate) fn side(shape: &TaperedEllipticCylinder, angle: f64, t: f64) -> Vec3 {
    let a = shape.a0() + (shape.a1() - shape.a0()) * t;
    let b = shape.b0() + (shape.b1() - shape.b0()) * t;
    Vec3::new(a * angle.cos(), b * angle.sin(), shape.length() * t)
}

/// A random point of the closed surface.
pub(crate) fn surface_point(shape: &TaperedEllipticCylinder, random: &mut Random) -> Vec3 {
    let (angle, t) = (random.within(0.0, TAU), random.unit());
    match (random.unit() * 4.0) as usize {
        0 => side(shape, angle, 0.0) * Vec3::new(t, t, 1.0),
        1 => side(shape, angle, 1.0) * Vec3::new(t, t, 1.0),
        _ => side(shape, angle, t),
    }
}

fn to_segment(q: Vec3, from: Vec3, to: Vec3) -> (f64, Vec3) {
    let t = ((q - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
    let point = from + (to - from) * t;
    (point.distance(q), point)
}

/// Distance to the segment of the side at `angle`, and its nearest point.
fn to_ruling(shape: &TaperedEllipticCylinder, q: Vec3, angle: f64) -> (f64, Vec3) {
    to_segment(q, side(shape, angle, 0.0), side(shape, angle, 1.0))
}

/// The closest point of the closed surface by dense search: every local minimum of a fine grid over the angle (uniform in θ
/// and uniform in the direction of the normal of either end) refined by ternary search, and the caps. Unsigned distance.
pub(crate) fn brute_force(shape: &TaperedEllipticCylinder, q: Vec3, grid: usize) -> (f64, Vec3) {
    // By symmetry the nearest point lies in the quadrant of the query.
    let fold = Vec3::new(1f64.copysign(q.x), 1f64.copysign(q.y), 1.0);
    let q = q * fold;
    let mut angles: Vec<f64> = Vec::new();
    let tips = [(1.0, 1.0), (shape.a0().max(1e-4), shape.b0().max(1e-4)), (shape.a1().max(1e-4), shape.b1().max(1e-4))];
    for (a, b) in tips {
        for k in 0..=grid {
            let phi = FRAC_PI_2 * k as f64 / grid as f64;
            angles.push((b * phi.sin()).atan2(a * phi.cos()));
        }
    }
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let distances: Vec<f64> = angles.iter().map(|&angle| to_ruling(shape, q, angle).0).collect();
    let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let mut best = (f64::INFINITY, Vec3::ZERO);
    let last = angles.len() - 1;
    for k in 0..=last {
        let (low, high) = (k.saturating_sub(1), (k + 1).min(last));
        let reach = (angles[high] - angles[low]) * shape.a0().max(shape.a1()).max(shape.b0()).max(shape.b1());
        if distances[k] > distances[low].min(distances[high]) || distances[k] > least + reach {
            continue;
        }
        let (mut from, mut to) = (angles[low], angles[high]);
        for _ in 0..80 {
            let (first, second) = (from + (to - from) / 3.0, to - (to - from) / 3.0);
            if to_ruling(shape, q, first).0 < to_ruling(shape, q, second).0 {
                to = second;
            } else {
                from = first;
            }
        }
        for angle in [angles[low], angles[k], angles[high], 0.5 * (from + to)] {
            let found = to_ruling(shape, q, angle);
            if found.0 < best.0 {
                best = found;
            }
        }
    }
    for (z, a, b) in [(0.0, shape.a0(), shape.b0()), (shape.length(), shape.a1(), shape.b1())] {
        let within = a > 0.0 && b > 0.0 && (q.x / a).powi(2) + (q.y / b).powi(2) <= 1.0;
        if within && (q.z - z).abs() < best.0 {
            best = ((q.z - z).abs(), Vec3::new(q.x, q.y, z));
        }
    }
    (best.0, best.1 * fold)
}

/// True strictly inside the solid, from the definition.
pub(crate) fn inside(shape: &TaperedEllipticCylinder, q: Vec3) -> bool {
    let t = q.z / shape.length();
    let a = shape.a0() + (shape.a1() - shape.a0()) * t;
    let b = shape.b0() + (shape.b1() - shape.b0()) * t;
    t > 0.0 && t < 1.0 && (q.x / a).powi(2) + (q.y / b).powi(2) < 1.0
}
