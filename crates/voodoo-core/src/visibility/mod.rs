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
/// Sections along a limb, as fractions of its length: evenly spaced, without the ends, where limbs overlap with their neighbors.
pub(crate) const ALONG_LIMB: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Points across a limb, as fractions of its radius from the middle: evenly spaced.
pub(crate) const ACROSS_LIMB: [f64; 5] = [-LIMB_RIM, -0.3, 0.0, 0.3, LIMB_RIM];
/// Fractions below this count as small: of the expected visible surface, of free-space violations, of the hidden part of a body,
/// and of roundness.
pub(crate) const LITTLE: f64 = 0.3;
/// Minimum number of patches that a fraction refers to, because fractions of fewer patches fluctuate. Without a depth image, a
/// limb with as many points counts as measured.
pub(crate) const FEW: f64 = 5.0;
/// Distance from the model's surface at which a point counts as unexplained, meters. The surface violates free space where the
/// background is this far behind it, or a possible body point twice as far.
pub(crate) const EXPLAINED: f64 = 0.04;
/// Tolerance for the overlap of limb surfaces, meters: they overlap by this much at joints and where they touch. Only greater
/// depths count as occlusion or as intersection.
pub(crate) const OVERLAP: f64 = 0.01;
