//! All tests of the core's interface in one program: as many programs would take twice as long to build.
//! What counts allocations is a program of its own.

mod color_scene;
mod scene;
mod shape_support;

mod camera;
mod detector_check;
mod determinism;
mod hostile;
mod people;
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
