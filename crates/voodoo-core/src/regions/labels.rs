//! Which limb a camera sees where: the limbs' outlines, filled, at a part of the picture's size.
//!
//! What lies before what is all that region lines ask of it, so the outline is the convex hull of the two ends, and depth runs
//! linearly along the axis.

use super::lens::Lens;
use crate::body::Body;
use crate::math::{Pose, Vec3};

/// Pixels of the picture, across and down, that one cell stands for.
pub(super) const PIXELS_A_CELL: usize = 2;
/// Corners of an end's outline.
const CORNERS: usize = 8;
/// A limb with an end nearer than this to the camera's plane is not drawn, metres.
const NEAREST_END: f64 = 0.1;

/// No limb is seen there.
pub(super) const NOTHING: u16 = u16::MAX;

/// A picture of limbs.
#[derive(Clone, Debug, Default)]
pub(super) struct Labels {
    columns: usize,
    rows: usize,
    limb: Vec<u16>,
    depth: Vec<f32>,
    hull: Vec<[f32; 2]>,
    corners: Vec<[f32; 2]>,
}

/// Depth along the picture of an axis.
struct Axis {
    start: [f32; 2],
    along: [f32; 2],
    depth: [f32; 2],
}

impl Labels {
    /// Draws all limbs as a camera sees them.
    pub(super) fn draw(&mut self, body: &Body, camera_from_limb: &[Pose], lens: &Lens) {
        (self.columns, self.rows) = (lens.width.div_ceil(PIXELS_A_CELL), lens.height.div_ceil(PIXELS_A_CELL));
        self.limb.clear();
        self.limb.resize(self.columns * self.rows, NOTHING);
        self.depth.resize(self.columns * self.rows, 0.0);
        for (index, (limb, pose)) in body.limbs().iter().zip(camera_from_limb).enumerate() {
            let shape = &limb.shape;
            let ends = [(shape.a0(), shape.b0(), 0.0), (shape.a1(), shape.b1(), shape.length())];
            let centres = ends.map(|(_, _, z)| *pose * (Vec3::Z * z));
            if ends.iter().zip(centres).any(|((a, b, _), centre)| centre.z - a.max(*b) < NEAREST_END) {
                continue;
            }
            self.corners.clear();
            for (a, b, z) in ends {
                for corner in 0..CORNERS {
                    let (s, c) = f64::sin_cos(std::f64::consts::TAU * corner as f64 / CORNERS as f64);
                    let place = lens.project(*pose * Vec3::new(a * c, b * s, z));
                    self.corners.push(place.map(|value| (value / PIXELS_A_CELL as f64) as f32));
                }
            }
            let [start, end] =
                centres.map(|centre| lens.project(centre).map(|value| (value / PIXELS_A_CELL as f64) as f32));
            let front = |end: usize| (centres[end].z - 0.5 * (ends[end].0 + ends[end].1)) as f32;
            let along = [end[0] - start[0], end[1] - start[1]];
            let square = (along[0] * along[0] + along[1] * along[1]).max(1.0);
            let axis = Axis { start, along: along.map(|value| value / square), depth: [front(0), front(1)] };
            self.find_hull();
            self.fill(index as u16, &axis);
        }
    }

    /// The limb that a cell shows and its depth, metres.
    #[inline]
    pub(super) fn at(&self, u: f32, v: f32) -> (u16, f32) {
        let (column, row) = ((u * (1.0 / PIXELS_A_CELL as f32)) as usize, (v * (1.0 / PIXELS_A_CELL as f32)) as usize);
        let index = row * self.columns + column;
        match self.limb.get(index) {
            Some(limb) if column < self.columns => (*limb, self.depth[index]),
            _ => (NOTHING, 0.0),
        }
    }

    /// The convex hull of the corners, anticlockwise (Andrew's monotone chain).
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

    /// Fills the hull where nothing nearer is.
    fn fill(&mut self, limb: u16, axis: &Axis) {
        let Self { columns, rows, hull, depth, limb: limbs, .. } = self;
        let (low, high) =
            hull.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), [_, y]| (low.min(*y), high.max(*y)));
        let first = low.ceil().max(0.0) as usize;
        for row in first..(high.floor() + 1.0).clamp(0.0, *rows as f32) as usize {
            let y = row as f32;
            let (mut left, mut right) = (f32::INFINITY, f32::NEG_INFINITY);
            for (index, [x0, y0]) in hull.iter().enumerate() {
                let [x1, y1] = hull[(index + 1) % hull.len()];
                if (*y0 <= y) != (y1 <= y) {
                    let x = x0 + (x1 - x0) * (y - y0) / (y1 - y0);
                    (left, right) = (left.min(x), right.max(x));
                }
            }
            if !(left <= right) {
                continue;
            }
            let range = left.ceil().max(0.0) as usize..(right.floor() + 1.0).clamp(0.0, *columns as f32) as usize;
            for column in range {
                let at = (column as f32 - axis.start[0]) * axis.along[0] + (y - axis.start[1]) * axis.along[1];
                let z = axis.depth[0] + (axis.depth[1] - axis.depth[0]) * at.clamp(0.0, 1.0);
                let index = row * *columns + column;
                if limbs[index] == NOTHING || z < depth[index] {
                    (limbs[index], depth[index]) = (limb, z);
                }
            }
        }
    }
}
