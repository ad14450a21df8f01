//! Cost of a frame with several persons: 320x240, a wall behind them, everybody found by the detector.
//!
//! `cargo bench --bench people`. Humans of 18 limbs (`HumanModel::Full`), who sway beside each other; the detector
//! is included.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench stops at the first surprise")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use voodoo_core::Frame;
use voodoo_core::HumanModel;
use voodoo_core::PeopleOptions;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Config, People};
use voodoo_detect::Detector;

#[path = "../crates/voodoo-core/tests/scene/mod.rs"]
mod scene;

const CAMERA: scene::DepthCamera = scene::DepthCamera { width: 320, height: 240, focal: 277.0 };
const RATE: f64 = 30.0;
/// Frames of a period of the swaying, and as many as everybody needs to be found.
const PERIOD: usize = 60;

/// What the camera sees of so many persons, a period long.
fn images(count: usize) -> Vec<Vec<u16>> {
    let mut noise = scene::Noise(4);
    let bodies: Vec<Body> =
        (0..count).map(|one| Body::human(1.6 + 0.08 * one as f64, HumanModel::Full).unwrap()).collect();
    let frame = |frame: usize| {
        let mut all = vec![u16::MAX; CAMERA.width * CAMERA.height];
        for (number, body) in bodies.iter().enumerate() {
            let phase = std::f64::consts::TAU * frame as f64 / PERIOD as f64 + number as f64;
            let aside = 0.62 * (number as f64 - 0.5 * (count as f64 - 1.0)) + 0.12 * phase.sin();
            let shift = Vec3::new(0.25 * (number % 2) as f64 + 0.3, aside, 0.0);
            let place = |pose: &Pose| Pose::from_parts(pose.translation + shift, pose.rotation);
            let poses: Vec<Pose> = scene::standing(body).iter().map(place).collect();
            let (pixels, _) = CAMERA.shoot(body, &poses, 0.004, &mut noise);
            all.iter_mut().zip(pixels).for_each(|(all, pixel)| *all = pixel.min(*all));
        }
        all
    };
    (0..PERIOD).map(frame).collect()
}

/// A room with people, and what comes next.
struct Room {
    people: People,
    images: Vec<Vec<u16>>,
    frames: usize,
}

impl Room {
    fn frame(&mut self) {
        let images = [CAMERA.image(&self.images[self.frames % PERIOD])];
        self.frames += 1;
        let frame = Frame { images: &images, ..Frame::empty(self.frames as f64 / RATE) };
        black_box(&mut self.people).step(&frame, &[]).unwrap();
    }
}

fn persons(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame of 320x240, by persons");
    for count in [1, 2, 4] {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let people = People::new(body, Config::default(), PeopleOptions::default()).unwrap();
        let people = people.with_detector(Box::new(Detector::new()));
        let mut room = Room { people, images: images(count), frames: 0 };
        let start = Instant::now();
        (0..2 * PERIOD).for_each(|_| room.frame());
        let mean = start.elapsed().as_secs_f64() / (2 * PERIOD) as f64;
        let there = room.people.present().count();
        println!("{count} person(s), {there} found: {:.2} ms a frame from the first on", 1e3 * mean);
        group.bench_function(BenchmarkId::from_parameter(count), |b| b.iter(|| room.frame()));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
    targets = persons
}
criterion_main!(benches);
