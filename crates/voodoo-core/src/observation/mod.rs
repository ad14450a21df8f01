//! Measurements: the frame, which of its points may be the body, and what its images show at positions in space.
//!
//! `frame` is the input (K06 IV-A). Step 1 of the method, the selection of points that may lie on the body (K06 IV-B.1), is
//! `candidates`, with `pixels` and `background`; `clusters` sorts them for the next step. `depth_view` queries the images by
//! position. `segments` finds the foreground segments in which a lost body may be.

pub(crate) mod background;
mod background_moved;
pub(crate) mod candidates;
pub(crate) mod clusters;
pub(crate) mod depth_view;
pub(crate) mod frame;
pub(crate) mod observer;
pub(crate) mod ownership;
pub(crate) mod picture;
pub(crate) mod pixels;
pub(crate) mod segments;
