//! Color models of limbs and their surroundings in the images of one camera.

use super::histogram::{ColorHistogram, Kind};

/// Weight of the new colors of two frames in the model of a limb, and in that of its surroundings: clothes stay the same.
const RATES: [f32; 2] = [0.19, 0.36];

/// Colors by group of limbs: the left and the right limb of a pair share one model.
#[derive(Clone, Debug, Default)]
pub(super) struct ColorModel {
    pub kind: Kind,
    pub limbs: Vec<ColorHistogram>,
    pub around: Vec<ColorHistogram>,
    room: Vec<f32>,
}

impl ColorModel {
    /// Clears all colors.
    pub(super) fn clear(&mut self, kind: Kind, groups: usize) {
        self.kind = kind;
        for histograms in [&mut self.limbs, &mut self.around] {
            histograms.resize_with(groups, ColorHistogram::default);
            histograms.iter_mut().for_each(|histogram| histogram.clear(kind));
        }
    }

    /// Updates the models with the counted colors.
    pub(super) fn learn(&mut self) {
        let Self { kind, limbs, around, room } = self;
        for (histograms, rate) in [limbs, around].into_iter().zip(RATES) {
            histograms.iter_mut().for_each(|histogram| histogram.learn(*kind, rate, room));
        }
    }

    /// Whether the colors of a group and of its surroundings are known.
    pub(super) fn knows(&self, group: usize) -> bool {
        self.limbs[group].known && self.around[group].known
    }
}
