//! Color evidence for and against a limb, accumulated over its lines.

use crate::association::correspondence::RegionSupport;

/// Least absolute mean log ratio beside the contour that counts as evidence.
const DECISIVE: f32 = 0.15;
/// The evidence for a limb is weak when a smaller fraction of its informative lines supports it.
const WEAK: f64 = 0.15;

/// Sums over the lines of a limb.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    lines: f64,
    decided: f64,
    /// Weights of the informative lines, of those that support the limb, and of those that contradict it.
    sums: [f64; 3],
}

impl Evidence {
    /// Adds a line at fraction `t` of the length; `beside` are the mean log ratios inside and outside of the contour, if the
    /// line is informative.
    pub(super) fn take(&mut self, t: f64, beside: Option<[f32; 2]>) {
        self.lines += 1.0;
        let Some([inside, outside]) = beside else { return };
        self.decided += 1.0;
        let own = inside > DECISIVE && outside < -DECISIVE;
        let against = inside < -DECISIVE;
        for (sum, counts) in self.sums.iter_mut().zip([true, own, against]) {
            *sum += if counts { t.max(0.1) } else { 0.0 };
        }
    }

    /// Whether the color evidence for the limb's pose is weak.
    pub(super) fn is_weak(&self) -> bool {
        self.decided > 0.0 && self.support().own < WEAK
    }

    pub(super) fn support(&self) -> RegionSupport {
        let [all, own, against] = self.sums;
        let fraction = |part: f64| if all > 0.0 { part / all } else { 0.0 };
        RegionSupport {
            own: fraction(own),
            against: fraction(against),
            visible: self.decided / self.lines.max(1.0),
            ..RegionSupport::default()
        }
    }
}
