//! Where along a line the edge of a limb is, from the log ratios of limb and surroundings at its samples.

/// Log ratios of neighboring pixels err alike: so many of them tell as much as one.
const TEMPERATURE: f32 = 8.0;
/// Greatest distance from the expected edge at which one is looked for, samples.
pub(super) const MOST_REACH: usize = 10;

/// An edge's place, in samples outward from where it is expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ColorEdge {
    /// Mean.
    pub mean: f32,
    /// What the colors say of it: one over the variance, less what the bounds of the search alone would say.
    pub information: f32,
}

/// The edge within `reach` samples of the middle. `near` are the log ratios of samples half a step beside whole ones, from
/// `-reach` to `reach`; where the limb is known to end on its other side as well, `far` are those from there, else the limb goes on.
/// What lies between the two is the limb's wherever its edge is. A sample stands for as many as one is looked at `every`.
pub(super) fn edge(near: &[f32], far: Option<&[f32]>, reach: usize, every: f32) -> ColorEdge {
    let count = 2 * reach + 1;
    let mut sums = [0.0_f32; 2 * MOST_REACH + 1];
    let sums = &mut sums[..count];
    // The limb ends at the displacement d: what lies inwards of it, as far as the limb goes, is the limb's.
    let (mut sum, mut most) = (0.0_f32, 0.0_f32);
    for index in 1..count {
        sum += near[index - 1] - far.map_or(0.0, |far| far[index - 1]);
        sums[index] = sum;
        most = most.max(sum);
    }
    let sharpness = every / TEMPERATURE;
    let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
    for (index, sum) in sums.iter().enumerate() {
        let weight = ((sum - most) * sharpness).exp();
        let place = index as f32 - reach as f32;
        total += weight;
        first += weight * place;
        second += weight * place * place;
    }
    let mean = first / total;
    let variance = (second / total - mean * mean).max(0.25);
    let flat = (count * count - 1) as f32 / 12.0;
    let information = 1.0 / variance - 1.0 / flat;
    if information <= 0.0 {
        return ColorEdge::default();
    }
    // The bounds of the search draw the mean to the middle; what is left without them lies farther out.
    let most = reach as f32;
    ColorEdge { mean: (mean / (variance * information)).clamp(-most, most), information }
}
