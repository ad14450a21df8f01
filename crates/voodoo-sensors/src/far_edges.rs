//! Finds the far side of depth edges in a sparsely measured depth image.

use std::ops::Range;

use voodoo_core::math::widest;

/// Chamfer distances from a pixel to its neighbors, to its diagonal neighbors and to those a knight's move away: 1, 1.4 and
/// 2.1969 in units of 2^-16 (Borgefors, "Distance transformations in digital images", 1986), as in OpenCV.
const CHAMFERS: [i32; 3] = [65_536, 91_750, 143_976];
/// Greater than any distance to a measured pixel.
const NOTHING: i32 = i32::MAX >> 2;
/// Margin of columns and rows around an image for the neighbors of its pixels.
const BORDER: usize = 2;
/// Neighbors of a pixel in the rows before it, in the order that resolves ties: rows back, columns forward, and index of the
/// distance.
const NEIGHBORS_BEFORE: [(usize, usize, usize); 7] =
    [(2, 1, 2), (2, 3, 2), (1, 0, 2), (1, 1, 1), (1, 2, 0), (1, 3, 1), (1, 4, 2)];

/// Distances to the nearest measured pixel, and its depth, row by row with a margin of [`BORDER`] pixels on all sides.
struct NearestPixel {
    stride: usize,
    away: Vec<i32>,
    depth: Vec<f32>,
}

/// Marks a line of pixels on the far side of edges between surfaces whose depths differ by more than `apart`.
///
/// `depth` has so many columns, meters, and is infinite where nothing was measured: such a pixel gets the depth of the nearest
/// measured one. The result is undefined for pixels without a measurement within `reach` rows and columns.
pub(crate) fn far_edges(depth: &[f32], width: usize, apart: f32, reach: usize) -> Vec<bool> {
    let mut edges = vec![false; depth.len()];
    if depth.is_empty() || width == 0 {
        return edges;
    }
    let rows = depth.len() / width;
    let stride = width + 2 * BORDER;
    let cells = (rows + 2 * BORDER) * stride;
    let mut filled = NearestPixel { stride, away: vec![NOTHING; cells], depth: vec![0.0; cells] };
    // A pixel and its neighbors depend only on the path from the nearest measured pixel, whose chamfer distance is at most 7/5 of
    // the distance in rows or columns.
    let far = (7 * (reach + 1)).div_ceil(5);
    let spans = spans(depth, width, far);
    let mut copy = (vec![0; width], vec![0.0; width]);
    widest(
        #[inline(always)]
        || {
            for (row, span) in spans.iter().enumerate() {
                filled.propagate_rows::<false>(row, span, Some(&depth[row * width..][span.clone()]));
                filled.propagate_columns::<false>(row, span, far, &mut copy);
            }
            for (row, span) in spans.iter().enumerate().rev() {
                filled.propagate_rows::<true>(row, span, None);
                filled.propagate_columns::<true>(row, span, far, &mut copy);
            }
            filled.edges(rows, width, apart, &mut edges, &spans);
        },
    );
    edges
}

/// For each row, the range of columns from the first to the last one with a measurement within `far` rows and columns.
fn spans(depth: &[f32], width: usize, far: usize) -> Vec<Range<usize>> {
    let own: Vec<Range<usize>> = depth
        .chunks_exact(width)
        .map(|row| match row.iter().position(|depth| depth.is_finite()) {
            Some(first) => first..row.iter().rposition(|depth| depth.is_finite()).map_or(width, |last| last + 1),
            None => width..0,
        })
        .collect();
    let around = |row: usize| {
        let near = &own[row.saturating_sub(far)..(row + far + 1).min(own.len())];
        let first = near.iter().map(|span| span.start).min().unwrap_or(width);
        let end = near.iter().map(|span| span.end).max().unwrap_or(0);
        if first < end { first.saturating_sub(far)..(end + far).min(width) } else { 0..0 }
    };
    (0..own.len()).map(around).collect()
}

/// Number of pixels of a row that are processed together.
const BLOCK: usize = 16;

