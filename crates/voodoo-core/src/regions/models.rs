//! What colors limbs and their surroundings have in one camera's pictures.

use super::histogram::{ColorHistogram, Kind, clamped};

/// Share of what two frames bring in what is known of a limb's colors, and of those around it: a body keeps its clothes.
const RATES: [f32; 2] = [0.19, 0.36];
/// Fewer pixels than this teach nothing.
const LEAST_PIXELS: f32 = 15.0;

/// Colors by group of limbs: the two of a pair have the same.
#[derive(Clone, Debug, Default)]
pub(super) struct ColorModel {
    pub kind: Kind,
    pub limbs: Vec<ColorHistogram>,
    pub around: Vec<ColorHistogram>,
    /// Log ratios of each group's colors and of those around it, as they count.
    ratios: Vec<f32>,
    room: Vec<f32>,
}

impl ColorModel {
    /// Forgets all colors.
    pub(super) fn clear(&mut self, kind: Kind, groups: usize) {
        self.kind = kind;
        for histograms in [&mut self.limbs, &mut self.around] {
            histograms.resize_with(groups, ColorHistogram::default);
            histograms.iter_mut().for_each(|histogram| histogram.clear(kind));
        }
        self.ratios.clear();
        self.ratios.resize(groups * kind.bins(), 0.0);
    }

    /// Learns what was counted.
    pub(super) fn learn(&mut self) {
        let Self { kind, limbs, around, ratios, room } = self;
        for (histograms, rate) in [&mut *limbs, &mut *around].into_iter().zip(RATES) {
            histograms.iter_mut().for_each(|histogram| histogram.learn(*kind, rate, LEAST_PIXELS, room));
        }
        for (group, ratios) in ratios.chunks_exact_mut(kind.bins()).enumerate() {
            let logs = limbs[group].log.iter().zip(&around[group].log);
            ratios.iter_mut().zip(logs).for_each(|(ratio, (own, other))| *ratio = clamped(own - other));
        }
    }

    /// Log ratios of a group's colors and of those around it.
    #[inline(always)]
    pub(super) fn ratios(&self, group: usize) -> &[f32] {
        let bins = self.kind.bins();
        &self.ratios[group * bins..(group + 1) * bins]
    }

    /// Whether a group's colors and those around it are known.
    pub(super) fn knows(&self, group: usize) -> bool {
        self.limbs[group].known && self.around[group].known
    }
}
