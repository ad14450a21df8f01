//! One of several persons: their tracker, and what is stored while they are absent.

use super::clothes::Clothes;
use crate::Body;
use crate::config::Config;
use crate::detect::{Detect, Detected};
use crate::error::TrackError;
use crate::math::{Pose, Vec3};
use crate::observation::frame::Frame;
use crate::observation::ownership::OwnershipMask;
use crate::relocalize::{NEW_TRACK_AGE, distance_cost};
use crate::sizes::LengthEstimate;
use crate::tracker::BodyTracker;
use crate::tracker::estimate::Status;
use crate::visibility::EXPLAINED;

/// A lost person whose position is in view and not hidden becomes absent after this, seconds.
const LEAVES: f64 = 0.3;
/// A lost person who is mostly outside of all images becomes absent after this, seconds.
const OUTSIDE: f64 = 0.1;
/// A lost person who is hidden becomes absent after this, seconds.
const HIDDEN: f64 = 2.0;
/// Shortest time between two updates of the clothes, seconds.
const CLOTHES_EVERY: f64 = 0.3;

/// A person, present or absent.
#[derive(Debug)]
pub(super) struct Person {
    pub(super) id: usize,
    pub(super) tracker: BodyTracker,
    pub(super) present: bool,
    /// Whether the person is the one of a [`crate::Tracker`], who is never deleted.
    pub(super) followed: bool,
    /// Whether the person stays present while lost, because the user said where they are.
    pub(super) stays: bool,
    /// Stamps of the first and of the last tracked frame, seconds.
    pub(super) created: f64,
    pub(super) last_tracked: f64,
    /// Stamp at which `place` was known, seconds: it follows the time by the probability that the root is there.
    pub(super) place_known: f64,
    /// Fraction of the time after which the lost person becomes absent, and the stamp up to which it was counted, seconds.
    absence: f64,
    counted: f64,
    /// Last tracked position of the root, world frame.
    pub(super) place: Vec3,
    /// The detected stature.
    pub(super) stature: LengthEstimate,
    /// Colors of their clothes.
    pub(super) clothes: Clothes,
    last_clothes: f64,
    /// Poses predicted for this frame, world frame.
    pub(super) expected: Vec<Pose>,
}

impl Person {
    pub(super) fn new(
        id: usize,
        body: Body,
        config: Config,
        detector: Option<Box<dyn Detect>>,
        stamp: f64,
    ) -> Result<Self, TrackError> {
        let mut tracker = BodyTracker::new(body, config)?;
        tracker.set_detector(detector);
        Ok(Self {
            id,
            tracker,
            present: false,
            followed: false,
            stays: false,
            created: stamp,
            last_tracked: stamp,
            place_known: stamp,
            absence: 0.0,
            counted: f64::NEG_INFINITY,
            place: Vec3::ZERO,
            stature: LengthEstimate::default(),
            clothes: Clothes::default(),
            last_clothes: f64::NEG_INFINITY,
            expected: Vec::new(),
        })
    }

    /// Whether the clothes have not been updated for a while.
    pub(super) fn are_clothes_due(&self, stamp: f64) -> bool {
        stamp - self.last_clothes >= CLOTHES_EVERY
    }

    /// Whether the person is present and not lost.
    pub(super) fn is_tracked(&self) -> bool {
        self.present && self.tracker.is_there()
    }

    /// Sets when the person was tracked last, and their place known: -infinity if they may be anywhere.
    pub(super) fn set_last_tracked(&mut self, stamp: f64) {
        (self.last_tracked, self.place_known) = (stamp, stamp);
    }

    /// Whether the person was seen first less than a second ago.
    pub(super) fn is_new(&self) -> bool {
        self.last_tracked - self.created < NEW_TRACK_AGE
    }

    /// Exchanges the track with that of another person: both keep their numbers, clothes and statures.
    pub(super) fn exchange_track(&mut self, other: &mut Self) {
        std::mem::swap(&mut self.tracker, &mut other.tracker);
        std::mem::swap(&mut self.place, &mut other.place);
    }

    /// Returns the cost of the person's being at a position, nats.
    pub(super) fn distance_cost(&self, place: Vec3, stamp: f64) -> f64 {
        distance_cost(self.place.distance(place), stamp - self.place_known)
    }

    /// Returns the cost of the detected stature for this person, nats: all sizes scale with the stature.
    pub(super) fn stature_cost(&self, detected: Detected) -> f64 {
        let Some([stature, sigma]) = detected.stature().filter(|_| self.stature.information > 0.0) else { return 0.0 };
        // The detector is trained for errors of a Laplace distribution.
        (stature.ln() - self.stature.mean).abs() * (2.0 / (1.0 / self.stature.information + sigma * sigma)).sqrt()
    }

    /// Updates the person after the tracker's step. A person who has been lost for too long becomes absent.
    pub(super) fn update(&mut self, frame: &Frame, ownership: OwnershipMask) {
        let estimate = self.tracker.estimate();
        if self.is_tracked() {
            self.last_tracked = frame.stamp;
            self.place = estimate.world_from_limb.first().map_or(self.place, |root| root.translation);
            let probability = estimate.limb_probability.first().map_or(0.0, |probability| probability.max(0.0));
            let elapsed = Some(frame.stamp - self.place_known).filter(|elapsed| (0.0..f64::INFINITY).contains(elapsed));
            self.place_known = frame.stamp - elapsed.map_or(0.0, |elapsed| (1.0 - probability) * elapsed);
            // Half the interval makes the updates of all persons coincide, so that they need a single picture.
            if frame.stamp - self.last_clothes >= 0.5 * CLOTHES_EVERY && !frame.colors.is_empty() {
                self.last_clothes = frame.stamp;
                if estimate.status == Status::Tracking {
                    let own = |image, pixel: usize| ownership.owners(image).get(pixel) == Some(&ownership.own);
                    self.clothes.observe(frame, self.tracker.body(), &estimate.world_from_limb, own);
                }
            }
            return;
        }
        self.present &= estimate.status != Status::Searching;
        if self.stays {
            return;
        }
        if self.last_tracked >= self.counted {
            (self.absence, self.counted) = (0.0, self.last_tracked);
        }
        self.absence += (frame.stamp - self.counted) / self.patience(frame);
        self.counted = frame.stamp;
        self.present &= self.absence < 1.0;
    }

    /// Returns the time after which the lost person becomes absent, seconds: by whether most of their sites are hidden, outside of
    /// the images, or neither.
    fn patience(&self, frame: &Frame) -> f64 {
        if frame.images.is_empty() {
            // A frame without depth images is no evidence that a person left.
            return HIDDEN;
        }
        let sites = &self.tracker.estimate().sites;
        let (mut hidden, mut outside) = (0, 0);
        for site in sites {
            let depths = || frame.images.iter().filter_map(|image| image.measured(*site));
            outside += usize::from(depths().next().is_none());
            hidden += usize::from(depths().any(|[z, place]| z > 0.0 && z < place - 2.0 * EXPLAINED));
        }
        match sites.len() / 2 {
            half if hidden > half => HIDDEN,
            half if outside > half => OUTSIDE,
            _ => LEAVES,
        }
    }
}
