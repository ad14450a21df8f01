//! Updates the background: learns the static scene around the body.

use super::background::{Background, Backgrounds};
use super::candidates::image_window;
use super::frame::{DepthImage, Frame};
use super::observer::{Expectation, Own};
use crate::math::{Aabb, Points, shifted};
use crate::shape::SurfaceBatch;

/// In the first frame, returns within this distance of the body may be the body, meters: poses set by the user have errors of
/// this size.
const BODY_REACH: f32 = 0.15;

impl Backgrounds {
    /// Updates the background around the body. In the first frame after a reset the pose is known, and everything that is not
    /// near the body is scene. While the body is lost, the whole image is learned.
    pub(super) fn learn_around(&mut self, frame: &Frame, expected: Expectation, bounds: &Aabb) {
        if expected.first {
            self.learn_first(frame, expected, bounds);
            self.release(frame, expected.own);
            return;
        }
        if expected.searched == Some(0) {
            self.fill();
        }
        self.update(frame, |image: &DepthImage| match expected.searched {
            Some(_) => [0..0, 0..0],
            None => image_window(image, &shifted(&image.world_from_sensor, expected.origin), bounds),
        });
    }

    /// Sets the learned depth to unknown at pixels that show the body, and returns the previous values.
    pub(super) fn release(&mut self, frame: &Frame, own: Own) -> Vec<f32> {
        let Some(image) = frame.images.get(own.image) else { return Vec::new() };
        let Some(depth) = self.depth_mut(image) else { return Vec::new() };
        let scale = image.meters_per_unit as f32;
        let forget = |pixel: &usize| {
            let Some(depth) = depth.get_mut(*pixel) else { return 0.0 };
            let learned = *depth;
            // Depths learned behind the body stay.
            let z = image.pixels.get(*pixel) * scale;
            if !(z > 0.0) || Background::contains(learned, z) {
                *depth = 0.0;
            }
            learned
        };
        own.pixels.iter().map(forget).collect()
    }

    /// Restores the depths that `release` returned.
    pub(super) fn restore(&mut self, frame: &Frame, own: Own, learned: &[f32]) {
        let Some(depth) = frame.images.get(own.image).and_then(|image| self.depth_mut(image)) else { return };
        for (pixel, learned) in own.pixels.iter().zip(learned) {
            if let Some(depth) = depth.get_mut(*pixel) {
                *depth = *learned;
            }
        }
    }

    fn learn_first(&mut self, frame: &Frame, expected: Expectation, bounds: &Aabb) {
        let (mut queries, mut pixels, mut surface) = (Points::default(), Vec::new(), SurfaceBatch::default());
        self.start(frame, |image, depth| {
            let working_from_sensor = shifted(&image.world_from_sensor, expected.origin);
            queries.clear();
            pixels.clear();
            for (index, z) in depth.iter().enumerate().filter(|(_, z)| **z > 0.0) {
                let point = working_from_sensor * image.back_project(index, *z);
                if bounds.contains(point) {
                    queries.push(point.to_array().map(|value| value as f32));
                    pixels.push(index);
                }
            }
            for (limb, pose) in expected.body.limbs().iter().zip(expected.poses) {
                limb.shape.closest_points(pose, &queries, &mut surface);
                for (pixel, distance) in pixels.iter().zip(&surface.signed_distance) {
                    if *distance < BODY_REACH {
                        depth[*pixel] = 0.0;
                    }
                }
            }
        });
    }
}
