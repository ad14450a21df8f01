//! Closest points of batches of queries.

use super::TaperedEllipticCylinder;
use super::kernel::{BLOCK, Block, BlockResult, Constants, FEW, MORE, SHORT, closest};
use crate::math::{Points, Pose, Vec3, load, store, widest_fused};
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
/// assert_eq!(Region::from_u8(found.region[1]), Some(Region::ProximalCap));
/// # Ok::<(), voodoo_core::ShapeError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceBatch {
    /// Points on the surface, meters.
    pub points: Points,
    /// Outward unit normals.
    pub normals: Points,
    /// Distances, meters, negative inside.
    pub signed_distance: Vec<f32>,
    /// Faces: [`Region`](super::Region) as a number, decoded by [`Region::from_u8`](super::Region::from_u8).
    pub region: Vec<u8>,
}

impl SurfaceBatch {
    /// Reserves memory for `len` results in total.
    pub fn reserve(&mut self, len: usize) {
        self.points.reserve(len);
        self.normals.reserve(len);
        self.signed_distance.reserve(len.saturating_sub(self.signed_distance.len()));
        self.region.reserve(len.saturating_sub(self.region.len()));
    }

    fn resize(&mut self, len: usize) {
        self.points.resize(len);
        self.normals.resize(len);
        self.signed_distance.resize(len, 0.0);
        self.region.resize(len, 0);
    }

    /// Computes the result of one query in double precision.
    fn set_exactly(&mut self, index: usize, query: [f32; 3], shape: &TaperedEllipticCylinder, world_from_limb: &Pose) {
        let query = world_from_limb.inverse_transform_point(Vec3::from_array(query.map(f64::from)));
        let found = shape.closest_point(query);
        let point = world_from_limb.transform_point(found.point);
        let normal = world_from_limb.rotation * found.normal;
        self.points.set(index, point.as_vec3().to_array());
        self.normals.set(index, normal.as_vec3().to_array());
        self.signed_distance[index] = found.signed_distance as f32;
        self.region[index] = found.region as u8;
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
        out.resize(count);
        if self.aspect_change() > SETTLED || !self.is_blunt() {
            for i in 0..count {
                out.set_exactly(i, [queries.x[i], queries.y[i], queries.z[i]], self, world_from_limb);
            }
            return;
        }
        let constants = Constants::new(self, world_from_limb);
        // More than half a block takes less time as a whole block than as short ones.
        let rest = count % BLOCK;
        let whole = if 2 * rest > BLOCK { count } else { count - rest };
        let mut batch = Batch { shape: self, world_from_limb, constants, out, unsettled: Few::new() };
        batch.closest_blocks::<BLOCK>(queries, 0..whole);
        batch.closest_blocks::<SHORT>(queries, whole..count);
        batch.refine_unsettled();
    }
}

/// Queries, with their indices, that wait until there are enough to be processed side by side.
struct Few {
    queries: Block<SHORT>,
    indices: [usize; SHORT],
    count: usize,
}

impl Few {
    const fn new() -> Self {
        Self { queries: Block::ZERO, indices: [0; SHORT], count: 0 }
    }

    /// Adds a query; returns whether there are now enough.
    fn push(&mut self, index: usize, [x, y, z]: [f32; 3]) -> bool {
        let at = self.count;
        (self.queries.x[at], self.queries.y[at], self.queries.z[at], self.indices[at]) = (x, y, z, index);
        self.count += 1;
        self.count == SHORT
    }
}

/// Queries to one shape in its pose, and the output of the results.
struct Batch<'a> {
    shape: &'a TaperedEllipticCylinder,
    world_from_limb: &'a Pose,
    constants: Constants,
    out: &'a mut SurfaceBatch,
    /// Queries not settled by few single-precision steps.
    unsettled: Few,
}

