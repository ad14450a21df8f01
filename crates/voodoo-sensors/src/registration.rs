//! Registers depth points near the body to the image of a color camera.

use std::ops::Range;

use crate::far_edges::far_edges;
use crate::masks::grown;
use voodoo_core::TrackError;

/// A sum of this number (three times 2^51) and one of an image's size has no digits for fractions.
const NO_FRACTION: f64 = (1_u64 << 52) as f64 + (1_u64 << 51) as f64;

/// Rounds to the nearest integer, ties to even, by adding a number so large that the sum has no fractional digits; values beyond
/// 2^51 stay large.
#[inline(always)]
fn nearest_whole(value: f64) -> f64 {
    (value + NO_FRACTION) - NO_FRACTION
}

/// Points in an image of so many rows and columns.
#[derive(Clone, Debug)]
pub struct ProjectedPoints {
    /// Indices of the points within the image.
    pub inside: Vec<isize>,
    /// Rows of the bounding box of these points.
    pub rows: Range<usize>,
    /// Columns of that bounding box.
    pub columns: Range<usize>,
    /// Depth of the nearest point in each pixel of the box, infinite where there is none.
    pub nearest: Vec<f32>,
    /// 1 in each pixel of the box that contains a marked point; `None` without marks.
    pub marked: Option<Vec<u8>>,
}

impl ProjectedPoints {
    /// Assigns points to the pixels nearest to their projections (column, row) in an image of `[height, width]`; NaN, for points
    /// that are not visible, is in no pixel.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when the number of depths or marks differs from that of the projections.
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
        let mut marked = marks.map(|_| vec![0; nearest.len()]);
        for (&index, [row, column]) in inside.iter().zip(cells) {
            let index = index as usize;
            let place = (row - rows.start) * columns.len() + column - columns.start;
            if let (Some(marks), Some(marked)) = (marks, &mut marked) {
                marked[place] |= u8::from(marks[index]);
            }
            nearest[place] = nearest[place].min(points[index][2] as f32);
        }
        Ok(Self { inside, rows, columns, nearest, marked })
    }
}

/// Surfaces whose depths differ by more than this, meters, are separate.
const SURFACES_APART: f32 = 0.1;

impl ProjectedPoints {
    /// Returns two masks of an image of `[height, width]`: the pixels within `reach` of a point or outside the depth camera's
    /// field of view (`beyond`, true there), and the pixels within `reach` of a marked point (`None` without marks). The far
    /// side of edges between surfaces is removed from both.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when `beyond` does not have that size.
    pub fn visible_mask(
        &self,
        beyond: &[bool],
        reach: usize,
        [height, width]: [usize; 2],
    ) -> Result<(Vec<bool>, Option<Vec<bool>>), TrackError> {
        if height.checked_mul(width) != Some(beyond.len()) || self.rows.end > height || self.columns.end > width {
            let found = format!("{} for {height} rows of {width}", beyond.len());
            return Err(TrackError::measurement("beyond", "as many pixels as the picture has", found));
        }
        let count = self.columns.len();
        let mut mask = beyond.to_vec();
        let mut before = self.marked.as_ref().map(|_| vec![false; beyond.len()]);
        if count == 0 {
            return Ok((mask, before));
        }
        // The bounding box of the points, extended by `reach`.
        let wider = |span: &Range<usize>, size: usize| span.start.saturating_sub(reach)..(span.end + reach).min(size);
        let (rows, columns) = (wider(&self.rows, height), wider(&self.columns, width));
        let stride = columns.len();
        let inner = (self.rows.start - rows.start) * stride + self.columns.start - columns.start;
        let part = |fill: &mut dyn FnMut(usize, &mut [u8])| {
            let mut part = vec![0; rows.len() * stride];
            let lines = part[inner..].chunks_mut(stride).take(self.rows.len());
            lines.enumerate().for_each(|(row, line)| fill(row * count, &mut line[..count]));
            grown(&part, stride, reach)
        };
        let near_return = part(&mut |first, line| {
            line.iter_mut()
                .zip(&self.nearest[first..])
                .for_each(|(near_return, depth)| *near_return = u8::from(depth.is_finite()));
        });
        let here = |row: usize| row * width + columns.start..row * width + columns.end;
        for (row, near_return) in rows.clone().zip(near_return.chunks_exact(stride)) {
            mask[here(row)].iter_mut().zip(near_return).for_each(|(pixel, near_return)| *pixel |= *near_return != 0);
        }
        if let (Some(before), Some(marked)) = (&mut before, &self.marked) {
            let marked = part(&mut |first, line| line.copy_from_slice(&marked[first..][..count]));
            for (row, marked) in rows.clone().zip(marked.chunks_exact(stride)) {
                before[here(row)].iter_mut().zip(marked).for_each(|(pixel, marked)| *pixel = *marked != 0);
            }
        }
        let edges = far_edges(&self.nearest, count, SURFACES_APART, reach);
        for (index, (row, edges)) in self.rows.clone().zip(edges.chunks_exact(count)).enumerate() {
            let here = row * width + self.columns.start..row * width + self.columns.end;
            let edges = || {
                edges
                    .iter()
                    .zip(&near_return[inner + index * stride..])
                    .map(|(edge, near_return)| *edge & (*near_return != 0))
            };
            mask[here.clone()].iter_mut().zip(edges()).for_each(|(pixel, edge)| *pixel &= !edge);
            if let Some(before) = &mut before {
                before[here].iter_mut().zip(edges()).for_each(|(pixel, edge)| *pixel &= !edge);
            }
        }
        Ok((mask, before))
    }
}

