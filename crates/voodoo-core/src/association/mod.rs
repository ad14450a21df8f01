//! Pairs of body points and measurements: which point belongs to which limb, and where on it.

pub mod assignment;
pub mod contour;
pub mod correspondence;
pub(crate) mod landmarks;
pub(crate) mod nearest_limb;
pub(crate) mod visible_side;
