//! Converts the pixels of a depth image to points: selects which are used, and processes part of a row at a time on SIMD lanes.

use std::ops::Range;

use crate::math::Points;
use crate::observation::background::Background;
use crate::observation::depth_view::DepthView;
use crate::observation::frame::DepthPixels;

/// An axis-aligned box, a half space and a shift in single precision, in the form that the per-point test needs.
pub(super) struct PointGate {
    pub low: [f32; 3],
    pub high: [f32; 3],
    pub up: [f32; 3],
    pub floor: f32,
}

impl PointGate {
    #[inline(always)]
    pub(super) fn passes(&self, p: [f32; 3]) -> bool {
        let inside = |axis: usize| (p[axis] >= self.low[axis]) & (p[axis] <= self.high[axis]);
        inside(0) & inside(1) & inside(2) & (p[0] * self.up[0] + p[1] * self.up[1] + p[2] * self.up[2] >= self.floor)
    }
}

/// Maximum stride of rows or columns: no image has more.
const MOST_APART: f64 = 65536.0;

/// Which pixels of an image are used: rows at a stride, and columns at a stride in each row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    pub rows: usize,
    pub columns: usize,
}

impl Grid {
    /// Uses approximately one pixel in `fraction`, as evenly as integer strides allow.
    pub(super) fn new(fraction: f64) -> Self {
        let within = |apart: f64| if apart >= 1.0 { apart.min(MOST_APART) } else { 1.0 };
        let rows = within(fraction.sqrt().floor());
        let columns = within((fraction / rows).round());
        Self { rows: rows as usize, columns: columns as usize }
    }

    /// First column of a row. Where the column stride exceeds the row stride, used columns of consecutive rows are staggered.
    pub(super) fn offset(self, row: usize) -> usize {
        if self.columns == self.rows { 0 } else { row / self.rows * (self.columns / 2) % self.columns }
    }
}

/// Pixels of a row, or points, that are processed together: a whole number of SIMD lanes.
pub(crate) const STRETCH: usize = 32;

/// Visits every `stride`th value together with its slot in `to`; neighbors fill whole registers.
#[inline(always)]
fn every<T>(from: &[T], stride: usize, to: &mut [f32], visit: impl Fn(&mut f32, &T)) {
    if stride == 1 {
        to.iter_mut().zip(from).for_each(|(to, value)| visit(to, value));
    } else {
        to.iter_mut().zip(from.iter().step_by(stride)).for_each(|(to, value)| visit(to, value));
    }
}

/// Depth, `x / z` and `y / z` of neighboring pixels; the depth is 0 beyond the last of them.
pub(super) struct Stretch {
    x: [f32; STRETCH],
    y: [f32; STRETCH],
    z: [f32; STRETCH],
}

impl Stretch {
    #[inline(always)]
    pub(super) fn load(view: &DepthView, row: usize, columns: Range<usize>, stride: usize) -> Self {
        let DepthView { image, background, .. } = view;
        let count = STRETCH.min((columns.end - columns.start).div_ceil(stride));
        let first = row * image.camera.width() + columns.start;
        let scale = image.meters_per_unit as f32;
        let mut z = [0.0; STRETCH];
        match image.pixels {
            DepthPixels::U16(pixels) => {
                every(&pixels[first..], stride, &mut z[..count], |z, pixel| *z = f32::from(*pixel) * scale);
            }
            DepthPixels::F32(pixels) => {
                every(&pixels[first..], stride, &mut z[..count], |z, pixel| *z = *pixel * scale);
            }
        }
        if !background.is_empty() {
            every(&background[first..], stride, &mut z[..count], |z, depth| {
                *z = if Background::contains(*depth, *z) { 0.0 } else { *z };
            });
        }
        let [x, y] = image.camera.row_rays(row, columns.start, stride, count);
        Self { x, y, z }
    }

    /// Whether any pixel has a return that is not background.
    #[inline(always)]
    pub(super) fn returned(&self) -> bool {
        self.z.iter().fold(0, |any, z| any | u8::from(*z > 0.0)) != 0
    }

    /// Appends the points with a return inside the gate, in order.
    #[inline(always)]
    pub(super) fn gather(&self, m: &[[f32; 3]; 4], gate: &PointGate, points: &mut Points) {
        let mut p = [[0.0; STRETCH]; 3];
        let mut passes = [false; STRETCH];
        for i in 0..STRETCH {
            let z = self.z[i];
            let (x, y) = (self.x[i] * z, self.y[i] * z);
            let place = |axis: usize| m[0][axis] * x + (m[1][axis] * y + (m[2][axis] * z + m[3][axis]));
            let point = [place(0), place(1), place(2)];
            // A NaN fails the first comparison.
            passes[i] = (z > 0.0) & (z < f32::INFINITY) & gate.passes(point);
            (p[0][i], p[1][i], p[2][i]) = (point[0], point[1], point[2]);
        }
        if passes.iter().fold(0, |any, pass| any | u8::from(*pass)) == 0 {
            return;
        }
        let mut kept = 0;
        for i in 0..STRETCH {
            // `kept` is at most `i`; the mask only removes the bounds checks.
            let to = kept % STRETCH;
            (p[0][to], p[1][to], p[2][to]) = (p[0][i], p[1][i], p[2][i]);
            kept += usize::from(passes[i]);
        }
        points.x.extend_from_slice(&p[0][..kept]);
        points.y.extend_from_slice(&p[1][..kept]);
        points.z.extend_from_slice(&p[2][..kept]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_keeps_the_fraction_asked_for_and_spreads_it() {
        for tenths in 1..400 {
            let fraction = f64::from(tenths) / 10.0;
            let grid = Grid::new(fraction);
            let kept = (grid.rows * grid.columns) as f64 / fraction.max(1.0);
            assert!(kept > 0.66 && kept < 1.5, "{grid:?} for one in {fraction}");
            assert!((0..50).all(|row| grid.offset(row) < grid.columns));
        }
        let columns = |fraction: f64| [0, 1, 2, 3].map(|row| Grid::new(fraction).offset(row));
        assert_eq!((Grid::new(0.3), columns(0.3)), (Grid { rows: 1, columns: 1 }, [0; 4]));
        assert_eq!((Grid::new(2.0), columns(2.0)), (Grid { rows: 1, columns: 2 }, [0, 1, 0, 1]));
        assert_eq!((Grid::new(4.0), columns(4.0)), (Grid { rows: 2, columns: 2 }, [0; 4]));
        assert_eq!((Grid::new(8.0), columns(8.0)), (Grid { rows: 2, columns: 4 }, [0, 0, 2, 2]));
    }
}
