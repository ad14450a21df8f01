//! The file of a trained network's weights.
//!
//! Lines of ASCII, each ended by a newline: `voodoo person 1`, then for every tensor its name and shape, as in
//! `s2.conv.weight 32 6 6 2`, then an empty line. The values follow in that order, row by row, as little-endian half floats
//! (IEEE 754 binary16). Weights of convolutions have the shape (out, ky, kx, in), those of linear layers (out, in).

use std::collections::BTreeMap;
use voodoo_core::Unexpected;

/// First line of a file.
const FIRST_LINE: &str = "voodoo person 1";

/// A matrix with a row for every output and a column for every input, its biases, and the edge of its kernel.
#[derive(Debug)]
pub(crate) struct Layer {
    pub(crate) weights: Vec<f32>,
    pub(crate) bias: Vec<f32>,
    pub(crate) kernel: usize,
}

/// Named tensors.
#[derive(Debug, Default)]
pub(crate) struct Weights {
    tensors: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
}

impl Weights {
    /// Parses the bytes of a file.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, Unexpected> {
        let ascii = || Unexpected::new("weights", "lines of ASCII and an empty line", "something else");
        let end = bytes.windows(2).position(|pair| pair == b"\n\n").ok_or_else(ascii)?;
        let mut lines = std::str::from_utf8(&bytes[..end]).map_err(|_| ascii())?.lines();
        let first = lines.next().unwrap_or_default();
        let expected = format_args!("a first line {FIRST_LINE:?}");
        Unexpected::unless(first == FIRST_LINE, "weights", expected, format_args!("{first:?}"))?;
        let (mut rest, mut tensors) = (&bytes[end + 2..], BTreeMap::new());
        for line in lines {
            let mut words = line.split(' ');
            let name = words.next().unwrap_or_default();
            let (expected, found) = ("a name and whole numbers in each line", format_args!("the line of {name}"));
            let wrong = |_| Unexpected::new("weights", expected, found);
            let shape = words.map(str::parse::<usize>).collect::<Result<Vec<_>, _>>().map_err(wrong)?;
            let count = shape.iter().try_fold(1_usize, |count, edge| count.checked_mul(*edge));
            let bytes = count.and_then(|count| count.checked_mul(2)).and_then(|bytes| rest.split_at_checked(bytes));
            let (expected, found) = (format_args!("{shape:?} values of {name}"), format_args!("{} bytes", rest.len()));
            let (values, after) = bytes.ok_or_else(|| Unexpected::new("weights", expected, found))?;
            rest = after;
            let values = values.as_chunks().0.iter().map(|half| from_half(*half)).collect();
            tensors.insert(name.to_owned(), (shape, values));
        }
        Unexpected::unless(rest.is_empty(), "weights", "the end", format_args!("{} bytes", rest.len()))?;
        Ok(Self { tensors })
    }

    /// Whether there is a tensor of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// Takes the shape and values of a tensor with `edges` dimensions.
    fn take(&mut self, name: &str, edges: usize) -> Result<(Vec<usize>, Vec<f32>), Unexpected> {
        let expected = format_args!("{name} with {edges} edge(s)");
        let (shape, values) = self.tensors.remove(name).ok_or_else(|| Unexpected::new("weights", expected, "none"))?;
        let valid = shape.len() == edges && !values.is_empty() && values.iter().all(|value| value.is_finite());
        Unexpected::unless(valid, "weights", expected, format_args!("{shape:?}, or values that are not finite"))?;
        Ok((shape, values))
    }

    /// Takes a layer whose weights have `edges` dimensions, with so many inputs, and so many outputs if they are known.
    pub(crate) fn layer(
        &mut self,
        name: &str,
        edges: usize,
        inputs: usize,
        outputs: Option<usize>,
    ) -> Result<Layer, Unexpected> {
        let (shape, weights) = self.take(&format!("{name}.weight"), edges)?;
        let (_, bias) = self.take(&format!("{name}.bias"), 1)?;
        let outputs = outputs.unwrap_or(shape[0]);
        let square = edges == 2 || shape[1] == shape[2];
        let fits = square && [shape[edges - 1], shape[0], bias.len()] == [inputs, outputs, outputs];
        let expected =
            format_args!("a square kernel, {inputs} inputs, {outputs} outputs and {outputs} biases of {name}");
        Unexpected::unless(fits, "weights", expected, format_args!("{shape:?} and {}", bias.len()))?;
        let kernel = if edges == 4 { shape[1] } else { 1 };
        Ok(Layer { weights, bias, kernel })
    }
}

/// A half float in single precision, exactly.
fn from_half(bytes: [u8; 2]) -> f32 {
    let half = u32::from(u16::from_le_bytes(bytes));
    let (sign, exponent, fraction) = ((half & 0x8000) << 16, (half >> 10) & 0x1f, half & 0x3ff);
    match exponent {
        // Subnormal numbers: the fraction counts in steps of 2^-24.
        0 => f32::from_bits(sign | (fraction as f32 * 2.0_f32.powi(-24)).to_bits()),
        0x1f => f32::from_bits(sign | 0x7f80_0000 | (fraction << 13)),
        _ => f32::from_bits(sign | ((exponent + 112) << 23) | (fraction << 13)),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn half_floats_are_exact() {
        let known = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x3555, 0.333_251_95),
            (0x0001, 5.960_464_5e-8),
            (0x7bff, 65504.0),
            (0x8000, 0.0),
        ];
        for (half, value) in known {
            assert_eq!(from_half(u16::to_le_bytes(half)), value, "{half:x}");
        }
        assert!(
            from_half(u16::to_le_bytes(0x7e00)).is_nan() && from_half(u16::to_le_bytes(0xfc00)) == f32::NEG_INFINITY
        );
    }

    #[test]
    fn damaged_files_are_refused() {
        let good = b"voodoo person 1\nhead.weight 2 1\nhead.bias 2\n\n\x00\x3c\x00\x40\x00\x00\x00\x3c".to_vec();
        let mut weights = Weights::read(&good).unwrap();
        let layer = weights.layer("head", 2, 1, None).unwrap();
        assert_eq!((layer.weights, layer.bias, layer.kernel), (vec![1.0, 2.0], vec![0.0, 1.0], 1));
        assert!(weights.layer("head", 2, 1, None).is_err(), "taken already");
        let mut wrong =
            vec![good[..good.len() - 1].to_vec(), [&good[..], b"x"].concat(), b"voodoo person 2\n\n".to_vec()];
        wrong.push(b"voodoo person 1\nhead.weight 4294967296 4294967296 2\n\n".to_vec());
        wrong.push(b"voodoo person 1\nhead.weight x\n\n".to_vec());
        wrong.push(Vec::new());
        for bytes in wrong {
            assert!(Weights::read(&bytes).is_err(), "{:?}", String::from_utf8_lossy(&bytes));
        }
    }
}
