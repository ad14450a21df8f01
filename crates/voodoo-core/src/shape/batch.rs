//! Closest points of batches of queries.

use super::kernel::{BLOCK, BlockResult, Constants, FEW, MORE, SHORT, closest};
use super::{Region, TaperedEllipticCylinder};
use crate::math::{FMA, Points, Pose, Vec3, load, store, widest_fused};
use std::ops::Range;

/// Largest [`TaperedEllipticCylinder::aspect_change`] at which results that the f32 kernel marks as settled are accepted: at 0.4
/// no error was above a micrometer in a million queries.
const SETTLED: f64 = 0.2;

/// Closest points of a batch of queries, in the frame of the queries; index i belongs to query i.
///
/// ```
/// use voodoo_core::math::{Points, Pose};
/// use voodoo_core::{Region, SurfaceBatch, TaperedEllipticCylinder};
///
/// let forearm = TaperedEllipticCylinder::new(0.25, 0.05, 0.05, 0.05, 0.05)?;
/// let mut queries = Points::default();
/// queries.push([0.15, 0.0, 0.1]);
/// queries.push([0.0, 0.0, -0.02]);
/// let mut found = SurfaceBatch::default(); // kept and reused: no allocation per call
/// forearm.closest_points(&Pose::IDENTITY, &queries, &mut found);
/// assert!((found.signed_distance[0] - 0.1).abs() < 1e-6);
/// assert_eq!(found.region[1], Region::ProximalCap);
/// # Ok::<(), voodoo_core::Unexpected>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceBatch {
    /// Points on the surface, meters.
    pub points: Points,
    /// Outward unit normals.
    pub normals: Points,
    /// Distances, meters, negative inside.
    pub signed_distance: Vec<f32>,
    /// Faces.
    pub region: Vec<Region>,
}

impl SurfaceBatch {
    /// Reserves memory for `len` results in total.
    pub fn reserve(&mut self, len: usize) {
        self.points.reserve(len);
        self.normals.reserve(len);
        self.signed_distance.reserve(len.saturating_sub(self.signed_distance.len()));
        self.region.reserve(len.saturating_sub(self.region.len()));
    }

    /// Computes the result of one query in double precision.
    fn set_exactly(&mut self, index: usize, query: Vec3, shape: &TaperedEllipticCylinder, world_from_limb: &Pose) {
        let found = shape.closest_point(world_from_limb.inverse_transform_point(query));
        let point = world_from_limb.transform_point(found.point);
        let normal = world_from_limb.rotation * found.normal;
        self.points.set(index, point.as_vec3().to_array());
        self.normals.set(index, normal.as_vec3().to_array());
        self.signed_distance[index] = found.signed_distance as f32;
        self.region[index] = found.region;
    }
}

impl TaperedEllipticCylinder {
    /// [`Self::closest_point`] for every query; queries and results in the frame `world`.
    ///
    /// Computed in single precision on SIMD lanes, within 1 µm of the exact answer for queries within 1.5 m of the limb in a
    /// frame a few meters wide. Some queries are not settled by the fixed number of Newton steps: those near the medial axis, on
    /// a rim or not finite, and those to shapes whose end ellipses differ in aspect or one of which is nearly a tip. They are
    /// computed again in double precision. A result depends on its query, shape and pose only, not on its position in the batch.
    /// `out` is resized; nothing is allocated once it is large enough.
    pub fn closest_points(&self, world_from_limb: &Pose, queries: &Points, out: &mut SurfaceBatch) {
        let count = queries.len();
        out.points.resize(count);
        out.normals.resize(count);
        out.signed_distance.resize(count, 0.0);
        out.region.resize(count, Region::Side);
        if self.aspect_change() > SETTLED || !self.is_blunt() {
            for i in 0..count {
                out.set_exactly(i, queries.get(i), self, world_from_limb);
            }
            return;
        }
        let constants = Constants::new(self, world_from_limb);
        let batch = Batch { shape: self, world_from_limb, constants, queries, out, unsettled: [0; SHORT], waiting: 0 };
        widest_fused(
            batch,
            #[inline(always)]
            |batch| batch.run::<FMA>(),
            #[inline(always)]
            |batch| batch.run::<true>(),
        );
    }
}

