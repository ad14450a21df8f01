//! What colours limbs and their surroundings have in one camera's pictures.

use super::histogram::{Histogram, Kind};

/// Share of a new frame in what is known of a limb's colours, and of those around it: a body keeps its clothes.
const RATES: [f32; 2] = [0.1, 0.2];
/// Fewer pixels than this teach nothing.
const LEAST_PIXELS: f32 = 30.0;

/// Colours by group of limbs: the two of a pair have the same.
#[derive(Clone, Debug, Default)]
pub(super) struct ColorModel {
    pub kind: Kind,
    pub limbs: Vec<Histogram>,
    pub around: Vec<Histogram>,
    room: Vec<f32>,
}

impl ColorModel {
    /// Forgets all colours.
    pub(super) fn clear(&mut self, kind: Kind, groups: usize) {
        self.kind = kind;
        for histograms in [&mut self.limbs, &mut self.around] {
            histograms.resize_with(groups, Histogram::default);
            histograms.iter_mut().for_each(|histogram| histogram.clear(kind));
        }
    }

    /// Learns what was counted.
    pub(super) fn learn(&mut self) {
        let Self { kind, limbs, around, room } = self;
        for (histograms, rate) in [limbs, around].into_iter().zip(RATES) {
            histograms.iter_mut().for_each(|histogram| histogram.learn(*kind, rate, LEAST_PIXELS, room));
        }
    }

    /// Whether a group's colours and those around it are known.
    pub(super) fn knows(&self, group: usize) -> bool {
        self.limbs[group].known && self.around[group].known
    }
}
