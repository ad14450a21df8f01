//! The iteration of `closest` for several queries side by side: the queries of a batch that single precision does not settle.
//!
//! Every lane does the same operations as [`TaperedEllipticCylinder::refine`], so the result is bit-identical.

use super::ruling::{Angle, Foot};
use super::{SurfacePoint, TaperedEllipticCylinder};
use crate::math::{LANES, Vec3, widest};

type Lanes = [f64; LANES];

/// One [`Foot`] per lane.
#[derive(Clone, Copy)]
struct Feet {
    angle: [Lanes; 2],
    t: Lanes,
    point: [Lanes; 3],
    squared: Lanes,
    slope: Lanes,
    bend: Lanes,
}

impl Feet {
    const ZERO: Self = Self {
        angle: [[0.0; LANES]; 2],
        t: [0.0; LANES],
        point: [[0.0; LANES]; 3],
        squared: [0.0; LANES],
        slope: [0.0; LANES],
        bend: [0.0; LANES],
    };

    /// Replaces one lane if `replace`.
    #[inline(always)]
    fn set(&mut self, lane: usize, replace: bool, foot: &Foot) {
        let put = |slot: &mut f64, value: f64| *slot = if replace { value } else { *slot };
        put(&mut self.angle[0][lane], foot.angle.c);
        put(&mut self.angle[1][lane], foot.angle.s);
        put(&mut self.t[lane], foot.t);
        put(&mut self.point[0][lane], foot.point.x);
        put(&mut self.point[1][lane], foot.point.y);
        put(&mut self.point[2][lane], foot.point.z);
        put(&mut self.squared[lane], foot.squared);
        put(&mut self.slope[lane], foot.slope);
        put(&mut self.bend[lane], foot.bend);
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> Foot {
        Foot {
            angle: Angle { c: self.angle[0][lane], s: self.angle[1][lane] },
            t: self.t[lane],
            point: Vec3::new(self.point[0][lane], self.point[1][lane], self.point[2][lane]),
            squared: self.squared[lane],
            slope: self.slope[lane],
            bend: self.bend[lane],
        }
    }
}

impl TaperedEllipticCylinder {
    /// [`Self::closest_point`] for all queries (at most [`LANES`]), for a shape whose end ellipses differ little, limb frame.
    pub(super) fn closest_points_in_one_basin(&self, queries: &[Vec3], mut found: impl FnMut(usize, SurfacePoint)) {
        // Unused lanes repeat the first query, so they never take longer than the used ones.
        let Some(first) = queries.first() else { return };
        let mut folded = [super::closest::folded(*first); LANES];
        for (folded, query) in folded.iter_mut().zip(queries) {
            *folded = super::closest::folded(*query);
        }
        let guessed = widest(
            #[inline(always)]
            || self.refine_lanes(&folded.map(|query| self.guess(query)), &folded),
        );
        for (lane, query) in queries.iter().enumerate() {
            found(lane, self.settled(*query, guessed.get(lane)));
        }
    }

    /// The minimum of `g` in the quadrant, for every lane.
    #[inline(always)]
    fn refine_lanes(&self, start: &[Angle; LANES], queries: &[Vec3; LANES]) -> Feet {
        let scale = self.a0.max(self.a1).max(self.b0).max(self.b1);
        let [x, y, z] = [0, 1, 2].map(|axis| queries.map(|query| query[axis]));
        let mut feet = Feet::ZERO;
        for lane in 0..LANES {
            feet.set(lane, true, &self.foot(start[lane], Vec3::new(x[lane], y[lane], z[lane])));
        }
        let mut best = feet;
        let (mut low, mut high) = ([[1.0; LANES], [0.0; LANES]], [[0.0; LANES], [1.0; LANES]]);
        let mut last_step = [f64::INFINITY; LANES];
        let mut open = [true; LANES];
        for _ in 0..120 {
            for lane in 0..LANES {
                let foot = feet.get(lane);
                let beyond = foot.slope > 0.0;
                for part in 0..2 {
                    let here = feet.angle[part][lane];
                    high[part][lane] = if beyond { here } else { high[part][lane] };
                    low[part][lane] = if beyond { low[part][lane] } else { here };
                }
                let from = Angle { c: low[0][lane], s: low[1][lane] };
                let to = Angle { c: high[0][lane], s: high[1][lane] };
                let step = -foot.slope / foot.bend;
                let converging = (foot.bend > 0.0) & (step.abs() < 0.5 * last_step[lane]);
                let ended = (foot.slope == 0.0) & (foot.bend >= 0.0)
                    | converging & (step.abs() * scale < 1e-14)
                    | (from.sine_to(to) * scale < 1e-15);
                open[lane] &= !ended;
                let next = foot.angle.turned(step);
                let bisected = !converging | (from.sine_to(next) <= 0.0) | (next.sine_to(to) <= 0.0);
                let middle = from.middle(to);
                let next =
                    Angle { c: if bisected { middle.c } else { next.c }, s: if bisected { middle.s } else { next.s } };
                last_step[lane] = if bisected { from.sine_to(to) } else { step.abs() };
                let foot = self.foot(next, Vec3::new(x[lane], y[lane], z[lane]));
                let better = open[lane] & (foot.squared < best.squared[lane]);
                feet.set(lane, open[lane], &foot);
                best.set(lane, better, &foot);
            }
            if open.iter().fold(0, |any, open| any | u8::from(*open)) == 0 {
                break;
            }
        }
        for lane in 0..LANES {
            let flat = feet.squared[lane] <= best.squared[lane] * (1.0 + 1e-12);
            best.set(lane, flat, &feet.get(lane));
        }
        best
    }
}