impl Batch<'_> {
    /// Closest points of the queries in `range`, block by block. Unsettled queries are processed whenever there are enough of
    /// them; the last ones wait.
    fn closest_blocks<const N: usize>(&mut self, queries: &Points, range: Range<usize>) {
        widest_fused(
            self,
            #[inline(always)]
            |batch| batch.run_blocks::<FMA, N>(queries, range.clone()),
            #[inline(always)]
            |batch| batch.run_blocks::<true, N>(queries, range.clone()),
        );
    }

    #[inline(always)]
    fn run_blocks<const FMA: bool, const N: usize>(&mut self, queries: &Points, range: Range<usize>) {
        let mut block = Block::ZERO;
        let mut found = BlockResult::ZERO;
        for start in range.clone().step_by(N) {
            let count = N.min(range.end - start);
            let span = start..start + count;
            // The tail is padded with the block's previous contents, so that every point goes through the same instructions.
            load(&mut block.x, &queries.x[span.clone()]);
            load(&mut block.y, &queries.y[span.clone()]);
            load(&mut block.z, &queries.z[span.clone()]);
            closest::<FMA, N, FEW>(&self.constants, &block, &mut found);
            let out = &mut *self.out;
            store(&mut out.points.x[span.clone()], &found.points.x);
            store(&mut out.points.y[span.clone()], &found.points.y);
            store(&mut out.points.z[span.clone()], &found.points.z);
            store(&mut out.normals.x[span.clone()], &found.normals.x);
            store(&mut out.normals.y[span.clone()], &found.normals.y);
            store(&mut out.normals.z[span.clone()], &found.normals.z);
            store(&mut out.signed_distance[span.clone()], &found.signed_distance);
            store(&mut out.region[span], &found.region);
            if found.unsettled.iter().fold(0, |any, flag| any | flag) == 0 {
                continue;
            }
            for i in (0..count).filter(|i| found.unsettled[*i] != 0) {
                if self.unsettled.push(start + i, [block.x[i], block.y[i], block.z[i]]) {
                    self.refine_unsettled();
                }
            }
        }
    }

    /// Takes more single-precision steps for the queries that few steps did not settle, and computes those exactly that these do
    /// not settle either.
    fn refine_unsettled(&mut self) {
        let mut found = BlockResult::ZERO;
        if self.unsettled.count > 0 {
            run::<SHORT, MORE>(&self.constants, &self.unsettled.queries, &mut found);
        }
        for i in 0..self.unsettled.count {
            let (index, query) = (self.unsettled.indices[i], self.unsettled.queries.get(i));
            if found.unsettled[i] == 0 {
                self.out.points.set(index, found.points.get(i));
                self.out.normals.set(index, found.normals.get(i));
                (self.out.signed_distance[index], self.out.region[index]) = (found.signed_distance[i], found.region[i]);
            } else {
                self.out.set_exactly(index, query, self.shape, self.world_from_limb);
            }
        }
        self.unsettled.count = 0;
    }
}

/// Whether the target that the crate is compiled for has fused multiply-add: every aarch64 processor does.
const FMA: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

/// [`closest`], compiled for the widest registers of this processor.
fn run<const N: usize, const STEPS: usize>(constants: &Constants, queries: &Block<N>, out: &mut BlockResult<N>) {
    widest_fused(
        out,
        #[inline(always)]
        |out| closest::<FMA, N, STEPS>(constants, queries, out),
        #[inline(always)]
        |out| closest::<true, N, STEPS>(constants, queries, out),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    #[cfg(target_arch = "x86_64")]
    use crate::math::{compiled, has_avx512};

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
                let mut queries = Block::ZERO;
                for i in 0..BLOCK {
                    [queries.x[i], queries.y[i], queries.z[i]] = point(block * BLOCK + i).to_array();
                }
                queries
            })
            .collect()
    }

    #[test]
    fn limbs_rarely_need_the_exact_path() -> Result<(), crate::shape::ShapeError> {
        for [length, a0, b0, a1, b1] in
            [[0.55, 0.16, 0.11, 0.19, 0.12], [0.25, 0.05, 0.045, 0.03, 0.027], [0.42, 0.06, 0.065, 0.04, 0.042]]
        {
            let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1)?;
            let constants = Constants::new(&shape, &Pose::IDENTITY);
            let mut found = BlockResult::ZERO;
            let mut unsettled = 0;
            for queries in shell(&shape) {
                run::<BLOCK, FEW>(&constants, &queries, &mut found);
                unsettled += found.unsettled.iter().filter(|&&flag| flag != 0).count();
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
    fn the_baseline_kernel_agrees_with_the_selected_one() -> Result<(), crate::shape::ShapeError> {
        let shape = TaperedEllipticCylinder::new(0.25, 0.05, 0.045, 0.03, 0.027)?;
        let constants = Constants::new(&shape, &Pose::IDENTITY);
        let (mut fast, mut plain) = (BlockResult::ZERO, BlockResult::ZERO);
        for queries in shell(&shape) {
            run::<BLOCK, FEW>(&constants, &queries, &mut fast);
            closest::<FMA, BLOCK, FEW>(&constants, &queries, &mut plain);
            for i in (0..BLOCK).filter(|&i| fast.unsettled[i] | plain.unsettled[i] == 0) {
                assert!((fast.points.x[i] - plain.points.x[i]).abs() < 1e-6);
                assert!((fast.points.y[i] - plain.points.y[i]).abs() < 1e-6);
                assert!((fast.signed_distance[i] - plain.signed_distance[i]).abs() < 5e-7);
            }
        }
        Ok(())
    }

    /// Skipped, as there is nothing to compare, on processors without AVX-512.
    #[test]
    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code, reason = "a function compiled for an instruction set is called where the processor has it")]
    fn wider_registers_change_no_bit() -> Result<(), crate::shape::ShapeError> {
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
                [
                    &found.points.x,
                    &found.points.y,
                    &found.points.z,
                    &found.normals.x,
                    &found.normals.z,
                    &found.signed_distance,
                ]
                .map(|values| values.map(f32::to_bits))
            };
            assert_eq!(bits(&wider), bits(&wide));
            assert_eq!((wider.unsettled, wider.region), (wide.unsettled, wide.region));
        }
        Ok(())
    }
}
