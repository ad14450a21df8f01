//! Color models of limbs and their surroundings in the images of one camera.

use super::histogram::{ColorHistogram, Kind, clamped};
use crate::math::reset;

/// Weight of the new colors of two frames in the model of a limb, and in that of its surroundings: clothes stay the same.
const RATES: [f32; 2] = [0.19, 0.36];

/// Colors by group of limbs: the left and the right limb of a pair share one model.
#[derive(Clone, Debug, Default)]
pub(super) struct ColorModel {
    pub kind: Kind,
    pub limbs: Vec<ColorHistogram>,
    pub around: Vec<ColorHistogram>,
    /// Clamped log ratios between each group's colors and those of its surroundings.
    ratios: Vec<f32>,
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
        reset(&mut self.ratios, groups * kind.bins(), 0.0);
    }

    /// Updates the models with the counted colors.
    pub(super) fn learn(&mut self) {
        let Self { kind, limbs, around, ratios, room } = self;
        for (histograms, rate) in [&mut *limbs, &mut *around].into_iter().zip(RATES) {
            histograms.iter_mut().for_each(|histogram| histogram.learn(*kind, rate, room));
        }
        for (group, ratios) in ratios.chunks_exact_mut(kind.bins()).enumerate() {
            let logs = limbs[group].log.iter().zip(&around[group].log);
            ratios.iter_mut().zip(logs).for_each(|(ratio, (own, other))| *ratio = clamped(own - other));
        }
    }

    /// Log ratios between a group's colors and those of its surroundings.
    #[inline(always)]
    pub(super) fn ratios(&self, group: usize) -> &[f32] {
        let bins = self.kind.bins();
        &self.ratios[group * bins..(group + 1) * bins]
    }

    /// Whether the colors of a group and of its surroundings are known.
    pub(super) fn knows(&self, group: usize) -> bool {
        self.limbs[group].known && self.around[group].known
    }
}
