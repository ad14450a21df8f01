//! The color model of one person's skin in the current light: a histogram that is learned with a forgetting factor.

use std::ops::Range;

use crate::chroma::{BINS, CHROMA_BINS, Counter, LUMA_BINS, is_among};
use crate::skin::discs::Disc;
use voodoo_core::math::widest;

/// Weight of the old histograms after each further image.
const FORGETTING: f32 = 0.86;
/// Number of images with a smaller weight, in which the general skin colors become those of this person.
const SETTLED_PICTURES: u32 = 5;
/// Weight of the old histograms in these first images.
const FORGETTING_AT_FIRST: f32 = 0.5;
/// Least likelihood ratio of skin to the rest for a color to count as skin.
const RATIO: f32 = 2.0;
/// Least likelihood ratio of a color to be learned: colors close to those of skin.
const NEAR_RATIO: f32 = 1.0;
/// Standard deviation of the smoothing along luma, bins.
const LUMA_SPREAD: f64 = 0.7;
/// Standard deviation of the smoothing along either axis of chroma, bins.
const CHROMA_SPREAD: f64 = 0.8;
/// Half width of the smoothing kernel, bins.
const SMOOTHED_BINS: usize = 2;
/// Two sites whose color histograms overlap by less than this fraction do not both show skin.
const IN_COMMON: f64 = 0.1;
/// Mean chroma (Cr, Cb) of human skin of any tone under white light, of 256.
const PRIOR_MIDDLE: [f32; 2] = [150.0, 110.0];
/// Standard deviation of that chroma.
const PRIOR_SPREAD: f32 = 8.0;
/// Least number of approximately skin-colored pixels for a site to show skin.
const FEWEST_IN_PLACE: usize = 8;
/// Least number of such pixels at all sites together.
const FEWEST: usize = 20;
/// Fraction of the background histogram that is spread evenly over all colors, so that a color never observed is not skin.
const UNSEEN: f32 = 0.05;
/// Number of bins with the same value of Cr.
const PLANE: usize = CHROMA_BINS * LUMA_BINS;

/// Classifies colors by the ratio of two histograms, of skin and of everything else.
#[derive(Clone, Debug)]
pub struct SkinColors {
    /// Histogram of skin, by Cr, Cb and luma.
    pub skin: Vec<f32>,
    /// Histogram of everything else.
    pub rest: Vec<f32>,
    /// Which bins count as skin.
    pub table: Box<[bool; BINS]>,
    /// Which bins are close enough to skin to be learned.
    near: Box<[bool; BINS]>,
    pictures: u32,
    counter: Counter,
    scratch: [Vec<f32>; 4],
}

/// The pixels of an image of `[height, width]` from which skin and background are learned.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lesson<'a> {
    /// Bin of each pixel's color, see [`crate::chroma::bins`].
    pub bins: &'a [u16],
    pub size: [usize; 2],
    /// Circles at the head and at each hand; only their approximately skin-colored pixels are learned.
    pub inside: &'a [Disc],
    /// 1 where neither head nor hand is.
    pub outside: &'a [u8],
    /// Pixels of the body, if known: half of the background histogram is learned from its clothes.
    pub body: Option<&'a [bool]>,
}

impl Default for SkinColors {
    /// Returns the prior: the colors of all skin tones against a uniform background.
    fn default() -> Self {
        let axis = |middle: f32| {
            let place = move |bin: usize| (bin as f32 + 0.5) * (256 / CHROMA_BINS) as f32;
            (0..CHROMA_BINS).map(move |bin| ((place(bin) - middle) / PRIOR_SPREAD).powi(2))
        };
        let (cr, cb) = (axis(PRIOR_MIDDLE[0]), axis(PRIOR_MIDDLE[1]));
        let chroma = cr.flat_map(|cr| cb.clone().map(move |cb| (-0.5 * (cr + cb)).exp()));
        let prior: Vec<f32> = chroma.flat_map(|value| [value; LUMA_BINS]).collect();
        let total = sum(&prior) as f32;
        let mut colors = Self {
            skin: prior.into_iter().map(|value| value / total).collect(),
            rest: vec![1.0 / BINS as f32; BINS],
            table: Box::new([false; BINS]),
            near: Box::new([false; BINS]),
            pictures: 0,
            counter: Counter::default(),
            scratch: [const { Vec::new() }; 4],
        };
        colors.judge();
        colors
    }
}

