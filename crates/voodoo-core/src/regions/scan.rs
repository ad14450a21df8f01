//! Samples images along lines: log ratios of limb and surroundings, and colors to learn.

use super::Learned;
use super::empty_scene::{EmptyScene, LEAST_SIGMA};
use super::histogram::{ColorModel, bin_of, clamped};
use super::labels::{LimbLabels, NOTHING};
use super::lines::{BESIDE, Line, NEARER_BY};
use super::posterior::{MOST_REACH, edge};
use crate::camera::Camera;
use crate::observation::picture::ColorImage;

/// On a limb wider than this, each edge is searched for alone, units.
const WIDEST: f32 = 48.0;
/// Distance from the contour within which local brightness is compared, units.
const LOCAL: f32 = 12.0;
/// Number of samples on each side that count as beside the contour.
const NEXT_TO: usize = 5;
/// Colors are learned from this distance inside and outside of the contour on, units.
const LEARN_FROM: f32 = 2.0;
/// Spacing of the samples for learning, units: neighboring pixels are similar.
const LEARN_EVERY: f32 = 2.0;
/// The surroundings are learned up to this distance outside, units.
const SURROUND: f32 = 30.0;

/// An edge search: `reach` samples on either side of the contour, `every` units apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeSearch {
    pub reach: usize,
    pub every: f32,
}

/// The data that a line is sampled in.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScanView<'a> {
    pub picture: &'a ColorImage<'a>,
    /// What is known of its camera.
    pub camera: &'a Learned,
    pub groups: &'a [u16],
}

/// Result of the search on a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineEdge {
    /// Position, units outward from the expected edge, and its information.
    pub mean: f32,
    pub information: f32,
    /// Mean log ratios inside and outside of the contour.
    pub beside: [f32; 2],
}

/// Finds the edge on a line; `None` where there is no evidence.
pub(super) fn edge_on(view: &ScanView, line: &Line, search: EdgeSearch, together: bool) -> Option<LineEdge> {
    let group = view.group(line.limb);
    // A neighbor outside of the contour may have the same colors as the limb.
    let alike = line.outside != NOTHING && view.group(line.outside) == group;
    if !line.clear || !view.camera.model.knows(group) || alike {
        return None;
    }
    let EdgeSearch { reach, every } = search;
    let width = if together && line.both && line.width < WIDEST { (line.width / every + 0.5) as usize } else { 0 };
    // The samples around this edge and those around the opposite one may overlap.
    let span = 2 * reach;
    let far = width.min(span);
    let start = 0.5 - reach as f32;
    let mut ratios = [0.0; 4 * MOST_REACH];
    let ratios = &mut ratios[..far + span];
    if far == width {
        view.fill(line, [start - far as f32, every], ratios);
    } else {
        view.fill(line, [start - width as f32, every], &mut ratios[..far]);
        view.fill(line, [start, every], &mut ratios[far..]);
    }
    let (inside, outside) = ratios.split_at(far + reach);
    let mean = |ratios: &[f32]| ratios.iter().sum::<f32>() / ratios.len() as f32;
    let next = NEXT_TO.min(reach);
    let beside = [mean(&inside[inside.len() - next..]), mean(&outside[..next])];
    let [mean, information] = edge(&ratios[far..], (width > 0).then(|| &ratios[..span]), reach, every);
    Some(LineEdge { mean, information, beside })
}

/// Returns the logarithm of the density of brightness beside the contour, up to a constant: of a Gaussian (R07) that is fitted to
/// these values. `None` if there are too few.
fn log_density(values: impl Iterator<Item = f32>) -> Option<impl Fn(f32) -> f32> {
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        (count, sum, squares) = (count + 1.0, sum + value, squares + value * value);
    }
    let mean = sum / count;
    let variance = (squares / count - mean * mean).max(LEAST_SIGMA * LEAST_SIGMA);
    (count >= 3.0).then_some(move |value: f32| -0.5 * ((value - mean).powi(2) / variance + variance.ln()))
}

/// Gray values alone hardly identify a whole limb: each ratio is averaged with the log ratio of the local brightness beside the
/// contour.
fn compare_locally(view: &ScanView, line: &Line, [start, every]: [f32; 2], ratios: &mut [f32]) {
    let (picture, unit) = (view.picture, view.camera.unit);
    let side = |from: f32, to: f32| {
        let steps = (to - from).max(0.0) as usize;
        let walk = Walk::new(picture, line, from * unit, unit).take(steps);
        log_density(walk.flatten().map(|(column, row)| brightness(picture, column, row)))
    };
    let (Some(inside), Some(outside)) = (side(-line.width.min(LOCAL), -1.0), side(1.0, LOCAL)) else { return };
    let walk = Walk::new(picture, line, start * every * unit, every * unit);
    for (ratio, pixel) in ratios.iter_mut().zip(walk) {
        if let Some((column, row)) = pixel.filter(|_| *ratio != 0.0) {
            let value = brightness(picture, column, row);
            let local = clamped(inside(value) - outside(value));
            *ratio = 0.5 * (*ratio + local);
        }
    }
}

