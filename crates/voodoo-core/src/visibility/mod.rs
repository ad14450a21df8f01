//! What cameras should see of a posed body, and what they do see of it.
//!
//! `render` predicts a depth image, `evidence` says how well a pose explains the frame, `limb_support` what only one arm or leg
//! explains, and `roundness` whether what is seen is round as limbs are.

pub mod evidence;
pub mod limb_support;
pub mod render;
pub mod roundness;

/// Places along a limb, and as many across it, at which its surface is compared with images: costs time in proportion.
const PLACES: usize = 5;
/// The outermost ones across, in shares of its radius from the middle; nearer to the rim, a pixel shows what lies beside it.
const OUTERMOST: f64 = 0.6;
/// Where along a limb, in shares of its length: evenly, and not at the ends, which belong to the neighbours as well.
pub(crate) const ALONG_LIMB: [f64; PLACES] = along();
/// Where across a limb, in shares of its radius from the middle.
pub(crate) const ACROSS_LIMB: [f64; PLACES] = across();
/// A point this far from the model's surface is not explained by it, metres.
pub const EXPLAINED: f64 = 0.04;
/// A camera sees past the model's surface when what may be the body lies this much behind it, metres; half as much of what is
/// known to be the background, since that is not the body.
pub(crate) const SEEN_PAST: f64 = 2.0 * EXPLAINED;
/// Points of a frame at which a pose is compared with it, at most or about: costs time in proportion.
pub(crate) const SAMPLE: usize = 400;
/// No more patches than this may be stray ones, and say nothing.
pub(crate) const FEW: f64 = 5.0;
/// From this share of a limb on what is said of it counts: less flickers.
pub(crate) const NOTABLE: f64 = 0.3;
/// A rough pose explains points up to this distance, metres: they are drawn in when it is refined.
pub(crate) const ROUGHLY: f64 = SEEN_PAST;
/// A quarter of a whole: cameras that see past as much of an arm or leg refute it, a body of which as much shows is there, and
/// one of whose limbs as many are not measured is tracked at most.
pub(crate) const QUARTER: f64 = 0.25;
/// Limbs overlap by this at their joints, and where their surfaces touch, metres.
pub(crate) const OVERLAP: f64 = 0.01;

/// The middles of equal parts.
const fn along() -> [f64; PLACES] {
    let (mut places, mut index) = ([0.0; PLACES], 0);
    while index < PLACES {
        places[index] = (2 * index + 1) as f64 / (2 * PLACES) as f64;
        index += 1;
    }
    places
}

/// Evenly from rim to rim.
const fn across() -> [f64; PLACES] {
    let (mut places, mut index) = ([0.0; PLACES], 0);
    while index < PLACES {
        places[index] = OUTERMOST * ((2 * index) as f64 / (PLACES - 1) as f64 - 1.0);
        index += 1;
    }
    places
}
