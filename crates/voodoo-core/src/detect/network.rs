//! The network that looks at a picture: convolutions as products of matrices.
//!
//! Maps lie channel by channel for every pixel, row by row. The structure is that of A2J (Xiong et al., "A2J: Anchor-to-Joint
//! Regression Network", ICCV 2019) on a small residual network: every cell of a 12 x 12 grid says of every joint how much it
//! counts and where the joint is from there.

use super::crop::{SIZE, WIDTH};
use super::product::{Panels, ROWS};
use super::weights::{Weights, WeightsError};

/// Numbers a cell gives for a joint: how much it counts, offset to the right, offset down, depth.
const A_JOINT: usize = 4;

/// A square map of features.
#[derive(Clone, Debug, Default)]
struct Map {
    edge: usize,
    channels: usize,
    values: Vec<f32>,
}

/// A convolution, with what happens to its edge.
#[derive(Debug)]
struct Convolution {
    panels: Panels,
    kernel: usize,
    stride: usize,
    padding: usize,
}

impl Convolution {
    fn take(weights: &mut Weights, name: &str, stride: usize) -> Result<Self, WeightsError> {
        let (panels, kernel) = weights.layer(name, 4)?;
        Ok(Self { panels, kernel, stride, padding: usize::from(kernel > 1) })
    }

    fn inputs(&self) -> usize {
        self.panels.inputs / (self.kernel * self.kernel)
    }

    fn outputs(&self) -> usize {
        self.panels.outputs
    }

    /// The map after it; `columns` is working memory.
    fn apply(&self, map: &Map, out: &mut Map, columns: &mut Vec<f32>, relu: bool) {
        out.edge = (map.edge + 2 * self.padding - self.kernel) / self.stride + 1;
        out.channels = self.outputs();
        self.gather(map, out.edge, columns);
        self.panels.apply(columns, out.edge * out.edge, &mut out.values);
        if relu {
            rectify(&mut out.values);
        }
    }

