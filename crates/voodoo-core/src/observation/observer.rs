//! Turns a frame into an observation of the tracked body: background, candidates for the body, and which images were segmented.

use super::background::Backgrounds;
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
}

/// Holds the candidates of the current frame.
#[derive(Debug, Default)]
pub(crate) struct Observer {
    /// The scene as this body sees it, where it is not the one that all share: other persons hide some of it, or the body was
    /// learned as a part of it.
    masked: Backgrounds,
    is_masked: bool,
    segmented: Vec<bool>,
    /// The candidates of the last frame.
    pub candidates: Candidates,
    /// Whether a frame had depth images.
    has_images: bool,
}

impl Observer {
    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Finds which images of a frame are segmented, and what other persons hide. The pixels `own` of the image with an index show the
    /// body in this frame, even where they are known as the scene.
    pub(crate) fn begin(&mut self, frame: &Frame, ownership: OwnershipMask, own: Option<&(usize, Vec<usize>)>) {
        find_segmented(frame, &mut self.segmented);
        self.has_images |= !frame.images.is_empty();
        self.is_masked = ownership.others > 0 || own.is_some();
        if self.is_masked {
            self.masked.mask(frame, ownership);
        }
        if let Some((image, pixels)) = own {
            self.masked.release(frame, *image, pixels);
        }
    }

    /// Step 1 (K06 IV-B.1): keeps the points in the enlarged box of the whole body, without the scene and the pixels that other
    /// persons explain. Returns the observation of `frame`.
    pub(crate) fn gather<'a>(
        &'a mut self,
        frame: &'a Frame<'a>,
        origin: Vec3,
        bounds: &Aabb,
        ownership: OwnershipMask<'a>,
        config: &Config,
    ) -> Observation<'a> {
        let mut candidates = std::mem::take(&mut self.candidates);
        candidates.gather(self.observation(frame, origin, ownership).views, bounds, config);
        self.candidates = candidates;
        self.observation(frame, origin, ownership)
    }

    /// The observation of `frame`, with the candidates that were gathered last.
    pub(crate) fn observation<'a>(
        &'a self,
        frame: &'a Frame<'a>,
        origin: Vec3,
        ownership: OwnershipMask<'a>,
    ) -> Observation<'a> {
        let scene = if self.is_masked { &self.masked } else { ownership.scene };
        let ownership = OwnershipMask { scene, ..ownership };
        let views = DepthViews { frame, ownership, segmented: &self.segmented, origin };
        Observation { candidates: &self.candidates, views }
    }

    /// Whether the frame has no depth image although earlier frames had: this is no evidence that the body left.
    pub(crate) fn silent(&self, frame: &Frame) -> bool {
        frame.images.is_empty() && self.has_images
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
                let scene = wall(frame);
                observer.begin(frame, everything(&scene), None);
                observer.gather(frame, Vec3::ZERO, &bounds, everything(&scene), &Config::default());
            });
        };
        observe(&mut observer);
        observer.begin(&nothing, everything(&Backgrounds::default()), None);
        assert!(observer.silent(&nothing) && !with_frame(&pixels, 1.0, |frame| observer.silent(frame)));
        observer.clear();
        assert!(!observer.silent(&nothing) && observer.candidates.points.is_empty());
    }
}
