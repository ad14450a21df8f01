//! Finds the pixels in a skin mask where a head or a hand may be.

use std::f64::consts::PI;

use crate::mask_regions::{MaskRegion, regions};
use crate::masks::{bounds, cut};
use crate::registration::RegionLabels;
use crate::skin::cutout::Cutout;

/// Radius of a palm, meters.
pub const PALM: f64 = 0.045;
/// Radius of a face, meters.
pub const FACE: f64 = 0.085;
/// Length of a hand with stretched fingers, in palm radii.
const LONGEST_HAND: f64 = 4.6;
/// Regions with less area than this fraction of a palm's disc are noise.
const SMALLEST: f64 = 0.2;
/// Regions with fewer pixels are noise at any distance.
const FEWEST_PIXELS: f64 = 6.0;
/// Regions larger than this many faces are background, such as a door.
const MOST_FACES: f64 = 4.0;

/// A pixel where a head or hand may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinCandidate {
    /// Column and row.
    pub pixel: [f64; 2],
    /// Label of its region.
    pub region: i32,
    /// Area of that region, pixels.
    pub area: usize,
    /// False for the center of a region longer than a hand, which may be a face but not a hand.
    pub hand: bool,
}

/// Returns the candidates in a mask of so many columns for a palm of this radius in pixels, and the region label of each pixel.
///
/// Regions with less than a fifth of a palm's area are noise. Every other region yields its center, unless it is larger than four
/// faces. A region longer than a hand also yields its tips: the centers of what lies within a hand's reach of the contour's
/// extremal points.
pub fn candidates(skin: &[u8], width: usize, palm: f64) -> (Vec<SkinCandidate>, RegionLabels) {
    let smallest = (SMALLEST * PI * palm.powi(2)).max(FEWEST_PIXELS);
    let largest = MOST_FACES * PI * (FACE / PALM * palm).powi(2);
    // Regions are labeled in blocks of two by two pixels, so the crop starts at an even row and column.
    let [rows, columns] = bounds(skin, width).map(|span| span.start / 2 * 2..span.end);
    let part = cut(skin, width, &rows, &columns);
    let (regions, values) = regions(&part, columns.len());
    let labels = RegionLabels { first: [rows.start, columns.start], size: [rows.len(), columns.len()], values };
    let mut found = Vec::new();
    for (region, number) in regions.iter().zip(1..) {
        let area = region.area as f64;
        if !(smallest <= area && area <= largest) {
            continue;
        }
        let [sum_u, sum_v] = region.sums.map(|sum| sum as f64);
        let pixel = [columns.start as f64 + sum_u / area, rows.start as f64 + sum_v / area];
        let middle = SkinCandidate { pixel, region: number, area: region.area, hand: true };
        let sides = [region.rows, region.columns].map(|(low, high)| (high - low) as f64);
        let cutout = (sides[1].hypot(sides[0]) > LONGEST_HAND * palm).then(|| cut_out(region, number, &labels));
        match cutout.filter(|cutout| cutout.length() > LONGEST_HAND * palm) {
            None => found.push(middle),
            Some(cutout) => {
                found.push(SkinCandidate { hand: false, ..middle });
                let corner = [columns.start + region.columns.0, rows.start + region.rows.0].map(|place| place as f64);
                let at = |tip: [f64; 2]| SkinCandidate { pixel: [tip[0] + corner[0], tip[1] + corner[1]], ..middle };
                found.extend(cutout.tips(palm).into_iter().map(at));
            }
        }
    }
    (found, labels)
}

fn cut_out(region: &MaskRegion, number: i32, labels: &RegionLabels) -> Cutout {
    let (((top, bottom), (left, right)), width) = ((region.rows, region.columns), labels.size[1]);
    let rows = (top..bottom).flat_map(|row| &labels.values[row * width + left..row * width + right]);
    let mask = rows.map(|label| u8::from(*label == number)).collect();
    let mean = |sum: usize, first: usize| (sum - first * region.area) as f64 / region.area as f64;
    Cutout { width: right - left, mask, middle: [mean(region.sums[0], left), mean(region.sums[1], top)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_and_doors_are_none_and_an_arm_offers_its_ends() {
        let (width, palm) = (160, 5.4);
        let mut mask = vec![0_u8; width * 120];
        let mut fill = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
            rows.for_each(|row| mask[row * width..][columns.clone()].fill(1));
        };
        fill(2..4, 2..4);
        fill(10..22, 10..22);
        fill(0..120, 100..160);
        fill(40..50, 20..80);
        let (found, labels) = candidates(&mask, width, palm);
        assert_eq!(
            found.iter().map(|item| (item.area, item.hand)).collect::<Vec<_>>(),
            [(144, true), (600, false), (600, true), (600, true)]
        );
        assert_eq!(found[0].pixel, [15.5, 15.5]);
        assert!((found[2].pixel[0] - found[3].pixel[0]).abs() > 35.0);
        let [row, column] = [45 - labels.first[0], 50 - labels.first[1]];
        assert_eq!(labels.values[row * labels.size[1] + column], found[1].region);
    }

    #[test]
    fn a_region_is_a_hand_by_its_length_however_it_lies() {
        let (width, palm) = (320, 10.0);
        for angle in [0.0_f64, 45.0, 90.0].map(f64::to_radians) {
            for (length, hand) in [(3.6, true), (5.4, false)] {
                let along = |index: usize| {
                    let (u, v) = ((index % width) as f64 - 160.0, (index / width) as f64 - 120.0);
                    let (sine, cosine) = angle.sin_cos();
                    u8::from((u * cosine + v * sine).abs() <= 5.0 * length && (v * cosine - u * sine).abs() <= 8.0)
                };
                let mask: Vec<u8> = (0..width * 240).map(along).collect();
                let (found, _) = candidates(&mask, width, palm);
                assert_eq!((found[0].hand, found.len() > 1), (hand, !hand), "{angle} {length}");
            }
        }
    }
}
