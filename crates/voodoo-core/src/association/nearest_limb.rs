//! The nearest-limb search of step 2 (K06 IV-B.2), for many points at once: the nearest of the limbs whose enlarged boxes
//! contain a point.
//!
//! The bounding box of a cluster of points gives a lower bound of the distance to every limb. Only limbs that can still be the
//! nearest of some point are evaluated point by point.

use super::buried::is_buried;
use crate::body::{Body, Limb};
use crate::math::{LANES, Pose, Vec3, refill, vectorized};
use crate::observation::clusters::{Bounds, CLUSTER, Cluster, Clusters};

/// The limb of a point that lies in no box.
pub(crate) const NONE: u32 = u32::MAX;
/// Squared distance of a point that lies outside a limb's box.
const OUTSIDE: f32 = f32::INFINITY;
/// Error of single precision in the position of a box, meters, and as a fraction of the coordinates it was computed from; bounds
/// are widened by this.
const SINGLE_PRECISION: (f32, f32) = (1e-4, 1e-6);

/// Minimum semi-axes, meters: near a pointed tip they become small, and their product is a divisor.
const THINNEST: f32 = 1e-4;

type LimbLanes = [f32; LANES];
type Squares = [f32; CLUSTER];

/// The limbs in their poses, and working memory.
#[derive(Debug, Default)]
pub(crate) struct NearestLimb {
    limbs: Vec<LimbBox>,
    /// Bounding spheres of the limbs.
    spheres: Vec<(Vec3, f64)>,
    groups: Vec<Group>,
    least: Vec<LimbLanes>,
    /// The limbs that were nearest to two points of each cluster in the last call: evaluated first, as they are probably nearest
    /// again.
    expected: Vec<[u32; 2]>,
}

impl NearestLimb {
    /// Sets the limb poses, with the boxes enlarged by `margin`. Limbs inside other limbs contain no point unless `buried`.
    pub(crate) fn place(&mut self, body: &Body, poses: &[Pose], margin: f64, buried: bool) {
        let limbs = || body.limbs().iter().zip(poses);
        refill(&mut self.limbs, limbs().map(|(limb, pose)| LimbBox::new(limb, pose, margin)));
        refill(&mut self.spheres, limbs().map(|(limb, pose)| limb.shape.sphere(pose)));
        for (index, limb) in self.limbs.iter_mut().enumerate().filter(|_| !buried) {
            if is_buried(body, poses, &self.spheres, index) {
                (limb.low, limb.high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            }
        }
        refill(&mut self.groups, self.limbs.chunks(LANES).map(Group::new));
    }

    /// Writes the nearest limb of every point, or [`NONE`], to `nearest`.
    pub(crate) fn find(&mut self, clusters: &Clusters, nearest: &mut [u32]) {
        self.least.resize(self.groups.len(), [OUTSIDE; LANES]);
        self.expected.resize(clusters.iter().len(), [0; 2]);
        vectorized!({
            for (index, cluster) in clusters.iter().enumerate() {
                let found = self.find_cluster(index, &cluster);
                for (which, limb) in cluster.which.iter().zip(found) {
                    nearest[*which as usize] = limb;
                }
            }
        });
    }

    /// The limbs whose boxes contain a point.
    pub(crate) fn around(&self, [x, y, z]: [f32; 3]) -> impl Iterator<Item = usize> {
        self.limbs.iter().enumerate().filter(move |(_, limb)| limb.holds(limb.local(x, y, z))).map(|(index, _)| index)
    }

    #[inline(always)]
    fn find_cluster(&mut self, index: usize, cluster: &Cluster) -> [u32; CLUSTER] {
        let Self { limbs, groups, least, expected, .. } = self;
        for (least, group) in least.iter_mut().zip(groups) {
            *least = group.least_squares(cluster.bounds);
        }
        let mut best = Best { limb: [NONE; CLUSTER], square: [OUTSIDE; CLUSTER] };
        // The distances to the expected limbs decide which others must be evaluated. After a reset there may be fewer limbs.
        let [first, second] = expected[index].map(|limb| (limb as usize).min(limbs.len() - 1));
        best.offer(first as u32, &limbs[first].squares(cluster));
        if second != first {
            best.offer(second as u32, &limbs[second].squares(cluster));
        }
        for (start, least) in (0..).step_by(LANES).zip(least.iter()) {
            let mut remaining = within(least, best.worst());
            for limb in [first, second] {
                remaining &= !(1_u32.checked_shl((limb as u32).wrapping_sub(start)).unwrap_or(0));
            }
            while remaining != 0 {
                let limb = start + remaining.trailing_zeros();
                best.offer(limb, &limbs[limb as usize].squares(cluster));
                remaining &= remaining - 1;
                if remaining != 0 {
                    // The bound may now exclude some of the remaining limbs.
                    remaining &= within(least, best.worst());
                }
            }
        }
        let middle = best.limb[CLUSTER / 2];
        if middle != NONE {
            // A different limb at one end of the cluster, if there is one.
            let other = if best.limb[0] == middle { best.limb[CLUSTER - 1] } else { best.limb[0] };
            expected[index] = [middle, if other == NONE { middle } else { other }];
        }
        best.limb
    }
}

/// The greater one of two numbers, as one instruction.
#[inline(always)]
fn at_least(value: f32, least: f32) -> f32 {
    if value > least { value } else { least }
}

/// Bit mask of the values that are at most `worst`; [`OUTSIDE`] never is.
#[inline(always)]
fn within(values: &LimbLanes, worst: f32) -> u32 {
    let mut bits = 0;
    for lane in 0..LANES {
        bits |= u32::from(values[lane] <= worst) << lane;
    }
    bits
}

/// The nearest limb of every point so far; the first one when two are equally near.
struct Best {
    limb: [u32; CLUSTER],
    square: Squares,
}

impl Best {
    #[inline(always)]
    fn offer(&mut self, limb: u32, square: &Squares) {
        for i in 0..CLUSTER {
            let as_near = (square[i] == self.square[i]) & (square[i] < OUTSIDE) & (limb < self.limb[i]);
            let nearer = (square[i] < self.square[i]) | as_near;
            self.limb[i] = if nearer { limb } else { self.limb[i] };
            self.square[i] = if nearer { square[i] } else { self.square[i] };
        }
    }

