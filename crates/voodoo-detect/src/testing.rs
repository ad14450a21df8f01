//! Shared by unit tests: a synthetic depth camera, and a human before it.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

#[path = "../../voodoo-core/tests/before_camera/mod.rs"]
mod before_camera;

pub(crate) use before_camera::{before_wall, millimeters as image, put_board};
use voodoo_core::math::Pose;
use voodoo_core::{Body, HumanModel};

/// A human who stands there.
pub(crate) fn standing() -> (Body, Vec<Pose>) {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = before_camera::stand(&body);
    (body, poses)
}
