//! Convolutions with 3 x 3 kernels that need fewer multiplications: Winograd's minimal filtering F(2 x 2, 3 x 3), see Lavin and
//! Gray, "Fast Algorithms for Convolutional Neural Networks", CVPR 2016.
//!
//! A 4 x 4 tile of the input map gives 2 x 2 output pixels. Both are linear transforms of tiles in which the convolution is one
//! product for each of the 16 positions: 16 multiplications instead of 36.

use crate::product::{Panels, TOGETHER};
use voodoo_core::math::{load, store, widest};

/// Edge of the kernel.
pub(crate) const KERNEL: usize = 3;
/// Edge of an input tile.
const TILE: usize = 4;
/// Edge of an output tile.
const OUTPUT_TILE: usize = TILE + 1 - KERNEL;
/// Number of positions in a transformed tile.
const PLACES: usize = TILE * TILE;
/// The position that contributes to all output pixels of a tile with weight one: the bias is added there.
const EVERYWHERE: usize = TILE + 1;

/// A convolution with a kernel of 3 x 3 that keeps the map's even edge.
#[derive(Debug)]
pub(crate) struct Winograd {
    places: Vec<Panels>,
}

/// Working memory of convolutions: what matrix products read, and the tiles that they write, position by position.
#[derive(Debug, Default)]
pub(crate) struct Working {
    pub(crate) inputs: Vec<f32>,
    output_tiles: Vec<f32>,
}

impl Winograd {
    /// From `weights` (out, ky, kx, in) and biases.
    pub(crate) fn from_weights(weights: &[f32], bias: &[f32]) -> Self {
        let none = vec![0.0; bias.len()];
        let inputs = weights.len() / (bias.len() * KERNEL * KERNEL);
        let mut transformed = vec![Vec::new(); PLACES];
        for kernel in weights.chunks_exact(KERNEL * KERNEL * inputs) {
            for input in 0..inputs {
                let at = |ky: usize, kx: usize| kernel[(ky * KERNEL + kx) * inputs + input];
                let columns: [[f32; TILE]; KERNEL] =
                    std::array::from_fn(|kx| of_kernel([0, 1, 2].map(|ky| at(ky, kx))));
                for row in 0..TILE {
                    let places = of_kernel(columns.map(|column| column[row]));
                    (0..TILE).for_each(|column| transformed[row * TILE + column].push(places[column]));
                }
            }
        }
        let panels = |(place, weights): (usize, &Vec<f32>)| {
            Panels::from_weights(weights, if place == EVERYWHERE { bias } else { &none })
        };
        Self { places: transformed.iter().enumerate().map(panels).collect() }
    }

    /// Writes the output map, which has the same `edge`.
    pub(crate) fn apply(&self, map: &[f32], edge: usize, working: &mut Working, out: &mut [f32]) {
        let Panels { inputs, outputs, .. } = self.places[0];
        let count = (edge / OUTPUT_TILE) * (edge / OUTPUT_TILE);
        let Working { inputs: input_tiles, output_tiles } = working;
        input_tiles.resize(PLACES * count * inputs, 0.0);
        output_tiles.resize(PLACES * count * outputs, 0.0);
        widest(
            #[inline(always)]
            || transform_input(map, edge, inputs, input_tiles),
        );
        for (place, panels) in self.places.iter().enumerate() {
            panels.apply(
                &input_tiles[place * count * inputs..][..count * inputs],
                &mut output_tiles[place * count * outputs..][..count * outputs],
            );
        }
        widest(
            #[inline(always)]
            || transform_output(output_tiles, edge, outputs, out),
        );
    }
}

/// Transforms one line of a kernel.
fn of_kernel([a, b, c]: [f32; KERNEL]) -> [f32; TILE] {
    [a, 0.5 * (a + b + c), 0.5 * (a - b + c), c]
}

/// Transforms all tiles of a map, with zeros around the map.
#[inline(always)]
fn transform_input(map: &[f32], edge: usize, channels: usize, input_tiles: &mut [f32]) {
    let across = edge / OUTPUT_TILE;
    let count = across * across;
    let (mut tile, mut half, mut whole) =
        ([[[0.0; TOGETHER]; TILE]; TILE], [[[0.0; TOGETHER]; TILE]; TILE], [[[0.0; TOGETHER]; TILE]; TILE]);
    for number in 0..count {
        let (top, left) = (OUTPUT_TILE * (number / across), OUTPUT_TILE * (number % across));
        for first in (0..channels).step_by(TOGETHER) {
            let here = TOGETHER.min(channels - first);
            for (row, line) in tile.iter_mut().enumerate() {
                for (column, values) in line.iter_mut().enumerate() {
                    // A tile starts one pixel before its output.
                    let [y, x] = [top + row, left + column];
                    if y == 0 || x == 0 || y > edge || x > edge {
                        *values = [0.0; TOGETHER];
                    } else {
                        load(values, &map[((y - 1) * edge + x - 1) * channels + first..][..here]);
                    }
                }
            }
            for column in 0..TILE {
                for lane in 0..TOGETHER {
                    let [a, b, c, d] = [0, 1, 2, 3].map(|row: usize| tile[row][column][lane]);
                    half[0][column][lane] = a - c;
                    half[1][column][lane] = b + c;
                    half[2][column][lane] = c - b;
                    half[3][column][lane] = b - d;
                }
            }
            for (half, whole) in half.iter().zip(&mut whole) {
                for lane in 0..TOGETHER {
                    let [a, b, c, d] = [0, 1, 2, 3].map(|column: usize| half[column][lane]);
                    whole[0][lane] = a - c;
                    whole[1][lane] = b + c;
                    whole[2][lane] = c - b;
                    whole[3][lane] = b - d;
                }
            }
            for (place, values) in whole.as_flattened().iter().enumerate() {
                store(&mut input_tiles[(place * count + number) * channels + first..][..here], values);
            }
        }
    }
}

/// Assembles the output map from its tiles.
#[inline(always)]
fn transform_output(output_tiles: &[f32], edge: usize, channels: usize, out: &mut [f32]) {
    let across = edge / OUTPUT_TILE;
    let count = across * across;
    let (mut tile, mut half, mut whole) =
        ([[0.0; TOGETHER]; PLACES], [[[0.0; TOGETHER]; TILE]; OUTPUT_TILE], [[0.0; TOGETHER]; OUTPUT_TILE]);
    for number in 0..count {
        let (top, left) = (OUTPUT_TILE * (number / across), OUTPUT_TILE * (number % across));
        for first in (0..channels).step_by(TOGETHER) {
            let here = TOGETHER.min(channels - first);
            for (place, values) in tile.iter_mut().enumerate() {
                load(values, &output_tiles[(place * count + number) * channels + first..][..here]);
            }
            for column in 0..TILE {
                for lane in 0..TOGETHER {
                    let [a, b, c, d] = [0, 1, 2, 3].map(|row: usize| tile[row * TILE + column][lane]);
                    half[0][column][lane] = a + b + c;
                    half[1][column][lane] = b - c - d;
                }
            }
            for (row, half) in half.iter().enumerate() {
                for lane in 0..TOGETHER {
                    let [a, b, c, d] = [0, 1, 2, 3].map(|column: usize| half[column][lane]);
                    whole[0][lane] = a + b + c;
                    whole[1][lane] = b - c - d;
                }
                for (column, values) in whole.iter().enumerate() {
                    let pixel = (top + row) * edge + left + column;
                    store(&mut out[pixel * channels + first..][..here], values);
                }
            }
        }
    }
}
