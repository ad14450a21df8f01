//! What cameras should see of a posed body, and what they do see of it.
//!
//! `render` predicts a depth image, `evidence` says how well a pose explains the frame, `limb_support` what only one arm or leg
//! explains, and `roundness` whether what is seen is round as limbs are.

pub mod evidence;
pub mod limb_support;
pub mod render;
pub mod roundness;

/// At so many places along and across a limb its surface is compared with images.
const SECTIONS: usize = 5;
/// The outermost of those across, in shares of the radius from the middle: nearer to the rim, a pixel shows what lies beside it.
const LIMB_RIM: f64 = 0.7;
/// Where they are along a limb, in shares of its length: evenly, and not at the ends, which belong to the neighbours as well.
pub(crate) const ALONG_LIMB: [f64; SECTIONS] = middles();
/// Where they are across a limb, in shares of its radius from the middle: evenly.
pub(crate) const ACROSS_LIMB: [f64; SECTIONS] = evenly(LIMB_RIM);
/// A camera sees past the model's surface when what may be the body lies this much behind it, metres; half as much of what is
/// known to be the background, since that is not the body.
pub(crate) const SEEN_PAST: f64 = 0.08;
/// A smaller share of what a limb should show is little: it is idle that alone explains no more, hidden that shows no more, and of one
/// that is right cameras may see past so much.
pub(crate) const LITTLE: f64 = 0.3;
/// Surfaces of limbs lie in each other by so much at their joints, and touch elsewhere, metres: no less stands before another one,
/// or where there is no room for it.
pub(crate) const OVERLAP: f64 = 0.01;

/// The middles of as many equal parts of a length of one.
const fn middles<const PARTS: usize>() -> [f64; PARTS] {
    let mut places = [0.0; PARTS];
    let mut index = 0;
    while index < PARTS {
        places[index] = (2 * index + 1) as f64 / (2 * PARTS) as f64;
        index += 1;
    }
    places
}

/// As many places, evenly from one side to the other, as far as `rim` from the middle.
pub(crate) const fn evenly<const PARTS: usize>(rim: f64) -> [f64; PARTS] {
    let mut places = [0.0; PARTS];
    let (step, middle) = (2.0 * rim / (PARTS - 1) as f64, (PARTS - 1) as f64 / 2.0);
    let mut index = 0;
    while index < PARTS {
        places[index] = (index as f64 - middle) * step;
        index += 1;
    }
    places
}
