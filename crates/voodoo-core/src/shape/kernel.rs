//! The arithmetic of the batch: one point as straight-line f32 code, which the compiler turns into one SIMD lane.

use super::closest::DISTINCT;
use super::{RIM_NORMAL_DISTANCE, Region, TaperedEllipticCylinder};
use crate::math::{Mat3, Pose, Vec3, multiply_add as fma};

/// Number of points in a full block; the blocks at the end are shorter. The loop over a block has no branch and no bounds check,
/// so the compiler vectorizes it at the target's SIMD width.
pub(super) const BLOCK: usize = 32;
pub(super) const SHORT: usize = 8;
/// Newton steps before the last one: for all points, and for the approximately one percent of them for which that is too few.
pub(super) const FEW: usize = 1;
pub(super) const MORE: usize = 3;
/// Largest accepted estimate of the foot's error, meters: the square of the last Newton step times the size of the shape.
const FOOT_ERROR: f32 = 3e-8;
/// Minimum ratio of `g''/2` to `|P_θ|²` that counts as well-conditioned. The foot's error is the query's error divided by this
/// ratio.
const CONDITIONED: f32 = DISTINCT as f32;

/// One block of points, axis by axis.
pub(super) type Block<const N: usize> = [[f32; N]; 3];

/// The results of one block, in the frame of the queries.
pub(super) struct BlockResult<const N: usize> {
    pub points: Block<N>,
    pub normals: Block<N>,
    /// NaN where the result is not settled.
    pub signed_distance: [f32; N],
    pub region: [Region; N],
}

impl<const N: usize> BlockResult<N> {
    pub(super) const ZERO: Self =
        Self { points: [[0.0; N]; 3], normals: [[0.0; N]; 3], signed_distance: [0.0; N], region: [Region::Side; N] };
}

/// Shape and pose in single precision, as needed by the kernel.
///
/// The limb's origin is split into `origin`, exact in f32, and `rest`, the remainder rotated into the limb frame. The difference
/// of query and origin is then rounded relative to the size of the limb, not to its position in the world.
pub(super) struct Constants {
    /// Columns of `world_from_limb`'s rotation.
    columns: [[f32; 3]; 3],
    origin: [f32; 3],
    rest: [f32; 3],
    /// Factor of the square of the last Newton step that bounds the remaining error, meters.
    second_order: f32,
    length: f32,
    inverse_length: f32,
    a0: f32,
    b0: f32,
    da: f32,
    db: f32,
    /// Squared semi-axes and their squared product, per cap.
    proximal: [f32; 3],
    distal: [f32; 3],
}

impl Constants {
    pub(super) fn new(shape: &TaperedEllipticCylinder, world_from_limb: &Pose) -> Self {
        let rotation = Mat3::from_quat(world_from_limb.rotation);
        let single = |v: Vec3| v.as_vec3().to_array();
        let origin = world_from_limb.translation.as_vec3();
        let rest = rotation.transpose() * (world_from_limb.translation - origin.as_dvec3());
        let cap = |a: f64, b: f64| [(a * a) as f32, (b * b) as f32, (a * a * b * b) as f32];
        let size = shape.max_radius();
        // The flatter an ellipse, the larger the third derivative of g at its tips.
        let aspect =
            f64::max(shape.a0.max(shape.b0) / shape.a0.min(shape.b0), shape.a1.max(shape.b1) / shape.a1.min(shape.b1));
        Self {
            columns: [single(rotation.x_axis), single(rotation.y_axis), single(rotation.z_axis)],
            origin: origin.to_array(),
            rest: single(rest),
            second_order: (size * aspect) as f32,
            length: shape.length as f32,
            inverse_length: (1.0 / shape.length) as f32,
            a0: shape.a0 as f32,
            b0: shape.b0 as f32,
            da: (shape.a1 - shape.a0) as f32,
            db: (shape.b1 - shape.b0) as f32,
            proximal: cap(shape.a0, shape.b0),
            distal: cap(shape.a1, shape.b1),
        }
    }

