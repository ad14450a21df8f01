//! What cameras should see of a posed body, and what they do see of it.
//!
//! `render` predicts a depth image, `evidence` says how well a pose explains the frame, `limb_support` what only one arm or leg
//! explains, and `roundness` whether what is seen is round as limbs are.

pub mod evidence;
pub mod limb_support;
pub mod render;
pub mod roundness;

/// Where along a limb its surface is compared with images, in shares of its length: evenly, and not at the ends, which belong
/// to the neighbours as well.
pub(crate) const ALONG_LIMB: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Where across a limb, in shares of its radius from the middle; nearer to the rim, a pixel shows what lies beside it.
pub(crate) const ACROSS_LIMB: [f64; 5] = [-0.7, -0.35, 0.0, 0.35, 0.7];
/// A camera sees past the model's surface when what may be the body lies this much behind it, metres; half as much of what is
/// known to be the background, since that is not the body.
pub(crate) const SEEN_PAST: f64 = 0.08;
