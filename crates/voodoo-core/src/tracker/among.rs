//! A tracker as one of several: each has its share of every frame, and a lost body is looked for by those who know them all.

use super::Tracker;
use super::estimate::{Estimate, Status};
use crate::detect::Detection;
use crate::math::Pose;
use crate::observation::frame::Frame;
use crate::observation::share::Share;
use crate::sizes::Start;

impl Tracker {
    /// The pose at the next instant by its share of a frame, which was checked.
    pub(crate) fn step_among(&mut self, frame: &Frame, share: Share) -> &Estimate {
        if self.is_started() {
            self.follow(frame, Some(share));
        }
        &self.estimate
    }

    /// Starts where a detector saw somebody, in their sizes or with `known` in those that the body has. Whether they are there.
    pub(crate) fn begin(&mut self, frame: &Frame, share: Share, detection: &Detection, known: bool) -> bool {
        let Some((body, poses)) = self.relocalizer.placed(&self.model, detection, known) else { return false };
        self.restart(body, poses, !known);
        self.assessor.doubt_pose();
        if !known {
            self.sizes.restart(&self.model, Start::Detected, &self.config);
        }
        self.follow(frame, Some(share));
        !matches!(self.estimate.status, Status::Lost | Status::Searching)
    }

    /// The poses expected at a time to come, world frame; none without a pose.
    pub(crate) fn expect(&self, stamp: f64, expected: &mut Vec<Pose>) {
        expected.clear();
        if self.is_started() {
            self.motion.expect(&self.model.body, stamp, self.config.prediction, expected);
        }
    }
}