    /// The greatest of the squared distances, if it is finite.
    #[inline(always)]
    fn worst(&self) -> f32 {
        let mut worst = [0.0; LANES];
        for lanes in self.square.as_chunks::<LANES>().0 {
            for lane in 0..LANES {
                worst[lane] = if lanes[lane] > worst[lane] { lanes[lane] } else { worst[lane] };
            }
        }
        worst.into_iter().fold(0.0, f32::max).min(f32::MAX)
    }
}

/// Data of several limbs for lower bounds of their distances to a box of points, side by side.
#[derive(Debug)]
struct Group {
    /// Columns of the rotations, and the translations, limb_from_working.
    axes: [[LimbLanes; 3]; 3],
    shift: [LimbLanes; 3],
    low: [LimbLanes; 3],
    high: [LimbLanes; 3],
    length: LimbLanes,
    radius: LimbLanes,
    flatness: LimbLanes,
}

impl Group {
    fn new(limbs: &[LimbBox]) -> Self {
        let lanes = |value: &dyn Fn(&LimbBox) -> f32, none: f32| {
            std::array::from_fn(|lane| limbs.get(lane).map_or(none, value))
        };
        Self {
            axes: [0, 1, 2].map(|from| [0, 1, 2].map(|to| lanes(&|limb| limb.axes[from][to], 0.0))),
            shift: [0, 1, 2].map(|axis| lanes(&|limb| limb.shift[axis], 0.0)),
            // A lane without a limb never contains a point.
            low: [0, 1, 2].map(|axis| lanes(&|limb| limb.low[axis], f32::INFINITY)),
            high: [0, 1, 2].map(|axis| lanes(&|limb| limb.high[axis], f32::NEG_INFINITY)),
            length: lanes(&|limb| limb.length, 0.0),
            radius: lanes(&|limb| limb.radius, 0.0),
            flatness: lanes(&|limb| limb.flatness, 0.0),
        }
    }

