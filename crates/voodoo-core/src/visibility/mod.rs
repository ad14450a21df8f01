//! What cameras should see of a posed body, and what they do see of it.
//!
//! `render` predicts a depth image, `evidence` says how well a pose explains the frame, `limb_support` what only one arm or leg
//! explains, and `roundness` whether what is seen is round as limbs are; all of them look at the places of `surface`.

pub(crate) mod evidence;
pub(crate) mod limb_support;
pub(crate) mod render;
pub(crate) mod roundness;
pub(crate) mod surface;

/// At so many places along and across a limb its surface is compared with images.
const SECTIONS: usize = 5;
/// The outermost of those across, in shares of the radius from the middle: nearer to the rim, a pixel shows what lies beside it.
pub(crate) const LIMB_RIM: f64 = 0.6;
/// Where they are along a limb, in shares of its length: evenly, and not at the ends, which belong to the neighbors as well.
pub(crate) const ALONG_LIMB: [f64; SECTIONS] = middles();
/// Where they are across a limb, in shares of its radius from the middle: evenly.
pub(crate) const ACROSS_LIMB: [f64; SECTIONS] = evenly();
/// A smaller share of anything is little: of what a limb should show, of what it may be seen past, of a body that is hidden, of how
/// round it is.
pub(crate) const LITTLE: f64 = 0.3;
/// Fewer patches flicker: shares are of so many at least. As many points make a limb measured where there is no depth image.
pub(crate) const FEW: f64 = 5.0;
/// Surfaces of limbs lie in each other by so much at their joints, and touch elsewhere, meters: no less stands before another one,
/// or where there is no room for it.
pub(crate) const OVERLAP: f64 = 0.01;

/// The middles of as many equal parts of a length of one.
const fn middles() -> [f64; SECTIONS] {
    let mut places = [0.0; SECTIONS];
    let mut index = 0;
    while index < SECTIONS {
        places[index] = (2 * index + 1) as f64 / (2 * SECTIONS) as f64;
        index += 1;
    }
    places
}

/// As many places, evenly from one rim to the other.
const fn evenly() -> [f64; SECTIONS] {
    let mut places = [0.0; SECTIONS];
    let (step, middle) = (2.0 * LIMB_RIM / (SECTIONS - 1) as f64, (SECTIONS - 1) as f64 / 2.0);
    let mut index = 0;
    while index < SECTIONS {
        places[index] = (index as f64 - middle) * step;
        index += 1;
    }
    places
}
