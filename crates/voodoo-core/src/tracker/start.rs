//! How a track begins: where a detector sees somebody, and anew where it was begun wrongly.

use super::Tracker;
use super::estimate::{Estimate, Status};
use crate::detect::Detection;
use crate::fit::Setting;
use crate::observation::frame::Frame;
use crate::observation::share::Share;
use crate::sizes::Start;

impl Tracker {
    /// In the first frame after a reset: where a detector sees the person elsewhere or the other way round, and the frame agrees,
    /// the start was given wrongly.
    pub(super) fn verify_start(&mut self, frame: &Frame) {
        let Self { config, model, motion, observer, fit, relocalizer, .. } = self;
        if motion.stamp.is_some() || !config.relocalization || !fit.schedule(config).whole_body {
            return;
        }
        relocalizer.look(frame, motion.poses[0].translation, false, false);
        if relocalizer.elsewhere(&model.body, &motion.poses, false, false) {
            observer.face(frame);
            let seen = observer.seen(frame, motion.origin);
            let setting = Setting { config, seen, previous: &[], time_scale: 1.0 };
            if relocalizer.detected(setting.of(model), fit, &motion.poses, false).is_some() {
                self.restart_at_detection();
            }
        }
    }

    /// Starts anew where a detector sees the body, in the sizes it was set in; whether it could.
    pub(super) fn restart_at_detection(&mut self) -> bool {
        let body = self.sizes.as_set().unwrap_or(&self.model.body).clone();
        let Some(poses) = self.relocalizer.posed(&body) else { return false };
        let (known, itself) = (self.sizes.known(), self.relocalizer.found_itself());
        self.restart(body, poses, !known);
        self.relocalizer.take_note_of_start(itself);
        if !known {
            self.sizes.restart(&self.model, Start::Detected, &self.config);
        }
        true
    }

    /// Looks for a person, and follows the one that is found.
    pub(super) fn search(&mut self, frame: &Frame) {
        if let Some((body, poses)) = self.relocalizer.first(frame, &self.model) {
            self.restart(body, poses, true);
            self.assessor.doubt_pose();
            self.relocalizer.take_note_of_start(true);
            self.sizes.restart(&self.model, Start::Detected, &self.config);
            self.follow(frame, None);
            if !matches!(self.estimate.status, Status::Lost | Status::Searching) {
                return;
            }
        }
        self.stop(frame.stamp);
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

    /// There is nobody: from the next frame on somebody is looked for.
    pub(super) fn stop(&mut self, stamp: f64) {
        self.motion.poses.clear();
        self.motion.stamp = Some(stamp);
        self.estimate = Estimate { stamp, ..Estimate::default() };
    }
}
