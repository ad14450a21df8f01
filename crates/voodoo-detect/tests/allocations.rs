//! Heap allocations of frames with a detector: only those in which it looks may allocate.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

#[path = "../../voodoo-core/tests/counting/mod.rs"]
mod counting;
#[path = "../../voodoo-core/tests/scene/mod.rs"]
mod scene;

use counting::allocations_so_far;

use voodoo_core::Frame;
use voodoo_core::HumanModel;
use voodoo_core::PeopleOptions;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Config, People};
use voodoo_detect::Detector;

/// Of frames of two persons who stand before a camera, how many allocate, after a warm-up, and how many there are.
fn people_allocations() -> [usize; 2] {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let camera = scene::DepthCamera { width: 160, height: 124, focal: 110.0 };
    let mut noise = scene::Noise(3);
    let mut pixels = vec![u16::MAX; 160 * 124];
    for aside in [-0.6, 0.6] {
        let shift = Vec3::new(0.3, aside, 0.0);
        let place = |pose: &Pose| Pose::from_parts(pose.translation + shift, pose.rotation);
        let poses: Vec<Pose> = scene::standing(&body).iter().map(place).collect();
        let (frame_pixels, _) = camera.shoot(&body, &poses, 0.002, &mut noise);
        pixels.iter_mut().zip(frame_pixels).for_each(|(all, pixel)| *all = pixel.min(*all));
    }
    let people = People::new(body, Config::default(), PeopleOptions::default()).unwrap();
    let mut people = people.with_detector(Box::new(Detector::new()));
    let mut counts = [0, 0];
    for index in 0..200 {
        let images = [camera.image(&pixels)];
        let frame = Frame::empty(index as f64 / 100.0).with_images(&images);
        let before = allocations_so_far();
        people.step(&frame, &[]).unwrap();
        if index >= 140 {
            counts[0] += usize::from(allocations_so_far() > before);
            counts[1] += 1;
        }
    }
    assert_eq!(people.present().count(), 2, "both are followed");
    counts
}

/// One test only: the counter is global, another test in this process would be counted, too.
#[test]
fn of_two_persons_who_are_followed_few_frames_allocate() {
    // A detector looks for others once in six such frames, and at each of the two once in fifteen.
    let [allocating, all] = people_allocations();
    assert!(allocating <= all / 6 + 2 * all / 15, "{allocating} of {all} frames of two persons");
}