    /// Transforms a query into the limb frame.
    #[inline(always)]
    fn in_limb<const FMA: bool>(&self, query: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = [0, 1, 2].map(|axis| query[axis] - self.origin[axis]);
        [0, 1, 2].map(|axis| {
            let [cx, cy, cz] = self.columns[axis];
            fma::<FMA>(cx, x, fma::<FMA>(cy, y, fma::<FMA>(cz, z, -self.rest[axis])))
        })
    }

    /// A limb-frame vector in the frame of the queries, added to `base`.
    #[inline(always)]
    fn in_world<const FMA: bool>(&self, [x, y, z]: [f32; 3], base: [f32; 3]) -> [f32; 3] {
        let [cx, cy, cz] = self.columns;
        [0, 1, 2].map(|axis| fma::<FMA>(cx[axis], x, fma::<FMA>(cy[axis], y, fma::<FMA>(cz[axis], z, base[axis]))))
    }

    /// Semi-axes of the slice at height `z`, clamped to the ends.
    #[inline(always)]
    fn slice<const FMA: bool>(&self, z: f32) -> (f32, f32) {
        let t = max(min(z * self.inverse_length, 1.0), 0.0);
        (fma::<FMA>(self.da, t, self.a0), fma::<FMA>(self.db, t, self.b0))
    }
}

/// `max` and `min` as one instruction: the standard functions handle NaN, which is detected at the end here.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn select(condition: bool, yes: f32, no: f32) -> f32 {
    if condition { yes } else { no }
}

/// The foot on one ruling and the derivatives of `g`, as in `ruling`.
struct LaneFoot {
    /// The parameter along the ruling before it is clamped to 0..1, and its derivative with respect to θ.
    free: f32,
    drift: f32,
    slope: f32,
    bend: f32,
    tangent: f32,
}

#[inline(always)]
fn foot<const FMA: bool>(k: &Constants, c: f32, s: f32, [x, y, z]: [f32; 3]) -> LaneFoot {
    let (dx, dy) = (k.da * c, k.db * s);
    let along = fma::<FMA>(dx, dx, fma::<FMA>(dy, dy, k.length * k.length));
    let inverse = 1.0 / along;
    let (ax, ay) = (fma::<FMA>(-k.a0, c, x), fma::<FMA>(-k.b0, s, y));
    let free = fma::<FMA>(ax, dx, fma::<FMA>(ay, dy, z * k.length)) * inverse;
    let t = max(min(free, 1.0), 0.0);
    let (a, b) = (fma::<FMA>(k.da, t, k.a0), fma::<FMA>(k.db, t, k.b0));
    let (px, py) = (a * c, b * s);
    let e = [px - x, py - y, fma::<FMA>(k.length, t, -z)];
    let (tx, ty) = (-a * s, b * c);
    let slope = fma::<FMA>(e[0], tx, e[1] * ty);
    let tangent = fma::<FMA>(tx, tx, ty * ty);
    let curved = fma::<FMA>(e[0], px, e[1] * py);
    // P_θ · D + e · D_θ, with D_θ = (-a' s, b' c, 0).
    let turned = fma::<FMA>(-k.da * s, e[0], (k.db * c) * e[1]);
    let mixed = fma::<FMA>(tx, dx, fma::<FMA>(ty, dy, turned));
    let drift = -mixed * inverse;
    let coupling = select(t == free, mixed * drift, 0.0);
    LaneFoot { free, drift, slope, bend: tangent - curved + coupling, tangent }
}

#[inline(always)]
fn unit<const FMA: bool>(x: f32, y: f32) -> (f32, f32) {
    let inverse = 1.0 / fma::<FMA>(x, x, y * y).sqrt();
    (x * inverse, y * inverse)
}

