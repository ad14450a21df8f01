//! The same input gives the same output, bit by bit, for any number of threads.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use voodoo_core::Frame;
use voodoo_core::HumanModel;
use voodoo_core::Overlap;
use voodoo_core::{Body, Config};

fn run(config: Config, frames: &[(Vec<u16>, Vec<[f64; 3]>)]) -> Vec<Vec<u64>> {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let camera = scene::DepthCamera { width: 160, height: 124, focal: 145.0 };
    let mut tracker = crate::tracker(body.clone(), config).unwrap();
    tracker.reset_pose(&scene::standing(&body)).unwrap();
    let step = |(index, (pixels, points)): (usize, &(Vec<u16>, Vec<[f64; 3]>))| {
        let (images, clouds) = ([camera.image(pixels)], [scene::cloud(points)]);
        let frame = Frame { clouds: &clouds, images: &images, ..Frame::empty(index as f64) };
        let estimate = tracker.step(&frame).unwrap();
        assert!(estimate.limb_points.iter().sum::<usize>() > 1000, "the frame is not seen at all");
        scene::bits(estimate)
    };
    frames.iter().enumerate().map(step).collect()
}

#[test]
fn estimates_are_equal_bit_by_bit_for_any_number_of_threads() {
    let frames = scene::swaying(&Body::human(1.75, HumanModel::Papers).unwrap(), 4);
    for config in scene::every_solver() {
        for overlap in [Overlap::Exclusive, Overlap::Adjacent, Overlap::Shared] {
            let config = scene::with(config.clone(), |config| config.overlap = overlap);
            let alone = run(config.clone(), &frames);
            for threads in [2, 3] {
                let many = run(scene::with(config.clone(), |config| config.threads = threads), &frames);
                assert_eq!(alone, many, "{threads} threads, {config:?}");
            }
        }
    }
}

#[test]
fn a_different_input_gives_a_different_estimate() {
    let mut frames = scene::swaying(&Body::human(1.75, HumanModel::Papers).unwrap(), 2);
    let first = run(Config::default(), &frames);
    frames[1].1[0][1] += 0.001;
    let second = run(Config::default(), &frames);
    assert_eq!(first[0], second[0]);
    assert_ne!(first[1], second[1], "the comparison would not notice a difference");
}
