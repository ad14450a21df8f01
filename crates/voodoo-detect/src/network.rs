//! The network that evaluates a candidate.
//!
//! The structure is that of A2J (Xiong et al., "A2J: Anchor-to-Joint Regression Network", ICCV 2019) on a small residual network:
//! every cell of a 12 x 12 grid predicts, for every joint, its own weight and the joint's offset from the cell.

use crate::convolution::{Convolution, Map, rectify};
use crate::crop::{SIZE, WIDTH};
use crate::product::Panels;
use crate::weights::Weights;
use crate::winograd::Working;
use voodoo_core::Unexpected;
use voodoo_core::math::refill;

/// Values per cell and joint: weight, offset to the right, offset down, depth.
const A_JOINT: usize = 4;

/// A residual block: two convolutions and an identity connection.
#[derive(Debug)]
struct Residual {
    first: Convolution,
    second: Convolution,
}

impl Residual {
    fn take(weights: &mut Weights, name: &str, edge: usize, channels: usize) -> Result<Self, Unexpected> {
        let first = Convolution::take(weights, &format!("{name}.a"), [1, edge], channels, None)?;
        let second = Convolution::take(weights, &format!("{name}.b"), [1, edge], first.outputs, Some(channels))?;
        Ok(Self { first, second })
    }

    fn apply(&self, map: &mut Map, memory: &mut [Map; 2], working: &mut Working) {
        let [between, out] = memory;
        self.first.apply(map, between, working, true);
        self.second.apply(between, out, working, false);
        map.values.iter_mut().zip(&out.values).for_each(|(value, more)| *value = (*value + more).max(0.0));
    }
}

/// A convolution that reduces the map, followed by residual blocks.
#[derive(Debug)]
struct Stage {
    reduce: Convolution,
    blocks: Vec<Residual>,
}

impl Stage {
    /// Takes a stage whose input maps have this `edge`.
    fn take(weights: &mut Weights, name: &str, [stride, edge]: [usize; 2], inputs: usize) -> Result<Self, Unexpected> {
        let reduce = Convolution::take(weights, &format!("{name}.conv"), [stride, edge], inputs, None)?;
        let mut blocks = Vec::new();
        while weights.has(&format!("{name}.res{}.a.weight", blocks.len())) {
            let name = format!("{name}.res{}", blocks.len());
            blocks.push(Residual::take(weights, &name, edge / stride, reduce.outputs)?);
        }
        Ok(Self { reduce, blocks })
    }
}

/// Takes a linear layer: a matrix and a bias.
fn linear(weights: &mut Weights, name: &str, inputs: usize, outputs: Option<usize>) -> Result<Panels, Unexpected> {
    let layer = weights.layer(name, 2, inputs, outputs)?;
    Ok(Panels::from_weights(&layer.weights, &layer.bias))
}

/// What a linear layer makes of a row of values.
fn product(layer: &Panels, values: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; layer.outputs];
    layer.apply(values, &mut out);
    out
}

/// The network's output for an input image.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Positions of the joints: meters right of, below and behind the center of the input image.
    pub joints: Vec<[f32; 3]>,
    /// Natural logarithm of the scale of each position's error (Laplace distribution, meters).
    pub log_scale: Vec<f32>,
    /// Log odds that each joint is inside the image and not occluded.
    pub visible: Vec<f32>,
    /// Log odds that the trunk faces the camera.
    pub facing: f32,
    /// Log odds that it is a person.
    pub person: f32,
    /// Natural logarithms of the lengths, which are in meters.
    pub log_lengths: Vec<f32>,
    /// Natural logarithms of the scales of the errors of `log_lengths`.
    pub log_length_scale: Vec<f32>,
}

/// The trained layers.
#[derive(Debug)]
pub struct Network {
    stages: [Stage; 4],
    top: [Convolution; 2],
    middle: Residual,
    head: Convolution,
    hidden: Panels,
    /// Whether each joint is visible, facing, person, scale of each joint's error, lengths, and scales of their errors.
    overall: [Panels; 6],
}

/// Working memory of a network.
#[derive(Debug, Default)]
pub struct Memory {
    maps: [Map; 4],
    between: [Map; 2],
    top: Map,
    working: Working,
}

impl Network {
    /// Reads the bytes of a file of weights.
    pub fn read(bytes: &[u8]) -> Result<Self, Unexpected> {
        let weights = &mut Weights::read(bytes)?;
        let s2 = Stage::take(weights, "s2", [4, SIZE], 2)?;
        let s3 = Stage::take(weights, "s3", [2, SIZE / 4], s2.reduce.outputs)?;
        let s4 = Stage::take(weights, "s4", [2, SIZE / 8], s3.reduce.outputs)?;
        let s5 = Stage::take(weights, "s5", [2, SIZE / 16], s4.reduce.outputs)?;
        let stages = [s2, s3, s4, s5];
        let [_, third, fourth, fifth] = stages.each_ref().map(|stage| stage.reduce.outputs);
        let top = [
            Convolution::take(weights, "top5", [1, SIZE / 32], fifth, Some(fourth))?,
            Convolution::take(weights, "top4", [1, SIZE / 16], fourth, Some(third))?,
        ];
        let middle = Residual::take(weights, "mid", SIZE / 8, third)?;
        let head = Convolution::take(weights, "head", [1, SIZE / 8], third, None)?;
        let hidden = linear(weights, "hidden", fifth, None)?;
        let mut overall = |name: &str, outputs: Option<usize>| linear(weights, name, hidden.outputs, outputs);
        let joints = Some(head.outputs / A_JOINT);
        let (visible, facing, person) =
            (overall("visible", joints)?, overall("facing", Some(1))?, overall("person", Some(1))?);
        let length = overall("length", None)?;
        let length_scale = overall("length_scale", Some(length.outputs))?;
        let overall = [visible, facing, person, overall("scale", joints)?, length, length_scale];
        Ok(Self { stages, top, middle, head, hidden, overall })
    }