fn sum(values: &[f32]) -> f64 {
    // Several partial sums, so that additions do not wait for each other.
    let (blocks, rest) = values.as_chunks::<8>();
    let mut sums = [0.0_f64; 8];
    for block in blocks {
        sums.iter_mut().zip(block).for_each(|(sum, value)| *sum += f64::from(*value));
    }
    sums.iter().sum::<f64>() + rest.iter().map(|value| f64::from(*value)).sum::<f64>()
}

impl SkinColors {
    fn judge(&mut self) {
        let bins = self.skin.iter().zip(&self.rest).zip(self.table.iter_mut().zip(self.near.iter_mut()));
        for ((skin, rest), (table, near)) in bins {
            *table = *skin > RATIO * rest;
            *near = *skin > NEAR_RATIO * rest;
        }
    }

    /// Updates the histograms with an image; returns whether there was enough skin to learn from.
    ///
    /// A color is learned to the degree that two sites show it, so that a shirt behind one hand is not learned as skin.
    pub(super) fn learn(&mut self, lesson: &Lesson) -> bool {
        let mut smoothed_most = std::mem::take(&mut self.scratch);
        let enough = self.learn_with(lesson, &mut smoothed_most);
        self.scratch = smoothed_most;
        enough
    }

    fn learn_with(&mut self, lesson: &Lesson, [most, smoothed_most, frequencies, work]: &mut [Vec<f32>; 4]) -> bool {
        let masks: Vec<_> = lesson.inside.iter().map(|disc| self.skin_in(lesson, disc)).collect();
        let places: Vec<_> = masks.iter().filter(|found| found.len() >= FEWEST_IN_PLACE).collect();
        if places.len() < 2 || places.iter().map(|found| found.len()).sum::<usize>() < FEWEST {
            return false;
        }
        for values in [&mut *most, &mut *smoothed_most, &mut *frequencies] {
            values.clear();
            values.resize(BINS, 0.0);
        }
        let (mut first, mut end) = (BINS, 0);
        for found in places {
            // Counts this small are exact in single precision.
            found.iter().for_each(|bin| frequencies[usize::from(*bin)] += 1.0);
            let planes = smooth(frequencies, work);
            let count = found.len() as f32;
            (first, end) = (first.min(planes.start), end.max(planes.end));
            for ((most, smoothed_most), frequency) in
                most[planes.clone()].iter_mut().zip(&mut smoothed_most[planes.clone()]).zip(&mut frequencies[planes])
            {
                let smoothed = std::mem::take(frequency) / count;
                *smoothed_most = smoothed_most.max(most.min(smoothed));
                *most = most.max(smoothed);
            }
        }
        let total = sum(&smoothed_most[first..end]);
        if total < IN_COMMON {
            return false;
        }
        let keep = if self.pictures >= SETTLED_PICTURES { FORGETTING } else { FORGETTING_AT_FIRST };
        let total = total as f32;
        for (skin, smoothed_most) in self.skin.iter_mut().zip(&*smoothed_most) {
            *skin = keep * *skin + (1.0 - keep) * (smoothed_most / total);
        }
        self.count_rest(lesson, frequencies);
        smooth(frequencies, work);
        for (rest, frequency) in self.rest.iter_mut().zip(&*frequencies) {
            *rest = keep * *rest + (1.0 - keep) * ((1.0 - UNSEEN) * frequency + UNSEEN / BINS as f32);
        }
        self.pictures += 1;
        self.judge();
        true
    }

