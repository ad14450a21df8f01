//! Predicts what cameras observe of a posed body and compares it with the images.
//!
//! `render` predicts a depth image, `evidence` scores how well a pose explains the frame, and `limb_support` measures what only one
//! arm or leg explains, and whether the observed surface is round as limbs are. `evidence` and `limb_support` sample the points of
//! `surface`.

pub(crate) mod evidence;
pub(crate) mod limb_support;
pub(crate) mod render;
pub(crate) mod surface;

/// Offset of the outermost points across a limb, as a fraction of its radius; nearer to the rim, a pixel may show the background.
pub(crate) const LIMB_RIM: f64 = 0.6;
/// Sections along a limb, as fractions of its length: without the ends, where limbs overlap with their neighbors.
pub(crate) const ALONG_LIMB: [f64; 5] = along_limb(0.1);
/// Points across a limb, as fractions of its radius from the middle.
pub(crate) const ACROSS_LIMB: [f64; 5] = across_limb(LIMB_RIM);
/// Fractions below this count as small: of the expected visible surface, of free-space violations, of the hidden part of a body,
/// and of roundness.
pub(crate) const LITTLE: f64 = 0.3;
/// Minimum number of patches that a fraction refers to, because fractions of fewer patches fluctuate. Without a depth image, a
/// limb with as many points counts as measured.
pub(crate) const FEW: f64 = 5.0;
/// Distance from the model's surface at which a point counts as unexplained, meters. The surface violates free space where the
/// background is this far behind it, or a possible body point twice as far, and what is twice as far before it occludes it.
pub(crate) const EXPLAINED: f64 = 0.04;
/// Tolerance for the overlap of limb surfaces, meters: they overlap by this much at joints and where they touch. Only greater
/// depths count as occlusion or as intersection.
pub(crate) const OVERLAP: f64 = 0.01;

/// Five evenly spaced places along a limb, as fractions of its length, the outermost ones so far from its ends.
pub(crate) const fn along_limb(from_end: f64) -> [f64; 5] {
    let between = 0.5 * (from_end + 0.5);
    [from_end, between, 0.5, 1.0 - between, 1.0 - from_end]
}

/// Five evenly spaced places across a limb, as fractions of its radius from the middle, the outermost ones at `rim`.
pub(crate) const fn across_limb(rim: f64) -> [f64; 5] {
    [-rim, -0.5 * rim, 0.0, 0.5 * rim, rim]
}
