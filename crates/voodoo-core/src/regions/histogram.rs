//! Color models of limbs and their surroundings in the images of one camera: smoothed color histograms, of 16 x 16 x 16 bins for
//! color images, 256 for grayscale.

use crate::math::{refill, reset, vectorized};
use crate::observation::picture::ColorPixels;

/// Leading bits of each channel that select its bin.
const BITS: u32 = 4;
/// Bins per channel.
pub(super) const SIDE: usize = 1 << BITS;
/// Fraction of a count that spreads to the neighbor on either side: a Gaussian of 0.7 bins.
const SPREAD: f32 = 0.21;
/// Number of smoothing passes for grayscale, which has finer bins.
const GRAY_PASSES: usize = 40;
/// Weight of a uniform distribution mixed into the histogram.
const UNIFORM: f32 = 0.05;

/// Weight of the new colors of two frames in the model of a limb, and in that of its surroundings: clothes stay the same.
const RATES: [f32; 2] = [0.19, 0.36];

/// Bound of the absolute log ratio: a color that was never observed before is weak evidence.
pub(super) const MOST_RATIO: f32 = 2.0;

/// Number of bins for grayscale and for color images.
fn bins(gray: bool) -> usize {
    if gray { 256 } else { SIDE * SIDE * SIDE }
}

/// The bin of a pixel.
#[inline(always)]
pub(super) fn bin_of(pixels: &ColorPixels, index: usize) -> usize {
    match pixels {
        ColorPixels::Color(pixels) => {
            let [x, y, z] = pixels[index].map(|value| usize::from(value >> (8 - BITS)));
            (x * SIDE + y) * SIDE + z
        }
        ColorPixels::Gray(pixels) => usize::from(pixels[index]),
    }
}

/// Clamps a log ratio to the bound.
#[inline(always)]
pub(super) fn clamped(ratio: f32) -> f32 {
    ratio.clamp(-MOST_RATIO, MOST_RATIO)
}

/// Relative frequencies of colors, and their logarithms.
#[derive(Clone, Debug, Default)]
pub(super) struct ColorHistogram {
    frequency: Vec<f32>,
    pub log: Vec<f32>,
    counts: Vec<f32>,
    counted: f32,
    /// Whether any color was learned.
    pub known: bool,
}

impl ColorHistogram {
    pub(super) fn clear(&mut self, gray: bool) {
        let bins = bins(gray);
        for values in [&mut self.frequency, &mut self.counts] {
            reset(values, bins, 0.0);
        }
        reset(&mut self.log, bins, (1.0 / bins as f32).ln());
        (self.counted, self.known) = (0.0, false);
    }

    /// Counts a color for the next [`ColorHistogram::learn`].
    #[inline(always)]
    pub(super) fn count(&mut self, bin: usize) {
        self.counts[bin] += 1.0;
        self.counted += 1.0;
    }

    /// Updates the histogram with the counts, if there are any: the first time it takes them over, later it mixes them in at
    /// `rate`. Resets the counts.
    pub(super) fn learn(&mut self, gray: bool, rate: f32, room: &mut Vec<f32>) {
        if self.counted == 0.0 {
            return;
        }
        if gray {
            (0..GRAY_PASSES).for_each(|_| smooth(&mut self.counts, room, 1, bins(gray)));
        } else {
            smooth_color(&mut self.counts, room);
        }
        let rate = if self.known { rate } else { 1.0 };
        let (keep, new) = (1.0 - rate, rate / self.counted);
        let uniform = UNIFORM / self.frequency.len() as f32;
        let Self { frequency, log, counts, .. } = self;
        vectorized!({
            for ((frequency, log), count) in frequency.iter_mut().zip(log).zip(&*counts) {
                *frequency = keep * *frequency + new * count;
                *log = ln((1.0 - UNIFORM) * *frequency + uniform);
            }
        });
        self.known = true;
        self.counts.fill(0.0);
        self.counted = 0.0;
    }
}

