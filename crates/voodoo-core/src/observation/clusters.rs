//! Groups neighboring candidates into clusters, so that a test can be made once for a whole cluster.

use crate::math::{LANES, Points, reset, vectorized};

/// Points per cluster: a whole number of SIMD lanes.
pub(crate) const CLUSTER: usize = 32;
/// Cells along each axis of the grid that sorts the points: a power of two, so that a bit mask keeps an index in range.
const CELLS: usize = 16;
/// The last cell along an axis.
const LAST: u32 = CELLS as u32 - 1;
/// From here on single precision has no fractions, and the bits after the leading one are zero.
const WHOLE: f32 = (1 << 23) as f32;
/// Least size of a cell, meters: approximately the size of a cluster of depth pixels.
const SMALLEST_CELL: f32 = 0.08;

/// Points in an order that keeps neighbors together, cut into clusters.
#[derive(Debug, Default)]
pub(crate) struct Clusters {
    /// The original index of each sorted point, and the sorted points; the last one is repeated to fill the last cluster.
    order: Vec<u32>,
    points: Points,
    bounds: Vec<Bounds>,
    /// The cell of each point, and where the next point of each cell goes in the sorted order.
    cells: Vec<u32>,
    next: Vec<u32>,
}

/// An axis-aligned box around points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    /// Center.
    pub center: [f32; 3],
    /// Half of the size.
    pub half: [f32; 3],
}

/// The points of one cluster, including repetitions of the last one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cluster<'a> {
    /// First coordinates.
    pub x: &'a [f32; CLUSTER],
    /// Second coordinates.
    pub y: &'a [f32; CLUSTER],
    /// Third coordinates.
    pub z: &'a [f32; CLUSTER],
    /// Bounding box.
    pub bounds: &'a Bounds,
    /// Indices of the points, without repetitions.
    pub which: &'a [u32],
}

impl Clusters {
    /// Sorts points into clusters.
    pub(crate) fn arrange(&mut self, points: &Points) {
        reset(&mut self.order, points.len(), 0);
        self.bounds.clear();
        self.points.clear();
        if points.is_empty() {
            return;
        }
        vectorized!(self.find_cells(points));
        reset(&mut self.next, CELLS * CELLS * CELLS, 0);
        for cell in &self.cells {
            self.next[*cell as usize] += 1;
        }
        let mut start = 0;
        for next in &mut self.next {
            start += std::mem::replace(next, start);
        }
        for (index, cell) in (0..).zip(&self.cells) {
            let place = &mut self.next[*cell as usize];
            self.order[*place as usize] = index;
            *place += 1;
        }
        let padding = self.order.len().next_multiple_of(CLUSTER) - self.order.len();
        let last = self.order[self.order.len() - 1];
        for (to, from) in
            [(&mut self.points.x, &points.x), (&mut self.points.y, &points.y), (&mut self.points.z, &points.z)]
        {
            to.extend(self.order.iter().map(|index| from[*index as usize]));
            to.extend(std::iter::repeat_n(from[last as usize], padding));
        }
        vectorized!(self.find_bounds());
    }

    /// The cell of every point. Cells are numbered layer by layer, and back and forth in each layer, so that consecutive cells
    /// are adjacent.
    #[inline(always)]
    fn find_cells(&mut self, points: &Points) {
        let (x, y, z) = (CellAxis::new(&points.x), CellAxis::new(&points.y), CellAxis::new(&points.z));
        reset(&mut self.cells, points.len(), 0);
        let back = |turn: u32| (turn & 1) * LAST;
        let (xs, ys, zs) =
            (&points.x[..self.cells.len()], &points.y[..self.cells.len()], &points.z[..self.cells.len()]);
        for (index, cell) in self.cells.iter_mut().enumerate() {
            let layer = z.cell(zs[index]);
            let row = y.cell(ys[index]) ^ back(layer);
            let place = x.cell(xs[index]) ^ back(row);
            *cell = (layer * CELLS as u32 + row) * CELLS as u32 + place;
        }
    }

