//! Skin color as a cue for head and hands (K06 III-A).
//!
//! All regions become candidates without a label. They are followed in space (see `blobs`), so that a hand keeps its name while the body
//! model falls behind. What keeps a hand with its owner:
//!
//! * A region that is larger than a hand (a bare forearm, a door) offers its tips, not its middle, and of the tips of a forearm the one
//!   that is not the elbow's.
//! * What has had skin's color for long where no head or hand was is background (a wooden door); with a depth image, so is what lies
//!   nowhere near the body.
//! * Where two new candidates could both be a site, neither is taken. A site that was lost is taken up far from where it is expected only
//!   in a region that belongs to no other site and that the body does not explain where it is thought to be.
//! * The colors are learned where two of head and hands show them, with a forgetting factor, so that they follow the light and the person.
//!
//! With a depth image a region is a place in space, not only a ray.

mod assignment;
pub mod blobs;
pub mod candidates;
pub mod colors;
pub mod cue;
mod cutout;
mod discs;
mod naming;
pub mod picture;
pub mod rules;
pub mod teacher;
