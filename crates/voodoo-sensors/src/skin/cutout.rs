//! The contour of a mask region: its length in any orientation, and its tips.

/// A region cropped from a mask: row by row, 1 inside the region, within its bounding box.
#[derive(Clone, Debug)]
pub(super) struct Cutout {
    /// Number of columns.
    pub width: usize,
    pub mask: Vec<u8>,
    /// Mean column and row.
    pub middle: [f64; 2],
}

/// Greatest number of tips that are evaluated; more than two hands do not join.
const MOST_TIPS: usize = 4;
/// A tip is a maximum of the distance from the center along the contour within this many palm radii.
const TIP_ALONE: f64 = 2.5;
/// Least distance of a tip from the region's center, in palm radii; a palm alone has no tips.
const FAR_OUT: f64 = 1.5;
/// Least distance between two tips, in palm radii.
const TIPS_APART: f64 = 3.0;
/// Extent of a hand from its tip, in palm radii.
const HAND_AT_TIP: f64 = 3.2;
/// Offsets (column, row) of the eight neighbors, counterclockwise in the image.
const NEIGHBOR_STEPS: [[i32; 2]; 8] = [[1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1], [0, 1], [1, 1]];

impl Cutout {
    fn contains(&self, [u, v]: [i32; 2]) -> bool {
        let inside = u >= 0 && v >= 0 && (u as usize) < self.width;
        inside && self.mask.get(v as usize * self.width + u as usize).is_some_and(|pixel| *pixel != 0)
    }

    /// The pixels (column, row) of the region's outer border, from its first one on, as Suzuki and Abe follow it ("Topological
    /// structural analysis of digitized binary images by border following", 1985), and OpenCV.
    pub(super) fn border(&self) -> Vec<[i32; 2]> {
        let Some(first) = self.mask.iter().position(|pixel| *pixel != 0) else { return Vec::new() };
        let start = [(first % self.width) as i32, (first / self.width) as i32];
        let step = |[u, v]: [i32; 2], turn: usize| [u + NEIGHBOR_STEPS[turn & 7][0], v + NEIGHBOR_STEPS[turn & 7][1]];
        // Clockwise from the left neighbor, which is outside, to the last border pixel.
        let Some(to_last) = (5..12).rev().find(|turn| self.contains(step(start, *turn))) else { return vec![start] };
        let last = step(start, to_last);
        let (mut here, mut back) = (start, to_last & 7);
        let mut border = Vec::new();
        loop {
            let Some(turn) = (back + 1..back + 9).find(|turn| self.contains(step(here, *turn))) else { return border };
            border.push(here);
            let next = step(here, turn);
            if next == start && here == last {
                return border;
            }
            (here, back) = (next, (turn + 4) & 7);
        }
    }

    /// Longer side of the narrowest box of any orientation around the region, pixels.
    pub(super) fn length(&self) -> f64 {
        let hull = self.hull();
        let mut best = (f64::INFINITY, 0.0);
        for (index, [u, v]) in hull.iter().enumerate() {
            let [to_u, to_v] = hull[(index + 1) % hull.len()];
            let [du, dv] = [f64::from(to_u - u), f64::from(to_v - v)];
            let norm = du.hypot(dv).max(1e-9);
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for [x, y] in &hull {
                let [x, y] = [f64::from(*x), f64::from(*y)];
                for (axis, place) in [(x * du + y * dv) / norm, (y * du - x * dv) / norm].into_iter().enumerate() {
                    low[axis] = low[axis].min(place);
                    high[axis] = high[axis].max(place);
                }
            }
            let sides = [high[0] - low[0], high[1] - low[1]];
            if sides[0] * sides[1] < best.0 {
                best = (sides[0] * sides[1], sides[0].max(sides[1]));
            }
        }
        best.1 + 1.0
    }

