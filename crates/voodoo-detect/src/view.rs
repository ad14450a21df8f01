//! A depth image as the detector looks at it: thinned out, in metres, without what cannot be a person.

use voodoo_core::detect::Surroundings;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::observation::frame::{DepthImage, Ground};

/// Columns and rows are thinned out until an image has at most so many pixels: a person at 4 m then still is 30 wide and 80 high.
const MOST_PIXELS: usize = 26_000;
/// What lies less than this above the floor is left out, metres: feet would join the person to the floor.
const FLOOR_CLEARANCE: f64 = 0.06;
/// Depths between which persons are looked for, metres.
const RANGE: [f32; 2] = [0.4, 12.0];

/// The thinned image. Points are in the camera's optical frame.
#[derive(Debug, Default)]
pub(crate) struct View {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Every so manyth column and row of the image was kept.
    pub(crate) step: usize,
    /// Depth, metres; 0: nothing, or nothing that may be a person.
    pub(crate) depth: Vec<f32>,
    /// `(x/z, y/z)` of every pixel.
    pub(crate) slopes: Vec<[f32; 2]>,
    /// `x/z` of every column where the lens has no distortion.
    across: Vec<f32>,
    /// The image's width, for its pixels' indices.
    columns: usize,
    intrinsics: [f64; 4],
}

impl View {
    /// Reads an image; what holds nobody is left out but for the floor.
    pub(crate) fn read(&mut self, image: &DepthImage, around: &Surroundings) {
        let mut step = 1;
        while (image.width.div_ceil(step)) * (image.height.div_ceil(step)) > MOST_PIXELS {
            step += 1;
        }
        (self.width, self.height, self.step) = (image.width.div_ceil(step), image.height.div_ceil(step), step);
        (self.columns, self.intrinsics) = (image.width, image.intrinsics);
        self.depth.clear();
        self.slopes.clear();
        let [fx, fy, cx, cy] = image.intrinsics;
        self.across.clear();
        self.across.extend((0..image.width).step_by(step).map(|column| ((column as f64 - cx) / fx) as f32));
        for row in (0..image.height).step_by(step) {
            let down = ((row as f64 - cy) / fy) as f32;
            for (column, across) in (0..image.width).step_by(step).zip(&self.across) {
                let index = row * image.width + column;
                let slope = image.rays.map_or([*across, down], |rays| rays[index]);
                let z = image.pixels.get(index) * image.metres_per_unit as f32;
                let kept = z > RANGE[0] && z < RANGE[1] && !around.explains(index, z);
                self.depth.push(if kept { z } else { 0.0 });
                self.slopes.push(slope);
            }
        }
        self.exclude(&image.world_from_sensor, around);
    }

    fn exclude(&mut self, world_from_camera: &Pose, around: &Surroundings) {
        if around.excluded.is_empty() {
            return;
        }
        for index in 0..self.depth.len() {
            if self.depth[index] > 0.0 {
                let point = *world_from_camera * self.point(index);
                if around.excludes(point) {
                    self.depth[index] = 0.0;
                }
            }
        }
    }

    /// The point of a pixel, camera frame.
    pub(crate) fn point(&self, index: usize) -> Vec3 {
        let (z, [x, y]) = (f64::from(self.depth[index]), self.slopes[index]);
        Vec3::new(z * f64::from(x), z * f64::from(y), z)
    }

    /// Leaves out what is on the floor or below it.
    pub(crate) fn remove_floor(&mut self, floor: &Ground) {
        let normal = floor.normal.to_array().map(|value| value as f32);
        let least = (floor.offset + FLOOR_CLEARANCE) as f32;
        for (z, [x, y]) in self.depth.iter_mut().zip(&self.slopes) {
            if *z * (normal[0] * x + normal[1] * y + normal[2]) < least {
                *z = 0.0;
            }
        }
    }

    /// The pixel in whose direction `(x/z, y/z)` lies.
    pub(crate) fn pixel_at(&self, [x, y]: [f32; 2], distorted: bool) -> Option<usize> {
        let [fx, fy, cx, cy] = self.intrinsics.map(|value| value as f32);
        let (mut column, mut row) = (fx * x + cx, fy * y + cy);
        if distorted {
            // Fixed point of the lens: the pinhole's error at a pixel is nearly that at its neighbour.
            for _ in 0..3 {
                let index = self.index(column, row)?;
                let seen = self.slopes[index];
                let (at_column, at_row) = self.place(index);
                column = at_column + fx * (x - seen[0]);
                row = at_row + fy * (y - seen[1]);
            }
        }
        self.index(column, row)
    }

    fn index(&self, column: f32, row: f32) -> Option<usize> {
        let step = self.step as f32;
        let (column, row) = ((column / step).round(), (row / step).round());
        let inside = column >= 0.0 && row >= 0.0 && column < self.width as f32 && row < self.height as f32;
        inside.then(|| row as usize * self.width + column as usize)
    }

    fn place(&self, index: usize) -> (f32, f32) {
        (((index % self.width) * self.step) as f32, ((index / self.width) * self.step) as f32)
    }

    /// Surface that a pixel covers at a depth of 1 m, square metres.
    pub(crate) fn pixel_area(&self) -> f64 {
        (self.step * self.step) as f64 / (self.intrinsics[0] * self.intrinsics[1])
    }

    /// The pixels of the image for which one with this index in the image stands.
    pub(crate) fn block(&self, index: usize, into: &mut Vec<usize>) {
        let (row, column) = (index / self.columns, index % self.columns);
        for row in row..row + self.step {
            into.extend((column..(column + self.step).min(self.columns)).map(|column| row * self.columns + column));
        }
    }

    /// Index in the image of a pixel.
    pub(crate) fn in_image(&self, index: usize) -> usize {
        (index / self.width) * self.step * self.columns + (index % self.width) * self.step
    }
}
