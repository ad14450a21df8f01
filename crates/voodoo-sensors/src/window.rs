//! The part of a depth image in which the body is expected, and what of it lies in a box.

use std::ops::Range;

use voodoo_core::error::TrackError;
use voodoo_core::math::widest;

/// Part of a depth image (metres, along the optical axis) in which the body is expected.
#[derive(Clone, Debug)]
pub struct Window<'a> {
    /// Depths, row by row; what is not finite and above zero is no return.
    pub depth: &'a [f32],
    /// Rows and columns of that image.
    pub size: [usize; 2],
    /// `(x/z, y/z)` of every pixel of the camera, row by row.
    pub rays: &'a [[f32; 2]],
    /// Rows and columns of the camera.
    pub camera: [usize; 2],
    /// The image has every so-many-th row and column of the camera.
    pub step: usize,
    /// Rows of the image that are looked at.
    pub rows: Range<usize>,
    /// And columns.
    pub columns: Range<usize>,
}

impl Window<'_> {
    fn check(&self) -> Result<(), TrackError> {
        let [height, width] = self.size;
        let fits = self.step > 0
            && self.size.iter().zip(&self.camera).all(|(size, camera)| *size == camera.div_ceil(self.step.max(1)))
            && self.camera[0].checked_mul(self.camera[1]) == Some(self.rays.len())
            && height.checked_mul(width) == Some(self.depth.len());
        if fits && self.rows.end <= height && self.columns.end <= width {
            return Ok(());
        }
        let found = format!(
            "{} depths for {:?}, {} rays for {:?}, step {}, rows {:?} and columns {:?}",
            self.depth.len(),
            self.size,
            self.rays.len(),
            self.camera,
            self.step,
            self.rows,
            self.columns
        );
        Err(TrackError::measurement(
            "window",
            "a depth, and a ray, for every pixel, and rows and columns of them",
            found,
        ))
    }

    /// The points within the box from `low` to `high` (world, metres), in the frame of another camera, metres; and the index
    /// of each one's pixel in the image.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when sizes do not fit together.
    pub fn within(
        &self,
        low: [f64; 3],
        high: [f64; 3],
        world_from_sensor: &[[f64; 4]; 4],
        other_from_sensor: &[[f64; 4]; 4],
    ) -> Result<(Vec<[f64; 3]>, Vec<isize>), TrackError> {
        self.check()?;
        let to_world = world_from_sensor.map(|row| row.map(|entry| entry as f32));
        // Values of single precision are between these where they are between the corners.
        let (low, high) = (low.map(below), high.map(|value| -below(-value)));
        let (rows, count) = (self.rows.clone(), self.columns.len());
        let mut inside = vec![false; rows.len() * count];
        for (row, inside) in rows.clone().zip(inside.chunks_exact_mut(count.max(1))) {
            let depths = &self.depth[row * self.size[1]..][self.columns.clone()];
            let rays = &self.rays[(row * self.camera[1] + self.columns.start) * self.step..];
            widest(
                #[inline(always)]
                || {
                    // One column after the other fills whole registers.
                    if self.step == 1 {
                        gate(inside, depths.iter().zip(rays), (low, high), &to_world);
                    } else {
                        gate(inside, depths.iter().zip(rays.iter().step_by(self.step)), (low, high), &to_world);
                    }
                },
            );
        }
        let found = inside.iter().map(|inside| usize::from(*inside)).sum();
        let (mut points, mut pixels) = (Vec::with_capacity(found), Vec::with_capacity(found));
        for (row, inside) in rows.zip(inside.chunks_exact(count.max(1))) {
            let first = row * self.size[1] + self.columns.start;
            let depths = &self.depth[first..][..count];
            let rays = &self.rays[(row * self.camera[1] + self.columns.start) * self.step..];
            // Most of the columns are passed over, some at once.
            for (block, inside) in inside.chunks(COLUMNS_TOGETHER).enumerate().filter(|(_, inside)| any(inside)) {
                for (offset, _) in inside.iter().enumerate().filter(|(_, inside)| **inside) {
                    let offset = block * COLUMNS_TOGETHER + offset;
                    let (z, ray) = (depths[offset], rays[offset * self.step]);
                    let [x, y, z] = [ray[0] * z, ray[1] * z, z].map(f64::from);
                    points.push([0, 1, 2].map(|axis| {
                        let turn = &other_from_sensor[axis];
                        turn[0] * x + turn[1] * y + turn[2] * z + turn[3]
                    }));
                    pixels.push((first + offset) as isize);
                }
            }
        }
        Ok((points, pixels))
    }
}