    /// Lower bounds of [`LimbBox::squares`] over all points inside the bounds; [`OUTSIDE`] when no such point lies in the limb's
    /// box.
    #[inline(always)]
    fn least_squares(&self, bounds: &Bounds) -> LimbLanes {
        let (c, h) = (bounds.center, bounds.half);
        let slack = SINGLE_PRECISION.0
            + SINGLE_PRECISION.1 * [c, h].as_flattened().iter().map(|value| value.abs()).sum::<f32>();
        let mut found = [OUTSIDE; LANES];
        for l in 0..LANES {
            let m = |from: usize, to: usize| self.axes[from][to][l];
            let place = |i: usize| m(0, i) * c[0] + m(1, i) * c[1] + m(2, i) * c[2] + self.shift[i][l];
            let reach = |i: usize| m(0, i).abs() * h[0] + m(1, i).abs() * h[1] + m(2, i).abs() * h[2] + slack;
            let (place, reach) = ([place(0), place(1), place(2)], [reach(0), reach(1), reach(2)]);
            let meets = |i: usize| (place[i] + reach[i] >= self.low[i][l]) & (place[i] - reach[i] <= self.high[i][l]);
            let off = |i: usize| at_least(place[i].abs() - reach[i], 0.0);
            // Lateral to a slice, (rho - 1) / |grad rho| is at least (rho - 1) times the smaller semi-axis, and rho is at least
            // the distance from the axis divided by the larger one.
            let side = at_least((off(0) * off(0) + off(1) * off(1)).sqrt() - self.radius[l], 0.0) * self.flatness[l];
            let beyond = at_least(at_least(-place[2], place[2] - self.length[l]) - reach[2], 0.0);
            let square = side * side + beyond * beyond;
            found[l] = if meets(0) & meets(1) & meets(2) { square } else { OUTSIDE };
        }
        found
    }
}

/// Box test and approximate distance of a tapered elliptic cylinder, in single precision for several points at once.
#[derive(Debug)]
struct LimbBox {
    /// Columns of the rotation, and the translation, limb_from_working.
    axes: [[f32; 3]; 3],
    shift: [f32; 3],
    /// The enlarged box in the limb frame.
    low: [f32; 3],
    high: [f32; 3],
    length: f32,
    /// Semi-axes at the proximal end, and their growth along the axis.
    a: [f32; 2],
    b: [f32; 2],
    /// The greatest semi-axis, and the least ratio of the smaller to the larger semi-axis of a slice.
    radius: f32,
    flatness: f32,
}

impl LimbBox {
    fn new(limb: &Limb, working_from_limb: &Pose, margin: f64) -> Self {
        let to_f32 = |v: Vec3| v.as_vec3().to_array();
        let limb_from_working = working_from_limb.inverse();
        let shape = &limb.shape;
        let bounds = shape.local_aabb().enlarged(margin);
        let ends = [(shape.a0(), shape.b0()), (shape.a1(), shape.b1())];
        let growth = shape.growth();
        let ratio = |(a, b): (f64, f64)| a.min(b) / a.max(b).max(f64::MIN_POSITIVE);
        Self {
            axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_f32(limb_from_working.rotation * axis)),
            shift: to_f32(limb_from_working.translation),
            low: to_f32(bounds.mins),
            high: to_f32(bounds.maxs),
            length: shape.length() as f32,
            a: [shape.a0(), growth[0]].map(|value| value as f32),
            b: [shape.b0(), growth[1]].map(|value| value as f32),
            radius: shape.max_radius() as f32,
            flatness: ends.map(ratio).into_iter().fold(1.0, f64::min) as f32,
        }
    }

    /// Squared distances of points, [`OUTSIDE`] for those outside the box.
    #[inline(always)]
    fn squares(&self, points: &Cluster) -> Squares {
        let mut squares = [OUTSIDE; CLUSTER];
        for i in 0..CLUSTER {
            let local = self.local(points.x[i], points.y[i], points.z[i]);
            let square = self.square(local);
            squares[i] = if self.holds(local) { square } else { OUTSIDE };
        }
        squares
    }

