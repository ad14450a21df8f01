//! Matrix products with trained weights, which are reordered once to be read sequentially.

use voodoo_core::math::{FMA, multiply_add, store, widest_fused};

/// Number of columns, or channels, that are processed together.
pub(crate) const TOGETHER: usize = 16;
/// Number of rows that are processed together: their sums fit into the registers of AVX2. The network's maps have multiples of
/// nine pixels; the remaining rows are processed in groups of three.
const ROWS: usize = 6;
const FEW_ROWS: usize = 3;

/// Trained weights and biases in groups of `TOGETHER` columns; missing columns are zeros.
#[derive(Debug)]
pub(crate) struct Panels {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    weights: Vec<[f32; TOGETHER]>,
    bias: Vec<[f32; TOGETHER]>,
}

impl Panels {
    /// From the `weights` of all outputs, output by output, and their `bias`; there is at least one of each.
    pub(crate) fn from_weights(weights: &[f32], bias: &[f32]) -> Self {
        let outputs = bias.len();
        let inputs = weights.len() / outputs;
        let groups = outputs.div_ceil(TOGETHER);
        let mut sorted = vec![[0.0; TOGETHER]; groups * inputs];
        let mut sorted_bias = vec![[0.0; TOGETHER]; groups];
        for (output, bias) in bias.iter().enumerate() {
            let (group, lane) = (output / TOGETHER, output % TOGETHER);
            sorted_bias[group][lane] = *bias;
            let own = &weights[output * inputs..][..inputs];
            for (sorted, weight) in sorted[group * inputs..][..inputs].iter_mut().zip(own) {
                sorted[lane] = *weight;
            }
        }
        Self { inputs, outputs, weights: sorted, bias: sorted_bias }
    }

    /// Multiplies each row of `activations` (`inputs` values) with the weights and adds the biases; writes rows of `outputs`
    /// values to `out`.
    pub(crate) fn apply(&self, activations: &[f32], out: &mut [f32]) {
        widest_fused(
            out,
            #[inline(always)]
            |out| self.groups::<FMA>(activations, out),
            #[inline(always)]
            |out| self.groups::<true>(activations, out),
        );
    }

    #[inline(always)]
    fn groups<const FMA: bool>(&self, activations: &[f32], out: &mut [f32]) {
        for group in 0..self.bias.len() {
            let (activations, out) = self.rows::<FMA, ROWS>(group, activations, out);
            let (activations, out) = self.rows::<FMA, FEW_ROWS>(group, activations, out);
            self.rows::<FMA, 1>(group, activations, out);
        }
    }

    /// Processes full groups of this number of rows and returns the remaining rows.
    #[inline(always)]
    fn rows<'a, 'b, const FMA: bool, const COUNT: usize>(
        &self,
        group: usize,
        activations: &'a [f32],
        out: &'b mut [f32],
    ) -> (&'a [f32], &'b mut [f32]) {
        let column = group * TOGETHER;
        let width = TOGETHER.min(self.outputs - column);
        let panel = &self.weights[group * self.inputs..][..self.inputs];
        let whole = activations.len() / (COUNT * self.inputs);
        let (activations, activations_last) = activations.split_at(whole * COUNT * self.inputs);
        let (out, out_last) = out.split_at_mut(whole * COUNT * self.outputs);
        for (rows, here) in
            activations.chunks_exact(COUNT * self.inputs).zip(out.chunks_exact_mut(COUNT * self.outputs))
        {
            let sums = product::<FMA, COUNT>(rows, panel, &self.bias[group]);
            let here = here.chunks_exact_mut(self.outputs);
            here.zip(&sums).for_each(|(row, sums)| store(&mut row[column..][..width], sums));
        }
        (activations_last, out_last)
    }
}

/// Multiplies this number of rows with the columns of a group.
#[inline(always)]
fn product<const FMA: bool, const COUNT: usize>(
    rows: &[f32],
    panel: &[[f32; TOGETHER]],
    bias: &[f32; TOGETHER],
) -> [[f32; TOGETHER]; COUNT] {
    let inputs = panel.len();
    // Sliced separately, so that the compiler knows the length of each.
    let (mut own, mut rest): ([&[f32]; COUNT], _) = ([&[]; COUNT], rows);
    for row in &mut own {
        (*row, rest) = rest.split_at(inputs);
    }
    let mut sums = [*bias; COUNT];
    for (input, weights) in panel.iter().enumerate() {
        for (row, sums) in own.iter().zip(&mut sums) {
            let value = row[input];
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum = multiply_add::<FMA>(value, *weight, *sum);
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
        for (count, inputs, outputs) in [(1_usize, 5, 1), (9, 3, 32), (20, 7, 75)] {
            let weights: Vec<f32> = (0..inputs * outputs).map(number).collect();
            let bias: Vec<f32> = (0..outputs).map(|index| number(index + 100)).collect();
            let activations: Vec<f32> = (0..count * inputs).map(|index| number(index + 1000)).collect();
            let mut out = vec![f32::NAN; count * outputs];
            Panels::from_weights(&weights, &bias).apply(&activations, &mut out);
            for (index, found) in out.iter().enumerate() {
                let (row, output) = (index / outputs, index % outputs);
                let terms =
                    (0..inputs).map(|input| activations[row * inputs + input] * weights[output * inputs + input]);
                let sum = bias[output] + terms.sum::<f32>();
                assert!((found - sum).abs() < 1e-5, "{found} for {sum}");
            }
        }
    }
}
