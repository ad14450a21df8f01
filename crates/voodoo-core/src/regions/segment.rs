//! Segments the body in an image from colors, with the predicted body as the shape prior (R07 section 3.1).
//!
//! The log odds of a pixel are the sum of its color log ratio, the mean log ratio of its neighborhood, and a prior that falls
//! with the distance from the projected contour.

use super::histogram::bin_of;
use super::labels::NOTHING;
use super::{ColorRegions, Posed};
use crate::association::correspondence::Correspondences;
use crate::observation::frame::Frame;
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
    pub(crate) fn segment(&mut self, frame: &Frame, posed: Posed) -> Vec<Vec<f32>> {
        self.begin(frame, posed);
        frame.colors.iter().map(|picture| self.segment_picture(frame, picture, posed)).collect()
    }

    /// Learns the colors of the body and its surroundings at this pose.
    pub(crate) fn learn_at(&mut self, frame: &Frame, posed: Posed) {
        self.begin(frame, posed);
        self.find(frame, posed, 0, |_| true, &mut Correspondences::default());
        self.learn(frame);
    }

    fn segment_picture(&mut self, frame: &Frame, picture: &ColorImage, posed: Posed) -> Vec<f32> {
        self.place_lines(frame, picture, posed);
        let [width, height] = [picture.camera.width(), picture.camera.height()];
        let mut likely = vec![0.0; width * height];
        let Some(camera) = self.cameras.iter().find(|camera| camera.number == picture.number) else { return likely };
        let view = camera.view(picture, &camera.labels, &self.groups);
        let cell = 1_usize << super::CELL_BITS;
        let (nearest, outside) = distances(&camera.labels, [width, height], cell as f32 / camera.unit);
        let place = |index: usize| index / width / cell * width.div_ceil(cell) + index % width / cell;
        // Log ratios, and then their means along rows and columns.
        let mut ratios = vec![0.0_f32; likely.len()];
        for (index, ratio) in ratios.iter_mut().enumerate() {
            let limb = nearest[place(index)];
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
            let place = place(index);
            if nearest[place] != NOTHING && outside[place] < FARTHEST {
                let odds = ratios[index] + around[index] - outside[place] / FALL;
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

/// Of every cell the nearest limb, and the signed distance outside of the contour of what is drawn; a cell is `side` units wide.
fn distances(labels: &super::LimbLabels, size: [usize; 2], side: f32) -> (Vec<u16>, Vec<f32>) {
    let cell = 1_usize << super::CELL_BITS;
    let [columns, rows] = size.map(|size| size.div_ceil(cell));
    let visible = |index: usize| labels.at(index % columns * cell, index / columns * cell).0;
    let mut limb: Vec<u16> = (0..columns * rows).map(visible).collect();
    let far = |inside: bool| move |limb: &u16| if (*limb == NOTHING) == inside { 0.0 } else { f32::INFINITY };
    let mut outward: Vec<f32> = limb.iter().map(far(false)).collect();
    let mut inward: Vec<f32> = limb.iter().map(far(true)).collect();
    spread(&mut outward, Some(&mut limb), columns);
    spread(&mut inward, None, columns);
    let outside = outward.iter().zip(&inward).map(|(outward, inward)| side * (outward - inward)).collect();
    (limb, outside)
}

/// Distances to the nearest cell with distance zero, in two passes; each cell takes over the limb of its nearest one.
fn spread(distance: &mut [f32], mut limb: Option<&mut Vec<u16>>, columns: usize) {
    let rows = distance.len() / columns.max(1);
    let [side, corner] = CHAMFER;
    let mut take = |to: usize, from: usize, step: f32| {
        if distance[from] + step < distance[to] {
            distance[to] = distance[from] + step;
            if let Some(limb) = &mut limb {
                limb[to] = limb[from];
            }
        }
    };
    for pass in 0..2 {
        for index in 0..rows * columns {
            let to = if pass == 0 { index } else { rows * columns - 1 - index };
            let (column, row) = (to % columns, to / columns);
            let (back, ahead) =
                if pass == 0 { (column > 0, column + 1 < columns) } else { (column + 1 < columns, column > 0) };
            let before = if pass == 0 { row > 0 } else { row + 1 < rows };
            // The second pass runs the same way backwards.
            let at = |offset: usize| if pass == 0 { to - offset } else { to + offset };
            if back {
                take(to, at(1), side);
            }
            if before {
                take(to, at(columns), side);
            }
            if before && back {
                take(to, at(columns + 1), corner);
            }
            if before && ahead {
                take(to, at(columns - 1), corner);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_spread_from_where_they_are_none() {
        let (columns, rows) = (9, 7);
        let mut distance = vec![f32::INFINITY; columns * rows];
        let mut limb = vec![NOTHING; columns * rows];
        (distance[3 * columns + 4], limb[3 * columns + 4]) = (0.0, 5);
        spread(&mut distance, Some(&mut limb), columns);
        for (index, found) in distance.iter().enumerate() {
            let (x, y) = ((index % columns) as f32 - 4.0, (index / columns) as f32 - 3.0);
            assert!((found - x.hypot(y)).abs() < 0.09 * x.hypot(y) + 1e-3, "{x} {y}: {found}");
        }
        assert!(limb.iter().all(|limb| *limb == 5));
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
