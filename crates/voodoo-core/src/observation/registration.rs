//! What a depth camera sees of the body, in the picture of a colour camera beside it.

use std::ops::Range;

use crate::error::TrackError;
use crate::math::widest;
use crate::observation::far_edges::far_edges;
use crate::observation::masks::grown;

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
        let (mut points, mut pixels) = (Vec::new(), Vec::new());
        let mut inside = vec![false; self.columns.len()];
        for row in self.rows.clone() {
            let first = row * self.size[1];
            let depths = &self.depth[first..][self.columns.clone()];
            let rays = &self.rays[(row * self.camera[1] + self.columns.start) * self.step..];
            widest(
                #[inline(always)]
                || {
                    // One column after the other fills whole registers.
                    if self.step == 1 {
                        gate(&mut inside, depths.iter().zip(rays), (low, high), &to_world);
                    } else {
                        gate(&mut inside, depths.iter().zip(rays.iter().step_by(self.step)), (low, high), &to_world);
                    }
                },
            );
            for (offset, _) in inside.iter().enumerate().filter(|(_, inside)| **inside) {
                let (z, ray) = (depths[offset], rays[offset * self.step]);
                let [x, y, z] = [ray[0] * z, ray[1] * z, z].map(f64::from);
                points.push([0, 1, 2].map(|axis| {
                    let turn = &other_from_sensor[axis];
                    turn[0] * x + turn[1] * y + turn[2] * z + turn[3]
                }));
                pixels.push((first + self.columns.start + offset) as isize);
            }
        }
        Ok((points, pixels))
    }
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

/// Sums with numbers of a picture's size have no digits left for fractions of them: three times 2^51.
const NO_FRACTION: f64 = (1_u64 << 52) as f64 + (1_u64 << 51) as f64;

/// A number rounded to the nearest whole one, of two the even one, by the digits that a large sum has no room for; numbers beyond
/// 2^51 stay large.
#[inline(always)]
fn nearest_whole(value: f64) -> f64 {
    (value + NO_FRACTION) - NO_FRACTION
}

/// Points in a picture of so many rows and columns.
#[derive(Clone, Debug)]
pub struct ProjectedPoints {
    /// 1 where a point is, row by row.
    pub seen: Vec<u8>,
    /// 1 where a marked point is; empty without marks.
    pub marked: Vec<u8>,
    /// Indices of the points that lie in the picture.
    pub inside: Vec<isize>,
    /// Rows that hold them.
    pub rows: Range<usize>,
    /// And columns.
    pub columns: Range<usize>,
    /// Depth of the nearest point in each pixel of those, infinite where none is.
    pub nearest: Vec<f32>,
}

impl ProjectedPoints {
    /// Puts points into the pixels that are nearest to their places (column, row) in a picture of `[height, width]`; NaN,
    /// where the camera cannot see, is in none.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when there are not as many depths, or marks, as places.
    pub fn new(
        places: &[[f64; 2]],
        points: &[[f64; 3]],
        marks: Option<&[bool]>,
        [height, width]: [usize; 2],
    ) -> Result<Self, TrackError> {
        if points.len() != places.len() || marks.is_some_and(|marks| marks.len() != places.len()) {
            let found = format!("{} points and {:?} marks", points.len(), marks.map(<[_]>::len));
            let expected = "as many points, and marks, as pixels";
            return Err(TrackError::measurement("points", expected, format!("{found} for {} pixels", places.len())));
        }
        let mut inside = Vec::with_capacity(places.len());
        let mut cells = Vec::with_capacity(places.len());
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for (index, place) in places.iter().enumerate() {
            let [u, v] = place.map(nearest_whole);
            if u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64 {
                let cell = [v as i64 as usize, u as i64 as usize];
                inside.push(index as isize);
                cells.push(cell);
                low = [0, 1].map(|axis| low[axis].min(cell[axis]));
                high = [0, 1].map(|axis| high[axis].max(cell[axis] + 1));
            }
        }
        let [rows, columns] = [0, 1].map(|axis| low[axis].min(high[axis])..high[axis]);
        let mut nearest = vec![f32::INFINITY; rows.len() * columns.len()];
        let mut seen = vec![0; height * width];
        let mut marked = vec![0; if marks.is_some() { seen.len() } else { 0 }];
        for (&index, [row, column]) in inside.iter().zip(cells) {
            let index = index as usize;
            let place = row * width + column;
            seen[place] = 1;
            if marks.is_some_and(|marks| marks[index]) {
                marked[place] = 1;
            }
            let least = &mut nearest[(row - rows.start) * columns.len() + column - columns.start];
            *least = least.min(points[index][2] as f32);
        }
        Ok(Self { seen, marked, inside, rows, columns, nearest })
    }
}