    /// What the kernel sees at every pixel, one after the other; zeros outside of the map.
    fn gather(&self, map: &Map, edge: usize, columns: &mut Vec<f32>) {
        let row_of = self.kernel * map.channels;
        columns.clear();
        let pixels = edge * edge;
        columns.resize(pixels.div_ceil(ROWS) * ROWS * self.kernel * row_of, 0.0);
        for (number, chunk) in columns.chunks_exact_mut(row_of).take(pixels * self.kernel).enumerate() {
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

fn rectify(values: &mut [f32]) {
    values.iter_mut().for_each(|value| *value = value.max(0.0));
}

/// Two convolutions beside the identity.
#[derive(Debug)]
struct Residual {
    first: Convolution,
    second: Convolution,
}

impl Residual {
    fn take(weights: &mut Weights, name: &str) -> Result<Self, WeightsError> {
        let first = Convolution::take(weights, &format!("{name}.a"), 1)?;
        Ok(Self { first, second: Convolution::take(weights, &format!("{name}.b"), 1)? })
    }

    fn apply(&self, map: &mut Map, memory: &mut [Map; 2], columns: &mut Vec<f32>) {
        let [between, out] = memory;
        self.first.apply(map, between, columns, true);
        self.second.apply(between, out, columns, false);
        map.values.iter_mut().zip(&out.values).for_each(|(value, more)| *value = (*value + more).max(0.0));
    }
}

/// A convolution that makes the map smaller, and residual blocks.
#[derive(Debug)]
struct Stage {
    reduce: Convolution,
    blocks: Vec<Residual>,
}

impl Stage {
    fn take(weights: &mut Weights, name: &str, stride: usize) -> Result<Self, WeightsError> {
        let reduce = Convolution::take(weights, &format!("{name}.conv"), stride)?;
        let mut blocks = Vec::new();
        while weights.has(&format!("{name}.res{}.a.weight", blocks.len())) {
            blocks.push(Residual::take(weights, &format!("{name}.res{}", blocks.len()))?);
        }
        Ok(Self { reduce, blocks })
    }
}

/// A matrix and a bias.
#[derive(Debug)]
struct Linear(Panels);

impl Linear {
    fn take(weights: &mut Weights, name: &str) -> Result<Self, WeightsError> {
        Ok(Self(weights.layer(name, 2)?.0))
    }

    fn apply(&self, values: &[f32]) -> Vec<f32> {
        let (mut row, mut out) = (values.to_vec(), Vec::new());
        row.resize(ROWS * values.len(), 0.0);
        self.0.apply(&row, 1, &mut out);
        out
    }
}

/// What the network says of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// Places of the joints: metres to the right, down and behind the picture's middle.
    pub joints: Vec<[f32; 3]>,
    /// Natural logarithm of the scale (metres) of their error (Laplace).
    pub log_scale: Vec<f32>,
    /// Log odds that they are in the image.
    pub visible: Vec<f32>,
    /// Log odds that the trunk faces the camera.
    pub facing: f32,
    /// Log odds that it is a person.
    pub person: f32,
    /// Natural logarithms of lengths, metres.
    pub log_lengths: Vec<f32>,
    /// Natural logarithms of the scale of their error.
    pub log_length_scale: Vec<f32>,
}

/// The trained layers.
#[derive(Debug)]
pub struct Network {
    stages: [Stage; 4],
    top: [Convolution; 2],
    middle: Residual,
    head: Convolution,
    hidden: Option<Linear>,
    visible: Linear,
    facing: Linear,
    person: Linear,
    sizes: Option<[Linear; 3]>,
}

/// Working memory of a network.
#[derive(Debug, Default)]
pub struct Memory {
    maps: [Map; 4],
    between: [Map; 2],
    top: Map,
    columns: Vec<f32>,
}

impl Network {
    /// Reads the bytes of a file of weights.
    pub fn read(bytes: &[u8]) -> Result<Self, WeightsError> {
        let mut weights = Weights::read(bytes)?;
        let weights = &mut weights;
        let stages = [
            Stage::take(weights, "s2", 4)?,
            Stage::take(weights, "s3", 2)?,
            Stage::take(weights, "s4", 2)?,
            Stage::take(weights, "s5", 2)?,
        ];
        let top = [Convolution::take(weights, "top5", 1)?, Convolution::take(weights, "top4", 1)?];
        let hidden = if weights.has("hidden.weight") { Some(Linear::take(weights, "hidden")?) } else { None };
        let sizes = ["scale", "length", "length_scale"];
        let sizes = if weights.has("scale.weight") {
            let [scale, length, length_scale] = sizes.map(|name| Linear::take(weights, name));
            Some([scale?, length?, length_scale?])
        } else {
            None
        };
        let network = Self {
            middle: Residual::take(weights, "mid")?,
            head: Convolution::take(weights, "head", 1)?,
            visible: Linear::take(weights, "visible")?,
            facing: Linear::take(weights, "facing")?,
            person: Linear::take(weights, "person")?,
            stages,
            top,
            hidden,
            sizes,
        };
        network.check()?;
        Ok(network)
    }

    /// Every layer takes what the one before gives.
    fn check(&self) -> Result<(), WeightsError> {
        let mut channels = 2;
        let mut ends = Vec::new();
        let mut chain = Vec::new();
        for stage in &self.stages {
            chain.push((&stage.reduce, channels, None));
            channels = stage.reduce.outputs();
            for block in &stage.blocks {
                chain.push((&block.first, channels, Some(block.first.outputs())));
                chain.push((&block.second, block.first.outputs(), Some(channels)));
            }
            ends.push(channels);
        }
        chain.push((&self.top[0], ends[3], Some(ends[2])));
        chain.push((&self.top[1], ends[2], Some(ends[1])));
        chain.push((&self.middle.first, ends[1], Some(self.middle.first.outputs())));
        chain.push((&self.middle.second, self.middle.first.outputs(), Some(ends[1])));
        chain.push((&self.head, ends[1], None));
        for (layer, inputs, outputs) in chain {
            let outputs = outputs.unwrap_or(layer.outputs());
            if layer.inputs() != inputs || layer.outputs() != outputs {
                let found = format!("{} and {}", layer.inputs(), layer.outputs());
                return Err(WeightsError::new(format!("a layer of {inputs} inputs and {outputs} outputs"), found));
            }
        }
        let pooled = self.hidden.as_ref().map_or(ends[3], |hidden| hidden.0.outputs);
        let joints = self.head.outputs() / A_JOINT;
        let lengths = self.sizes.as_ref().map_or(0, |sizes| sizes[1].0.outputs);
        let mut linear = vec![(&self.visible, pooled, joints), (&self.facing, pooled, 1), (&self.person, pooled, 1)];
        linear.extend(self.hidden.iter().map(|hidden| (hidden, ends[3], pooled)));
        if let Some([scale, length, length_scale]) = &self.sizes {
            linear.extend([(scale, pooled, joints), (length, pooled, lengths), (length_scale, pooled, lengths)]);
        }
        for (layer, inputs, outputs) in linear {
            let Linear(layer) = layer;
            if layer.inputs != inputs || layer.outputs != outputs {
                let found = format!("{} and {}", layer.inputs, layer.outputs);
                return Err(WeightsError::new(format!("a layer of {inputs} inputs and {outputs} outputs"), found));
            }
        }
        Ok(())
    }

    /// Number of joints it tells.
    pub fn joints(&self) -> usize {
        self.head.outputs() / A_JOINT
    }

    /// Looks at a picture, `SIZE * SIZE` pixels.
    pub fn look(&self, picture: &[[f32; 2]], memory: &mut Memory) -> Answer {
        let Memory { maps, between, top, columns } = memory;
        top.edge = SIZE;
        top.channels = 2;
        top.values.clear();
        top.values.extend_from_slice(picture.as_flattened());
        for (number, stage) in self.stages.iter().enumerate() {
            let (before, rest) = maps.split_at_mut(number);
            stage.reduce.apply(before.last().unwrap_or(top), &mut rest[0], columns, true);
            for block in &stage.blocks {
                block.apply(&mut rest[0], between, columns);
            }
        }
        let mut answer = self.overall(&mean(&maps[3]));
        top.clone_from(&maps[3]);
        for (layer, skip) in self.top.iter().zip([&maps[2], &maps[1]]) {
            layer.apply(top, &mut between[0], columns, true);
            enlarge(&between[0], skip, top);
        }
        self.middle.apply(top, between, columns);
        self.head.apply(top, &mut between[0], columns, false);
        answer.joints = (0..self.joints()).map(|joint| place(&between[0], joint)).collect();
        answer
    }

    /// What the whole picture says.
    fn overall(&self, pooled: &[f32]) -> Answer {
        let mut values = pooled.to_vec();
        if let Some(hidden) = &self.hidden {
            values = hidden.apply(&values);
            rectify(&mut values);
        }
        let [log_scale, log_lengths, log_length_scale] = match &self.sizes {
            Some(layers) => [0, 1, 2].map(|number: usize| layers[number].apply(&values)),
            None => [vec![UNKNOWN.ln(); self.joints()], Vec::new(), Vec::new()],
        };
        Answer {
            joints: Vec::new(),
            log_scale,
            visible: self.visible.apply(&values),
            facing: self.facing.apply(&values)[0],
            person: self.person.apply(&values)[0],
            log_lengths,
            log_length_scale,
        }
    }
}

/// Scale of a joint's error where a network does not tell it, metres.
const UNKNOWN: f32 = 0.04;

fn mean(map: &Map) -> Vec<f32> {
    let mut sum = vec![0.0; map.channels];
    for pixel in map.values.chunks_exact(map.channels) {
        sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += value);
    }
    let count = (map.edge * map.edge) as f32;
    sum.iter_mut().for_each(|sum| *sum /= count);
    sum
}

/// A map of twice the edge, every pixel repeated, with another added.
fn enlarge(map: &Map, skip: &Map, out: &mut Map) {
    out.clone_from(skip);
    for (pixel, values) in out.values.chunks_exact_mut(skip.channels).enumerate() {
        let (row, column) = (pixel / skip.edge / 2, pixel % skip.edge / 2);
        let from = (row * map.edge + column) * map.channels;
        values.iter_mut().zip(&map.values[from..from + map.channels]).for_each(|(value, more)| *value += more);
    }
}

/// Where the cells together put a joint, metres from the picture's middle.
fn place(map: &Map, joint: usize) -> [f32; 3] {
    let cell = (WIDTH / map.edge as f64) as f32;
    let half = 0.5 * (map.edge as f32 - 1.0);
    let said = |pixel: usize| &map.values[pixel * map.channels + joint * A_JOINT..][..A_JOINT];
    let pixels = 0..map.edge * map.edge;
    let most = pixels.clone().map(|pixel| said(pixel)[0]).fold(f32::NEG_INFINITY, f32::max);
    let (mut sum, mut place) = (0.0, [0.0; 3]);
    for pixel in pixels {
        let [counts, right, down, behind] = said(pixel) else { continue };
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

    /// Numbers that look random.
    fn noise(count: usize, seed: f32) -> Vec<f32> {
        (0..count).map(|index| ((index as f32 + seed) * 12.9898).sin()).collect()
    }

    #[test]
    fn a_convolution_is_the_sum_over_its_kernel() {
        for (edge, channels, outputs, kernel, stride, padding) in
            [(8, 3, 5, 3, 2, 1), (12, 2, 4, 6, 4, 1), (5, 6, 2, 1, 1, 0)]
        {
            let map = Map { edge, channels, values: noise(edge * edge * channels, 0.3) };
            let weights = noise(outputs * kernel * kernel * channels, 7.1);
            let panels = Panels::of(&weights, &noise(outputs, 1.7));
            let layer = Convolution { panels, kernel, stride, padding };
            let (mut out, mut columns) = (Map::default(), vec![5.0; 3]);
            layer.apply(&map, &mut out, &mut columns, false);
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
                                let seen = map.values[((y - padding) * edge + x - padding) * channels + channel];
                                sum += seen * weights[((output * kernel + ky) * kernel + kx) * channels + channel];
                            }
                        }
                        let found = out.values[(row * out.edge + column) * outputs + output];
                        assert!((found - sum).abs() < 1e-4, "{found} for {sum}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_joint_is_where_the_cells_that_count_put_it() {
        let edge = 12;
        let mut map = Map { edge, channels: 2 * A_JOINT, values: vec![0.0; edge * edge * 2 * A_JOINT] };
        // Of the second joint one cell counts, in row 2 and column 9: half a cell beside its middle, 0.4 m behind.
        let cell = WIDTH as f32 / edge as f32;
        let at = (2 * edge + 9) * map.channels + A_JOINT;
        map.values[at..at + A_JOINT].copy_from_slice(&[60.0, 0.5 * cell, -0.5 * cell, 0.4]);
        let [x, y, z] = place(&map, 1);
        assert!(
            (x - 4.0 * cell).abs() < 1e-5 && (y + 4.0 * cell).abs() < 1e-5 && (z - 0.4).abs() < 1e-5,
            "{x} {y} {z}"
        );
        // Of the first all count the same, and the middle is between them.
        assert!(place(&map, 0).iter().all(|value| value.abs() < 1e-5));
    }

    #[test]
    fn layers_that_do_not_fit_are_refused() {
        let good = include_bytes!("person.weights");
        let network = Network::read(good);
        assert!(
            network.as_ref().is_ok_and(|network| network.joints() == crate::detect::names::JOINTS.len()),
            "{:?}",
            network.err()
        );
        let end = good.windows(2).position(|pair| pair == b"\n\n").unwrap_or(0);
        let header = String::from_utf8_lossy(&good[..end]).into_owned();
        let line = header.lines().find(|line| line.starts_with("top4.weight")).unwrap_or_default();
        // The same number of values in another shape.
        let [name, out, ky, kx, inputs] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let changed = header.replace(line, &format!("{name} {inputs} {ky} {kx} {out}"));
        assert!(Network::read(&[changed.as_bytes(), &good[end..]].concat()).is_err());
    }
}
