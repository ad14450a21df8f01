//! Images for tests: no file is read.

use crate::math::Pose;
use crate::observation::frame::{DepthImage, DepthPixels};

/// A depth image in metres whose centre is that of its pixels, from a camera at the world's origin.
pub fn image(pixels: &[f32], width: usize, focal: f64) -> DepthImage<'_> {
    let height = pixels.len() / width;
    DepthImage {
        pixels: DepthPixels::F32(pixels),
        width,
        height,
        metres_per_unit: 1.0,
        intrinsics: [focal, focal, 0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)],
        rays: None,
        world_from_sensor: Pose::identity(),
        weight: 1.0,
        source: 0,
    }
}