/// Points registered to an image.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredPixels<'a> {
    /// Columns and rows in the image.
    pub places: &'a [[f64; 2]],
    /// Depths, meters.
    pub depths: &'a [f64],
    /// Which of them may be the still scene.
    pub still: Option<&'a [bool]>,
}

/// Depths within this of the nearest 20 % quantile, meters, belong to one surface: a limb is no deeper.
const ONE_SURFACE: f64 = 0.1;
/// Fewer points than this around a pixel are no surface, since one or two may be stray returns.
const FEWEST_POINTS: usize = 3;
/// Number of consecutive points whose common bounds are tested together.
const POINTS_TOGETHER: usize = 64;

/// Region labels in a part of an image, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegionLabels {
    /// First row and column.
    pub first: [usize; 2],
    /// Rows and columns.
    pub size: [usize; 2],
    /// Label of each pixel.
    pub values: Vec<i32>,
}

impl RegionLabels {
    /// Label of the pixel at (column, row); -1 outside.
    fn at(&self, place: &[f64; 2]) -> i32 {
        let [u, v] = place.map(nearest_whole);
        let [row, column] = [(v, 0), (u, 1)].map(|(value, axis)| value - self.first[axis] as f64);
        let inside = row >= 0.0 && column >= 0.0 && row < self.size[0] as f64 && column < self.size[1] as f64;
        if inside { self.values[row as i64 as usize * self.size[1] + column as i64 as usize] } else { -1 }
    }
}

