//! What was measured: the frame, what of it may be the body, and what its images say about places in space.

pub mod background;
mod background_update;
pub mod candidates;
pub(crate) mod clusters;
pub mod depth_view;
pub mod frame;
pub mod observer;
pub mod registration;
pub(crate) mod segments;
