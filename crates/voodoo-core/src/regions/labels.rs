//! Label images: which limb a camera sees in each cell. Filled silhouettes of the limbs, drawn at reduced resolution.
//!
//! The lines across the contour only need the order of occlusion. So the silhouette is the convex hull of the two ends, and
//! depth is linear along the axis.

use std::ops::Range;

use crate::body::Body;
use crate::camera::Camera;
use crate::math::{Pose, Vec3, make_room, reset};

/// Corners of an end's silhouette: cosines and sines.
const CORNERS: [[f64; 2]; 8] = {
    use std::f64::consts::FRAC_1_SQRT_2 as H;
    [[1.0, 0.0], [H, H], [0.0, 1.0], [-H, H], [-1.0, 0.0], [-H, -H], [0.0, -1.0], [H, -H]]
};
/// A limb with an end nearer than this to the camera plane is not drawn, meters.
pub(super) const NEAREST_END: f64 = 0.1;

/// Label of a cell without a limb.
pub(super) const NOTHING: u16 = u16::MAX;

/// A label image of limbs.
#[derive(Clone, Debug, Default)]
pub(super) struct LimbLabels {
    /// A cell is two to this power pixels wide and high.
    bits: u32,
    pub(super) columns: usize,
    rows: usize,
    /// The label of each cell, row by row.
    pub(super) limb: Vec<u16>,
    /// Depth of each cell; infinite where there is no limb.
    depth: Vec<f32>,
    /// Ranges of columns and rows that may contain a limb.
    drawn: [Range<usize>; 2],
    hull: Vec<[f32; 2]>,
    corners: Vec<[f32; 2]>,
    /// Left and right end of the hull in every row that it spans.
    sides: Vec<[f32; 2]>,
}

