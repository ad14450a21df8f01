//! All tests of the core's interface in one program: as many programs would take twice as long to build.
//! What counts allocations is a program of its own.

mod color_scene;
mod scene;
mod shape_support;

mod camera;
mod detection;
mod determinism;
mod hostile;
mod properties;
mod refusals;
mod regions;
mod relocalization;
mod render;
mod shape_batch;
mod shape_closest;
mod shape_ray;
mod status;
mod terms;
mod tree;

use voodoo_core::{Body, Config, TrackError, Tracker};

/// A tracker without a detector; voodoo-detect runs some of these files with its own.
fn tracker(body: Body, config: Config) -> Result<Tracker, TrackError> {
    Tracker::new(body, config)
}
