//! The tracker: `step` names the method.

mod assess;
mod edits;
pub mod estimate;
mod queries;
mod report;

use crate::body::{Body, Model};
use crate::config::Config;
use crate::error::TrackError;
use crate::fit::{Fit, Motion, Setting};
use crate::hypotheses::Hypotheses;
use crate::math::{Pose, Vec3};
use crate::observation::candidates::body_box;
use crate::observation::frame::Frame;
use crate::observation::observer::{Expectation, Observer};
use crate::relocalize::{Relocalizer, Sighting};
use crate::sizes::{Reliance, Sizes};
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
        self.sizes.restart(&self.model, fit_sizes, &self.config);
        self.assessor.trust_pose();
        self.report(f64::NAN, 0);
    }

    /// The pose at the next instant (K06 IV-B). On error the tracker is as before.
    pub fn step(&mut self, frame: &Frame) -> Result<&Estimate, TrackError> {
        self.check(frame)?;
        let Self { config, model, motion, observer, fit, hypotheses, relocalizer, sizes, assessor, .. } = self;
        let schedule = fit.schedule(config);
        let known = motion.stamp.is_some();
        // Where the body is expected, and what the frame shows there (1).
        let time_scale = motion.advance(&model.body, frame.stamp, config.prediction, schedule.whole_body);
        let searched = relocalizer.searched().filter(|_| config.relocalization);
        let Motion { poses, previous, predicted, origin, .. } = motion;
        let expected = Expectation { body: &model.body, poses, origin: *origin, first: !known, searched };
        observer.observe(frame, expected, config);
        let setting = Setting { config, seen: observer.seen(frame, *origin), previous, time_scale };
        // Sizes from the first frame, then warm start and the ICP steps (2 to 7).
        sizes.initialise(setting, model, poses, fit);
        let mut steps = fit.run(setting.of(model), predicted, poses);
        // Other configurations of arms and legs.
        if config.hypotheses && schedule.whole_body && known {
            steps += hypotheses.improve(setting.of(model), fit, poses, predicted);
        }
        // Sizes that follow what this frame shows.
        let lost = assessor.status() == Status::Lost;
        let reliance = Reliance { lost, girths: schedule.whole_body, limb: |limb| assessor.relied_on(limb) };
        sizes.refine(setting, model, poses, predicted, fit, reliance);
        // What all that is worth.
        assessor.assess(setting.of(model), fit.matched(poses));
        motion.commit(frame.stamp);
        if self.config.relocalization && schedule.whole_body {
            self.relocalize(frame);
        }
        self.remember();
        self.report(frame.stamp, steps);
        Ok(&self.estimate)
    }

    /// Refuses what cannot be used, before anything changes.
    fn check(&self, frame: &Frame) -> Result<(), TrackError> {
        if !self.is_started() {
            return Err(TrackError::NotInitialised);
        }
        frame.check(&self.model.body, self.motion.stamp)
    }

    /// Remembers a tracked body; looks for a lost one, and takes it where it is found.
    fn relocalize(&mut self, frame: &Frame) {
        if !self.relocalizer.observe(self.sighting(frame), &self.motion.poses) {
            return;
        }
        let Self { config, model, motion, observer, fit, relocalizer, .. } = self;
        let seen = observer.seen(frame, motion.origin);
        let setting = Setting { config, seen, previous: &[], time_scale: 1.0 };
        let place = relocalizer.search(setting.of(model), fit, &motion.poses).map(<[Pose]>::to_vec);
        let found = place.is_some_and(|place| self.move_to(frame, place));
        let sighting = self.sighting(frame);
        if self.relocalizer.conclude(found, sighting, &self.motion.poses) {
            self.assessor.give_up();
        }
    }

    /// Moves the body to another place, if it is not lost there; whether it is there now.
    fn move_to(&mut self, frame: &Frame, place: Vec<Pose>) -> bool {
        let before = std::mem::replace(&mut self.motion.poses, place);
        self.settle(frame);
        if self.assessor.status() != Status::Lost {
            // Nothing is known of how it moves.
            self.motion.forget();
            return true;
        }
        self.motion.poses = before;
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
