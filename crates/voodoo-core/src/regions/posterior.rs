//! Posterior of a limb's edge along a line, from the log ratios of limb and surroundings at its samples.

/// Log ratios of neighboring pixels are correlated: this many of them count as one.
const TEMPERATURE: f32 = 8.0;
/// Greatest distance of the search from the expected edge, samples.
pub(super) const MOST_REACH: usize = 10;

/// Estimates the edge within `reach` samples of the middle: returns the mean of its posterior, in units outward from the expected
/// edge, and its information: one over the variance of the posterior, minus the information of the search bounds alone.
///
/// `near` are the log ratios halfway between the integer positions from `-reach` to `reach`. If the opposite contour of the limb is
/// visible too, `far` are the log ratios there; otherwise the limb continues. Samples between the two ranges belong to the limb for
/// any displacement. A sample represents `every` units.
pub(super) fn edge(near: &[f32], far: Option<&[f32]>, reach: usize, every: f32) -> [f32; 2] {
    let count = 2 * reach + 1;
    let mut sums = [0.0_f32; 2 * MOST_REACH + 1];
    let sums = &mut sums[..count];
    // The limb ends at displacement d: the samples inward of it, up to the opposite contour, belong to the limb.
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
        return [0.0; 2];
    }
    // The search bounds pull the mean to the middle; without their effect it lies farther out.
    let most = reach as f32;
    [every * (mean / (variance * information)).clamp(-most, most), information / (every * every)]
}
