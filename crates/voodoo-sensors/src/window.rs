//! Selects the points of a depth image that lie in a box around the body.

use std::ops::Range;

use voodoo_core::Camera;
use voodoo_core::TrackError;
use voodoo_core::math::widest;

/// The part of a depth image (meters, along the optical axis) in which the body is expected.
#[derive(Clone, Debug)]
pub(crate) struct Window<'a> {
    /// Depth image, row by row; values that are not finite and positive are no returns.
    pub depth: &'a [f32],
    /// Rows and columns of the image.
    pub size: [usize; 2],
    /// Calibration of the camera.
    pub camera: &'a Camera,
    /// The image contains every n-th row and column of the camera.
    pub step: usize,
    /// Rows of the image that are evaluated.
    pub rows: Range<usize>,
    /// Columns of the image that are evaluated.
    pub columns: Range<usize>,
}

impl Window<'_> {
    fn check(&self) -> Result<(), TrackError> {
        let [height, width] = self.size;
        let camera = [self.camera.height(), self.camera.width()];
        let fits = self.step > 0
            && self.size.iter().zip(&camera).all(|(size, camera)| *size == camera.div_ceil(self.step.max(1)))
            && height.checked_mul(width) == Some(self.depth.len());
        if fits && self.rows.end <= height && self.columns.end <= width {
            return Ok(());
        }
        let found = format!(
            "{} depths for {:?}, a camera of {camera:?}, step {}, rows {:?} and columns {:?}",
            self.depth.len(),
            self.size,
            self.step,
            self.rows,
            self.columns
        );
        Err(TrackError::measurement(
            "window",
            "a depth for every pixel of the camera, and rows and columns of them",
            found,
        ))
    }

    /// Returns the points within the box from `low` to `high` (world frame, meters), in the frame of another camera, meters, and
    /// the index of each point's pixel in the image.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when array sizes do not match.
    pub(crate) fn within(
        &self,
        low: [f64; 3],
        high: [f64; 3],
        world_from_sensor: &[[f64; 4]; 4],
        other_from_sensor: &[[f64; 4]; 4],
    ) -> Result<(Vec<[f64; 3]>, Vec<isize>), TrackError> {
        self.check()?;
        let to_world = world_from_sensor.map(|row| row.map(|entry| entry as f32));
        // A value of single precision lies between these bounds exactly if it lies between the corners.
        let (low, high) = (low.map(below), high.map(|value| -below(-value)));
        let (rows, count) = (self.rows.clone(), self.columns.len());
        let all_rays = self.camera.rays();
        let mut inside = vec![false; rows.len() * count];
        for (row, inside) in rows.clone().zip(inside.chunks_exact_mut(count.max(1))) {
            let depths = &self.depth[row * self.size[1]..][self.columns.clone()];
            let rays = &all_rays[(row * self.camera.width() + self.columns.start) * self.step..];
            widest(
                #[inline(always)]
                || {
                    // Processing one coordinate after the other fills whole registers.
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
            let rays = &all_rays[(row * self.camera.width() + self.columns.start) * self.step..];
            // Most of the columns are skipped, several at once.
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

/// Number of columns that are skipped together if none of them is marked.
const COLUMNS_TOGETHER: usize = 16;

/// Whether any of these is marked. Reading all of them at once is faster than searching for the first one.
fn any(marks: &[bool]) -> bool {
    marks.iter().fold(false, |any, mark| any | mark)
}

/// The greatest value of single precision that is not above a given one.
fn below(value: f64) -> f32 {
    let near = value as f32;
    if f64::from(near) > value { near.next_down() } else { near }
}

/// Which depths along rays are returns within a box (world frame, meters).
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
    use voodoo_core::Lens;

    const LOW: [f64; 3] = [-0.8, -0.6, 1.0];
    const HIGH: [f64; 3] = [0.7, 0.9, 2.4];
    const SIZE: [usize; 2] = [48, 64];

    /// A rotation about z and a translation.
    fn pose(angle: f64, shift: [f64; 3]) -> [[f64; 4]; 4] {
        let (sin, cos) = angle.sin_cos();
        [[cos, -sin, 0.0, shift[0]], [sin, cos, 0.0, shift[1]], [0.0, 0.0, 1.0, shift[2]], [0.0, 0.0, 0.0, 1.0]]
    }

    fn moved(pose: &[[f64; 4]; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| pose[axis][0] * x + pose[axis][1] * y + pose[axis][2] * z + pose[axis][3])
    }

    fn camera() -> Camera {
        let lens = Lens::PlumbBob([-0.2, 0.05, 0.001, 0.0, 0.0]);
        Camera::new(SIZE[1], SIZE[0], [50.0, 52.0, 31.5, 23.5], lens).unwrap()
    }

    /// Depths from 0.5 to 4 m, some of them no return.
    fn noisy(count: usize) -> Vec<f32> {
        let depth =
            |index: usize| 0.5 + 3.5 * ((index as u32).wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32;
        let mut depths: Vec<f32> = (0..count).map(|index| if index % 11 == 3 { 0.0 } else { depth(index) }).collect();
        [depths[70], depths[71], depths[72]] = [f32::NAN, f32::INFINITY, -1.0];
        depths
    }

    #[test]
    fn the_points_are_those_in_the_box_visible_from_the_other_camera() {
        let camera = camera();
        let rays = camera.rays();
        let (to_world, to_other) = (pose(0.3, [0.1, 0.0, -0.2]), pose(-0.1, [0.05, 0.02, 0.01]));
        for step in [1, 3] {
            let size = SIZE.map(|pixels| pixels.div_ceil(step));
            let depth = noisy(size[0] * size[1]);
            let (rows, columns) = (2..size[0] - 1, 1..size[1] - 3);
            let window = Window { depth: &depth, size, camera: &camera, step, rows, columns };
            let (points, pixels) = window.within(LOW, HIGH, &to_world, &to_other).unwrap();
            let mut expected = Vec::new();
            for row in window.rows.clone() {
                for column in window.columns.clone() {
                    let z = depth[row * size[1] + column];
                    let ray = rays[(row * 64 + column) * step];
                    let place = [ray[0] * z, ray[1] * z, z].map(f64::from);
                    let world = moved(&to_world, place);
                    if z.is_finite()
                        && z > 0.0
                        && (0..3).all(|axis| LOW[axis] < world[axis] && world[axis] < HIGH[axis])
                    {
                        expected.push((row * size[1] + column, moved(&to_other, place)));
                    }
                }
            }
            assert!(expected.len() > 20 && 2 * expected.len() < depth.len());
            assert!(pixels.iter().map(|pixel| *pixel as usize).eq(expected.iter().map(|(pixel, _)| *pixel)));
            for (point, (_, place)) in points.iter().zip(&expected) {
                assert!((0..3).all(|axis| (point[axis] - place[axis]).abs() < 1e-6), "{point:?} {place:?}");
            }
        }
    }

    #[test]
    fn a_window_that_does_not_fit_is_refused() {
        let (camera, depth, level) = (camera(), noisy(48 * 64), pose(0.0, [0.0; 3]));
        let whole = Window { depth: &depth, size: SIZE, camera: &camera, step: 1, rows: 0..48, columns: 0..64 };
        let points_of = |window: Window| window.within(LOW, HIGH, &level, &level).map_err(|error| error.to_string());
        assert!(points_of(whole.clone()).is_ok());
        for wrong in [
            Window { rows: 0..49, ..whole.clone() },
            Window { columns: 0..65, ..whole.clone() },
            Window { step: 2, ..whole.clone() },
            Window { step: 0, ..whole.clone() },
            Window { depth: &depth[1..], ..whole.clone() },
            Window { size: [48, 63], ..whole.clone() },
        ] {
            assert!(points_of(wrong).unwrap_err().contains("window: expected"));
        }
    }
}
