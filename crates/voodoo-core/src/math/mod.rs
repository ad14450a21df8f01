//! Points, rotations and poses, and the little linear algebra that single-purpose code needs.

mod absolute_orientation;
mod cholesky;
mod geometry;
mod linear_sum_assignment;
mod simd;
mod weighted_points;

pub use absolute_orientation::Moments;
pub use cholesky::{factor, half_substitute, solve_in_place};
pub use geometry::*;
pub use linear_sum_assignment::{CostTable, linear_sum_assignment};
pub use simd::{LANES, has_avx512, widest};
pub use weighted_points::WeightedPoints;

/// The sum of the products of two rows.
pub fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}