    /// Bins of the approximately skin-colored pixels in a circle.
    fn skin_in(&self, lesson: &Lesson, disc: &Disc) -> Vec<u16> {
        let [rows, columns] = disc.window(lesson.size);
        if rows.is_empty() || columns.is_empty() {
            return Vec::new();
        }
        let middle = [disc.middle[0] - columns.start as i64, disc.middle[1] - rows.start as i64];
        let mut mask = vec![0_u8; rows.len() * columns.len()];
        Disc { middle, ..*disc }.fill(&mut mask, [rows.len(), columns.len()], 1);
        let here = rows.flat_map(|row| &lesson.bins[row * lesson.size[1]..][columns.clone()]).copied();
        let inside = here.zip(mask).filter(|(bin, mask)| *mask != 0 && is_among(*bin, &self.near));
        inside.map(|(bin, _)| bin).collect()
    }

    /// Normalized histogram of the background; half of it from the clothes, where the body is known.
    fn count_rest(&mut self, lesson: &Lesson, frequencies: &mut [f32]) {
        let outside = lesson.outside.iter().map(|outside| *outside != 0);
        let pixels = lesson.bins.iter().copied().zip(outside);
        let mut all = lesson.outside.iter().map(|outside| u32::from(*outside)).sum::<u32>();
        let mut clothes = 0;
        match lesson.body {
            Some(body) => {
                clothes =
                    lesson.outside.iter().zip(body).map(|(outside, body)| u32::from(*outside & u8::from(*body))).sum();
                self.counter.count(pixels.zip(body).map(|((bin, outside), body)| (bin, outside, *body)));
            }
            None => self.counter.count(pixels.map(|(bin, outside)| (bin, outside, false))),
        }
        all = all.max(1);
        self.counter.take(|bin, [other, inside]| {
            let frequency = (other + inside) as f32 / all as f32;
            frequencies[bin] =
                if clothes > 0 { 0.5 * frequency + 0.5 * (inside as f32 / clothes as f32) } else { frequency };
        });
    }
}

/// Smooths a histogram in place, so that colors between observed ones count too. The boundaries are mirrored. All nonzero entries
/// lie in the returned range.
fn smooth(values: &mut [f32], work: &mut Vec<f32>) -> Range<usize> {
    work.clear();
    work.resize(values.len(), 0.0);
    let luma = luma_kernel();
    let [far, near, here] = kernel(CHROMA_SPREAD).map(|frequency| frequency as f32);
    let mirrored = |place: usize, shift: isize| {
        let place = place as isize + shift;
        let last = CHROMA_BINS as isize - 1;
        (if place < 0 {
            -1 - place
        } else if place > last {
            2 * last + 1 - place
        } else {
            place
        }) as usize
    };
    // Most colors never occur, so only occupied planes and their neighbors are processed.
    let holds: Vec<bool> = values.chunks_exact(PLANE).map(|plane| plane.iter().any(|value| *value != 0.0)).collect();
    let first = holds.iter().position(|holds| *holds).unwrap_or(CHROMA_BINS).saturating_sub(SMOOTHED_BINS);
    let end = holds.iter().rposition(|holds| *holds).map_or(first, |last| (last + 1 + SMOOTHED_BINS).min(CHROMA_BINS));
    let weighed = |[a, b, c, d, e]: [f32; 5]| far * (a + e) + near * (b + d) + here * c;
    widest(
        #[inline(always)]
        || {
            let planes = values.chunks_exact_mut(PLANE).zip(work.chunks_exact_mut(PLANE)).zip(&holds);
            for ((plane, work), _) in planes.filter(|(_, holds)| **holds) {
                for column in plane.as_chunks_mut::<LUMA_BINS>().0 {
                    let before = *column;
                    *column = [0.0; LUMA_BINS];
                    for (value, kernel) in before.iter().zip(&luma) {
                        column.iter_mut().zip(kernel).for_each(|(sum, frequency)| *sum += value * frequency);
                    }
                }
                let columns = plane.as_chunks::<LUMA_BINS>().0;
                for (index, work) in work.as_chunks_mut::<LUMA_BINS>().0.iter_mut().enumerate() {
                    let around = [-2, -1, 0, 1, 2].map(|shift| &columns[mirrored(index, shift)]);
                    for lane in 0..LUMA_BINS {
                        work[lane] = weighed(around.map(|column| column[lane]));
                    }
                }
            }
            for (index, plane) in values.chunks_exact_mut(PLANE).enumerate().take(end).skip(first) {
                let around = [-2, -1, 0, 1, 2].map(|shift| &work[mirrored(index, shift) * PLANE..][..PLANE]);
                for (lane, value) in plane.iter_mut().enumerate() {
                    *value = weighed(around.map(|other| other[lane]));
                }
            }
        },
    );
    first * PLANE..end * PLANE
}

