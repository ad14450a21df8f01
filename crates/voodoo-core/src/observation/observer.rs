//! Turns a frame into an observation of the tracked body: background, candidates for the body, and which images were segmented.

use super::background::{Backgrounds, OTHERS};
use super::candidates::Candidates;
use super::depth_view::{DepthViews, find_segmented};
use super::frame::{Frame, Ground};
use super::ownership::OwnershipMask;
use crate::config::Config;
use crate::math::{Aabb, Vec3};

/// What a frame shows of the body. Cheap to copy; everything is in the working frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Observation<'a> {
    /// The points that may be on the body.
    pub candidates: &'a Candidates,
    /// The frame, and its depth images for queries by position.
    pub views: DepthViews<'a>,
}

impl<'a> Observation<'a> {
    /// The frame.
    pub(crate) fn frame(&self) -> &'a Frame<'a> {
        self.views.frame
    }

    /// The working frame's origin in the world.
    pub(crate) fn origin(&self) -> Vec3 {
        self.views.origin
    }

    /// The ground plane in the working frame, if it is known.
    pub(crate) fn floor(&self) -> Option<Ground> {
        self.frame().ground.map(|ground| ground.relative_to(self.origin()))
    }

    /// The same frame with other candidates.
    pub(crate) fn with(self, candidates: &'a Candidates) -> Self {
        Self { candidates, ..self }
    }
}

/// Pixels of one depth image that show the body: the index of the image in the frame, and the indices of the pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Own<'a> {
    /// Index of the image.
    pub image: usize,
    /// Indices of pixels.
    pub pixels: &'a [usize],
}

/// Holds the learned scene, and the candidates of the current frame.
#[derive(Debug, Default)]
pub(crate) struct Observer {
    backgrounds: Backgrounds,
    segmented: Vec<bool>,
    candidates: Candidates,
}

impl Observer {
    /// Forgets scene and candidates.
    pub(crate) fn clear(&mut self) {
        self.candidates = Candidates::default();
        self.backgrounds.clear();
    }

    /// Step 1 (K06 IV-B.1): keeps the points in the enlarged box of the whole body, without the scene and the pixels that other
    /// persons explain.
    pub(crate) fn observe(
        &mut self,
        frame: &Frame,
        bounds: &Aabb,
        origin: Vec3,
        ownership: OwnershipMask,
        config: &Config,
    ) {
        self.adopt(frame, ownership);
        self.gather(frame, origin, bounds, config);
    }

    /// Finds which images of a frame are segmented; the scene is not adopted.
    pub(crate) fn find_segmented(&mut self, frame: &Frame) {
        find_segmented(frame, &mut self.segmented);
    }

    /// Adopts the scene, and what other persons explain.
    fn adopt(&mut self, frame: &Frame, ownership: OwnershipMask) {
        find_segmented(frame, &mut self.segmented);
        self.backgrounds.mark_others_points(ownership.cloud_owners, |owner| ownership.is_others(owner));
        // A frame without images keeps what is known of the cameras.
        if frame.images.is_empty() {
            return;
        }
        self.backgrounds.adopt(frame, ownership.scene, |image, depth| {
            let owners = if ownership.alone { &[] } else { ownership.owners(image) };
            for (depth, owner) in depth.iter_mut().zip(owners) {
                *depth = if ownership.is_others(*owner) { OTHERS } else { *depth };
            }
        });
    }

    /// Treats background pixels as possibly showing the body. Returns the depths learned there, for `restore`.
    pub(crate) fn release(&mut self, frame: &Frame, own: Own) -> Vec<f32> {
        self.backgrounds.release(frame, own)
    }

    /// Undoes `release`.
    pub(crate) fn restore(&mut self, frame: &Frame, own: Own, learned: &[f32]) {
        self.backgrounds.restore(frame, own, learned);
    }

    /// Selects the candidates again in another box.
    pub(crate) fn gather(&mut self, frame: &Frame, origin: Vec3, bounds: &Aabb, config: &Config) {
        self.candidates.gather(frame, origin, bounds, &self.backgrounds, config);
    }

    /// The observation of `frame`.
    pub(crate) fn observation<'a>(&'a self, frame: &'a Frame<'a>, origin: Vec3) -> Observation<'a> {
        let views = DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin };
        Observation { candidates: &self.candidates, views }
    }

    /// Whether the frame has no depth image although earlier frames had: this is no evidence that the body left.
    pub(crate) fn silent(&self, frame: &Frame) -> bool {
        frame.images.is_empty() && !self.backgrounds.is_empty()
    }

    /// The candidates of the last frame.
    pub(crate) fn candidates(&self) -> &Candidates {
        &self.candidates
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{before_wall, everything, standing, wall, with_frame};

    #[test]
    fn a_camera_that_was_there_and_gives_no_image_is_silent_until_everything_is_forgotten() {
        let (model, poses) = standing();
        let pixels = before_wall(&model.body, &poses);
        let bounds = Aabb::from_points(poses.iter().map(|pose| pose.translation));
        let mut observer = Observer::default();
        let nothing = Frame::empty(1.0);
        assert!(!observer.silent(&nothing), "nobody knows of a camera");
        let observe = |observer: &mut Observer| {
            with_frame(&pixels, 0.0, |frame| {
                observer.observe(frame, &bounds, Vec3::ZERO, everything(&wall(frame)), &Config::default());
            });
        };
        observe(&mut observer);
        let none = Backgrounds::default();
        observer.observe(&nothing, &bounds, Vec3::ZERO, everything(&none), &Config::default());
        assert!(observer.silent(&nothing) && !with_frame(&pixels, 1.0, |frame| observer.silent(frame)));
        observer.clear();
        assert!(!observer.silent(&nothing) && observer.candidates().is_empty());
    }
}
