//! One of several persons: their tracker, and what is remembered of them while they are away.

use super::clothes::Clothes;
use crate::config::Config;
use crate::detect::{Detect, Detected};
use crate::error::TrackError;
use crate::math::{Pose, Vec3};
use crate::observation::frame::Frame;
use crate::observation::ownership::OwnershipMask;
use crate::tracker::estimate::Status;
use crate::{Body, Tracker};

/// A lost person of whom nothing hides the place is gone after this, seconds.
const LEAVES: f64 = 0.3;
/// Who is mostly outside of all images is gone after this, seconds.
const OUTSIDE: f64 = 0.1;
/// Who is hidden is waited for so long, seconds.
const HIDDEN: f64 = 2.0;
/// Clothes are looked at this often at most, seconds.
const CLOTHES_EVERY: f64 = 0.3;
/// What is measured so much nearer than a place hides it, and so much farther shows that it is free, meters.
const HIDES: f64 = 0.08;

/// A person, there or away.
#[derive(Debug)]
pub(super) struct Person {
    pub(super) id: usize,
    pub(super) tracker: Tracker,
    pub(super) present: bool,
    /// When they came the first time, and were last seen, seconds.
    pub(super) created: f64,
    pub(super) last_tracked: f64,
    /// Root where last seen, world frame.
    pub(super) place: Vec3,
    /// Natural logarithm of their stature as the detector told it and its variance, the mean of all looks by what each is worth.
    stature: Option<[f64; 2]>,
    /// What they wear.
    pub(super) clothes: Clothes,
    last_clothes: f64,
    /// Poses expected in this frame, world frame.
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
        let mut tracker = Tracker::new(body, config)?;
        tracker.set_detector(detector);
        Ok(Self {
            id,
            tracker,
            present: false,
            created: stamp,
            last_tracked: stamp,
            place: Vec3::ZERO,
            stature: None,
            clothes: Clothes::default(),
            last_clothes: f64::NEG_INFINITY,
            expected: Vec::new(),
        })
    }

    /// Whether their clothes were not looked at for a while.
    pub(super) fn are_clothes_due(&self, stamp: f64) -> bool {
        stamp - self.last_clothes >= CLOTHES_EVERY
    }

    /// There, and not lost.
    pub(super) fn is_tracked(&self) -> bool {
        self.present && !matches!(self.tracker.estimate().status, Status::Lost | Status::Searching)
    }

    /// Takes the stature of a look in. What one look has wrong the next one has, too: the best says how sure all are.
    pub(super) fn update_stature(&mut self, detected: Detected) {
        let Some([log_stature, variance]) = stature(detected) else { return };
        self.stature = Some(self.stature.map_or([log_stature, variance], |[known, before]| {
            let gain = before / (before + variance);
            [known + gain * (log_stature - known), before.min(variance)]
        }));
    }

    /// What a detected person's stature speaks against being this one, nats.
    pub(super) fn stature_cost(&self, detected: Detected) -> f64 {
        let both = self.stature.zip(stature(detected));
        both.map_or(0.0, |([own, a], [other, b])| 0.5 * (other - own).powi(2) / (a + b))
    }

    /// Notes how they came out of a frame; they are away when they are lost for too long.
    pub(super) fn update(&mut self, frame: &Frame, ownership: OwnershipMask) {
        let estimate = self.tracker.estimate();
        if self.is_tracked() {
            self.last_tracked = frame.stamp;
            self.place = estimate.world_from_limb.first().map_or(self.place, |root| root.translation);
            // Looked at together, all need one picture.
            if frame.stamp - self.last_clothes >= 0.5 * CLOTHES_EVERY && !frame.colors.is_empty() {
                self.last_clothes = frame.stamp;
                if estimate.status == Status::Tracking {
                    let own = |image, pixel: usize| ownership.owners(image).get(pixel) == Some(&ownership.own);
                    self.clothes.observe(frame, self.tracker.body(), &estimate.world_from_limb, own);
                }
            }
            return;
        }
        let patience = match self.presence(frame, ownership) {
            Presence::Hidden => HIDDEN,
            Presence::Outside => OUTSIDE,
            Presence::Gone => LEAVES,
        };
        self.present &= estimate.status != Status::Searching && frame.stamp - self.last_tracked < patience;
    }

    /// What the images show of most of where they are thought to be.
    fn presence(&self, frame: &Frame, ownership: OwnershipMask) -> Presence {
        if frame.images.is_empty() {
            // Depth cameras that gave no image this time are no sign that anybody went.
            return if ownership.scene.is_empty() { Presence::Gone } else { Presence::Hidden };
        }
        let sites = &self.tracker.estimate().sites;
        let (mut hidden, mut outside) = (0, 0);
        for site in sites {
            let depths = || frame.images.iter().filter_map(|image| image.measured(*site));
            outside += usize::from(depths().next().is_none());
            hidden += usize::from(depths().any(|[z, place]| z > 0.0 && z < place - HIDES));
        }
        match sites.len() / 2 {
            half if hidden > half => Presence::Hidden,
            half if outside > half => Presence::Outside,
            _ => Presence::Gone,
        }
    }
}

/// Natural logarithm of a detected person's stature, and its variance; all sizes follow it.
fn stature(detected: Detected) -> Option<[f64; 2]> {
    let [length, sigma] = detected.length(detected.map.stature()?)?;
    Some([length.ln(), sigma * sigma])
}

/// Where somebody is who is not seen.
#[derive(Clone, Copy, Debug)]
enum Presence {
    Hidden,
    Outside,
    Gone,
}
