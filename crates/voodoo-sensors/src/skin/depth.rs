//! Looks up the depth of a color camera's pixels in the image of a depth camera beside it.

use crate::eye::Eye;
use voodoo_core::{DepthPixels, TrackError};

/// Two depths within this are of one surface, meters.
const SAME: f64 = 0.1;

/// A depth image beside a color camera.
#[derive(Clone, Copy, Debug)]
pub struct DepthBeside<'a> {
    image: DepthPixels<'a>,
    meters_per_unit: f64,
    depth: Eye<'a>,
    color: Eye<'a>,
}

impl<'a> DepthBeside<'a> {
    /// The image of the camera `depth` beside the camera `color`.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when the image is not of the camera's size.
    pub fn new(
        image: DepthPixels<'a>,
        meters_per_unit: f64,
        depth: Eye<'a>,
        color: Eye<'a>,
    ) -> Result<Self, TrackError> {
        depth.check("depth", "a depth for every pixel of the camera", image.len())?;
        Ok(Self { image, meters_per_unit, depth, color })
    }

    /// Depth along the color camera's axis, meters, of what is seen on its ray `(x/z, y/z)`; `None` if it is not known. `z` is the
    /// depth that is expected.
    pub(super) fn at(&self, ray: [f64; 2], z: f64) -> Option<f64> {
        let first = self.look(ray, z)?;
        if (first - z).abs() < SAME {
            return Some(first);
        }
        // The two cameras see what is farther or nearer at another offset.
        self.look(ray, first).filter(|second| (second - first).abs() < SAME)
    }

    /// Depth of what the depth camera sees where this ray has the depth `z`.
    fn look(&self, ray: [f64; 2], z: f64) -> Option<f64> {
        let camera = self.depth.camera;
        let [u, v] = self.depth.pixel(self.depth.in_sensor(self.color.place(ray, z))).map(f64::round);
        if !(u >= 0.0 && v >= 0.0 && u < camera.width() as f64 && v < camera.height() as f64) {
            return None;
        }
        let index = v as usize * camera.width() + u as usize;
        let depth = f64::from(self.image.get(index)) * self.meters_per_unit;
        let place = self.depth.place(camera.rays()[index].map(f64::from), depth);
        Some(self.color.in_sensor(place).z).filter(|z| depth > 0.0 && z.is_finite())
    }
}