fn brightness(picture: &ColorImage, column: usize, row: usize) -> f32 {
    f32::from(picture.pixels.get(row * picture.camera.width() + column)[0])
}

impl ScanView<'_> {
    fn group(&self, limb: u16) -> usize {
        usize::from(self.groups[usize::from(limb)])
    }

    /// Fills `ratios` with log ratios at samples outward, `every` units apart, the first at `start` samples.
    fn fill(&self, line: &Line, [start, every]: [f32; 2], ratios: &mut [f32]) {
        let group = self.group(line.limb);
        let mut r = start * every;
        let unit = self.camera.unit;
        let walk = Walk::new(self.picture, line, r * unit, every * unit);
        for (ratio, pixel) in ratios.iter_mut().zip(walk) {
            *ratio = 0.0;
            if let Some((column, row)) = pixel
                && let Some(other) = self.other(line, r, column, row)
            {
                let pixel = row * self.picture.camera.width() + column;
                *ratio = self.ratio(group, other, pixel, bin_of(&self.picture.pixels, pixel));
            }
            r += every;
        }
        if self.picture.pixels.is_gray() {
            compare_locally(self, line, [start, every], ratios);
        }
    }

    /// Log ratio of a pixel with the given bin, between a group's colors and those of what would be visible without the limb.
    #[inline(always)]
    pub(super) fn ratio(&self, group: usize, other: u16, pixel: usize, bin: usize) -> f32 {
        let Learned { model, scene, .. } = self.camera;
        let own = model.limbs[group].log[bin];
        if other == NOTHING {
            let around = model.around[group].log[bin];
            let log = |scene: &EmptyScene| scene.log(pixel, self.picture.pixels.get(pixel), around);
            return clamped(own - scene.as_ref().map_or(around, log));
        }
        let other = self.group(other);
        if other == group || !model.limbs[other].known {
            return 0.0;
        }
        clamped(own - model.limbs[other].log[bin])
    }

    /// What would be visible at `r` units outward without the limb; `None` where something occludes it.
    #[inline(always)]
    fn other(&self, line: &Line, r: f32, column: usize, row: usize) -> Option<u16> {
        if r.abs() < BESIDE {
            return Some(line.outside);
        }
        let (label, depth) = self.camera.labels.at(column, row);
        let beyond = -r - line.width;
        if r < 0.0 && beyond < 0.0 && label == line.limb {
            Some(line.outside)
        } else if beyond.abs() < BESIDE {
            Some(line.opposite)
        } else if label == line.limb {
            Some(line.outside)
        } else if label != NOTHING && depth < line.depth - NEARER_BY {
            None
        } else {
            Some(label)
        }
    }
}

/// Steps along a line, in fixed-point pixel coordinates: column and row of each, if it is inside the image.
struct Walk<'a> {
    camera: &'a Camera,
    place: [i64; 2],
    step: [i64; 2],
}

/// Fractional bits of the fixed-point coordinates.
const FRACTION_BITS: u32 = 32;

impl<'a> Walk<'a> {
    /// Starts `from` pixels outward, with `step` pixels per step.
    fn new(picture: &ColorImage<'a>, line: &Line, from: f32, step: f32) -> Self {
        let part = |value: f32| (f64::from(value) * (1_i64 << FRACTION_BITS) as f64) as i64;
        let place = [0, 1].map(|axis| part(line.place[axis] + from * line.normal[axis] + 0.5));
        Self { camera: picture.camera, place, step: line.normal.map(|n| part(step * n)) }
    }
}

impl Iterator for Walk<'_> {
    type Item = Option<(usize, usize)>;

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        // Negative coordinates become huge unsigned numbers, so the bounds check rejects them.
        let [column, row] = self.place.map(|place| (place >> FRACTION_BITS) as usize);
        self.place = [0, 1].map(|axis| self.place[axis] + self.step[axis]);
        Some((column < self.camera.width() && row < self.camera.height()).then_some((column, row)))
    }
}

impl ColorModel {
    /// Counts the colors along a line of a limb of this group: of the limb up to its middle, and of its surroundings.
    pub(super) fn count(&mut self, picture: &ColorImage, labels: &LimbLabels, group: usize, unit: f32, line: &Line) {
        let inner = (0.5 * line.width).min(SURROUND);
        for (histogram, visible, to, sign) in
            [(&mut self.limbs[group], line.limb, inner, -1.0), (&mut self.around[group], NOTHING, SURROUND, 1.0)]
        {
            let walk = Walk::new(picture, line, sign * LEARN_FROM * unit, sign * LEARN_EVERY * unit);
            let steps = ((to - LEARN_FROM) / LEARN_EVERY + 1.0).max(0.0) as usize;
            for (column, row) in
                walk.take(steps).flatten().filter(|(column, row)| labels.at(*column, *row).0 == visible)
            {
                histogram.count(bin_of(&picture.pixels, row * picture.camera.width() + column));
            }
        }
    }
}
