//! Cost of a frame: against the number of points (K07 figure 8), of ICP steps (figure 9), the weights, and from image to pose.
//!
//! `cargo bench --bench step`. Synthetic points of the human of ten limbs (`HumanModel::Papers`), 1.75 m, which moves
//! to and fro, so that no frame is at its optimum; the published solver unless another is named; all boxes and weights are
//! the defaults.
//! Images also of that of eighteen limbs (`HumanModel::Full`).
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench stops at the first surprise")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use voodoo_core::HumanModel;
use voodoo_core::SolverKind;
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Config, Tracker};
use voodoo_core::{Cloud, DepthImage, Frame};
use voodoo_detect::Detector;

#[path = "../crates/voodoo-core/tests/scene/mod.rs"]
mod scene;

const POINTS: [usize; 6] = [250, 500, 1000, 2000, 4000, 8000];

/// A tracker and two instants that it goes between.
struct Bench<'a> {
    tracker: Tracker,
    instants: [(&'a [Cloud<'a>], &'a [DepthImage<'a>]); 2],
    frames: usize,
}

impl Bench<'_> {
    /// One frame; returns the ICP steps used.
    fn frame(&mut self) -> usize {
        let (clouds, images) = self.instants[self.frames % 2];
        self.frames += 1;
        // As often as a camera measures: a detector looks by time.
        let frame = Frame { clouds, images, ..Frame::empty(self.frames as f64 / 30.0) };
        black_box(self.tracker.step(&frame).unwrap()).steps
    }

    /// Seconds of a frame, tenth percentile (the least disturbed by other work on the machine), and mean ICP steps.
    fn typical(&mut self, repeats: usize) -> (f64, f64) {
        let mut steps = 0;
        for _ in 0..10 {
            self.frame();
        }
        let mut times: Vec<Duration> = (0..repeats)
            .map(|_| {
                let start = Instant::now();
                steps += self.frame();
                start.elapsed()
            })
            .collect();
        times.sort_unstable();
        (times[repeats / 10].as_secs_f64(), steps as f64 / repeats as f64)
    }
}

fn body() -> Body {
    human(HumanModel::Papers)
}

fn human(model: HumanModel) -> Body {
    Body::human(1.75, model).unwrap()
}

/// ICP steps forced; every point used.
fn every_point(max_steps: usize, threads: usize) -> Config {
    let mut config = Config::default();
    config.solver = SolverKind::Limbwise;
    (config.max_steps, config.threads, config.min_change) = (max_steps, threads, 0.0);
    (config.max_limb_points, config.max_points) = (100_000, 10_000_000);
    config
}

fn tracker(config: Config) -> Tracker {
    tracker_of(&body(), config)
}

fn tracker_of(body: &Body, config: Config) -> Tracker {
    let tracker = Tracker::new(body.clone(), config).unwrap();
    let mut tracker = tracker.with_detector(Box::new(Detector::new()));
    tracker.reset_pose(&scene::standing(body)).unwrap();
    tracker
}

/// The standing person, and the same 4 cm aside and turned by 0.1 rad.
fn two_poses(body: &Body) -> [Vec<Pose>; 2] {
    let first = scene::standing(body);
    let center = first[0].translation;
    let turn = Quat::from_axis_angle(Vec3::Z, 0.1);
    let second = first
        .iter()
        .map(|pose| {
            let place = center + turn * (pose.translation - center) + Vec3::new(0.02, 0.035, 0.0);
            Pose::from_parts(place, turn * pose.rotation)
        })
        .collect();
    [first, second]
}

fn two_clouds(count: usize) -> [Vec<[f64; 3]>; 2] {
    let mut noise = scene::Noise(7);
    two_poses(&body()).map(|poses| scene::surface_points(&body(), &poses, count, 0.01, &mut noise))
}

/// Least-squares line through `(x, y)`: slope, intercept and R^2.
fn line(x: &[f64], y: &[f64]) -> [f64; 3] {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mx, my) = (mean(x), mean(y));
    let sum = |f: &dyn Fn(f64, f64) -> f64| x.iter().zip(y).map(|(x, y)| f(x - mx, y - my)).sum::<f64>();
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    let slope = xy / xx;
    [slope, my - slope * mx, xy * xy / (xx * yy)]
}

