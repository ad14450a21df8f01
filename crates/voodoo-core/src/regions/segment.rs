//! Segments the body in an image from colors, with the predicted body as the shape prior (R07 section 3.1).
//!
//! The log odds of a pixel are the sum of its color log ratio, the mean log ratio of its neighborhood, and a prior that falls
//! with the distance from the projected contour.

use super::histogram::bin_of;
use super::labels::NOTHING;
use super::scan::ScanView;
use super::{ColorRegions, Posed};
use crate::association::correspondence::Correspondences;
use crate::observation::picture::ColorImage;

/// Log odds fall by one per this many units outward from the contour.
const FALL: f32 = 3.0;
/// Farther outside than this, units, the probability is zero.
const FARTHEST: f32 = 20.0;
/// Radius of the neighborhood, pixels: it suppresses noise.
const NEIGHBORS: usize = 2;
/// Costs of a step to a side neighbor and to a corner neighbor in the distance transform (Borgefors 1986), cells.
const CHAMFER: [f32; 2] = [1.0, 1.414];

impl ColorRegions {
    /// Probability that each pixel of a frame's images shows the body, image after image, row by row, in [0, 1]. New cameras
    /// first learn its colors at this pose.
    pub(crate) fn segment(&mut self, posed: Posed) -> Vec<Vec<f32>> {
        self.begin(posed);
        posed.frame.colors.iter().map(|picture| self.segment_picture(picture, posed)).collect()
    }

    /// Learns the colors of the body and its surroundings at this pose.
    pub(crate) fn learn_at(&mut self, posed: Posed) {
        self.begin(posed);
        self.find(posed, 0, |_| true, &mut Correspondences::default());
        posed.frame.colors.iter().for_each(|picture| self.teach(picture));
    }

    fn segment_picture(&mut self, picture: &ColorImage, posed: Posed) -> Vec<f32> {
        self.place_lines(picture, posed);
        let [width, height] = [picture.camera.width(), picture.camera.height()];
        let mut likely = vec![0.0; width * height];
        let Some(camera) = self.cameras.get(&picture.number) else { return likely };
        let view = ScanView { picture, camera, groups: &self.groups };
        let cell = 1_usize << super::CELL_BITS;
        let cells = distances(&camera.labels, cell as f32 / camera.unit);
        let nearest = |index: usize| cells[index / width / cell * width.div_ceil(cell) + index % width / cell];
        // Log ratios, and then their means along rows and columns.
        let mut ratios = vec![0.0_f32; likely.len()];
        for (index, ratio) in ratios.iter_mut().enumerate() {
            let (_, limb) = nearest(index);
            if limb == NOTHING {
                continue;
            }
            let group = usize::from(self.groups[usize::from(limb)]);
            if camera.model.knows(group) {
                *ratio = view.ratio(group, NOTHING, index, bin_of(&picture.pixels, index));
            }
        }
        let around = means(&means(&ratios, width, 1), width, width);
        for (index, likely) in likely.iter_mut().enumerate() {
            let (outside, limb) = nearest(index);
            if limb != NOTHING && outside < FARTHEST {
                let odds = ratios[index] + around[index] - outside / FALL;
                *likely = 1.0 / (1.0 + (-odds).exp());
            }
        }
        likely
    }
}

/// Means over a neighborhood along one axis, at a stride; values beyond the end of a row are left out.
fn means(values: &[f32], width: usize, stride: usize) -> Vec<f32> {
    let reach = NEIGHBORS * stride;
    let mean = |index: usize| {
        let (mut sum, mut count) = (0.0, 0.0);
        for step in 0..=2 * NEIGHBORS {
            let Some(other) = (index + step * stride).checked_sub(reach) else { continue };
            if other < values.len() && (stride > 1 || other / width == index / width) {
                sum += values[other];
                count += 1.0;
            }
        }
        sum / count
    };
    (0..values.len()).map(mean).collect()
}

/// Of every cell the signed distance outside of the contour of what is drawn, and the nearest limb; a cell is `side` units wide.
fn distances(labels: &super::LimbLabels, side: f32) -> Vec<(f32, u16)> {
    let spread_from = |is_start: fn(u16) -> bool| {
        let start = |limb: &u16| (if is_start(*limb) { 0.0 } else { f32::INFINITY }, *limb);
        let mut cells: Vec<(f32, u16)> = labels.limb.iter().map(start).collect();
        spread(&mut cells, labels.columns);
        cells
    };
    let (outward, inward) = (spread_from(|limb| limb != NOTHING), spread_from(|limb| limb == NOTHING));
    let both = outward.into_iter().zip(inward);
    both.map(|((outward, limb), (inward, _))| (side * (outward - inward), limb)).collect()
}

/// Distances to the nearest cell with distance zero, in two passes, the second one backwards; each cell takes over the limb of its
/// nearest one.
fn spread(cells: &mut [(f32, u16)], columns: usize) {
    let [side, corner] = CHAMFER;
    for _ in 0..2 {
        for to in 0..cells.len() {
            let mut take = |from: usize, step: f32| {
                let (distance, limb) = cells[from];
                if distance + step < cells[to].0 {
                    cells[to] = (distance + step, limb);
                }
            };
            let (left, right, above) = (to % columns > 0, to % columns + 1 < columns, to >= columns);
            if left {
                take(to - 1, side);
            }
            if above {
                take(to - columns, side);
            }
            if above && left {
                take(to - columns - 1, corner);
            }
            if above && right {
                take(to - columns + 1, corner);
            }
        }
        cells.reverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_spread_from_where_they_are_none() {
        let (columns, rows) = (9, 7);
        let mut cells = vec![(f32::INFINITY, NOTHING); columns * rows];
        cells[3 * columns + 4] = (0.0, 5);
        spread(&mut cells, columns);
        for (index, (found, limb)) in cells.into_iter().enumerate() {
            let (x, y) = ((index % columns) as f32 - 4.0, (index / columns) as f32 - 3.0);
            assert!((found - x.hypot(y)).abs() < 0.09 * x.hypot(y) + 1e-3, "{x} {y}: {found}");
            assert_eq!(limb, 5);
        }
    }

    #[test]
    fn means_stay_within_a_row() {
        let values: Vec<f32> = (0..12).map(|index| if index == 5 { 5.0 } else { 0.0 }).collect();
        let found = means(&values, 6, 1);
        assert_eq!(found[3..6], [1.0, 1.25, 5.0 / 3.0]);
        assert!(found[6..].iter().all(|mean| *mean == 0.0));
        let down = means(&values, 6, 6);
        assert_eq!((down[5], down[11]), (2.5, 2.5));
    }
}
