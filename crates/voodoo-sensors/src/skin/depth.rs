//! Looks up the depth of a color camera's pixels in the image of a depth camera beside it.

use crate::eye::Eye;
use crate::registration::ONE_SURFACE;
use voodoo_core::DepthPixels;

/// A depth image beside a color camera.
#[derive(Clone, Copy, Debug)]
pub struct DepthBeside<'a> {
    /// Its pixels, row by row.
    pub image: DepthPixels<'a>,
    /// Length of one unit of the pixels, meters.
    pub meters_per_unit: f64,
    /// The depth camera.
    pub eye: Eye<'a>,
}

impl DepthBeside<'_> {
    /// Depth along the color camera's axis, meters, of what is seen on its ray `(x/z, y/z)`; `None` if it is not known. `z` is the
    /// depth that is expected.
    pub(super) fn at(&self, color: &Eye, ray: [f64; 2], z: f64) -> Option<f64> {
        let first = self.depth_at(color, ray, z)?;
        if (first - z).abs() < ONE_SURFACE {
            return Some(first);
        }
        // The two cameras see what is farther or nearer at another offset.
        self.depth_at(color, ray, first).filter(|second| (second - first).abs() < ONE_SURFACE)
    }

    /// Depth of what the depth camera sees where this ray has the depth `z`.
    fn depth_at(&self, color: &Eye, ray: [f64; 2], z: f64) -> Option<f64> {
        let camera = self.eye.camera;
        let index = camera.index_of(self.eye.in_sensor(color.place(ray, z)))?;
        let depth = f64::from(self.image.get(index)) * self.meters_per_unit;
        let place = self.eye.place(camera.rays()[index].map(f64::from), depth);
        Some(color.in_sensor(place).z).filter(|z| depth > 0.0 && z.is_finite())
    }
}