/// Queries to one shape in its pose, and the output of the results.
struct Batch<'a> {
    shape: &'a TaperedEllipticCylinder,
    world_from_limb: &'a Pose,
    constants: Constants,
    queries: &'a Points,
    out: &'a mut SurfaceBatch,
    /// Queries that few single-precision steps did not settle: so many of them wait to be processed side by side.
    unsettled: [usize; SHORT],
    waiting: usize,
}

impl Batch<'_> {
    #[inline(always)]
    fn run<const FMA: bool>(mut self) {
        let count = self.queries.len();
        // More than half a block takes less time as a whole block than as short ones.
        let rest = count % BLOCK;
        let whole = if 2 * rest > BLOCK { count } else { count - rest };
        self.run_blocks::<FMA, BLOCK>(0..whole);
        self.run_blocks::<FMA, SHORT>(whole..count);
        if self.waiting > 0 {
            self.refine_unsettled::<FMA>();
        }
    }

    /// Closest points of the queries in `range`, block by block.
    #[inline(always)]
    fn run_blocks<const FMA: bool, const N: usize>(&mut self, range: Range<usize>) {
        let (mut block, mut found) = ([[0.0; N]; 3], BlockResult::ZERO);
        for start in range.clone().step_by(N) {
            let span = start..range.end.min(start + N);
            // The tail is padded with the block's previous contents, so that every point goes through the same instructions.
            load(&mut block[0], &self.queries.x[span.clone()]);
            load(&mut block[1], &self.queries.y[span.clone()]);
            load(&mut block[2], &self.queries.z[span.clone()]);
            closest::<FMA, N, FEW>(&self.constants, &block, &mut found);
            let out = &mut *self.out;
            for (points, [x, y, z]) in [(&mut out.points, &found.points), (&mut out.normals, &found.normals)] {
                store(&mut points.x[span.clone()], x);
                store(&mut points.y[span.clone()], y);
                store(&mut points.z[span.clone()], z);
            }
            store(&mut out.signed_distance[span.clone()], &found.signed_distance);
            store(&mut out.region[span.clone()], &found.region);
            if found.signed_distance.iter().fold(0, |any, distance| any | u32::from(distance.is_nan())) == 0 {
                continue;
            }
            for index in span.filter(|index| found.signed_distance[index - start].is_nan()) {
                self.unsettled[self.waiting] = index;
                self.waiting += 1;
                if self.waiting == SHORT {
                    self.refine_unsettled::<FMA>();
                }
            }
        }
    }

    /// Takes more single-precision steps for the queries that few steps did not settle, and computes those exactly that these do
    /// not settle either.
    #[inline(always)]
    fn refine_unsettled<const FMA: bool>(&mut self) {
        let (Points { x, y, z }, mut found) = (self.queries, BlockResult::ZERO);
        let block = [x, y, z].map(|axis| self.unsettled.map(|index| axis[index]));
        closest::<FMA, SHORT, MORE>(&self.constants, &block, &mut found);
        for (i, &index) in self.unsettled[..self.waiting].iter().enumerate() {
            if found.signed_distance[i].is_nan() {
                self.out.set_exactly(index, self.queries.get(index), self.shape, self.world_from_limb);
            } else {
                self.out.points.set(index, found.points.map(|axis| axis[i]));
                self.out.normals.set(index, found.normals.map(|axis| axis[i]));
                (self.out.signed_distance[index], self.out.region[index]) = (found.signed_distance[i], found.region[i]);
            }
        }
        self.waiting = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernel::Block;
    use super::*;
    #[cfg(target_arch = "x86_64")]
    use crate::math::{compiled, has_avx512};

    /// [`closest`], compiled for the widest registers of this processor.
    fn run(constants: &Constants, queries: &Block<BLOCK>, out: &mut BlockResult<BLOCK>) {
        widest_fused(
            out,
            #[inline(always)]
            |out| closest::<FMA, BLOCK, FEW>(constants, queries, out),
            #[inline(always)]
            |out| closest::<true, BLOCK, FEW>(constants, queries, out),
        );
    }

    /// Points on a grid around the side, from 2 cm inside to 4 cm outside.
    fn shell(shape: &TaperedEllipticCylinder) -> Vec<Block<BLOCK>> {
        let point = |n: usize| {
            let (angle, t) = (0.1 * n as f64, (n % 97) as f64 / 96.0);
            let off = (n % 61) as f64 * 1e-3 - 0.02;
            let (a, b) = shape.semi_axes(t * shape.length());
            Vec3::new((a + off) * angle.cos(), (b + off) * angle.sin(), t * shape.length()).as_vec3()
        };
        (0..200)
            .map(|block| {
                let points: [[f32; 3]; BLOCK] = std::array::from_fn(|i| point(block * BLOCK + i).to_array());
                [0, 1, 2].map(|axis| points.map(|point| point[axis]))
            })
            .collect()
    }

    #[test]
    fn limbs_rarely_need_the_exact_path() -> Result<(), crate::error::Unexpected> {
        for [length, a0, b0, a1, b1] in
            [[0.55, 0.16, 0.11, 0.19, 0.12], [0.25, 0.05, 0.045, 0.03, 0.027], [0.42, 0.06, 0.065, 0.04, 0.042]]
        {
            let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1)?;
            let constants = Constants::new(&shape, &Pose::IDENTITY);
            let mut found = BlockResult::ZERO;
            let mut unsettled = 0;
            for queries in shell(&shape) {
                run(&constants, &queries, &mut found);
                unsettled += found.signed_distance.iter().filter(|distance| distance.is_nan()).count();
            }
            let fraction = unsettled as f64 / (200 * BLOCK) as f64;
            assert!(
                shape.aspect_change() <= super::super::closest::ONE_BASIN && fraction < 0.01,
                "{fraction} of {shape:?}"
            );
        }
        Ok(())
    }

    #[test]
    fn the_baseline_kernel_agrees_with_the_selected_one() -> Result<(), crate::error::Unexpected> {
        let shape = TaperedEllipticCylinder::new(0.25, 0.05, 0.045, 0.03, 0.027)?;
        let constants = Constants::new(&shape, &Pose::IDENTITY);
        let (mut fast, mut plain) = (BlockResult::ZERO, BlockResult::ZERO);
        for queries in shell(&shape) {
            run(&constants, &queries, &mut fast);
            closest::<FMA, BLOCK, FEW>(&constants, &queries, &mut plain);
            for i in (0..BLOCK).filter(|&i| !(fast.signed_distance[i] + plain.signed_distance[i]).is_nan()) {
                assert!((fast.points[0][i] - plain.points[0][i]).abs() < 1e-6);
                assert!((fast.points[1][i] - plain.points[1][i]).abs() < 1e-6);
                assert!((fast.signed_distance[i] - plain.signed_distance[i]).abs() < 5e-7);
            }
        }
        Ok(())
    }

    /// Skipped, as there is nothing to compare, on processors without AVX-512.
    #[test]
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code, reason = "a function compiled for an instruction set is called where the processor has it")]
    fn wider_registers_change_no_bit() -> Result<(), crate::error::Unexpected> {
        if !has_avx512() || !std::arch::is_x86_feature_detected!("fma") {
            return Ok(());
        }
        let shape = TaperedEllipticCylinder::new(0.25, 0.05, 0.045, 0.03, 0.027)?;
        let constants = Constants::new(&shape, &Pose::IDENTITY);
        let (mut wider, mut wide) = (BlockResult::ZERO, BlockResult::ZERO);
        for queries in shell(&shape) {
            // The processor was just found to have AVX-512 (hence AVX2) and FMA.
            compiled!(
                "avx512f,avx512bw,avx512dq,avx512vl,fma",
                closest::<true, BLOCK, FEW>(&constants, &queries, &mut wider)
            );
            compiled!("avx2,fma", closest::<true, BLOCK, FEW>(&constants, &queries, &mut wide));
            let bits = |found: &BlockResult<BLOCK>| {
                let [x, y, z] = &found.points;
                [x, y, z, &found.normals[0], &found.normals[2], &found.signed_distance]
                    .map(|values| values.map(f32::to_bits))
            };
            assert_eq!(bits(&wider), bits(&wide));
            assert_eq!(wider.region, wide.region);
        }
        Ok(())
    }
}