/// Colors by group of limbs: the left and the right limb of a pair share one model.
#[derive(Clone, Debug, Default)]
pub(super) struct ColorModel {
    /// Whether the images are grayscale.
    pub gray: bool,
    pub limbs: Vec<ColorHistogram>,
    pub around: Vec<ColorHistogram>,
    room: Vec<f32>,
}

impl ColorModel {
    /// Clears all colors.
    pub(super) fn clear(&mut self, gray: bool, groups: usize) {
        self.gray = gray;
        for histograms in [&mut self.limbs, &mut self.around] {
            histograms.resize_with(groups, ColorHistogram::default);
            histograms.iter_mut().for_each(|histogram| histogram.clear(gray));
        }
    }

    /// Updates the models with the counted colors.
    pub(super) fn learn(&mut self) {
        let Self { gray, limbs, around, room } = self;
        for (histograms, rate) in [limbs, around].into_iter().zip(RATES) {
            histograms.iter_mut().for_each(|histogram| histogram.learn(*gray, rate, room));
        }
    }

    /// Whether the colors of a group and of its surroundings are known.
    pub(super) fn knows(&self, group: usize) -> bool {
        self.limbs[group].known && self.around[group].known
    }
}

fn smooth_color(values: &mut [f32], room: &mut Vec<f32>) {
    for stride in [1, SIDE, SIDE * SIDE] {
        smooth(values, room, stride, SIDE);
    }
}

/// Spreads values to their neighbors at a stride, within rows of the given length; values at the ends keep what would leave the
/// row.
fn smooth(values: &mut [f32], room: &mut Vec<f32>, stride: usize, row: usize) {
    refill(room, values.iter().copied());
    let length = stride * row;
    vectorized!({
        for (values, before) in values.chunks_exact_mut(length).zip(room.chunks_exact(length)) {
            // Flow between each value and the next one at the stride.
            for ((value, own), next) in values.iter_mut().zip(before).zip(&before[stride..]) {
                *value += SPREAD * (next - own);
            }
            for ((value, own), last) in values[stride..].iter_mut().zip(&before[stride..]).zip(before) {
                *value += SPREAD * (last - own);
            }
        }
    });
}

/// Natural logarithm of a positive normal number, to 2e-5; vectorizes.
#[inline(always)]
fn ln(value: f32) -> f32 {
    const HALF: u32 = 0x3f35_04f3;
    let bits = value.to_bits().wrapping_sub(HALF);
    let exponent = (bits as i32) >> 23;
    // The mantissa lies between the square roots of a half and of two: series of the inverse hyperbolic tangent.
    let rest = f32::from_bits((bits & 0x007f_ffff).wrapping_add(HALF));
    let s = (rest - 1.0) / (rest + 1.0);
    let square = s * s;
    exponent as f32 * std::f32::consts::LN_2 + 2.0 * s * (1.0 + square * (1.0 / 3.0 + square * 0.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_near_enough() {
        for step in 1..4000 {
            let value = (step as f32 / 4000.0).powi(4) + 1e-5;
            assert!((ln(value) - value.ln()).abs() < 2e-5, "{value}: {} and {}", ln(value), value.ln());
        }
    }

    #[test]
    fn smoothing_keeps_the_sum_and_spreads_to_neighbors_alone() {
        let mut values = vec![0.0; SIDE * SIDE * SIDE];
        let place = (3 * SIDE + 15) * SIDE;
        values[place] = 1.0;
        smooth_color(&mut values, &mut Vec::new());
        assert!((values.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        let (middle, beside) = (1.0 - 2.0 * SPREAD, 1.0 - SPREAD);
        assert!((values[place] - middle * beside * beside).abs() < 1e-6);
        assert!((values[place + 1] - middle * beside * SPREAD).abs() < 1e-6);
        assert_eq!((values[place - 1], values[place + SIDE]), (0.0, 0.0), "no neighbors");
    }
}
