//! The tracker: `step` names the method.

mod assess;
mod edits;
pub mod estimate;
mod queries;
mod report;
mod start;

use crate::body::{Body, Model};
use crate::config::Config;
use crate::error::TrackError;
use crate::fit::{Fit, Motion, Setting};
use crate::hypotheses::Hypotheses;
use crate::math::{Pose, Vec3};
use crate::observation::candidates::body_box;
use crate::observation::frame::Frame;
use crate::observation::observer::{Expectation, Observer};
use crate::observation::share::Share;
use crate::relocalize::{Relocalizer, Sighting};
use crate::sizes::{Reliance, Sizes, Start};
use assess::Assessor;
use estimate::{Estimate, Status};

/// Follows one body through frames.
#[derive(Debug)]
pub struct Tracker {
    config: Config,
    model: Model,
    motion: Motion,
    observer: Observer,
    fit: Fit,
    hypotheses: Hypotheses,
    relocalizer: Relocalizer,
    sizes: Sizes,
    assessor: Assessor,
    estimate: Estimate,
}

impl Tracker {
    /// A tracker of `body`. It has no pose until [`Tracker::reset`].
    pub fn new(body: Body, config: Config) -> Result<Self, TrackError> {
        Ok(Self {
            model: Model::new(body),
            motion: Motion::default(),
            observer: Observer::default(),
            fit: Fit::new(&config)?,
            hypotheses: Hypotheses::default(),
            relocalizer: Relocalizer::default(),
            sizes: Sizes::default(),
            assessor: Assessor::default(),
            estimate: Estimate::default(),
            config,
        })
    }