    /// Number of joints that it reports.
    pub fn joints(&self) -> usize {
        self.head.outputs / A_JOINT
    }

    /// Evaluates an input image of `SIZE * SIZE` pixels.
    pub fn evaluate(&self, picture: &[[f32; 2]], memory: &mut Memory) -> Answer {
        let Memory { maps, between, top, working } = memory;
        top.edge = SIZE;
        top.channels = 2;
        refill(&mut top.values, picture.as_flattened().iter().copied());
        for (number, stage) in self.stages.iter().enumerate() {
            let (before, rest) = maps.split_at_mut(number);
            stage.reduce.apply(before.last().unwrap_or(top), &mut rest[0], working, true);
            for block in &stage.blocks {
                block.apply(&mut rest[0], between, working);
            }
        }
        let mut values = product(&self.hidden, &mean(&maps[3]));
        rectify(&mut values);
        let [visible, facing, person, log_scale, log_lengths, log_length_scale] =
            self.overall.each_ref().map(|layer| product(layer, &values));
        top.clone_from(&maps[3]);
        for (layer, skip) in self.top.iter().zip([&maps[2], &maps[1]]) {
            layer.apply(top, &mut between[0], working, true);
            enlarge(&between[0], skip, top);
        }
        self.middle.apply(top, between, working);
        self.head.apply(top, &mut between[0], working, false);
        let joints = (0..self.joints()).map(|joint| place(&between[0], joint)).collect();
        let (facing, person) = (facing[0], person[0]);
        Answer { joints, log_scale, visible, facing, person, log_lengths, log_length_scale }
    }
}

fn mean(map: &Map) -> Vec<f32> {
    let mut sum = vec![0.0; map.channels];
    for pixel in map.values.chunks_exact(map.channels) {
        sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += value);
    }
    let count = (map.edge * map.edge) as f32;
    sum.iter_mut().for_each(|sum| *sum /= count);
    sum
}

/// Doubles the edge of a map by repeating every pixel, and adds another map.
fn enlarge(map: &Map, skip: &Map, out: &mut Map) {
    out.clone_from(skip);
    for (pixel, values) in out.values.chunks_exact_mut(skip.channels).enumerate() {
        let (row, column) = (pixel / skip.edge / 2, pixel % skip.edge / 2);
        let from = (row * map.edge + column) * map.channels;
        values.iter_mut().zip(&map.values[from..from + map.channels]).for_each(|(value, more)| *value += more);
    }
}

/// Position of a joint, the weighted mean over all cells, meters from the image's center.
fn place(map: &Map, joint: usize) -> [f32; 3] {
    let cell = (WIDTH / map.edge as f64) as f32;
    let half = 0.5 * (map.edge as f32 - 1.0);
    let cell_values = |pixel: usize| &map.values[pixel * map.channels + joint * A_JOINT..][..A_JOINT];
    let pixels = 0..map.edge * map.edge;
    let most = pixels.clone().map(|pixel| cell_values(pixel)[0]).fold(f32::NEG_INFINITY, f32::max);
    let (mut sum, mut place) = (0.0, [0.0; 3]);
    for pixel in pixels {
        let [counts, right, down, behind] = cell_values(pixel) else { continue };
        let weight = (counts - most).exp();
        let (row, column) = ((pixel / map.edge) as f32, (pixel % map.edge) as f32);
        sum += weight;
        place[0] += weight * ((column - half) * cell + right);
        place[1] += weight * ((row - half) * cell + down);
        place[2] += weight * behind;
    }
    place.map(|value| value / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_is_where_the_cells_that_count_put_it() {
        let edge = 12;
        let mut map = Map { edge, channels: 2 * A_JOINT, values: vec![0.0; edge * edge * 2 * A_JOINT] };
        // For the second joint a single cell has all the weight, in row 2 and column 9: half a cell from its center, 0.4 m
        // behind.
        let cell = WIDTH as f32 / edge as f32;
        let at = (2 * edge + 9) * map.channels + A_JOINT;
        map.values[at..at + A_JOINT].copy_from_slice(&[60.0, 0.5 * cell, -0.5 * cell, 0.4]);
        let [x, y, z] = place(&map, 1);
        assert!(
            (x - 4.0 * cell).abs() < 1e-5 && (y + 4.0 * cell).abs() < 1e-5 && (z - 0.4).abs() < 1e-5,
            "{x} {y} {z}"
        );
        // For the first joint all cells have equal weight, so its position is the center.
        assert!(place(&map, 0).iter().all(|value| value.abs() < 1e-5));
    }

    #[test]
    fn layers_that_do_not_fit_are_refused() {
        let good = include_bytes!("../person.weights");
        let network = Network::read(good);
        assert!(
            network.as_ref().is_ok_and(|network| network.joints() == crate::names::JOINTS.len()),
            "{:?}",
            network.err()
        );
        let end = good.windows(2).position(|pair| pair == b"\n\n").unwrap_or(0);
        let header = String::from_utf8_lossy(&good[..end]).into_owned();
        let line = header.lines().find(|line| line.starts_with("top4.weight")).unwrap_or_default();
        // The same number of values with a different shape.
        let [name, out, ky, kx, inputs] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let changed = header.replace(line, &format!("{name} {inputs} {ky} {kx} {out}"));
        assert!(Network::read(&[changed.as_bytes(), &good[end..]].concat()).is_err());
    }
}
