//! How often colours are seen: 16 x 16 x 16 bins of colours, or 256 of grey, smoothed.

use crate::observation::picture::ColorPixels;

/// Bits of each channel that tell its bin.
const BITS: u32 = 4;
/// Bins of each channel.
const SIDE: usize = 1 << BITS;
/// Share of a count that its neighbour gets on either side: a Gaussian of 0.7 bins.
const SPREAD: f32 = 0.21;
/// Grey has finer bins: it is smoothed so many times.
const GREY_PASSES: usize = 40;
/// Share of colours that may be any.
const UNIFORM: f32 = 0.05;

/// What the pixels of a picture are: it tells the bins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    #[default]
    Color,
    Grey,
}

impl Kind {
    pub(super) fn of(pixels: &ColorPixels) -> Self {
        match pixels {
            ColorPixels::Color(_) => Self::Color,
            ColorPixels::Grey(_) => Self::Grey,
        }
    }

    pub(super) fn bins(self) -> usize {
        match self {
            Self::Color => SIDE * SIDE * SIDE,
            Self::Grey => 256,
        }
    }
}

/// The bin of a pixel.
#[inline(always)]
pub(super) fn bin_of(pixels: &ColorPixels, index: usize) -> usize {
    match pixels {
        ColorPixels::Color(pixels) => {
            let [x, y, z] = pixels[index].map(|value| usize::from(value >> (8 - BITS)));
            (x * SIDE + y) * SIDE + z
        }
        ColorPixels::Grey(pixels) => usize::from(pixels[index]),
    }
}

/// Shares of colours, and their logarithms.
#[derive(Clone, Debug, Default)]
pub(super) struct Histogram {
    share: Vec<f32>,
    pub log: Vec<f32>,
    counts: Vec<f32>,
    counted: f32,
    /// Something was learnt.
    pub known: bool,
}

impl Histogram {
    pub(super) fn clear(&mut self, kind: Kind) {
        let bins = kind.bins();
        for values in [&mut self.share, &mut self.counts] {
            values.clear();
            values.resize(bins, 0.0);
        }
        self.log.clear();
        self.log.resize(bins, (1.0 / bins as f32).ln());
        (self.counted, self.known) = (0.0, false);
    }

    /// Counts a colour; it is learnt with the next [`Histogram::learn`].
    #[inline(always)]
    pub(super) fn count(&mut self, bin: usize) {
        self.counts[bin] += 1.0;
        self.counted += 1.0;
    }

    /// Learns what was counted, if it is as much as `least`; the first time all of it, then at `rate`. Counts anew.
    pub(super) fn learn(&mut self, kind: Kind, rate: f32, least: f32, room: &mut Vec<f32>) {
        if self.counted >= least {
            match kind {
                Kind::Color => smooth_color(&mut self.counts, room),
                Kind::Grey => (0..GREY_PASSES).for_each(|_| smooth(&mut self.counts, room, 1, 256)),
            }
            let rate = if self.known { rate } else { 1.0 };
            let (keep, new) = (1.0 - rate, rate / self.counted);
            let uniform = UNIFORM / self.share.len() as f32;
            for ((share, log), count) in self.share.iter_mut().zip(&mut self.log).zip(&self.counts) {
                *share = keep * *share + new * count;
                *log = ((1.0 - UNIFORM) * *share + uniform).ln();
            }
            self.known = true;
        }
        if self.counted > 0.0 {
            self.counts.fill(0.0);
            self.counted = 0.0;
        }
    }
}

fn smooth_color(values: &mut [f32], room: &mut Vec<f32>) {
    for stride in [1, SIDE, SIDE * SIDE] {
        smooth(values, room, stride, SIDE);
    }
}

/// Spreads values to their neighbours at a stride, in rows of so many; those at the ends keep what would leave.
fn smooth(values: &mut [f32], room: &mut Vec<f32>, stride: usize, row: usize) {
    room.clear();
    room.extend_from_slice(values);
    for (values, before) in values.chunks_exact_mut(stride * row).zip(room.chunks_exact(stride * row)) {
        let mut spread = |from: usize, to: usize| {
            for index in 0..stride {
                let flow = SPREAD * (before[from * stride + index] - before[to * stride + index]);
                values[to * stride + index] += flow;
                values[from * stride + index] -= flow;
            }
        };
        (1..row).for_each(|place| spread(place - 1, place));
    }
}
