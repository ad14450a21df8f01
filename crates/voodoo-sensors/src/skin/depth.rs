//! Looks up the depth of a color camera's pixels in the image of a depth camera beside it.

use crate::eye::{Eye, Matrix};
use voodoo_core::math::Vec3;
use voodoo_core::{Camera, DepthPixels, TrackError};

/// Two depths within this are of one surface, meters.
const SAME: f64 = 0.1;

/// A depth image and the transforms between its camera and a color camera.
#[derive(Clone, Copy, Debug)]
pub struct DepthBeside<'a> {
    image: DepthPixels<'a>,
    meters_per_unit: f64,
    camera: &'a Camera,
    depth_from_color: Matrix,
}

impl<'a> DepthBeside<'a> {
    /// A depth image whose camera has this pose, beside the color camera `eye`.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when the image is not of the camera's size.
    pub fn new(
        image: DepthPixels<'a>,
        meters_per_unit: f64,
        camera: &'a Camera,
        world_from_depth: Matrix,
        eye: &Eye,
    ) -> Result<Self, TrackError> {
        if camera.pixels() != image.len() {
            let found = format!("{} for {} pixels", image.len(), camera.pixels());
            return Err(TrackError::measurement("depth", "a depth for every pixel of the camera", found));
        }
        let depth = Eye { world_from_sensor: world_from_depth, camera };
        let origin = depth.in_sensor(eye.origin()).to_array();
        let mut depth_from_color = [[0.0; 4]; 4];
        for row in 0..3 {
            for column in 0..3 {
                depth_from_color[row][column] =
                    (0..3).map(|of| world_from_depth[of][row] * eye.world_from_sensor[of][column]).sum();
            }
            depth_from_color[row][3] = origin[row];
        }
        Ok(Self { image, meters_per_unit, camera, depth_from_color })
    }

    /// Depth along the color camera's axis, meters, of what is seen on its ray `(x/z, y/z)`, if that is near the depth `z`;
    /// `None` if it is not known.
    pub(super) fn at(&self, ray: [f64; 2], z: f64) -> Option<f64> {
        let first = self.look(ray, z)?;
        if (first - z).abs() < SAME {
            return Some(first);
        }
        // The two cameras see what is farther or nearer at another offset.
        self.look(ray, first).filter(|second| (second - first).abs() < SAME)
    }

    fn look(&self, [x, y]: [f64; 2], z: f64) -> Option<f64> {
        let transform = &self.depth_from_color;
        let turned =
            |row: usize, [x, y, z]: [f64; 3]| transform[row][0] * x + transform[row][1] * y + transform[row][2] * z;
        let place = [0, 1, 2].map(|row| turned(row, [x * z, y * z, z]) + transform[row][3]);
        let [u, v] = self.camera.project(Vec3::from_array(place))?.map(f64::round);
        let (width, height) = (self.camera.width() as f64, self.camera.height() as f64);
        if !(u >= 0.0 && v >= 0.0 && u < width && v < height) {
            return None;
        }
        let index = v as usize * self.camera.width() + u as usize;
        let depth = f64::from(self.image.get(index)) * self.meters_per_unit;
        if !(depth > 0.0 && depth.is_finite()) {
            return None;
        }
        let [x, y] = self.camera.rays()[index].map(f64::from);
        let offset = [x * depth, y * depth, depth];
        let offset = [0, 1, 2].map(|row| offset[row] - transform[row][3]);
        // The inverse of a rigid transform.
        Some((0..3).map(|row| transform[row][2] * offset[row]).sum())
    }
}