    /// A point in the limb frame.
    #[inline(always)]
    fn local(&self, x: f32, y: f32, z: f32) -> [f32; 3] {
        let local = |i: usize| self.axes[0][i] * x + self.axes[1][i] * y + self.axes[2][i] * z + self.shift[i];
        [local(0), local(1), local(2)]
    }

    /// Whether a point in the limb frame lies in the enlarged box.
    #[inline(always)]
    fn holds(&self, local: [f32; 3]) -> bool {
        let inside = |axis: usize| (local[axis] >= self.low[axis]) & (local[axis] <= self.high[axis]);
        inside(0) & inside(1) & inside(2)
    }

    /// Approximate squared distance: the square of `(rho - 1) / |grad rho|` beside the limb, with `rho^2 = (x/a)^2 + (y/b)^2`,
    /// plus the squared distance beyond its ends.
    #[inline(always)]
    fn square(&self, local: [f32; 3]) -> f32 {
        let along = at_least(local[2], 0.0);
        let along = if along < self.length { along } else { self.length };
        let a = at_least(self.a[0] + self.a[1] * along, THINNEST);
        let b = at_least(self.b[0] + self.b[1] * along, THINNEST);
        let over = 1.0 / (a * b);
        let (over_a, over_b) = (b * over, a * over);
        let (u, v) = (local[0] * over_a, local[1] * over_b);
        let rho_square = u * u + v * v;
        // grad rho = (u/a, v/b) / rho, so (rho - 1) / |grad rho| = (rho^2 - rho) / |(u/a, v/b)|.
        let (gx, gy) = (u * over_a, v * over_b);
        let rise = rho_square - rho_square.sqrt();
        let side_square = rise * rise / at_least(gx * gx + gy * gy, 1e-18);
        let beyond = local[2] - along;
        side_square + beyond * beyond
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::math::Points;

    /// Points around a body, near and far from it.
    fn around(seed: usize) -> Points {
        let mut points = Points::default();
        for n in 0..4000_usize {
            let part = |step: usize| ((n + seed) * step % 997) as f32 / 997.0 - 0.5;
            points.push([0.01 * (n % 97) as f32 - 0.5, 0.5 * part(71), 2.4 * part(1)]);
        }
        points
    }

    #[test]
    fn what_is_passed_over_is_not_the_nearest() -> Result<(), Box<dyn std::error::Error>> {
        let body = Body::human(1.75, HumanModel::Full)?;
        let (mut search, mut clusters) = (NearestLimb::default(), Clusters::default());
        for (seed, margin) in [(0, 0.0), (1, 0.12), (2, 0.3)] {
            let poses = body.rest_pose(Pose::new(Vec3::ZERO, Vec3::new(0.1, 0.2, 0.3) * seed as f64));
            let points = around(seed);
            clusters.arrange(&points);
            let mut nearest = vec![NONE; points.len()];
            search.place(&body, &poses, margin, true);
            search.find(&clusters, &mut nearest);
            let mut found = 0;
            for (index, nearest) in nearest.iter().enumerate() {
                let squares = search.limbs.iter().map(|limb| {
                    let local = limb.local(points.x[index], points.y[index], points.z[index]);
                    if limb.holds(local) { limb.square(local) } else { OUTSIDE }
                });
                let squares: Vec<f32> = squares.collect();
                let least = squares.iter().copied().fold(OUTSIDE, f32::min);
                let first = squares.iter().position(|square| *square == least && least < OUTSIDE);
                assert_eq!(first.map_or(NONE, |limb| limb as u32), *nearest);
                found += usize::from(first.is_some());
                let around = search.around([points.x[index], points.y[index], points.z[index]]);
                assert!(around.eq((0..squares.len()).filter(|limb| squares[*limb] < OUTSIDE)));
            }
            assert!(found > 400, "{found}");
        }
        Ok(())
    }
}
