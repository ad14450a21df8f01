//! Who was seen by a detector and is not tracked yet.

use crate::detect::{Detection, PlacedDetection};
use crate::math::Vec3;
use crate::relocalize::{ENOUGH_ODDS, LOOK_COSTS, SAME_PERSON};

/// The same of what has stood there from the start: plants get up to 4, persons who show more than half 8.
const STILL_COSTS: f64 = 5.0;
/// Who was not seen for so long is forgotten, seconds.
const FORGOTTEN: f64 = 0.5;

/// Somebody at a place.
#[derive(Debug)]
pub(super) struct Stranger {
    pub(super) place: Vec3,
    pub(super) detection: Detection,
    /// The image that shows it.
    pub(super) image: usize,
    sum: f64,
    stamp: f64,
}

/// All of them.
#[derive(Debug, Default)]
pub(super) struct Strangers {
    seen: Vec<Stranger>,
}

impl Strangers {
    /// Forgets who was not seen lately.
    pub(super) fn fade(&mut self, stamp: f64) {
        self.seen.retain(|stranger| stamp - stranger.stamp < FORGOTTEN);
    }

    /// Takes a look in; `still`: what is seen has stood there all the time.
    pub(super) fn note(&mut self, stamp: f64, placed: PlacedDetection, image: usize, still: bool) {
        let PlacedDetection { root: place, detection, .. } = placed;
        let gain = detection.person - if still { STILL_COSTS } else { LOOK_COSTS };
        let near = |stranger: &&mut Stranger| stranger.place.distance(place) < SAME_PERSON;
        let before = self.seen.iter_mut().find(near).map(|stranger| stranger.sum);
        self.seen.retain(|stranger| stranger.place.distance(place) >= SAME_PERSON);
        let sum = (before.unwrap_or(0.0) + gain).max(0.0);
        self.seen.push(Stranger { place, detection, image, sum, stamp });
    }

    /// Those seen in the frame of this time.
    pub(super) fn seen_at(&self, stamp: f64) -> impl Iterator<Item = &Stranger> {
        self.seen.iter().filter(move |stranger| stranger.stamp == stamp)
    }

    /// Forgets those who are somebody else of these.
    pub(super) fn leave_out(&mut self, others: &[Stranger]) {
        let same = |a: &Stranger, b: &Stranger| a.place.distance(b.place) < SAME_PERSON;
        self.seen.retain(|stranger| !others.iter().any(|other| same(stranger, other)));
    }

    /// Takes out those seen in the frame of this time who are persons for sure.
    pub(super) fn believed(&mut self, stamp: f64) -> Vec<Stranger> {
        let sure = |stranger: &mut Stranger| stranger.stamp == stamp && stranger.sum >= ENOUGH_ODDS;
        self.seen.extract_if(.., sure).collect()
    }
}