    #[inline(always)]
    fn find_bounds(&mut self) {
        let Points { x, y, z } = &self.points;
        for start in (0..x.len()).step_by(CLUSTER) {
            let (mut center, mut half) = ([0.0; 3], [0.0; 3]);
            for (axis, values) in [x, y, z].into_iter().enumerate() {
                let [low, high] = range(&values[start..start + CLUSTER]);
                center[axis] = 0.5 * (low + high);
                half[axis] = 0.5 * (high - low);
            }
            self.bounds.push(Bounds { center, half });
        }
    }

    /// The clusters in order.
    #[inline(always)]
    pub(crate) fn iter(&self) -> impl ExactSizeIterator<Item = Cluster<'_>> {
        let Points { x, y, z } = &self.points;
        let columns = [x, y, z].map(|column| column.as_chunks::<CLUSTER>().0);
        self.bounds.iter().zip(self.order.chunks(CLUSTER)).enumerate().map(move |(index, (bounds, which))| Cluster {
            x: &columns[0][index],
            y: &columns[1][index],
            z: &columns[2][index],
            bounds,
            which,
        })
    }
}

/// The grid cells along an axis.
struct CellAxis {
    low: f32,
    scale: f32,
}

impl CellAxis {
    #[inline(always)]
    fn new(values: &[f32]) -> Self {
        let [low, high] = range(values);
        Self { low, scale: 1.0 / ((high - low) / CELLS as f32).max(SMALLEST_CELL) }
    }

    /// The cell of a value; a NaN counts as the least value.
    #[inline(always)]
    fn cell(&self, value: f32) -> u32 {
        let place = (value - self.low) * self.scale;
        let place = if place > 0.0 { place } else { 0.0 };
        let place = if place < LAST as f32 { place } else { LAST as f32 };
        // The last bits of the sum are the integer; unlike a cast, this works in every SIMD lane.
        (place + WHOLE).to_bits() & LAST
    }
}

/// Minimum and maximum of some values, in lanes.
#[inline(always)]
fn range(values: &[f32]) -> [f32; 2] {
    let (mut low, mut high) = ([f32::MAX; LANES], [f32::MIN; LANES]);
    let (whole, rest) = values.as_chunks::<LANES>();
    for lanes in whole {
        for lane in 0..LANES {
            low[lane] = if lanes[lane] < low[lane] { lanes[lane] } else { low[lane] };
            high[lane] = if lanes[lane] > high[lane] { lanes[lane] } else { high[lane] };
        }
    }
    for value in rest {
        low[0] = if *value < low[0] { *value } else { low[0] };
        high[0] = if *value > high[0] { *value } else { high[0] };
    }
    [low.into_iter().fold(f32::MAX, f32::min), high.into_iter().fold(f32::MIN, f32::max)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_in_one_cluster_and_its_bounds() {
        let mut points = Points::default();
        let mut clusters = Clusters::default();
        for count in [0, 1, 31, 32, 1000] {
            points.clear();
            for n in 0..count {
                let part = |step: usize| (n * step % 997) as f32 / 997.0 - 0.5;
                points.push([part(3), 0.5 * part(71), 2.0 * part(401)]);
            }
            clusters.arrange(&points);
            let mut counts = vec![0; count];
            let mut size = 0.0;
            for cluster in clusters.iter() {
                let Bounds { center, half } = *cluster.bounds;
                size += half.iter().sum::<f32>() / half.len() as f32;
                for (offset, which) in cluster.which.iter().enumerate() {
                    let index = *which as usize;
                    counts[index] += 1;
                    let place = [cluster.x[offset], cluster.y[offset], cluster.z[offset]];
                    assert_eq!(place, [points.x[index], points.y[index], points.z[index]]);
                    for axis in 0..3 {
                        assert!((place[axis] - center[axis]).abs() <= half[axis] + 1e-6);
                    }
                }
            }
            assert!(counts.iter().all(|times| *times == 1), "{count}: {counts:?}");
            assert_eq!(clusters.iter().len(), count.div_ceil(CLUSTER));
            // All points lie in a box of 1 m x 0.5 m x 2 m.
            assert!(count < 1000 || size / (clusters.iter().len() as f32) < 0.25, "{size}");
        }
    }
}
