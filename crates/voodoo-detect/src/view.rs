//! The depth image as the detector uses it: subsampled, in meters, without pixels that cannot belong to a person.

use voodoo_core::math::{Vec3, refill};
use voodoo_core::{Camera, DepthImage, Ground, Surroundings};

/// Columns and rows are subsampled until an image has at most this many pixels. A person at 4 m is then still 30 pixels wide and
/// 80 high.
const MOST_PIXELS: usize = 26_000;
/// Points less than this far above the floor are removed, meters: otherwise feet would connect a person to the floor.
const FLOOR_CLEARANCE: f64 = 0.06;
/// Range of depths that is searched for persons, meters.
const RANGE: [f32; 2] = [0.4, 12.0];

/// The subsampled image. Points are in the camera's optical frame.
#[derive(Debug, Default)]
pub(crate) struct ThinnedImage {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Subsampling step: every `step`-th column and row of the image is kept.
    pub(crate) step: usize,
    /// Depth, meters; 0 where there is no return or where the pixel cannot belong to a person.
    pub(crate) depth: Vec<f32>,
    /// `(x/z, y/z)` of every pixel.
    pub(crate) slopes: Vec<[f32; 2]>,
    camera: Option<Camera>,
}

impl ThinnedImage {
    /// Reads an image. Pixels that cannot belong to a person are removed, except for the floor.
    pub(crate) fn read(&mut self, image: &DepthImage, around: &Surroundings) {
        let mut step = 1;
        let [width, height] = [image.camera.width(), image.camera.height()];
        while (width.div_ceil(step)) * (height.div_ceil(step)) > MOST_PIXELS {
            step += 1;
        }
        if self.camera.as_ref() != Some(image.camera) {
            (self.width, self.height, self.step) = (width.div_ceil(step), height.div_ceil(step), step);
            self.camera = Some(image.camera.clone());
            let ray = |row, column| image.camera.pixel_ray(column, row).map(|value| value as f32);
            let rows = (0..height).step_by(step);
            let slopes = rows.flat_map(|row| (0..width).step_by(step).map(move |column| ray(row, column)));
            refill(&mut self.slopes, slopes);
        }
        self.depth.clear();
        for (row, slopes) in (0..height).step_by(step).zip(self.slopes.chunks(self.width.max(1))) {
            for (column, slope) in (0..width).step_by(step).zip(slopes) {
                let index = row * width + column;
                let z = image.pixels.get(index) * image.meters_per_unit as f32;
                let returned = z > RANGE[0] && z < RANGE[1] && !slope[0].is_nan();
                let place = |[x, y]: [f32; 2]| f64::from(z) * Vec3::new(f64::from(x), f64::from(y), 1.0);
                let excluded =
                    || !around.excluded.is_empty() && around.excludes(image.world_from_sensor * place(*slope));
                let kept = returned && !around.is_others(index) && !excluded();
                self.depth.push(if kept { z } else { 0.0 });
            }
        }
    }

    /// Removes the known scene.
    pub(crate) fn remove_explained(&mut self, around: &Surroundings) {
        let width = self.camera.as_ref().map_or(0, Camera::width);
        for (row, depths) in self.depth.chunks_mut(self.width.max(1)).enumerate() {
            for (column, z) in depths.iter_mut().enumerate() {
                if *z > 0.0 && around.explains((row * width + column) * self.step, *z) {
                    *z = 0.0;
                }
            }
        }
    }

    /// The point of a pixel, camera frame.
    pub(crate) fn point(&self, index: usize) -> Vec3 {
        let (z, [x, y]) = (f64::from(self.depth[index]), self.slopes[index]);
        Vec3::new(z * f64::from(x), z * f64::from(y), z)
    }

    /// Removes points on the floor or below it.
    pub(crate) fn remove_floor(&mut self, floor: &Ground) {
        let normal = floor.normal.as_vec3().to_array();
        let least = (floor.offset + FLOOR_CLEARANCE) as f32;
        for (z, [x, y]) in self.depth.iter_mut().zip(&self.slopes) {
            if *z * (normal[0] * x + normal[1] * y + normal[2]) < least {
                *z = 0.0;
            }
        }
    }

    /// The pixel in the direction `(x/z, y/z)`.
    pub(crate) fn pixel_at(&self, [x, y]: [f32; 2]) -> Option<usize> {
        let [column, row] = self.camera.as_ref()?.pixel([f64::from(x), f64::from(y)])?;
        let step = self.step as f32;
        let (column, row) = ((column as f32 / step).round(), (row as f32 / step).round());
        let inside = column >= 0.0 && row >= 0.0 && column < self.width as f32 && row < self.height as f32;
        inside.then(|| row as usize * self.width + column as usize)
    }

    /// Surface area that a pixel covers at a depth of 1 m, square meters.
    pub(crate) fn pixel_area(&self) -> f64 {
        let [fx, fy] = self.camera.as_ref().map_or([1.0; 2], Camera::focal);
        (self.step * self.step) as f64 / (fx * fy)
    }

    /// The pixels of the full image that a pixel stands for: those that it is nearest to.
    pub(crate) fn block(&self, index: usize) -> impl Iterator<Item = usize> {
        let [rows, columns] = self.camera.as_ref().map_or([0; 2], |camera| [camera.height(), camera.width()]);
        let before = (self.step - 1) / 2;
        let nearest = |at: usize, size: usize| {
            let last = (at + 1) * self.step >= size;
            let end = if last { size } else { (at + 1) * self.step - before };
            (at * self.step).saturating_sub(before)..end
        };
        let across = nearest(index % self.width, columns);
        nearest(index / self.width, rows).flat_map(move |row| across.clone().map(move |column| row * columns + column))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use voodoo_core::DepthPixels;
    use voodoo_core::math::Pose;

    #[test]
    fn a_pixel_stands_for_those_that_it_is_nearest_to() {
        let (pixels, camera) = (vec![2000; 640 * 480], Camera::pinhole(640, 480, [560.0, 560.0, 319.5, 239.5]));
        let camera = &camera.unwrap();
        let image = DepthImage {
            pixels: DepthPixels::U16(&pixels),
            camera,
            meters_per_unit: 0.001,
            world_from_sensor: Pose::IDENTITY,
            weight: 1.0,
            source: 0,
        };
        let mut view = ThinnedImage::default();
        view.read(&image, &Surroundings::default());
        let mut covered = vec![0; image.camera.pixels()];
        for index in 0..view.depth.len() {
            for pixel in view.block(index) {
                covered[pixel] += 1;
            }
        }
        assert!(covered.iter().all(|count| *count == 1));
        let width = image.camera.width();
        let middle = view.block(view.width + 1).map(|pixel| (pixel % width) as f64);
        let count = view.step * view.step;
        let off = middle.sum::<f64>() / count as f64 - view.step as f64;
        assert!(off.abs() <= 0.5, "{off}");
    }
}
