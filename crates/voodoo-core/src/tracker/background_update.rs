//! What is not the body: the still scene, learnt around it.

use crate::math::{Aabb, Points, shifted};
use crate::observation::candidates::image_window;
use crate::observation::frame::{DepthImage, Frame};
use crate::shape::SurfaceBatch;
use crate::tracker::Tracker;

/// In the first frame, what lies within this of the body may be the body, metres.
const BODY_REACH: f32 = 0.15;

impl Tracker {
    /// In the first frame after a reset the pose is known, and all that is not near the body is scene. While the body is lost,
    /// nothing of the image is its.
    pub(crate) fn learn_background(&mut self, frame: &Frame, bounds: &Aabb) {
        let searching = if self.config.recovery { self.searching() } else { None };
        let Self { backgrounds, body, poses, origin, .. } = self;
        if self.stamp.is_some() {
            let window = |image: &DepthImage| match searching {
                Some(_) => (0..0, 0..0),
                None => image_window(image, &shifted(&image.world_from_sensor, *origin), bounds),
            };
            if searching == Some(0) {
                backgrounds.fill();
            }
            backgrounds.update(frame, window);
            return;
        }
        let (mut queries, mut pixels, mut surface) = (Points::default(), Vec::new(), SurfaceBatch::default());
        backgrounds.start(frame, |image, depth| {
            let working_from_sensor = shifted(&image.world_from_sensor, *origin);
            queries.clear();
            pixels.clear();
            for (index, z) in depth.iter().enumerate().filter(|(_, z)| **z > 0.0) {
                let point = working_from_sensor * image.back_project(index, *z);
                if bounds.contains_local_point(point) {
                    queries.push(point.to_array().map(|value| value as f32));
                    pixels.push(index);
                }
            }
            for (limb, pose) in body.limbs().iter().zip(poses.iter()) {
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