/// Rows that are already filled, from the first column of a span on.
struct Rows<'a> {
    away: &'a [i32],
    depth: &'a [f32],
    first: usize,
}

impl Rows<'_> {
    /// Updates `COUNT` pixels from their neighbors in these rows, given start indices and a step distance; measured pixels, where
    /// given, keep their own depth.
    ///
    /// All values are read and then selected by bit masks; for a choice between two addresses the compiler would process one
    /// pixel at a time.
    #[inline(always)]
    fn nearer<const COUNT: usize>(
        &self,
        starts: &[(usize, i32); 7],
        at: usize,
        (away, depth): (&mut [i32], &mut [f32]),
        measured: Option<&[f32]>,
    ) {
        let (mut least, mut found) = ([NOTHING; COUNT], [0.0; COUNT]);
        least.copy_from_slice(&away[at..at + COUNT]);
        found.copy_from_slice(&depth[at..at + COUNT]);
        let mut found = found.map(f32::to_bits);
        for (start, step) in starts {
            let from = start + self.first + at;
            let (mut others, mut depths) = ([0; COUNT], [0.0; COUNT]);
            others.copy_from_slice(&self.away[from..from + COUNT]);
            depths.copy_from_slice(&self.depth[from..from + COUNT]);
            for lane in 0..COUNT {
                let through = others[lane] + step;
                let keep = bits(through >= least[lane]);
                least[lane] = least[lane].min(through);
                found[lane] = (found[lane] & keep) | (depths[lane].to_bits() & !keep);
            }
        }
        if let Some(measured) = measured {
            let mut here = [0.0; COUNT];
            here.copy_from_slice(&measured[at..at + COUNT]);
            for lane in 0..COUNT {
                let keep = bits(!here[lane].is_finite());
                least[lane] &= keep as i32;
                found[lane] = (found[lane] & keep) | (here[lane].to_bits() & !keep);
            }
        }
        away[at..at + COUNT].copy_from_slice(&least);
        depth[at..at + COUNT].copy_from_slice(&found.map(f32::from_bits));
    }
}

/// Mask of all ones or all zeros.
#[inline(always)]
fn bits(condition: bool) -> u32 {
    u32::from(condition).wrapping_neg()
}

impl NearestPixel {
    /// Propagates to a row from the two rows above it, or from those below with reversed columns; measured pixels keep their own
    /// depth.
    #[inline(always)]
    fn propagate_rows<const BACK: bool>(&mut self, row: usize, span: &Range<usize>, measured: Option<&[f32]>) {
        let stride = self.stride;
        let row = row + BORDER;
        let split = if BACK { (row + 1) * stride } else { row * stride };
        let (above, below) = self.away.split_at_mut(split);
        let (depths_above, depths_below) = self.depth.split_at_mut(split);
        let (away, depth, others, other_depths) = if BACK {
            (&mut above[row * stride..], &mut depths_above[row * stride..], &*below, &*depths_below)
        } else {
            (&mut below[..stride], &mut depths_below[..stride], &*above, &*depths_above)
        };
        let (away, depth) = (&mut away[BORDER..][span.clone()], &mut depth[BORDER..][span.clone()]);
        // Blocks of neighbors stay in registers; the last block overlaps the one before, which does not change the result.
        let rows = Rows { away: others, depth: other_depths, first: span.start };
        let starts = NEIGHBORS_BEFORE.map(|(back, on, step)| {
            let start = if BACK { (back - 1) * stride + 2 * BORDER - on } else { (row - back) * stride + on };
            (start, CHAMFERS[step])
        });
        match away.len().checked_sub(BLOCK) {
            Some(last) => {
                for at in (0..last).step_by(BLOCK).chain([last]) {
                    rows.nearer::<BLOCK>(&starts, at, (away, depth), measured);
                }
            }
            None => (0..away.len()).for_each(|at| rows.nearer::<1>(&starts, at, (away, depth), measured)),
        }
    }

