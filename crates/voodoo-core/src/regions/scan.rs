//! Looks along lines: log ratios of limb and surroundings, and what colours there are.

use super::histogram::{Kind, bin_of};
use super::labels::{Labels, NOTHING};
use super::lines::{BESIDE, Line, NEARER_BY};
use super::models::ColorModel;
use super::posterior::{Edge, MOST_REACH, edge};
use super::scene::Scene;
use crate::observation::picture::ColorImage;

/// Log ratios are held to this: a colour never seen before proves little.
const MOST_RATIO: f32 = 2.0;
/// A limb wider than this is looked for by one edge alone, units.
const WIDEST: usize = 48;
/// How far from the contour brightness is compared, units.
const LOCAL: f32 = 12.0;
/// Least standard deviation of brightness beside the contour, of 255.
const LEAST_SPREAD: f32 = 6.0;
/// What is beside the contour is so many samples wide.
const NEXT_TO: usize = 5;
/// Colours are learnt from this far inside and outside of the contour, units.
const LEARN_FROM: f32 = 2.0;
/// As far outside of it the surroundings are learnt, units.
const SURROUND: f32 = 30.0;

/// What a line is looked along in.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a> {
    pub picture: &'a ColorImage<'a>,
    pub model: &'a ColorModel,
    pub labels: &'a Labels,
    pub scene: Option<&'a Scene>,
    pub groups: &'a [u16],
    pub unit: f32,
}

/// Working memory.
#[derive(Debug)]
pub(super) struct Scanner {
    ratios: [f32; 2 * MOST_REACH + WIDEST],
}

impl Default for Scanner {
    fn default() -> Self {
        Self { ratios: [0.0; 2 * MOST_REACH + WIDEST] }
    }
}

/// What is found on a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub edge: Edge,
    /// Mean log ratios inside and outside of the contour.
    pub beside: [f32; 2],
}

impl Scanner {
    /// The edge on a line; `None` where it cannot be told.
    pub(super) fn edge(&mut self, view: &View, line: &Line, reach: usize, together: bool) -> Option<Found> {
        let group = view.group(line.limb);
        if !line.clear || !view.model.knows(group) || view.outside_is(line, group) {
            return None;
        }
        let width = if together && line.both && line.width < WIDEST as f32 { (line.width + 0.5) as usize } else { 0 };
        let count = 2 * reach + width;
        let start = 0.5 - (reach + width) as f32;
        for (index, ratio) in self.ratios[..count].iter_mut().enumerate() {
            *ratio = view.ratio(line, group, start + index as f32);
        }
        if view.model.kind == Kind::Grey {
            self.compare_locally(view, line, start, count);
        }
        let (inside, outside) = self.ratios[..count].split_at(reach + width);
        let mean = |ratios: &[f32]| ratios.iter().sum::<f32>() / ratios.len() as f32;
        let near = NEXT_TO.min(reach);
        let beside = [mean(&inside[inside.len() - near..]), mean(&outside[..near])];
        Some(Found { edge: edge(&self.ratios[..count], reach, width), beside })
    }
}

/// Brightness beside the contour: a Gaussian (R07).
#[derive(Clone, Copy, Debug, Default)]
struct Local {
    count: f32,
    sum: f32,
    squares: f32,
}

impl Local {
    fn of(values: impl Iterator<Item = f32>) -> Self {
        values.fold(Self::default(), |all, value| Self {
            count: all.count + 1.0,
            sum: all.sum + value,
            squares: all.squares + value * value,
        })
    }

    /// Logarithm of the density at a value, up to a constant.
    fn log(&self, value: f32) -> f32 {
        let mean = self.sum / self.count;
        let variance = (self.squares / self.count - mean * mean).max(LEAST_SPREAD * LEAST_SPREAD);
        -0.5 * ((value - mean).powi(2) / variance + variance.ln())
    }
}

