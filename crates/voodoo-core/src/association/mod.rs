//! Pairs of body points and measurements: which limb a point belongs to, and where on that limb.
//!
//! Step 2 of the method (K06 IV-B.2), the limb of every candidate, is in `assignment`, with `nearest_limb` and `buried`. Steps 3
//! and 4, sampling and closest points, are in `assignment` and `visible_side`. Positions, rays and elastic bands (K06 IV-B.4 to
//! 6, K07 4.3) are in `landmarks`. `contour` adds the rims of limbs. All of them produce the types of `correspondence`, which
//! are all that solvers get.

mod buried;

pub(crate) mod assignment;
pub(crate) mod contour;
pub(crate) mod correspondence;
pub(crate) mod landmarks;
pub(crate) mod nearest_limb;
pub(crate) mod visible_side;
