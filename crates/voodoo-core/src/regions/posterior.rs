//! Where along a line the edge of a limb is, from the log ratios of limb and surroundings at its samples.

/// Log ratios of neighbouring pixels err alike: so many of them tell as much as one.
const TEMPERATURE: f32 = 8.0;
/// Greatest distance from the expected edge at which one is looked for, samples.
pub(super) const MOST_REACH: usize = 24;

/// An edge's place, in samples outward from where it is expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Edge {
    /// Mean.
    pub mean: f32,
    /// What the colours say of it: one over the variance, less what the bounds of the search alone would say.
    pub information: f32,
}

/// The edge within `reach` samples of the middle. `ratios` are those of samples half a step beside whole ones, from
/// `-(reach + width)` to `reach`: with a `width` above zero the limb ends there on its other side as well, else it goes on.
pub(super) fn edge(ratios: &[f32], reach: usize, width: usize) -> Edge {
    let count = 2 * reach + 1;
    let mut sums = [0.0_f32; 2 * MOST_REACH + 1];
    let sums = &mut sums[..count];
    // The limb ends at the displacement d: what lies inwards of it, as far as the limb goes, is the limb's.
    let mut sum: f32 = if width > 0 { ratios[..width].iter().sum() } else { 0.0 };
    sums[0] = sum;
    let mut most = sum;
    for index in 1..count {
        sum += ratios[width + index - 1] - if width > 0 { ratios[index - 1] } else { 0.0 };
        sums[index] = sum;
        most = most.max(sum);
    }
    let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
    for (index, sum) in sums.iter().enumerate() {
        let share = ((sum - most) / TEMPERATURE).exp();
        let place = index as f32 - reach as f32;
        total += share;
        first += share * place;
        second += share * place * place;
    }
    let mean = first / total;
    let variance = (second / total - mean * mean).max(0.25);
    let flat = (count * count - 1) as f32 / 12.0;
    let information = 1.0 / variance - 1.0 / flat;
    if information <= 0.0 {
        return Edge::default();
    }
    // The bounds of the search draw the mean to the middle; what is left without them lies farther out.
    let most = reach as f32;
    Edge { mean: (mean / (variance * information)).clamp(-most, most), information }
}
