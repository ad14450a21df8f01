//! Cost of a look for a person: from depth image to candidate and joints, and of reading the network's weights.
//!
//! `cargo bench --bench detect`. The human of eighteen limbs (`HumanModel::Full`), 1.75 m, stands before a wall with a board beside it, on one thread.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench stops at the first surprise")]

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use voodoo_core::Body;
use voodoo_core::HumanModel;
use voodoo_core::{Detect, DetectionQuery, Surroundings};
use voodoo_detect::Detector;

#[path = "../crates/voodoo-core/tests/scene/mod.rs"]
mod scene;

/// Depth of the wall and of the board, in the images' millimeters.
const WALL: u16 = 4500;
const BOARD: u16 = 3200;

fn detect(criterion: &mut Criterion) {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = scene::standing(&body);
    let mut group = criterion.benchmark_group("a look for a person, one thread");
    for (width, height, focal) in [(160, 124, 145.0), (320, 240, 277.0), (640, 480, 560.0)] {
        let camera = scene::DepthCamera { width, height, focal };
        let (mut pixels, visible) = camera.shoot(&body, &poses, 0.01, &mut scene::Noise(3));
        assert!(visible > 0, "the person is in the image");
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let [across, down] = [index % width, index / width];
            let board = across < width / 8 && down > height / 3;
            *pixel = if *pixel > 0 && *pixel < WALL {
                *pixel
            } else if board {
                BOARD
            } else {
                WALL
            };
        }
        let image = camera.image(&pixels);
        let mut detector = Detector::new();
        let root = poses[0].translation;
        for (what, query) in [
            ("of anybody", DetectionQuery::Any),
            ("at a place", DetectionQuery::Near(root)),
            ("of all", DetectionQuery::All),
        ] {
            let found = detector.detect(&image, &Surroundings::default(), query).unwrap();
            let place = found.first().and_then(|person| person.joints[2]);
            let off = place.map_or(f64::INFINITY, |joint| joint.position.distance(root));
            println!("{width}x{height}, {what}: {} found, the first {off:.2} m from the root", found.len());
            group.bench_function(BenchmarkId::new(what, format!("{width}x{height}")), |b| {
                b.iter(|| black_box(detector.detect(&image, &Surroundings::default(), query).unwrap().len()));
            });
        }
    }
}

fn weights(criterion: &mut Criterion) {
    let bytes = include_bytes!("../crates/voodoo-detect/person.weights");
    criterion.bench_function("reading the weights", |b| b.iter(|| Detector::with_weights(black_box(bytes)).is_ok()));
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(600));
    targets = detect, weights
}
criterion_main!(benches);
