//! What was measured: the frame, what of it may be the body, and what its images say about places in space.
//!
//! `frame` is what goes in (K06 IV-A). Step 1 of the method, the choice of points that may lie on the body (K06 IV-B.1), is
//! `candidates`, with `pixels` and `background`; `clusters` sorts them for the next step. `depth_view` asks the images about places in
//! space, `segments` looks for a lost body, `window` for what is near the body, and `registration` brings that into the picture of
//! another camera, with `far_edges` between surfaces, `chroma` tells colors, `masks` and `mask_regions` where skin's are, and
//! `still` what stands. `sites` knows where named sites will be, and which measurements of them are believed.

pub(crate) mod background;
mod background_moved;
mod background_update;
pub(crate) mod candidates;
pub(crate) mod clusters;
pub(crate) mod depth_view;
pub(crate) mod frame;
pub(crate) mod observer;
pub(crate) mod ownership;
pub(crate) mod picture;
pub(crate) mod pixels;
pub(crate) mod segments;
pub(crate) mod sites;
