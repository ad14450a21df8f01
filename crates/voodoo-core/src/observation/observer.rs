//! Turns a frame into an observation of the tracked body: what is background, what may be the body, which images were segmented.

use super::background::Backgrounds;
use super::candidates::{Candidates, body_box};
use super::depth_view::{DepthViews, find_segmented};
use super::frame::Frame;
use crate::body::Body;
use crate::config::Config;
use crate::math::{Aabb, Pose, Vec3};

/// What a frame shows of the body. Cheap to copy; everything is in the working frame.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// The points that may be on the body.
    pub candidates: &'a Candidates,
    /// The frame, and its depth images as witnesses.
    pub views: DepthViews<'a>,
}

impl<'a> Observation<'a> {
    /// The frame.
    pub fn frame(&self) -> &'a Frame<'a> {
        self.views.frame
    }

    /// The working frame's origin in the world.
    pub fn origin(&self) -> Vec3 {
        self.views.origin
    }

    /// The same frame with other candidates.
    pub fn with(self, candidates: &'a Candidates) -> Self {
        Self { candidates, ..self }
    }
}

/// Where the body is expected when a frame comes.
#[derive(Clone, Copy, Debug)]
pub struct Expectation<'a> {
    /// The body.
    pub body: &'a Body,
    /// Its expected poses, working frame.
    pub poses: &'a [Pose],
    /// The working frame's origin in the world.
    pub origin: Vec3,
    /// No frame came before this one: the pose was set for it.
    pub first: bool,
    /// For how many frames the body has been searched; `None` while it is not.
    pub searched: Option<usize>,
}

/// Keeps what is learnt of the scene, and the candidates of the current frame.
#[derive(Debug, Default)]
pub struct Observer {
    backgrounds: Backgrounds,
    segmented: Vec<bool>,
    candidates: Candidates,
}

impl Observer {
    /// Forgets scene and candidates.
    pub fn clear(&mut self) {
        self.candidates = Candidates::default();
        self.backgrounds.clear();
    }

    /// Step 1 (K06 IV-B.1): learns the background, and keeps the points in the enlarged box of the whole body.
    pub fn observe(&mut self, frame: &Frame, expected: Expectation, config: &Config) {
        find_segmented(frame, &mut self.segmented);
        let bounds = body_box(expected.body, expected.poses, config.body_box_margin);
        if config.background {
            self.backgrounds.learn_around(frame, expected, &bounds);
        }
        self.gather(frame, expected.origin, &bounds, config);
    }

    /// The candidates in another box.
    pub fn gather(&mut self, frame: &Frame, origin: Vec3, bounds: &Aabb, config: &Config) {
        self.candidates.gather(frame, origin, bounds, &self.backgrounds, config);
    }

    /// What was observed of `frame`.
    pub fn seen<'a>(&'a self, frame: &'a Frame<'a>, origin: Vec3) -> Observation<'a> {
        let views = DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin };
        Observation { candidates: &self.candidates, views }
    }

    /// Whether depth cameras that have been there gave no image this time: no sign that the body went.
    pub fn silent(&self, frame: &Frame) -> bool {
        frame.images.is_empty() && !self.backgrounds.is_empty()
    }

    /// The candidates of the last frame.
    pub fn candidates(&self) -> &Candidates {
        &self.candidates
    }
}