impl MeasuredPixels<'_> {
    /// Evaluates [`Self::nearest_surface`] at several pixels, using only the points in each pixel's own region of `labels` if
    /// there are enough.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when array sizes do not match.
    pub fn nearest_surfaces(
        &self,
        labels: &RegionLabels,
        places: &[([f64; 2], i32)],
        radius: f64,
    ) -> Result<Vec<Option<(f64, bool)>>, TrackError> {
        let [height, width] = labels.size;
        if height.checked_mul(width) != Some(labels.values.len()) {
            let found = format!("{} for {height} rows of {width}", labels.values.len());
            return Err(TrackError::measurement("labels", "one for every pixel", found));
        }
        self.check()?;
        // Consecutive points are near each other, so most blocks of the list are far from the pixel and are skipped.
        let stretches: Vec<[[f64; 2]; 2]> = self.places.chunks(POINTS_TOGETHER).map(bounds_of).collect();
        let surface = |(place, region): &([f64; 2], i32)| {
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
        Ok(places.iter().map(surface).collect())
    }

    /// Returns the depth of the nearest surface within `radius` of a pixel, meters, and whether most of it is still; `None` with
    /// fewer than three points there.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when the number of depths or marks differs from that of the points.
    pub fn nearest_surface(&self, place: [f64; 2], radius: f64) -> Result<Option<(f64, bool)>, TrackError> {
        self.check()?;
        let near = self.places.iter().enumerate().filter(|(_, other)| is_near(other, &place, radius));
        Ok(self.surface_of(near.map(|(index, _)| index).collect(), Vec::new()))
    }

    fn check(&self) -> Result<(), TrackError> {
        let count = self.places.len();
        if self.depths.len() == count && self.still.is_none_or(|still| still.len() == count) {
            return Ok(());
        }
        let found = format!("{} depths, {:?} marks", self.depths.len(), self.still.map(<[_]>::len));
        Err(TrackError::measurement("depths", "as many depths, and marks, as pixels", found))
    }

    /// Nearest surface of the points nearby, or of the chosen ones among them if there are enough.
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

/// Least and greatest columns and rows; NaN is ignored.
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    /// Numbers in [0, 1) that look random and are the same in every run (Knuth's linear congruence).
    fn numbers(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// 600 points in an image 41 pixels wide and high: a surface at 2 m in its left half, one at 3 m in its right half.
    fn two_surfaces() -> (Vec<[f64; 2]>, Vec<f64>) {
        let mut number = numbers(5);
        let places: Vec<[f64; 2]> = (0..600).map(|_| [40.0 * number(), 40.0 * number()]).collect();
        let depths =
            places.iter().map(|place| (if place[0] < 20.0 { 2.0 } else { 3.0 }) + 0.02 * (number() - 0.5)).collect();
        (places, depths)
    }

    #[test]
    fn the_nearest_surface_around_a_place_is_the_nearest_fifths() {
        let (places, depths) = two_surfaces();
        let still: Vec<bool> = places.iter().map(|place| place[0] < 20.0).collect();
        let measured = MeasuredPixels { places: &places, depths: &depths, still: Some(&still) };
        let mut near: Vec<f64> = places
            .iter()
            .zip(&depths)
            .filter(|(place, _)| (place[0] - 20.0).hypot(place[1] - 20.0) < 8.0)
            .map(|(_, depth)| *depth)
            .collect();
        near.sort_by(f64::total_cmp);
        let fifth = near[(near.len() - 1) / 5];
        near.retain(|depth| (depth - fifth).abs() < 0.1);
        let expected = Some((near[near.len() / 2], true));
        assert_eq!(measured.nearest_surface([20.0, 20.0], 8.0).unwrap(), expected);
        let behind = MeasuredPixels { still: None, ..measured }.nearest_surface([35.0, 20.0], 8.0).unwrap().unwrap();
        assert!((behind.0 - 3.0).abs() < 0.01 && !behind.1);
        assert_eq!(measured.nearest_surface([90.0, 20.0], 8.0).unwrap(), None);
        let two = MeasuredPixels { places: &places[..2], depths: &depths[..2], still: None };
        assert_eq!(two.nearest_surface([20.0, 20.0], 99.0).unwrap(), None, "two points are no surface");
        assert!(MeasuredPixels { depths: &depths[1..], ..measured }.nearest_surface([0.0; 2], 1.0).is_err());
        assert!(MeasuredPixels { still: Some(&still[1..]), ..measured }.nearest_surface([0.0; 2], 1.0).is_err());
    }

    #[test]
    fn each_place_is_checked_among_the_points_of_its_region() {
        let (mut places, mut depths) = two_surfaces();
        for outside in [[f64::NAN, 3.0], [-5.0, 3.0], [3.0, 99.0]] {
            places.push(outside);
            depths.push(1.0);
        }
        let right = |index: usize| if index % 41 >= 20 { 7 } else { 0 };
        let labels = RegionLabels { first: [0, 0], size: [41, 41], values: (0..41 * 41).map(right).collect() };
        let measured = MeasuredPixels { places: &places, depths: &depths, still: None };
        let at = |place: [f64; 2], region: i32| {
            measured.nearest_surfaces(&labels, &[(place, region)], 8.0).unwrap()[0].map(|(depth, _)| depth.round())
        };
        assert_eq!(at([20.0, 20.0], 7), Some(3.0));
        assert_eq!(at([20.0, 20.0], 0), Some(2.0));
        assert_eq!(at([20.0, 20.0], 5), Some(2.0), "without a region of its own all that is near counts");
        assert_eq!(at([90.0, 90.0], 7), None);
        let alone = |region: i32| {
            let chosen: Vec<usize> = (0..places.len()).filter(|index| labels.at(&places[*index]) == region).collect();
            let places: Vec<[f64; 2]> = chosen.iter().map(|index| places[*index]).collect();
            let depths: Vec<f64> = chosen.iter().map(|index| depths[*index]).collect();
            MeasuredPixels { places: &places, depths: &depths, still: None }.nearest_surface([20.0; 2], 8.0).unwrap()
        };
        let found = measured.nearest_surfaces(&labels, &[([20.0; 2], 7), ([20.0; 2], 0)], 8.0).unwrap();
        assert_eq!(found, [alone(7), alone(0)]);
        let short = RegionLabels { size: [41, 40], ..labels.clone() };
        assert!(measured.nearest_surfaces(&short, &[], 8.0).is_err());
    }

    #[test]
    fn points_are_put_into_their_pixels_and_grow_by_their_reach() {
        let places = [[2.4, 1.6], [2.0, 2.0], [f64::NAN, 0.0], [5.5, 1.0], [-0.5, 0.0], [3.0, 2.0]];
        let points = [3.0, 2.0, 1.0, 1.0, 4.0, 3.0].map(|depth| [0.0, 0.0, depth]);
        let marks = [false, true, true, true, false, true];
        let found = ProjectedPoints::new(&places, &points, Some(&marks), [4, 5]).unwrap();
        // Halves are rounded to even: column 5.5 is outside, -0.5 is not.
        assert_eq!(found.inside, [0, 1, 4, 5]);
        let mut beyond = [false; 20];
        beyond[19] = true;
        let (mask, before) = found.visible_mask(&beyond, 0, [4, 5]).unwrap();
        let near_return = |mask: &[bool]| (0..20).filter(|index| mask[*index]).collect::<Vec<_>>();
        assert_eq!(
            (near_return(&mask), near_return(&before.unwrap())),
            (vec![0, 12, 19], vec![12]),
            "13 is behind an edge"
        );
        let near = ProjectedPoints::new(&places[..2], &points[..2], Some(&marks[..2]), [4, 5]).unwrap();
        let (mask, before) = near.visible_mask(&beyond, 1, [4, 5]).unwrap();
        let around = vec![6, 7, 8, 11, 12, 13, 16, 17, 18];
        assert_eq!((near_return(&mask), near_return(&before.unwrap())), ([around.clone(), vec![19]].concat(), around));
        assert!(ProjectedPoints::new(&places, &points[1..], None, [4, 5]).is_err());
        assert!(ProjectedPoints::new(&places, &points, Some(&marks[1..]), [4, 5]).is_err());
        assert!(near.visible_mask(&beyond[1..], 1, [4, 5]).is_err());
        let unmarked = ProjectedPoints::new(&places, &points, None, [4, 5]).unwrap();
        assert_eq!(unmarked.visible_mask(&beyond, 1, [4, 5]).unwrap().1, None);
    }
}