impl LimbLabels {
    /// Draws the `visible` limbs from a camera's viewpoint, in cells of two to the power of `bits` pixels.
    pub(super) fn draw(
        &mut self,
        body: &Body,
        camera_from_limb: &[Pose],
        camera: &Camera,
        bits: u32,
        visible: impl Fn(usize) -> bool,
    ) {
        self.clear(bits, [camera.width(), camera.height()].map(|size| size.div_ceil(1 << bits)));
        let scale = 1.0 / f64::from(1_u32 << bits);
        let cells = |place: [f64; 2]| place.map(|value| (scale * value) as f32);
        let limbs = body.limbs().iter().zip(camera_from_limb).enumerate();
        for (index, (limb, pose)) in limbs.filter(|(index, _)| visible(*index)) {
            let ends = limb.shape.ends();
            let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| pose.rotation * axis);
            let centers = ends.map(|end| pose.translation + z * end.z);
            if ends.iter().zip(centers).any(|(end, center)| center.z - end.a.max(end.b) < NEAREST_END) {
                continue;
            }
            self.corners.clear();
            for (end, center) in ends.into_iter().zip(centers) {
                let (x, y) = (x * end.a, y * end.b);
                self.corners
                    .extend(CORNERS.iter().filter_map(|[c, s]| camera.project(center + x * *c + y * *s)).map(cells));
            }
            let [Some(start), Some(end)] = centers.map(|center| camera.project(center).map(cells)) else { continue };
            let front = |end: usize| (centers[end].z - 0.5 * (ends[end].a + ends[end].b)) as f32;
            let along = [end[0] - start[0], end[1] - start[1]];
            let square = (along[0] * along[0] + along[1] * along[1]).max(1.0);
            self.find_hull();
            self.fill(index as u16, start, along.map(|value| value / square), [front(0), front(1)]);
        }
    }

    /// Clears what was drawn, and makes room for an image of this size.
    fn clear(&mut self, bits: u32, [columns, rows]: [usize; 2]) {
        if (self.bits, self.columns, self.rows) == (bits, columns, rows) {
            let [across, down] = self.drawn.clone();
            for row in down {
                let cells = row * columns + across.start..row * columns + across.end;
                self.limb[cells.clone()].fill(NOTHING);
                self.depth[cells].fill(f32::INFINITY);
            }
        } else {
            (self.bits, self.columns, self.rows) = (bits, columns, rows);
            reset(&mut self.limb, columns * rows, NOTHING);
            reset(&mut self.depth, columns * rows, f32::INFINITY);
            make_room(&mut self.sides, rows);
            make_room(&mut self.corners, 2 * CORNERS.len());
            make_room(&mut self.hull, 2 * CORNERS.len() + 1);
        }
        self.drawn = [0..0, 0..0];
    }

    /// The label of a pixel and its depth, meters.
    #[inline(always)]
    pub(super) fn at(&self, column: usize, row: usize) -> (u16, f32) {
        let (column, row) = (column >> self.bits, row >> self.bits);
        let index = row * self.columns + column;
        match self.limb.get(index) {
            Some(limb) if column < self.columns => (*limb, self.depth[index]),
            _ => (NOTHING, 0.0),
        }
    }

    /// The convex hull of the corners, counterclockwise (Andrew's monotone chain).
    fn find_hull(&mut self) {
        let Self { corners, hull, .. } = self;
        corners.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        hull.clear();
        let mut extend = |place: [f32; 2], least: usize| {
            while hull.len() >= least {
                let ([x0, y0], [x1, y1]) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (x1 - x0) * (place[1] - y0) - (y1 - y0) * (place[0] - x0) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(place);
            hull.len()
        };
        let mut count = 0;
        for place in corners.iter() {
            count = extend(*place, 2);
        }
        for place in corners.iter().rev().skip(1) {
            extend(*place, count + 1);
        }
        hull.pop();
    }

    /// Fills the hull where nothing nearer was drawn. The depth changes along the projection of the axis, from `start`, between
    /// those of both `fronts`.
    fn fill(&mut self, limb: u16, start: [f32; 2], along: [f32; 2], fronts: [f32; 2]) {
        let Self { columns, rows, hull, depth, limb: limbs, sides, drawn, .. } = self;
        let (low, high) =
            hull.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), [_, y]| (low.min(*y), high.max(*y)));
        let first = low.ceil().max(0.0) as usize;
        let end = (high.floor() + 1.0).clamp(0.0, *rows as f32) as usize;
        if first >= end {
            return;
        }
        reset(sides, end - first, [f32::INFINITY, f32::NEG_INFINITY]);
        for (index, from) in hull.iter().enumerate() {
            let to = &hull[(index + 1) % hull.len()];
            let ([x0, y0], [x1, y1]) = if from[1] <= to[1] { (from, to) } else { (to, from) };
            // The rows below the upper end, down to the lower one.
            let from = (y0.floor() + 1.0).max(first as f32) as usize;
            let to = (y1.floor() + 1.0).clamp(0.0, end as f32) as usize;
            let slope = (x1 - x0) / (y1 - y0);
            for row in from..to {
                let x = x0 + slope * (row as f32 - y0);
                let [left, right] = &mut sides[row - first];
                (*left, *right) = (left.min(x), right.max(x));
            }
        }
        for (row, [left, right]) in (first..end).zip(&*sides) {
            let range = left.ceil().max(0.0) as usize..(right.floor() + 1.0).clamp(0.0, *columns as f32) as usize;
            if !(left <= right) || range.is_empty() {
                continue;
            }
            let whole = [&range, &(row..row + 1)];
            for (drawn, new) in drawn.iter_mut().zip(whole) {
                let both = drawn.start.min(new.start)..drawn.end.max(new.end);
                *drawn = if Range::is_empty(drawn) { new.clone() } else { both };
            }
            let (y, x) = (row as f32, range.start as f32);
            let start = (x - start[0]) * along[0] + (y - start[1]) * along[1];
            let cells = row * *columns + range.start..row * *columns + range.end;
            let cells = limbs[cells.clone()].iter_mut().zip(&mut depth[cells]);
            for (column, (visible, depth)) in cells.enumerate() {
                let at = (start + column as f32 * along[0]).clamp(0.0, 1.0);
                let z = fronts[0] + (fronts[1] - fronts[0]) * at;
                if z < *depth {
                    (*visible, *depth) = (limb, z);
                }
            }
        }
    }
}
