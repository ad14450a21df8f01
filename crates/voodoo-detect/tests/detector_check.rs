//! The detector's network computes what it computed where it was trained; training/README.md describes the file of vectors.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeMap;
use voodoo_detect::crop::SIZE;
use voodoo_detect::network::{Memory, Network};

const WEIGHTS: &[u8] = include_bytes!("../person.weights");
const VECTORS: &[u8] = include_bytes!("data/detector_check.bin");

/// The named values of the file of vectors.
fn vectors() -> BTreeMap<String, Vec<f32>> {
    let end = VECTORS.windows(2).position(|pair| pair == b"\n\n").unwrap();
    let mut lines = std::str::from_utf8(&VECTORS[..end]).unwrap().lines();
    assert_eq!(lines.next(), Some("voodoo person check 1"));
    let mut values = VECTORS[end + 2..].as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
    lines
        .map(|line| {
            let mut words = line.split(' ');
            let name = words.next().unwrap().to_owned();
            let count = words.map(|word| word.parse::<usize>().unwrap()).product();
            (name, values.by_ref().take(count).collect())
        })
        .collect()
}

#[test]
fn the_network_reports_what_it_reported_where_it_was_trained() {
    let (vectors, network) = (vectors(), Network::read(WEIGHTS).unwrap());
    let pictures: Vec<[f32; 2]> = vectors["pictures"].as_chunks().0.to_vec();
    let mut memory = Memory::default();
    for (number, picture) in pictures.chunks_exact(SIZE * SIZE).enumerate() {
        let answer = network.evaluate(picture, &mut memory);
        let outputs = [
            ("joints", answer.joints.as_flattened().to_vec(), 0.002),
            ("visible", answer.visible, 0.02),
            ("facing", vec![answer.facing], 0.02),
            ("person", vec![answer.person], 0.02),
            ("scale", answer.log_scale, 0.01),
            ("length", answer.log_lengths, 0.002),
            ("length_scale", answer.log_length_scale, 0.01),
        ];
        for (name, found, bound) in outputs {
            let expected = &vectors[name][number * found.len()..][..found.len()];
            let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < bound, "{name} of picture {number}: {found:?} for {expected:?}");
        }
    }
    assert!(vectors["person"][0] > 2.0 && vectors["person"][1] < -2.0, "{:?}", vectors["person"]);
}