/// Columns that are passed over together where none of them holds anything.
const COLUMNS_TOGETHER: usize = 16;

/// Whether some of these are marked; all are read at once, which is faster than to look for the first one.
fn any(marks: &[bool]) -> bool {
    marks.iter().fold(false, |any, mark| any | mark)
}

/// The greatest value of single precision that is not above another one.
fn below(value: f64) -> f32 {
    let near = value as f32;
    if f64::from(near) > value { near.next_down() } else { near }
}

/// Which depths along rays are returns from within a box (world, metres).
#[inline(always)]
fn gate<'a>(
    inside: &mut [bool],
    pixels: impl Iterator<Item = (&'a f32, &'a [f32; 2])>,
    (low, high): ([f32; 3], [f32; 3]),
    to_world: &[[f32; 4]; 4],
) {
    for (inside, (z, ray)) in inside.iter_mut().zip(pixels) {
        let (x, y) = (ray[0] * z, ray[1] * z);
        let mut passes = z.is_finite() & (*z > 0.0);
        for axis in 0..3 {
            let turn = &to_world[axis];
            let place = turn[0] * x + turn[1] * y + turn[2] * z + turn[3];
            passes &= (place > low[axis]) & (place < high[axis]);
        }
        *inside = passes;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    type Matrix = [[f64; 4]; 4];

    fn pose(angle: f64, shift: [f64; 3]) -> Matrix {
        let (sine, cosine) = angle.sin_cos();
        let [x, y, z] = shift;
        [[cosine, -sine, 0.0, x], [sine, cosine, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]]
    }

    fn moved(pose: &Matrix, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| pose[axis][0] * x + pose[axis][1] * y + pose[axis][2] * z + pose[axis][3])
    }

    #[test]
    fn points_within_a_box_are_those_found_one_by_one_and_what_does_not_fit_is_refused() {
        let camera = [48, 64];
        let rays: Vec<[f32; 2]> = (0..48 * 64_i32)
            .map(|index| [((index % 64) as f32 - 31.5) / 50.0, ((index / 64) as f32 - 23.5) / 52.0])
            .collect();
        let (world, other) = (pose(0.3, [0.1, 0.0, -0.2]), pose(-0.1, [0.05, 0.02, 0.01]));
        let (low, high) = ([-0.8, -0.6, 1.0], [0.7, 0.9, 2.4]);
        for step in [1, 3] {
            let size = camera.map(|count: usize| count.div_ceil(step));
            let mut depth: Vec<f32> = (0..size[0] * size[1])
                .map(|index| if index % 11 == 0 { 0.0 } else { 0.50037 + (index * 7919 % 3500) as f32 / 1000.0 })
                .collect();
            (depth[40], depth[61], depth[82]) = (f32::NAN, f32::INFINITY, -1.0);
            let (rows, columns) = (2..size[0] - 1, 1..size[1] - 3);
            let window =
                Window { depth: &depth, size, rays: &rays, camera, step, rows: rows.clone(), columns: columns.clone() };
            let (points, pixels) = window.within(low, high, &world, &other).unwrap();
            let mut expected = Vec::new();
            for row in rows {
                for column in columns.clone() {
                    let (index, ray) = (row * size[1] + column, rays[row * step * 64 + column * step]);
                    let z = depth[index];
                    let point = [ray[0] * z, ray[1] * z, z].map(f64::from);
                    let place = moved(&world, point);
                    if z.is_finite()
                        && z > 0.0
                        && (0..3).all(|axis| place[axis] > low[axis] && place[axis] < high[axis])
                    {
                        expected.push((index as isize, moved(&other, point)));
                    }
                }
            }
            assert!(expected.len() > 20 && pixels.iter().eq(expected.iter().map(|(index, _)| index)));
            let near =
                |(a, (_, b)): (&[f64; 3], &(isize, [f64; 3]))| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-6);
            assert!(points.iter().zip(&expected).all(near));
            for wrong in [
                Window { rows: 0..size[0] + 1, ..window.clone() },
                Window { columns: 0..size[1] + 1, ..window.clone() },
                Window { step: step + 1, ..window.clone() },
                Window { step: 0, ..window },
            ] {
                assert!(wrong.within(low, high, &world, &other).is_err());
            }
        }
    }
}