/// The unit vector along a vector whose length is 1 up to a small step: `1/sqrt(1 + u) = 1 - u/2 + 3u²/8 - ...`.
#[inline(always)]
fn nearly_unit<const FMA: bool>(x: f32, y: f32) -> (f32, f32) {
    let u = fma::<FMA>(x, x, fma::<FMA>(y, y, -1.0));
    let factor = fma::<FMA>(u, fma::<FMA>(u, fma::<FMA>(u, -0.3125, 0.375), -0.5), 1.0);
    (x * factor, y * factor)
}

/// The Newton step of `foot`, with `g''` kept positive and the step small enough for [`nearly_unit`].
#[inline(always)]
fn newton(foot: &LaneFoot) -> f32 {
    let step = -foot.slope / max(foot.bend, 0.1 * foot.tangent + 1e-20);
    max(min(step, 0.2), -0.2)
}

/// The angle after a Newton step, kept in the quadrant.
#[inline(always)]
fn turned<const FMA: bool>(c: f32, s: f32, step: f32) -> (f32, f32) {
    nearly_unit::<FMA>(max(fma::<FMA>(-step, s, c), 0.0), max(fma::<FMA>(step, c, s), 0.0))
}

/// The start angle: the direction `(x/a, y/b)` in the slice, then one step over the evolute of the slice.
#[inline(always)]
fn first_angle<const FMA: bool>(k: &Constants, [x, y, z]: [f32; 3]) -> (f32, f32) {
    let (a, b) = k.slice::<FMA>(z);
    let tiny = 1e-18;
    let (c, s) = unit::<FMA>(max(x * b, tiny), max(y * a, tiny));
    let focus = fma::<FMA>(a, a, -(b * b));
    unit::<FMA>(max(fma::<FMA>(a, x, -(focus * c) * (c * c)), tiny), max(fma::<FMA>(b, y, (focus * s) * (s * s)), tiny))
}

