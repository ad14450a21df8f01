//! Feature maps, and their convolutions as matrix products.
//!
//! A map is stored row by row; the channels of a pixel are adjacent.

use crate::product::Panels;
use crate::weights::Weights;
use crate::winograd::{KERNEL, Winograd, Working};
use voodoo_core::Unexpected;
use voodoo_core::math::reset;

/// A square feature map.
#[derive(Clone, Debug, Default)]
pub(crate) struct Map {
    pub(crate) edge: usize,
    pub(crate) channels: usize,
    pub(crate) values: Vec<f32>,
}

/// A convolution; maps are padded with zeros.
#[derive(Debug)]
pub(crate) struct Convolution {
    products: Products,
    pub(crate) outputs: usize,
    kernel: usize,
    stride: usize,
    padding: usize,
}

/// How the convolution is computed.
#[derive(Debug)]
enum Products {
    /// As one matrix product over the kernel windows of all pixels.
    Whole(Panels),
    /// With fewer multiplications, in transformed tiles.
    Tiled(Winograd),
}

impl Convolution {
    /// Takes a convolution from a weight file; its input maps have this `edge`.
    pub(crate) fn take(
        weights: &mut Weights,
        name: &str,
        [stride, edge]: [usize; 2],
        inputs: usize,
        outputs: Option<usize>,
    ) -> Result<Self, Unexpected> {
        let layer = weights.layer(name, 4, inputs, outputs)?;
        Ok(Self::from_weights(&layer.weights, &layer.bias, layer.kernel, stride, edge))
    }

    /// From `weights` (out, ky, kx, in) and biases.
    fn from_weights(weights: &[f32], bias: &[f32], kernel: usize, stride: usize, edge: usize) -> Self {
        let products = if kernel == KERNEL && stride == 1 && edge.is_multiple_of(2) {
            Products::Tiled(Winograd::from_weights(weights, bias))
        } else {
            Products::Whole(Panels::from_weights(weights, bias))
        };
        Self { products, outputs: bias.len(), kernel, stride, padding: usize::from(kernel > 1) }
    }

    /// Writes the output map.
    pub(crate) fn apply(&self, map: &Map, out: &mut Map, working: &mut Working, relu: bool) {
        out.edge = (map.edge + 2 * self.padding - self.kernel) / self.stride + 1;
        out.channels = self.outputs;
        out.values.resize(out.edge * out.edge * out.channels, 0.0);
        match &self.products {
            Products::Whole(panels) if self.kernel == 1 => panels.apply(&map.values, &mut out.values),
            Products::Whole(panels) => {
                self.gather(map, out.edge, &mut working.inputs);
                panels.apply(&working.inputs, &mut out.values);
            }
            Products::Tiled(tiled) => tiled.apply(&map.values, map.edge, working, &mut out.values),
        }
        if relu {
            rectify(&mut out.values);
        }
    }

    /// Gathers the kernel window of every pixel, one after the other; zeros outside of the map.
    fn gather(&self, map: &Map, edge: usize, columns: &mut Vec<f32>) {
        let row_of = self.kernel * map.channels;
        reset(columns, edge * edge * self.kernel * row_of, 0.0);
        for (number, chunk) in columns.chunks_exact_mut(row_of).enumerate() {
            let (pixel, ky) = (number / self.kernel, number % self.kernel);
            let Some(row) = (pixel / edge * self.stride + ky).checked_sub(self.padding).filter(|row| *row < map.edge)
            else {
                continue;
            };
            let left = pixel % edge * self.stride;
            let skipped = self.padding.saturating_sub(left);
            let first = (left + skipped) - self.padding;
            let count = (self.kernel - skipped).min(map.edge - first);
            let from = (row * map.edge + first) * map.channels;
            let to = skipped * map.channels;
            let length = count * map.channels;
            chunk[to..to + length].copy_from_slice(&map.values[from..from + length]);
        }
    }
}

pub(crate) fn rectify(values: &mut [f32]) {
    values.iter_mut().for_each(|value| *value = value.max(0.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic numbers that look random.
    fn noise(count: usize, seed: f32) -> Vec<f32> {
        (0..count).map(|index| ((index as f32 + seed) * 12.9898).sin()).collect()
    }

    #[test]
    fn a_convolution_is_the_sum_over_its_kernel() {
        for (edge, channels, outputs, kernel, stride, padding) in
            [(8, 3, 5, 3, 2, 1), (12, 2, 4, 6, 4, 1), (5, 6, 2, 1, 1, 0), (3, 4, 7, 3, 1, 1), (6, 19, 3, 3, 1, 1)]
        {
            let map = Map { edge, channels, values: noise(edge * edge * channels, 0.3) };
            let weights = noise(outputs * kernel * kernel * channels, 7.1);
            let layer = Convolution::from_weights(&weights, &noise(outputs, 1.7), kernel, stride, edge);
            assert_eq!((layer.outputs, layer.padding), (outputs, padding));
            let (mut out, mut working) = (Map { values: vec![5.0; 3], ..Map::default() }, Working::default());
            layer.apply(&map, &mut out, &mut working, false);
            assert_eq!(out.edge, (edge + 2 * padding - kernel) / stride + 1);
            for row in 0..out.edge {
                for column in 0..out.edge {
                    for output in 0..outputs {
                        let mut sum = noise(outputs, 1.7)[output];
                        for (ky, kx) in (0..kernel).flat_map(|ky| (0..kernel).map(move |kx| (ky, kx))) {
                            let (y, x) = (row * stride + ky, column * stride + kx);
                            if y < padding || x < padding || y - padding >= edge || x - padding >= edge {
                                continue;
                            }
                            for channel in 0..channels {
                                let value = map.values[((y - padding) * edge + x - padding) * channels + channel];
                                sum += value * weights[((output * kernel + ky) * kernel + kx) * channels + channel];
                            }
                        }
                        let found = out.values[(row * out.edge + column) * outputs + output];
                        assert!((found - sum).abs() < 1e-4, "{found} for {sum}");
                    }
                }
            }
        }
    }
}
