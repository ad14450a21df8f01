//! Counts the frames of two standing persons in which `People` allocates.
#![allow(
    dead_code,
    missing_docs,
    clippy::unwrap_used,
    reason = "shared by two tests that stop at the first surprise; one of them does not use all of it"
)]

use crate::counting::allocations_so_far;
use crate::scene;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Config, Frame, HumanModel, People, PeopleOptions};

const CAMERA: scene::DepthCamera = scene::DepthCamera { width: 160, height: 124, focal: 110.0 };

/// Two persons side by side in front of a depth camera.
pub(crate) struct TwoPersons {
    pub body: Body,
    pub poses: [Vec<Pose>; 2],
    pixels: Vec<u16>,
}

impl TwoPersons {
    pub(crate) fn new() -> Self {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = [-0.6, 0.6].map(|lateral| {
            let shift = Vec3::new(0.3, lateral, 0.0);
            let place = |pose: &Pose| Pose::from_parts(pose.translation + shift, pose.rotation);
            scene::standing(&body).iter().map(place).collect::<Vec<_>>()
        });
        let mut noise = scene::Noise(3);
        let mut pixels = vec![u16::MAX; 160 * 124];
        for poses in &poses {
            let (own, _) = CAMERA.shoot(&body, poses, 0.002, &mut noise);
            pixels.iter_mut().zip(own).for_each(|(all, pixel)| *all = pixel.min(*all));
        }
        Self { body, poses, pixels }
    }

    /// A tracker that has no persons yet.
    pub(crate) fn people(&self) -> People {
        People::new(self.body.clone(), Config::default(), PeopleOptions::default()).unwrap()
    }

    /// The number of frames after a warm-up in which a step allocates, and the number of these frames.
    pub(crate) fn allocations(&self, mut people: People) -> [usize; 2] {
        let mut counts = [0, 0];
        for index in 0..200 {
            let images = [CAMERA.image(&self.pixels)];
            let frame = Frame { images: &images, ..Frame::empty(index as f64 / 100.0) };
            let before = allocations_so_far();
            people.step(&frame, &[]).unwrap();
            if index >= 140 {
                counts[0] += usize::from(allocations_so_far() > before);
                counts[1] += 1;
            }
        }
        assert_eq!(people.present().count(), 2, "both are tracked");
        counts
    }
}