/// Surfaces that differ by more than this in depth, metres, do not touch.
const SURFACES_APART: f32 = 0.1;

impl ProjectedPoints {
    /// Where something was seen within `reach` pixels, or a camera does not look (`beyond`, 1 there), and of the marked points the
    /// first; without the lines behind edges between surfaces, in a picture of `[height, width]`.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when `beyond` is no picture of that size.
    pub fn shown(
        &self,
        beyond: &[bool],
        reach: usize,
        [height, width]: [usize; 2],
    ) -> Result<(Vec<bool>, Option<Vec<bool>>), TrackError> {
        if beyond.len() != self.seen.len() || height.checked_mul(width) != Some(beyond.len()) {
            let found = format!("{} for {}", beyond.len(), self.seen.len());
            return Err(TrackError::measurement("beyond", "as many pixels as the picture has", found));
        }
        let around = self.rows.start.saturating_sub(reach) * width..(self.rows.end + reach).min(height) * width;
        let grow = |mask: &[u8]| {
            let mut whole = vec![0; mask.len()];
            whole[around.clone()].copy_from_slice(&grown(&mask[around.clone()], width, reach));
            whole
        };
        let mut seen = grow(&self.seen);
        let mut before = (!self.marked.is_empty()).then(|| grow(&self.marked));
        let count = self.columns.len();
        let edges = far_edges(&self.nearest, count, SURFACES_APART, reach);
        let mut mask = beyond.to_vec();
        mask.iter_mut().zip(&seen).for_each(|(pixel, seen)| *pixel |= *seen != 0);
        for (row, edges) in self.rows.clone().zip(edges.chunks_exact(count.max(1))) {
            let here = row * width + self.columns.start..row * width + self.columns.end;
            let seen = &mut seen[here.clone()];
            seen.iter_mut().zip(edges).for_each(|(seen, edge)| *seen &= u8::from(*edge));
            mask[here.clone()].iter_mut().zip(&*seen).for_each(|(pixel, edge)| *pixel &= *edge == 0);
            if let Some(before) = &mut before {
                before[here].iter_mut().zip(&*seen).for_each(|(pixel, edge)| *pixel &= !*edge);
            }
        }
        let before = before.map(|before| before.into_iter().map(|pixel| pixel != 0).collect());
        Ok((mask, before))
    }
}

/// Places of a picture, and what was measured there.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredPixels<'a> {
    /// Columns and rows.
    pub places: &'a [[f64; 2]],
    /// Depths, metres.
    pub depths: &'a [f64],
    /// Which may be the still scene.
    pub still: Option<&'a [bool]>,
}

/// Depths within this of the nearest fifth, metres, belong to one surface: a limb is no deeper.
const ONE_SURFACE: f64 = 0.1;
/// Fewer points around a place than this are no surface: one or two may be stray returns.
const FEWEST_POINTS: usize = 3;
/// Points of a list whose bounds are looked at together.
const POINTS_TOGETHER: usize = 64;

/// Numbers of regions in a part of a picture, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Labels {
    /// First row and column.
    pub first: [usize; 2],
    /// Rows and columns.
    pub size: [usize; 2],
    /// A number for each pixel.
    pub values: Vec<i32>,
}

impl Labels {
    /// That of the pixel around a place (column, row); -1 outside.
    fn at(&self, place: &[f64; 2]) -> i32 {
        let [u, v] = place.map(nearest_whole);
        let [row, column] = [(v, 0), (u, 1)].map(|(value, axis)| value - self.first[axis] as f64);
        let inside = row >= 0.0 && column >= 0.0 && row < self.size[0] as f64 && column < self.size[1] as f64;
        if inside { self.values[row as i64 as usize * self.size[1] + column as i64 as usize] } else { -1 }
    }
}

