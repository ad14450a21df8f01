//! The static scene behind the body, learned from the depth images of each camera.

use crate::math::{Pose, refill};
use crate::observation::frame::{DepthImage, Frame};
use crate::observation::ownership::OwnershipMask;

/// Depths that differ by more than this are not of one surface: meters, plus a fraction of the depth, because the noise of depth
/// cameras grows with depth.
pub const SURFACE_STEP: [f32; 2] = [0.04, 0.012];
/// Depths of the scene that differ by less than this are of one surface, meters.
pub(crate) const SCENE_STEP: f32 = 0.15;
/// A camera that moved by no more than this counts as static: meters, and radians. The odometry of a stationary robot varies by
/// less.
const STANDS: (f64, f64) = (0.003, 0.0015);
/// Value of the depth at pixels that show another person: any return there does not belong to this person.
pub(crate) const OTHERS: f32 = f32::MIN_POSITIVE;

/// Depth of the scene behind the body, one value per pixel; 0 where it is unknown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Background {
    pub(super) world_from_sensor: Pose,
    pub(super) width: usize,
    pub depth: Vec<f32>,
    /// The ray `(x/z, y/z)` on which each depth was observed; empty while the camera has not moved: then it is the ray through
    /// the pixel center.
    pub(super) rays: Vec<[f32; 2]>,
    /// Recent depth of each pixel where the scene is not known, or of the person there, and the number of consecutive observations:
    /// it may become part of the scene.
    pub pending: Vec<f32>,
    pub frames: Vec<u8>,
    /// Stamp since which the camera has been at its position, seconds; `None` in the first frame.
    pub since: Option<f64>,
    /// Whether the whole image of the second frame was learned, and the row that was learned last.
    pub filled: bool,
    pub row: usize,
    /// Stamp of the last image, seconds.
    pub(super) seen: f64,
}

/// The backgrounds of all depth images, in the order of the frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Backgrounds {
    pub(super) images: Vec<Background>,
    /// Depths and rays of a camera before it moved.
    pub(super) before_move: (Vec<f32>, Vec<[f32; 2]>),
}

/// Distance between two poses: meters, and radians.
pub(super) fn pose_difference(a: &Pose, b: &Pose) -> (f64, f64) {
    (a.translation.distance(b.translation), a.rotation.angle_between(b.rotation))
}

impl Background {
    /// Whether a return at `z` meters belongs to a background at this depth: it is not clearly in front of it.
    #[inline(always)]
    pub(crate) fn contains(depth: f32, z: f32) -> bool {
        depth > 0.0 && z > depth - SURFACE_STEP[0] - SURFACE_STEP[1] * depth
    }

    /// Whether this background belongs to the image: to the same camera at the same pose.
    pub(super) fn fits(&self, image: &DepthImage) -> bool {
        let (a, b) = (&self.world_from_sensor, &image.world_from_sensor);
        let stands = || {
            let (meters, radians) = pose_difference(a, b);
            meters <= STANDS.0 && radians <= STANDS.1
        };
        self.is_sized_like(image) && (a == b || stands())
    }

    pub(super) fn is_sized_like(&self, image: &DepthImage) -> bool {
        self.width == image.camera.width() && self.depth.len() == image.pixels.len()
    }
}

impl Backgrounds {
    /// The background of this image, if its camera has not moved.
    pub(crate) fn of_image(&self, image: &DepthImage) -> Option<&Background> {
        self.images.iter().find(|background| background.fits(image))
    }

    /// The learned depths of this image, row by row; empty when nothing was learned.
    pub(crate) fn depth(&self, image: &DepthImage) -> &[f32] {
        self.of_image(image).map_or(&[], |background| &background.depth)
    }

    /// The background of this image, to be changed.
    pub(crate) fn of_image_mut(&mut self, image: &DepthImage) -> Option<&mut Background> {
        self.images.iter_mut().find(|background| background.fits(image))
    }

    /// Becomes the scene as one person sees it: with what other persons explain hidden.
    pub(super) fn mask(&mut self, frame: &Frame, ownership: OwnershipMask) {
        if frame.images.is_empty() {
            return; // The memory is kept for the next frame with images.
        }
        self.images.resize_with(frame.images.len(), Background::default);
        for (number, (image, own)) in frame.images.iter().zip(&mut self.images).enumerate() {
            (own.world_from_sensor, own.width) = (image.world_from_sensor, image.camera.width());
            refill(&mut own.depth, ownership.scene.depth(image).iter().copied());
            own.depth.resize(image.pixels.len(), 0.0);
            for (depth, owner) in own.depth.iter_mut().zip(ownership.owners(number)) {
                *depth = if ownership.is_others(*owner) { OTHERS } else { *depth };
            }
        }
    }

    /// Sets the learned depth to unknown at pixels, of the image with this index, that show a person. Depths learned behind the person
    /// stay: without them, the background would look like a flat body once the person is gone.
    pub(crate) fn release(&mut self, frame: &Frame, image: usize, pixels: &[usize]) {
        let Some(image) = frame.images.get(image) else { return };
        let Some(known) = self.of_image_mut(image) else { return };
        for pixel in pixels {
            if let Some(depth) = known.depth.get_mut(*pixel)
                && image.depth(*pixel).is_none_or(|z| Background::contains(*depth, z))
            {
                *depth = 0.0;
            }
        }
    }

    /// Gives every image of a frame a background: an empty one for a new camera, or one that moved far.
    pub(crate) fn register(&mut self, frame: &Frame) {
        for image in frame.images {
            if self.of_image(image).is_none() {
                self.carry_over(image, frame);
            }
            if let Some(background) = self.of_image_mut(image) {
                background.seen = frame.stamp;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::observation::frame::DepthPixels;
    use crate::testing::{learn, pinhole};

    #[test]
    fn a_silent_camera_is_remembered_and_a_moved_one_starts_anew() {
        let pixels = [3.0_f32; 16];
        let image = |x: f64| DepthImage {
            pixels: DepthPixels::F32(&pixels),
            camera: pinhole(4, 4, [4.0, 4.0, 2.0, 2.0]),
            meters_per_unit: 1.0,
            world_from_sensor: Pose::from_translation(Vec3::new(x, 0.0, 0.0)),
            weight: 1.0,
            source: 0,
        };
        let mut backgrounds = Backgrounds::default();
        let mut register = |stamp: f64, images: &[DepthImage], known: bool| {
            let frame = Frame { images, ..Frame::empty(stamp) };
            if known {
                learn(&mut backgrounds, &frame, |_| true);
            }
            backgrounds.register(&frame);
            [0.0, 1.0, 2.0].map(|x| {
                let learned = backgrounds.of_image(&image(x)).map(|known| &known.depth);
                learned.map(|depth| depth.iter().filter(|depth| **depth > 0.0).count())
            })
        };
        let both = [Some(16), Some(16), None];
        assert_eq!(register(0.0, &[image(0.0), image(1.0)], true), both);
        assert_eq!(register(0.1, &[], false), both);
        assert_eq!(register(0.2, &[image(1.0)], false), both, "the other one is silent");
        let all = [Some(16), Some(16), Some(0)];
        assert_eq!(register(0.3, &[image(2.0)], false), all, "cameras may deliver in frames of their own");
        assert_eq!(register(0.4, &[image(1.0), image(2.0)], false), all);
        assert_eq!(register(3.5, &[image(1.0), image(2.0)], false), all);
        assert_eq!(register(3.6, &[image(3.0)], false), [None, Some(16), Some(0)], "the first one has gone");
    }
}
