//! Pairs of body points and measurements: which point belongs to which limb, and where on it.
//!
//! Step 2 of the method (K06 IV-B.2), the limb of every candidate, is `assignment` with `nearest_limb` and `buried`; steps 3 and
//! 4, sampling and closest points, are `assignment` and `visible_side`; positions, rays and elastic bands (K06 IV-B.4 to 6, K07
//! 4.3) are `landmarks`. `contour` adds the rims of limbs. All of them end in `correspondence`, which is all that solvers see.

pub(crate) mod assignment;
pub(crate) mod buried;
pub(crate) mod contour;
pub(crate) mod correspondence;
pub(crate) mod landmarks;
pub(crate) mod nearest_limb;
pub(crate) mod visible_side;