    /// Corners of the smallest convex shape around all pixels (Andrew's monotone chain).
    fn hull(&self) -> Vec<[i32; 2]> {
        let mut ends: Vec<[i32; 2]> = Vec::new();
        for (v, row) in self.mask.chunks_exact(self.width.max(1)).enumerate() {
            if let Some(first) = row.iter().position(|pixel| *pixel != 0) {
                let last = row.iter().rposition(|pixel| *pixel != 0).unwrap_or(first);
                ends.push([first as i32, v as i32]);
                if last > first {
                    ends.push([last as i32, v as i32]);
                }
            }
        }
        let mut hull: Vec<[i32; 2]> = Vec::new();
        let mut add = |points: &mut dyn Iterator<Item = [i32; 2]>| {
            let begin = hull.len();
            for point in points {
                while let [.., a, b] = hull[begin..] {
                    let turn = (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]);
                    if turn > 0 {
                        break;
                    }
                    hull.pop();
                }
                hull.push(point);
            }
            // The opposite direction ends the border where this one begins.
            if hull.len() > begin + 1 {
                hull.pop();
            }
        };
        // Sorted by row, then by column: one chain downwards, the other upwards.
        add(&mut ends.iter().copied());
        add(&mut ends.iter().rev().copied());
        hull
    }

    /// Centers (column, row) of the parts of the region around its tips, farthest first, for a palm of this radius in pixels.
    pub(super) fn tips(&self, palm: f64) -> Vec<[f64; 2]> {
        let border = self.border();
        let count = border.len();
        let away: Vec<f64> = border
            .iter()
            .map(|[u, v]| (f64::from(*u) - self.middle[0]).powi(2) + (f64::from(*v) - self.middle[1]).powi(2))
            .collect();
        let reach = ((TIP_ALONE * palm).round_ties_even() as usize).min(count / 2);
        let least = (FAR_OUT * palm).powi(2);
        let is_peak = |index: &usize| {
            away[*index] >= least
                && (1..=reach).all(|on| {
                    away[*index] >= away[(*index + on) % count] && away[*index] >= away[(*index + count - on) % count]
                })
        };
        let mut peaks: Vec<usize> = (0..count).filter(is_peak).collect();
        peaks.sort_by(|a, b| away[*b].total_cmp(&away[*a]));
        let mut taken: Vec<[f64; 2]> = Vec::new();
        let mut tips = Vec::new();
        for peak in peaks {
            let tip = border[peak].map(f64::from);
            let apart = |other: &[f64; 2]| (tip[0] - other[0]).hypot(tip[1] - other[1]);
            if taken.len() == MOST_TIPS {
                break;
            }
            if taken.iter().all(|other| apart(other) >= TIPS_APART * palm) {
                taken.push(tip);
                tips.push(self.middle_near(tip, HAND_AT_TIP * palm));
            }
        }
        tips
    }

    /// Mean column and row of the region's pixels within `reach` of a pixel.
    fn middle_near(&self, place: [f64; 2], reach: f64) -> [f64; 2] {
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for (index, _) in self.mask.iter().enumerate().filter(|(_, pixel)| **pixel != 0) {
            let [u, v] = [(index % self.width) as f64, (index / self.width) as f64];
            if (u - place[0]).powi(2) + (v - place[1]).powi(2) < reach * reach {
                sums = [sums[0] + u, sums[1] + v];
                count += 1.0;
            }
        }
        sums.map(|sum| sum / f64::max(count, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cutout(rows: &[&str]) -> Cutout {
        let mask: Vec<u8> = rows.iter().flat_map(|row| row.bytes().map(|byte| u8::from(byte == b'#'))).collect();
        let (width, count) = (rows[0].len(), mask.iter().filter(|pixel| **pixel == 1).count() as f64);
        let mean = |of: fn(usize, usize) -> usize| {
            let there = mask.iter().enumerate().filter(|(_, pixel)| **pixel == 1);
            there.map(|(index, _)| of(index, width) as f64).sum::<f64>() / count
        };
        let middle = [mean(|index, width| index % width), mean(|index, width| index / width)];
        Cutout { width, mask, middle }
    }

    #[test]
    fn a_border_is_followed_all_around_and_twice_along_a_line() {
        let block = cutout(&[".##", "###", "##."]);
        assert_eq!(block.border(), [[1, 0], [0, 1], [0, 2], [1, 2], [2, 1], [2, 0]]);
        assert_eq!(cutout(&["###"]).border(), [[0, 0], [1, 0], [2, 0], [1, 0]]);
        assert_eq!(cutout(&[".#."]).border(), [[1, 0]]);
        assert!(cutout(&["..."]).border().is_empty());
    }

    #[test]
    fn a_region_is_as_long_as_the_narrowest_box_around_it() {
        let turned = cutout(&["#....", ".#...", "..#..", "...#.", "....#"]);
        assert!((turned.length() - (1.0 + 4.0 * 2.0_f64.sqrt())).abs() < 1e-12);
        assert!((cutout(&["####", "####"]).length() - 4.0).abs() < 1e-12);
        assert!((cutout(&["#"]).length() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_bar_has_two_tips_and_a_palm_none() {
        let bar = cutout(&["####################"; 3]);
        let mut tips = bar.tips(2.0);
        tips.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert_eq!(tips.len(), 2);
        assert!((tips[0][0] + tips[1][0] - 19.0).abs() < 1e-9 && tips[0][0] < 4.0);
        assert!(cutout(&["####"; 4]).tips(2.0).is_empty());
    }
}
