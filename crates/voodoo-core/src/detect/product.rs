//! Products of matrices with trained weights, which are sorted once for the order they are read in.
//!
//! No multiplication is fused with an addition: every processor gives the same bits.

use crate::math::widest;

/// Rows and columns that are worked on together: their sums fit the registers of AVX-512, and those of half of the columns the
/// registers of AVX2.
pub(super) const ROWS: usize = 12;
const TOGETHER: usize = 16;
const NARROW: usize = TOGETHER / 2;

/// Trained weights and biases, columns in groups of `TOGETHER`; missing columns are zeros.
#[derive(Debug)]
pub(super) struct Panels {
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    weights: Vec<[f32; TOGETHER]>,
    bias: Vec<[f32; TOGETHER]>,
}

impl Panels {
    /// Of `weights` for every output, one output after the other, and its `bias`.
    pub(super) fn of(weights: &[f32], bias: &[f32]) -> Self {
        let outputs = bias.len();
        let inputs = weights.len().checked_div(outputs).unwrap_or(0);
        let groups = outputs.div_ceil(TOGETHER);
        let mut sorted = vec![[0.0; TOGETHER]; groups * inputs];
        let mut sorted_bias = vec![[0.0; TOGETHER]; groups];
        for (output, bias) in bias.iter().enumerate() {
            let (group, lane) = (output / TOGETHER, output % TOGETHER);
            sorted_bias[group][lane] = *bias;
            for input in 0..inputs {
                sorted[group * inputs + input][lane] = weights[output * inputs + input];
            }
        }
        Self { inputs, outputs, weights: sorted, bias: sorted_bias }
    }

    /// For each of the first `count` rows of `seen` its products with the weights, and the biases. `seen` holds rows of `inputs`
    /// values, up to a whole number of `ROWS`.
    pub(super) fn apply(&self, seen: &[f32], count: usize, out: &mut Vec<f32>) {
        out.clear();
        out.resize(count * self.outputs, 0.0);
        if self.inputs == 0 {
            return;
        }
        let whole = wide_registers();
        widest(
            #[inline(always)]
            || {
                for group in 0..self.bias.len() {
                    if whole {
                        self.columns::<TOGETHER>(group, 0, seen, out);
                    } else {
                        self.columns::<NARROW>(group, 0, seen, out);
                        self.columns::<NARROW>(group, NARROW, seen, out);
                    }
                }
            },
        );
    }

    /// The products with `WIDTH` columns of a group, from its `first` on.
    #[inline(always)]
    fn columns<const WIDTH: usize>(&self, group: usize, first: usize, seen: &[f32], out: &mut [f32]) {
        let panel = &self.weights[group * self.inputs..][..self.inputs];
        let Some(bias) = self.bias[group][first..].first_chunk::<WIDTH>() else { return };
        let column = group * TOGETHER + first;
        let width = WIDTH.min(self.outputs.saturating_sub(column));
        for (tile, rows) in seen.chunks_exact(ROWS * self.inputs).enumerate() {
            let sums = product(rows, panel, first, bias);
            let here = out[tile * ROWS * self.outputs..].chunks_exact_mut(self.outputs);
            here.zip(&sums).for_each(|(row, sums)| row[column..][..width].copy_from_slice(&sums[..width]));
        }
    }
}

/// Whether a register holds a whole group of columns.
fn wide_registers() -> bool {
    #[cfg(target_arch = "x86_64")]
    return crate::math::has_avx512();
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// `ROWS` rows times some columns of a group, from `first` on.
#[inline(always)]
fn product<const WIDTH: usize>(
    rows: &[f32],
    panel: &[[f32; TOGETHER]],
    first: usize,
    bias: &[f32; WIDTH],
) -> [[f32; WIDTH]; ROWS] {
    let inputs = panel.len();
    let rows: [&[f32]; ROWS] = std::array::from_fn(|row| &rows[row * inputs..][..inputs]);
    let mut sums = [*bias; ROWS];
    for (input, weights) in panel.iter().enumerate() {
        let weights = &weights[first..][..WIDTH];
        for (row, sums) in rows.iter().zip(&mut sums) {
            let value = row[input];
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum += value * weight;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_sums_of_products() {
        let number = |index: usize| (index as f32 * 12.9898).sin();
        for (count, inputs, outputs) in [(1_usize, 5, 1), (6, 3, 16), (13, 7, 37)] {
            let weights: Vec<f32> = (0..inputs * outputs).map(number).collect();
            let bias: Vec<f32> = (0..outputs).map(|index| number(index + 100)).collect();
            let rows = count.div_ceil(ROWS) * ROWS;
            let seen: Vec<f32> = (0..rows * inputs).map(|index| number(index + 1000)).collect();
            let mut out = Vec::new();
            Panels::of(&weights, &bias).apply(&seen, count, &mut out);
            assert_eq!(out.len(), count * outputs);
            for (index, found) in out.iter().enumerate() {
                let (row, output) = (index / outputs, index % outputs);
                let terms = (0..inputs).map(|input| seen[row * inputs + input] * weights[output * inputs + input]);
                let sum = bias[output] + terms.sum::<f32>();
                assert!((found - sum).abs() < 1e-5, "{found} for {sum}");
            }
        }
    }
}
