//! Skin color as a cue for head and hands (K06 III-A).
//!
//! All regions are unlabeled candidates. They are tracked in 3-D (see `blobs`), so that a hand keeps its label while the body
//! model lags. Four rules keep each region with its site:
//!
//! * A region larger than a hand (a bare forearm, a door) offers its tips as candidates instead of its middle. Of the tips of a
//!   forearm, the one at the elbow is excluded.
//! * A pixel that has had the color of skin for long, away from head and hands, is background (a wooden door). With a depth
//!   image, so is everything far from the body.
//! * If two new candidates are similarly near to a site, neither is accepted. A lost site is reassigned far from its predicted
//!   position only to a region that no other site has and that the estimated pose does not explain.
//! * A color is learned only if at least two of head and hands show it, with a forgetting factor, so that the model follows the
//!   light and the person.
//!
//! With a depth image a region has a 3-D position, not only a ray.

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