impl MeasuredPixels<'_> {
    /// [`Self::nearest_surface`] of each of some places of a picture, by the points in its region, as `labels` number it, if there are
    /// enough.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when arrays do not belong together.
    pub fn nearest_surfaces(
        &self,
        labels: &Labels,
        places: &[([f64; 2], i32)],
        radius: f64,
    ) -> Result<Vec<Option<(f64, bool)>>, TrackError> {
        let [height, width] = labels.size;
        if height.checked_mul(width) != Some(labels.values.len()) {
            let found = format!("{} for {height} rows of {width}", labels.values.len());
            return Err(TrackError::measurement("labels", "one for every pixel", found));
        }
        self.check(None)?;
        // Neighbours in the list are near each other: most stretches of it are nowhere near a place.
        let stretches: Vec<[[f64; 2]; 2]> = self.places.chunks(POINTS_TOGETHER).map(bounds_of).collect();
        let look = |(place, region): &([f64; 2], i32)| {
            let (mut near, mut chosen) = (Vec::new(), Vec::new());
            let far = |[low, high]: &[[f64; 2]; 2]| {
                (0..2).any(|axis| low[axis] > place[axis] + radius || high[axis] < place[axis] - radius)
            };
            for (stretch, _) in stretches.iter().enumerate().filter(|(_, bounds)| !far(bounds)) {
                let first = stretch * POINTS_TOGETHER;
                let last = (first + POINTS_TOGETHER).min(self.places.len());
                for (index, other) in (first..).zip(&self.places[first..last]) {
                    if is_near(other, place, radius) {
                        near.push(index);
                        if labels.at(other) == *region {
                            chosen.push(index);
                        }
                    }
                }
            }
            self.surface_of(near, chosen)
        };
        Ok(places.iter().map(look).collect())
    }

    /// Depth of the nearest surface within `radius` of a place, metres, and whether most of it is still; none with less than
    /// three points there. Where three of the points `among` are there, only those count.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when there are not as many depths, or marks, as places.
    pub fn nearest_surface(
        &self,
        place: [f64; 2],
        radius: f64,
        among: Option<&[bool]>,
    ) -> Result<Option<(f64, bool)>, TrackError> {
        self.check(among)?;
        let (mut near, mut chosen) = (Vec::new(), Vec::new());
        for (index, _) in self.places.iter().enumerate().filter(|(_, other)| is_near(other, &place, radius)) {
            near.push(index);
            if among.is_some_and(|among| among[index]) {
                chosen.push(index);
            }
        }
        Ok(self.surface_of(near, chosen))
    }

    fn check(&self, among: Option<&[bool]>) -> Result<(), TrackError> {
        let (count, marks) = (self.places.len(), [self.still, among]);
        if self.depths.len() == count && marks.iter().flatten().all(|marks| marks.len() == count) {
            return Ok(());
        }
        let found = format!("{} depths, {:?} marks", self.depths.len(), marks.map(|marks| marks.map(<[_]>::len)));
        Err(TrackError::measurement("depths", "as many depths, and marks, as pixels", found))
    }

    /// The nearest surface of points that are near, or of those of them that are chosen, if there are enough.
    fn surface_of(&self, mut near: Vec<usize>, chosen: Vec<usize>) -> Option<(f64, bool)> {
        if chosen.len() >= FEWEST_POINTS {
            near = chosen;
        }
        if near.len() < FEWEST_POINTS {
            return None;
        }
        near.sort_unstable_by(|a, b| self.depths[*a].total_cmp(&self.depths[*b]));
        let fifth = self.depths[near[(near.len() - 1) / 5]];
        near.retain(|index| (self.depths[*index] - fifth).abs() < ONE_SURFACE);
        let still = self.still.map_or(0, |still| near.iter().filter(|index| still[**index]).count());
        near.get(near.len() / 2).map(|middle| (self.depths[*middle], 2 * still > near.len()))
    }
}

fn is_near(other: &[f64; 2], place: &[f64; 2], radius: f64) -> bool {
    let (u, v) = (other[0] - place[0], other[1] - place[1]);
    u * u + v * v < radius * radius
}

/// Least and greatest columns and rows; NaN counts nowhere.
fn bounds_of(places: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for place in places {
        for axis in 0..2 {
            low[axis] = if place[axis] < low[axis] { place[axis] } else { low[axis] };
            high[axis] = if place[axis] > high[axis] { place[axis] } else { high[axis] };
        }
    }
    [low, high]
}