    /// Propagates within a row from pixels up to `far` before, or behind: first by one pixel, then by two, and so on. The nearer
    /// pixel wins a tie.
    #[inline(always)]
    fn propagate_columns<const BACK: bool>(
        &mut self,
        row: usize,
        span: &Range<usize>,
        far: usize,
        copy: &mut (Vec<i32>, Vec<f32>),
    ) {
        let start = (row + BORDER) * self.stride + BORDER;
        let (away, depth) = (&mut self.away[start..][span.clone()], &mut self.depth[start..][span.clone()]);
        let (mut done, mut shift) = (0, 1);
        while done < far && shift < span.len() {
            let rest = span.len() - shift;
            // The result goes to another buffer; in place, the compiler would use slow masked writes.
            let (others, depths) = (&mut copy.0[..span.len()], &mut copy.1[..span.len()]);
            others.copy_from_slice(away);
            depths.copy_from_slice(depth);
            let (from, to) = if BACK { (shift, 0) } else { (0, shift) };
            let (own, own_depths) = (&others[to..to + rest], &depths[to..to + rest]);
            let (others, depths) = (&others[from..from + rest], &depths[from..from + rest]);
            let (away, depth) = (&mut away[to..to + rest], &mut depth[to..to + rest]);
            let step = CHAMFERS[0] * shift as i32;
            for (away, (own, other)) in away.iter_mut().zip(own.iter().zip(others)) {
                *away = (*own).min(*other + step);
            }
            for ((depth, (own, other)), (own_depth, other_depth)) in
                depth.iter_mut().zip(own.iter().zip(others)).zip(own_depths.iter().zip(depths))
            {
                let keep = bits(*other + step >= *own);
                *depth = f32::from_bits((own_depth.to_bits() & keep) | (other_depth.to_bits() & !keep));
            }
            done += shift;
            shift *= 2;
        }
    }

    #[inline(always)]
    fn edges(&self, rows: usize, width: usize, apart: f32, edges: &mut [bool], spans: &[Range<usize>]) {
        let lesser = |a: f32, b: f32| if a < b { a } else { b };
        let line = |row: usize, span: &Range<usize>| {
            &self.depth[(row.min(rows - 1) + BORDER) * self.stride + BORDER..][span.clone()]
        };
        let mut least = vec![0.0; width];
        for ((row, edges), span) in edges.chunks_exact_mut(width).enumerate().zip(spans) {
            if span.is_empty() {
                continue;
            }
            let (here, least, edges) = (line(row, span), &mut least[..span.len()], &mut edges[span.clone()]);
            let around = line(row.saturating_sub(1), span).iter().zip(here).zip(line(row + 1, span));
            least.iter_mut().zip(around).for_each(|(least, ((a, b), c))| *least = lesser(lesser(*a, *c), *b) + apart);
            let end = least.len() - 1;
            for (place, neighbors) in [(0, [0, end.min(1)]), (end, [end.saturating_sub(1), end])] {
                edges[place] = here[place] > lesser(least[neighbors[0]], least[neighbors[1]]);
            }
            if let (Some(inner), Some(here), Some(second), Some(third)) =
                (edges.get_mut(1..end), here.get(1..end), least.get(1..), least.get(2..))
            {
                let around = least.iter().zip(second).zip(third);
                for ((edge, z), ((a, b), c)) in inner.iter_mut().zip(here).zip(around) {
                    *edge = *z > lesser(lesser(*a, *c), *b);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_on_the_far_side_of_a_step_and_nothing_where_surfaces_touch() {
        let depth = [[1.0, f32::INFINITY, 1.0, 2.0, f32::INFINITY, 2.05]; 3].concat();
        let line = [false, false, false, true, false, false].repeat(3);
        assert_eq!(far_edges(&depth, 6, 0.1, 2), line);
        assert!(far_edges(&[f32::INFINITY; 12], 4, 0.1, 2).iter().all(|edge| !edge));
        assert!(far_edges(&[], 0, 0.1, 2).is_empty());
    }
}