fn points(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame of 6 steps, by points");
    for threads in [1, 2] {
        let mut steps = Vec::new();
        for count in POINTS {
            let [first, second] = two_clouds(count);
            let (first, second) = ([scene::cloud(&first)], [scene::cloud(&second)]);
            let bench = |max_steps| Bench {
                tracker: tracker(every_point(max_steps, threads)),
                instants: [(&first, &[]), (&second, &[])],
                frames: 0,
            };
            let ((few, used_few), (many, used_many)) = (bench(1).typical(201), bench(6).typical(201));
            steps.push((many - few) / (used_many - used_few));
            let mut six = bench(6);
            group.throughput(Throughput::Elements(count as u64));
            group.bench_function(BenchmarkId::new(format!("{threads} thread(s)"), count), |b| b.iter(|| six.frame()));
        }
        let [slope, start, fit] = line(&POINTS.map(|count| count as f64), &steps);
        println!(
            "one ICP step, {threads} thread(s): {:.1} us + {:.2} ns a point, R^2 = {fit:.5}; us at {POINTS:?} points: {:.1?}",
            start * 1e6,
            slope * 1e9,
            steps.iter().map(|time| time * 1e6).collect::<Vec<_>>()
        );
    }
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame of 2000 points, by ICP steps");
    let [first, second] = two_clouds(2000);
    let (first, second) = ([scene::cloud(&first)], [scene::cloud(&second)]);
    for threads in [1, 2] {
        let (mut used, mut times) = (Vec::new(), Vec::new());
        for max_steps in 1..=8 {
            let instants: [(&[_], &[_]); 2] = [(&first, &[]), (&second, &[])];
            let mut bench = Bench { tracker: tracker(every_point(max_steps, threads)), instants, frames: 0 };
            let (time, steps) = bench.typical(201);
            used.push(steps);
            times.push(time);
            group.bench_function(BenchmarkId::new(format!("{threads} thread(s)"), max_steps), |b| {
                b.iter(|| bench.frame());
            });
        }
        let [slope, start, fit] = line(&used, &times);
        println!(
            "frame of 2000 points, {threads} thread(s): {:.1} us + {:.1} us an ICP step, R^2 = {fit:.5}; us at {used:.1?} steps: {:.1?}",
            start * 1e6,
            slope * 1e6,
            times.iter().map(|time| time * 1e6).collect::<Vec<_>>()
        );
    }
}

fn weights(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame of 2000 points, by weight");
    let [first, second] = two_clouds(2000);
    for weight in [1.0, 1000.0] {
        let (first, second) = ([Cloud { weight, ..scene::cloud(&first) }], [Cloud { weight, ..scene::cloud(&second) }]);
        let instants: [(&[_], &[_]); 2] = [(&first, &[]), (&second, &[])];
        let mut bench = Bench { tracker: tracker(every_point(6, 1)), instants, frames: 0 };
        let (time, steps) = bench.typical(401);
        println!("weight {weight}: {:.1} us a frame of {steps:.1} ICP steps", time * 1e6);
        group.bench_function(BenchmarkId::from_parameter(weight), |b| b.iter(|| bench.frame()));
    }
}

fn images(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("from depth image to estimate");
    for (model, limbs) in [(HumanModel::Papers, "ten limbs"), (HumanModel::Full, "eighteen limbs")] {
        let body = human(model);
        for (width, height, focal) in [(160, 124, 145.0), (640, 480, 560.0)] {
            let camera = scene::DepthCamera { width, height, focal };
            let mut noise = scene::Noise(3);
            let [first, second] = two_poses(&body).map(|poses| camera.shoot(&body, &poses, 0.01, &mut noise));
            let visible = first.1;
            let (first, second) = ([camera.image(&first.0)], [camera.image(&second.0)]);
            for (solver, name, threads) in [
                (SolverKind::Limbwise, "limbwise", 1),
                (SolverKind::Limbwise, "limbwise", 2),
                (SolverKind::Chain, "chain", 1),
                (SolverKind::Chain, "chain", 2),
            ] {
                let instants: [(&[_], &[_]); 2] = [(&[], &first), (&[], &second)];
                let mut config = Config::default();
                (config.solver, config.threads, config.min_change) = (solver, threads, 0.0);
                let mut bench = Bench { tracker: tracker_of(&body, config), instants, frames: 0 };
                let (time, steps) = bench.typical(201);
                println!(
                    "{width}x{height}, {limbs}, {visible} pixels on the body, {name}, {threads} thread(s): {:.3} ms a frame of {steps:.1} ICP steps",
                    time * 1e3
                );
                group.bench_function(
                    BenchmarkId::new(format!("{limbs}, {name}, {threads} thread(s)"), format!("{width}x{height}")),
                    |b| {
                        b.iter(|| bench.frame());
                    },
                );
            }
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(600));
    targets = images, points, steps, weights
}
criterion_main!(benches);
