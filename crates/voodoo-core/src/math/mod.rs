//! Points, rotations and poses, and small linear-algebra routines.

mod absolute_orientation;
mod cholesky;
mod geometry;
mod linear_sum_assignment;
mod rotations;
mod simd;
mod weighted_points;

pub(crate) use absolute_orientation::Moments;
pub use cholesky::solve_in_place;
pub(crate) use cholesky::{factor, half_substitute};
pub use geometry::*;
pub use linear_sum_assignment::linear_sum_assignment;
pub use rotations::{euler_angles, is_skewed, quaternion};
pub(crate) use simd::vectorized;
pub use simd::{FMA, LANES, load, multiply_add, store, widest, widest_fused};
#[cfg(all(test, target_arch = "x86_64"))]
pub(crate) use simd::{compiled, has_avx512};
pub(crate) use weighted_points::WeightedPoints;

/// The cubic that rises smoothly from 0 at `at = 0` to 1 at `at = 1`, and is constant outside.
#[inline(always)]
pub(crate) fn smooth_step(at: f64) -> f64 {
    let at = at.clamp(0.0, 1.0);
    at * at * (3.0 - 2.0 * at)
}

/// Makes `values` a number of copies of a value. Their memory is kept.
pub fn reset<T: Clone>(values: &mut Vec<T>, len: usize, value: T) {
    values.clear();
    values.resize(len, value);
}

/// Empties `values` and reserves memory for so many, so that later steps do not allocate.
pub(crate) fn make_room<T>(values: &mut Vec<T>, len: usize) {
    values.clear();
    values.reserve(len);
}

/// Replaces `values` by others. Their memory is kept.
#[inline(always)]
pub fn refill<T>(values: &mut Vec<T>, others: impl IntoIterator<Item = T>) {
    values.clear();
    values.extend(others);
}

/// The probability of an event with these log odds.
pub fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// The dot product of two rows.
pub fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}