    /// Sets the pose, and with `fit_sizes` the sizes, from positions of named sites (index of the site, world position);
    /// sizes are fitted from those the body was given in, not from those of an earlier reset. Time may start anew afterwards.
    /// The tracker is unchanged on error.
    pub fn reset(&mut self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<&Estimate, TrackError> {
        let (body, poses) = self.model.fit(positions, fit_sizes)?;
        self.restart(body, poses, fit_sizes);
        Ok(&self.estimate)
    }

    /// Sets the pose of every limb directly.
    pub fn reset_pose(&mut self, world_from_limb: &[Pose]) -> Result<&Estimate, TrackError> {
        let count = self.model.body.limbs().len();
        if world_from_limb.len() != count || !world_from_limb.iter().all(Pose::is_finite) {
            return Err(TrackError::measurement(
                "world_from_limb",
                "one finite pose a limb",
                format!("{} pose(s) for {count} limbs", world_from_limb.len()),
            ));
        }
        self.restart(self.model.body.clone(), world_from_limb.to_vec(), false);
        Ok(&self.estimate)
    }

    fn restart(&mut self, body: Body, world_from_limb: Vec<Pose>, fit_sizes: bool) {
        self.model.adopt(body);
        self.motion.restart(world_from_limb);
        self.observer.clear();
        self.fit.clear();
        self.hypotheses.restart(&self.model);
        self.relocalizer.restart(&self.model, &self.motion.poses);
        let start = if fit_sizes { Start::Positions } else { Start::SizesKnown };
        self.sizes.restart(&self.model, start, &self.config);
        self.assessor.trust_pose();
        self.report(f64::NAN, 0);
    }

    /// The pose at the next instant (K06 IV-B). On error the tracker is as before.
    pub fn step(&mut self, frame: &Frame) -> Result<&Estimate, TrackError> {
        self.check(frame)?;
        if self.is_started() {
            self.verify_start(frame);
            self.follow(frame, None)
        } else {
            self.search(frame)
        }
        Ok(&self.estimate)
    }

    /// The pose at the next instant (K06 IV-B), by all of a frame or by its `share` of it.
    fn follow(&mut self, frame: &Frame, share: Option<Share>) {
        let Self { config, model, motion, observer, fit, hypotheses, relocalizer, sizes, assessor, .. } = self;
        let schedule = fit.schedule(config);
        let known = motion.stamp.is_some();
        // Where the body is expected, and what the frame shows there (1).
        let time_scale = motion.advance(&model.body, frame.stamp, config.prediction, schedule.whole_body);
        let searched = relocalizer.searched().filter(|_| config.relocalization);
        let Motion { poses, previous, predicted, origin, .. } = motion;
        let own = relocalizer.own();
        let expected = Expectation { body: &model.body, poses, origin: *origin, first: !known, searched, own };
        match share {
            None => observer.observe(frame, expected, config),
            Some(share) => observer.observe_share(frame, expected, share, config),
        }
        let setting = Setting { config, seen: observer.seen(frame, *origin), previous, time_scale };
        // Sizes from the first frame, then warm start and the ICP steps (2 to 7).
        let mut steps = 0;
        if sizes.wait_for_pose() {
            steps += fit.run(setting.of(model), predicted, poses);
        }
        sizes.initialise(setting, model, poses, fit);
        steps += fit.run(setting.of(model), predicted, poses);
        // Other configurations of arms and legs.
        if schedule.whole_body && known {
            let lost = assessor.status() == Status::Lost;
            let (root, doubtful) = (poses[0].translation + *origin, assessor.doubts());
            match share {
                None => relocalizer.look(frame, root, doubtful, lost),
                Some(share) => relocalizer.look_at_share(frame, share, root, lost),
            }
        }
        if config.hypotheses && schedule.whole_body && known {
            steps += hypotheses.improve(setting.of(model), fit, poses, predicted, relocalizer.detection());
        }
        // Sizes that follow what this frame shows.
        let lost = assessor.status() == Status::Lost;
        let reliance = Reliance { lost, girths: schedule.whole_body, limb: |limb| assessor.relied_on(limb) };
        sizes.refine(setting, model, poses, predicted, fit, reliance);
        // What all that is worth.
        assessor.assess(setting.of(model), fit.matched(poses));
        motion.commit(frame.stamp);
        let relocalizes = self.config.relocalization && schedule.whole_body;
        if relocalizes && self.relocalize(frame, known, share.is_some()) {
            return self.follow(frame, share);
        }
        self.remember();
        self.report(frame.stamp, steps);
        let lost = self.estimate.status == Status::Lost;
        if self.relocalizer.nobody(frame.stamp, lost) {
            self.stop(frame.stamp);
        }
    }

    /// The pose at the next instant by its share of a frame, which was checked.
    pub(crate) fn step_among(&mut self, frame: &Frame, share: Share) -> &Estimate {
        if self.is_started() {
            self.follow(frame, Some(share));
        }
        &self.estimate
    }

    /// Refuses what cannot be used, before anything changes.
    fn check(&self, frame: &Frame) -> Result<(), TrackError> {
        if !self.is_started() && !self.relocalizer.finds(&self.model.body) {
            return Err(TrackError::NotInitialised);
        }
        frame.check(&self.model.body, self.motion.stamp)
    }

    /// Remembers a tracked body; looks for a lost one, unless it is one `among` several, and takes it where it is found. A track
    /// that is not `known` for long starts anew instead, in this frame: whether it does.
    fn relocalize(&mut self, frame: &Frame, known: bool, among: bool) -> bool {
        let lost = self.assessor.status() == Status::Lost;
        if known && self.relocalizer.detection().is_some() {
            let world_from_limb: Vec<Pose> = self.motion.world_from_limb().collect();
            if self.relocalizer.elsewhere(&self.model.body, &world_from_limb, lost, among)
                && self.move_to_detection(frame)
            {
                // What was learnt of sizes and scene was learnt in the wrong place.
                return !among && self.relocalizer.young(frame.stamp) && self.restart_at_detection();
            }
        }
        if among || !self.relocalizer.observe(self.sighting(frame), &self.motion.poses) {
            return false;
        }
        let Self { config, model, motion, observer, fit, relocalizer, .. } = self;
        let seen = observer.seen(frame, motion.origin);
        let setting = Setting { config, seen, previous: &[], time_scale: 1.0 };
        let place = relocalizer.search(setting.of(model), fit, &motion.poses);
        let found =
            place.map(|place| motion.predicted.clone_from_slice(place)).is_some() && self.move_to_predicted(frame);
        let sighting = self.sighting(frame);
        if self.relocalizer.conclude(found, sighting, &self.motion.poses) {
            self.assessor.give_up();
        }
        false
    }

    /// Moves the body to where a detector sees it; whether it is there now.
    fn move_to_detection(&mut self, frame: &Frame) -> bool {
        let Self { config, model, motion, observer, fit, relocalizer, assessor, .. } = self;
        let learnt = observer.release(frame, relocalizer.own());
        let seen = observer.seen(frame, motion.origin);
        let setting = Setting { config, seen, previous: &[], time_scale: 1.0 };
        let lost = assessor.status() == Status::Lost;
        let place = relocalizer.detected(setting.of(model), fit, &motion.poses, lost);
        let better = place.map(|place| motion.predicted.clone_from_slice(place)).is_some();
        let moved = better && self.move_to_predicted(frame);
        if !moved {
            self.observer.restore(frame, self.relocalizer.own(), &learnt);
        }
        moved
    }

    /// Moves the body to another place, the predicted one, if it is not lost there; whether it is there now.
    fn move_to_predicted(&mut self, frame: &Frame) -> bool {
        let Motion { poses, predicted, .. } = &mut self.motion;
        std::mem::swap(poses, predicted);
        self.settle(frame);
        if self.assessor.status() != Status::Lost {
            // Nothing is known of how it moves.
            self.motion.forget();
            return true;
        }
        let Motion { poses, predicted, .. } = &mut self.motion;
        std::mem::swap(poses, predicted);
        self.settle(frame);
        false
    }

    /// Matches and assesses this frame for other poses.
    fn settle(&mut self, frame: &Frame) {
        let Self { config, model, motion: Motion { poses, previous, origin, .. }, observer, fit, assessor, .. } = self;
        observer.gather(frame, *origin, &body_box(&model.body, poses, config.body_box_margin), config);
        let setting = Setting { config, seen: observer.seen(frame, *origin), previous, time_scale: 1.0 };
        fit.match_all(setting.of(model), poses, config.max_steps);
        assessor.moved();
        assessor.assess(setting.of(model), fit.matched(poses));
    }

    /// What this frame said of the body.
    fn sighting(&self, frame: &Frame) -> Sighting {
        let status = self.assessor.status();
        Sighting {
            stamp: frame.stamp,
            lost: status == Status::Lost,
            tracked: status == Status::Tracking,
            silent: self.observer.silent(frame),
        }
    }

    /// Remembers where arms and legs end.
    fn remember(&mut self) {
        let Self { model, motion, hypotheses, assessor, .. } = self;
        hypotheses.remember(model, motion, assessor.status() == Status::Lost, |limb| assessor.relied_on(limb));
    }

    fn report(&mut self, stamp: f64, steps: usize) {
        let Self { model, motion, observer, fit, assessor, estimate, .. } = self;
        estimate.fill(&model.body, motion, fit.correspondences(), observer.candidates());
        (estimate.stamp, estimate.steps) = (stamp, steps);
        assessor.report_status(model, estimate);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::{before_wall, farthest, moved, put_board, standing, with_frame};

    /// A tracker that has followed the standing body for three frames.
    fn tracking() -> (Tracker, Vec<u16>) {
        let (model, poses) = standing();
        let pixels = before_wall(&model.body, &poses);
        let mut tracker = Tracker::new(model.body, Config::default()).unwrap();
        tracker.reset_pose(&poses).unwrap();
        for frame in 0..3 {
            show(&mut tracker, &pixels, frame);
        }
        (tracker, pixels)
    }

    /// Shows a frame; the status.
    fn show(tracker: &mut Tracker, pixels: &[u16], frame: usize) -> Status {
        with_frame(pixels, frame as f64 / 30.0, |frame| tracker.step(frame).unwrap().status)
    }

    #[test]
    fn a_refused_frame_leaves_every_part_as_it_was() {
        let (mut tracker, pixels) = tracking();
        let before = format!("{tracker:?}");
        assert!(with_frame(&pixels, 0.0, |frame| tracker.step(frame).is_err()), "time ran backwards");
        assert_eq!(format!("{tracker:?}"), before);
        show(&mut tracker, &pixels, 3);
        assert_ne!(format!("{tracker:?}"), before);
    }

    #[test]
    fn edits_keep_the_track() {
        type Edit = fn(&mut Tracker);
        let edits: [Edit; 4] = [
            |tracker| tracker.scale(1.02).unwrap(),
            |tracker| tracker.remove_limb("l_hand").unwrap(),
            |tracker| {
                let shape = tracker.body().limbs()[tracker.body().limb_index("r_calf").unwrap()].shape;
                let (a, b) = (1.1 * shape.a0(), 1.1 * shape.b0());
                let thicker = crate::TaperedEllipticCylinder::new(shape.length(), a, b, a, b).unwrap();
                tracker.set_shape("r_calf", thicker).unwrap();
            },
            |tracker| {
                let hand = &tracker.body().limbs()[tracker.body().limb_index("r_hand").unwrap()];
                let (shape, mut joint) = (hand.shape, hand.parent.as_ref().unwrap().1.clone());
                joint.parent_from_joint.translation = Vec3::Z * shape.length();
                tracker.add_limb("held", "r_hand", shape, joint, Vec::new()).unwrap();
            },
        ];
        for (number, edit) in edits.into_iter().enumerate() {
            let (mut tracker, _) = tracking();
            let before = tracker.estimate().clone();
            edit(&mut tracker);
            let after = tracker.estimate().clone();
            assert_eq!((after.status, after.stamp, after.steps), (before.status, before.stamp, 0), "edit {number}");
            let limbs = tracker.body().limbs().len();
            assert!(after.world_from_limb.len() == limbs && after.limb_status.len() == limbs, "edit {number}");
            let (then, now) = (&before.world_from_limb[0], &after.world_from_limb[0]);
            assert!(then.translation.distance(now.translation) < 0.01);
            assert!(after.joint_gaps.iter().all(|gap| *gap < 1e-9), "edit {number}: {:?}", after.joint_gaps);
            let pixels = before_wall(tracker.body(), &after.world_from_limb);
            let status = show(&mut tracker, &pixels, 3);
            assert_eq!(status, Status::Tracking, "edit {number}");
            let off = farthest(&tracker.estimate().world_from_limb, &after.world_from_limb);
            assert!(off < 0.02, "edit {number}: {off} m");
        }
    }

    #[test]
    fn a_lost_body_is_found_beside_its_place_and_no_board_of_its_size_is() {
        let (mut tracker, empty) = tracking();
        let (model, poses) = standing();
        let nothing = vec![4500; empty.len()];
        let aside = moved(&poses, 0.7 * Vec3::X);
        let person = before_wall(&model.body, &aside);
        for frame in 3..8 {
            assert_eq!(show(&mut tracker, &nothing, frame), Status::Lost);
        }
        for (frame, width) in [0.15, 0.2, 0.25].into_iter().flat_map(|width| [width; 3]).enumerate() {
            let mut board = nothing.clone();
            put_board(&mut board, Vec3::new(-0.7, 0.1, 2.6), [width, 0.85]);
            assert_eq!(show(&mut tracker, &board, 8 + frame), Status::Lost, "{width} m wide");
            let moved = poses[0].translation.distance(tracker.estimate().world_from_limb[0].translation);
            assert!(moved < 0.1, "{width} m wide: moved by {moved} m");
        }
        for frame in 20..30 {
            show(&mut tracker, &person, frame);
        }
        let off = farthest(&tracker.estimate().world_from_limb, &aside);
        assert!(tracker.estimate().status == Status::Tracking && off < 0.05, "{off} m");
    }
}