/// The kernel over one block. `FMA` states whether fused multiply-add is an instruction of the target.
///
/// It uses three loops instead of one: each is short enough for the processor to overlap its iterations, whose dependency chains
/// are long. Newton's iteration takes `STEPS` steps before the last one.
#[inline(always)]
pub(super) fn closest<const FMA: bool, const N: usize, const STEPS: usize>(
    k: &Constants,
    queries: &Block<N>,
    out: &mut BlockResult<N>,
) {
    // The queries in the limb frame, and their angles: cosine and sine.
    let mut limb = [[0.0; N]; 3];
    let (mut cosine, mut sine) = ([0f32; N], [0f32; N]);
    let at = |block: &Block<N>, i: usize| [block[0][i], block[1][i], block[2][i]];
    let folded = |[x, y, z]: [f32; 3]| [x.abs(), y.abs(), z];
    for i in 0..N {
        let query = k.in_limb::<FMA>(at(queries, i));
        (limb[0][i], limb[1][i], limb[2][i]) = (query[0], query[1], query[2]);
        (cosine[i], sine[i]) = first_angle::<FMA>(k, folded(query));
    }
    for _ in 0..STEPS {
        for i in 0..N {
            let (c, s) = (cosine[i], sine[i]);
            let f = foot::<FMA>(k, c, s, folded(at(&limb, i)));
            (cosine[i], sine[i]) = turned::<FMA>(c, s, newton(&f));
        }
    }
    for i in 0..N {
        let [qx, qy, z] = at(&limb, i);
        let (x, y) = (qx.abs(), qy.abs());

        // The closest point of the side: the last Newton step moves t along with the angle to first order.
        let f = foot::<FMA>(k, cosine[i], sine[i], [x, y, z]);
        let step = newton(&f);
        let (c, s) = turned::<FMA>(cosine[i], sine[i], step);
        let free = fma::<FMA>(f.drift, step, f.free);
        let t = max(min(free, 1.0), 0.0);
        let (a, b) = (fma::<FMA>(k.da, t, k.a0), fma::<FMA>(k.db, t, k.b0));
        let (ex, ey) = (fma::<FMA>(a, c, -x), fma::<FMA>(b, s, -y));
        let ez = fma::<FMA>(k.length, t, -z);
        let squared = fma::<FMA>(ex, ex, fma::<FMA>(ey, ey, ez * ez));
        // The remaining error is of second order in the step. A step across a rim changes g'' discontinuously, so its error is of
        // first order.
        let crossed = ((free < 0.0) != (f.free < 0.0)) | ((free > 1.0) != (f.free > 1.0));
        let error = k.second_order * select(crossed, step.abs(), step * step);
        let trusted = (error < FOOT_ERROR) & (f.bend >= CONDITIONED * f.tangent);

        // Inside: between the caps and inside the slice.
        let (xx, yy) = (x * x, y * y);
        let (aa, bb) = k.slice::<FMA>(z);
        let (aa, bb) = (aa * aa, bb * bb);
        let level = fma::<FMA>(xx, bb, fma::<FMA>(yy, aa, -(aa * bb)));
        let inside = (z > 0.0) & (z < k.length) & (level < 0.0);
        let sign = select(inside, -1.0, 1.0);

        // A cap is the nearest face where the query projects into it and it is nearer than the side. Beyond a cap it is nearer
        // regardless of the rounding of the side's distance.
        let over = |cap: [f32; 3]| fma::<FMA>(xx, cap[1], yy * cap[0]) < cap[2];
        let top = z - k.length;
        let (over_proximal, over_distal) = (over(k.proximal), over(k.distal));
        let beyond = (over_proximal & (z < 0.0)) | (over_distal & (top > 0.0));
        let proximal = over_proximal & ((z < 0.0) | (z * z < squared));
        let squared = select(proximal, z * z, squared);
        let distal = over_distal & ((top > 0.0) | (top * top < squared));
        let distance = select(distal, top * top, squared).sqrt();
        let proximal = proximal & !distal;
        let cap = proximal | distal;

        // The vector from the query to the surface, limb frame, unfolded.
        let (sx, sy) = (1f32.copysign(qx), 1f32.copysign(qy));
        let ex = select(cap, 0.0, ex * sx);
        let ey = select(cap, 0.0, ey * sy);
        let ez = select(distal, -top, select(proximal, -z, ez));

        // Normal: P_θ × P_t on the side, the direction to the query on a rim.
        let rim = (t <= 0.0) | (t >= 1.0);
        let nx = select(rim, -ex * sign, b * c * k.length * sx);
        let ny = select(rim, -ey * sign, a * s * k.length * sy);
        let slant = fma::<FMA>(a * k.db, s * s, b * k.da * (c * c));
        let nz = select(rim, -ez * sign, -slant);
        let norm = fma::<FMA>(nx, nx, fma::<FMA>(ny, ny, nz * nz));
        let inverse = 1.0 / norm.sqrt();
        let nx = select(cap, 0.0, nx * inverse);
        let ny = select(cap, 0.0, ny * inverse);
        let nz = select(distal, 1.0, select(proximal, -1.0, nz * inverse));

        let point = k.in_world::<FMA>([ex, ey, ez], at(queries, i));
        let normal = k.in_world::<FMA>([nx, ny, nz], [0.0; 3]);
        for axis in 0..3 {
            out.points[axis][i] = point[axis];
            out.normals[axis][i] = normal[axis];
        }
        let edge = if t <= 0.0 { Region::ProximalRim } else { Region::DistalRim };
        let lateral = if rim { edge } else { Region::Side };
        let flat = if distal { Region::DistalCap } else { Region::ProximalCap };
        out.region[i] = if cap { flat } else { lateral };
        // Written so that a NaN anywhere counts as unsettled.
        let settled =
            (trusted | beyond) & (cap | (norm > 1e-12)) & (cap | !rim | (distance > RIM_NORMAL_DISTANCE as f32));
        out.signed_distance[i] = select(settled, sign * distance, f32::NAN);
    }
}