impl Scanner {
    /// Grey alone says little of a whole limb: the ratios become the mean of theirs and of those of what is beside the contour.
    fn compare_locally(&mut self, view: &View, line: &Line, start: f32, count: usize) {
        let value = |r: f32| {
            let (pixel, ..) = pixel_at(view.picture, line, r * view.unit)?;
            Some(f32::from(view.picture.pixels.get(pixel)[0]))
        };
        let side = |from: f32, to: f32| {
            let steps = (to - from).max(0.0) as usize;
            Local::of((0..steps).filter_map(|step| value(from + step as f32)))
        };
        let (inside, outside) = (side(-line.width.min(LOCAL), -1.0), side(1.0, LOCAL));
        if inside.count < 3.0 || outside.count < 3.0 {
            return;
        }
        for (index, ratio) in self.ratios[..count].iter_mut().enumerate().filter(|(_, ratio)| **ratio != 0.0) {
            let Some(value) = value(start + index as f32) else { continue };
            let local = (inside.log(value) - outside.log(value)).clamp(-MOST_RATIO, MOST_RATIO);
            *ratio = 0.5 * (*ratio + local);
        }
    }
}

impl View<'_> {
    fn group(&self, limb: u16) -> usize {
        usize::from(self.groups[usize::from(limb)])
    }

    /// Whether what borders the limb has its colours.
    fn outside_is(&self, line: &Line, group: usize) -> bool {
        line.outside != NOTHING && self.group(line.outside) == group
    }

    /// How much more likely the colour of a sample is the limb's than what would be there without it.
    fn ratio(&self, line: &Line, group: usize, r: f32) -> f32 {
        let Some((pixel, u, v)) = pixel_at(self.picture, line, r * self.unit) else { return 0.0 };
        let beyond = -r - line.width;
        let (label, depth) = self.labels.at(u, v);
        let other = if r.abs() < BESIDE || (r < 0.0 && beyond < 0.0 && label == line.limb) {
            line.outside
        } else if beyond.abs() < BESIDE {
            line.opposite
        } else if label == line.limb {
            line.outside
        } else if label != NOTHING && depth < line.depth - NEARER_BY {
            return 0.0;
        } else {
            label
        };
        let bin = bin_of(&self.picture.pixels, pixel);
        let own = self.model.limbs[group].log[bin];
        let other = if other == NOTHING {
            let around = self.model.around[group].log[bin];
            self.scene.map_or(around, |scene| scene.log(pixel, self.picture.pixels.get(pixel), around))
        } else {
            let other = self.group(other);
            if other == group || !self.model.limbs[other].known {
                return 0.0;
            }
            self.model.limbs[other].log[bin]
        };
        (own - other).clamp(-MOST_RATIO, MOST_RATIO)
    }
}

/// The pixel `r` pixels outward along a line, and its place.
#[inline(always)]
fn pixel_at(picture: &ColorImage, line: &Line, r: f32) -> Option<(usize, f32, f32)> {
    let (u, v) = (line.place[0] + r * line.normal[0] + 0.5, line.place[1] + r * line.normal[1] + 0.5);
    if !(u >= 0.0 && v >= 0.0) {
        return None;
    }
    let (column, row) = (u as usize, v as usize);
    (column < picture.width && row < picture.height).then(|| (row * picture.width + column, u - 0.5, v - 0.5))
}

/// Counts the colours along a line, of the limb as far as its middle and of what is around it.
pub(super) fn count(
    picture: &ColorImage,
    labels: &Labels,
    groups: &[u16],
    unit: f32,
    line: &Line,
    model: &mut ColorModel,
) {
    let group = usize::from(groups[usize::from(line.limb)]);
    let inner = (0.5 * line.width).min(SURROUND);
    let mut r = LEARN_FROM;
    while r <= inner {
        if let Some((pixel, u, v)) = pixel_at(picture, line, -r * unit)
            && labels.at(u, v).0 == line.limb
        {
            model.limbs[group].count(bin_of(&picture.pixels, pixel));
        }
        r += 1.0;
    }
    let mut r = LEARN_FROM;
    while r <= SURROUND {
        if let Some((pixel, u, v)) = pixel_at(picture, line, r * unit)
            && labels.at(u, v).0 == NOTHING
        {
            model.around[group].count(bin_of(&picture.pixels, pixel));
        }
        r += 1.0;
    }
}