/// Gaussian kernel weights at two bins, one bin and zero distance.
fn kernel(spread: f64) -> [f64; SMOOTHED_BINS + 1] {
    let bell = [2.0, 1.0, 0.0].map(|away: f64| (-0.5 * (away / spread).powi(2)).exp());
    bell.map(|value| value / (2.0 * (bell[0] + bell[1]) + bell[2]))
}

/// Target bins and weights for each bin of luma.
fn luma_kernel() -> [[f32; LUMA_BINS]; LUMA_BINS] {
    let [far, near, here] = kernel(LUMA_SPREAD);
    let mut to = [[0.0_f64; LUMA_BINS]; LUMA_BINS];
    for bin in 0..LUMA_BINS as isize {
        for (shift, frequency) in [(-2, far), (-1, near), (0, here), (1, near), (2, far)] {
            let (from, last) = (bin + shift, LUMA_BINS as isize - 1);
            let from = if from < 0 {
                -1 - from
            } else if from > last {
                2 * last + 1 - from
            } else {
                from
            };
            to[from as usize][bin as usize] += frequency;
        }
    }
    to.map(|row| row.map(|frequency| frequency as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chroma::bins;

    #[test]
    fn smoothing_keeps_the_sum_and_reaches_two_bins() {
        for place in [0, 5 * PLANE + 3 * LUMA_BINS + 1, BINS - 1] {
            let mut values = vec![0.0; BINS];
            values[place] = 1.0;
            smooth(&mut values, &mut Vec::new());
            assert!((sum(&values) - 1.0).abs() < 1e-6);
            let apart = |index: usize, each: usize, count: usize| (index / each % count).abs_diff(place / each % count);
            for (index, value) in values.iter().enumerate() {
                let far = apart(index, PLANE, 64).max(apart(index, LUMA_BINS, 64)).max(apart(index, 1, 8));
                assert!((*value > 0.0) == (far <= SMOOTHED_BINS), "{place}: {index}");
            }
        }
    }

    #[test]
    fn what_two_places_show_becomes_skin_and_what_one_shows_does_not() {
        let (skin, shirt, wall) = ([120, 150, 205], [120, 110, 200], [150, 140, 130]);
        let size = [60, 80];
        let discs = [[20, 20], [60, 20], [40, 45]].map(|middle| Disc { middle, radius: 6 });
        let mut mask = vec![0_u8; 60 * 80];
        discs.iter().zip(1..).for_each(|(disc, value)| disc.fill(&mut mask, size, value));
        let picture: Vec<[u8; 3]> = mask.iter().map(|value| [wall, skin, skin, shirt][usize::from(*value)]).collect();
        let (bins, outside): (_, Vec<u8>) = (bins(&picture), mask.iter().map(|value| u8::from(*value == 0)).collect());
        let lesson = Lesson { bins: &bins, size, inside: &discs, outside: &outside, body: None };
        let mut colors = SkinColors::default();
        for _ in 0..8 {
            assert!(colors.learn(&lesson));
        }
        let is = |value: u8| {
            let place = mask.iter().position(|other| *other == value).unwrap_or(0);
            colors.table[usize::from(bins[place])]
        };
        assert_eq!([0, 1, 3].map(is), [false, true, false]);
        assert!(!colors.learn(&Lesson { inside: &discs[1..], ..lesson }), "nothing in common");
        assert!(!colors.learn(&Lesson { inside: &discs[..1], ..lesson }), "one place is not enough");
    }
}
