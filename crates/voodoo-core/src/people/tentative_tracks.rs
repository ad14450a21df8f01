//! Who was seen by a detector and is not tracked yet.

use crate::detect::{Detection, PlacedDetection};
use crate::math::Vec3;
use crate::relocalize::{DETECTION_COST, ENOUGH_ODDS, SAME_PERSON};

/// The same of what has stood there from the start: plants get up to 4, persons who show more than half 8.
const STILL_COSTS: f64 = 5.0;
/// Who was not seen for so long is forgotten, seconds.
const FORGOTTEN: f64 = 0.5;

/// Somebody at a place.
#[derive(Debug)]
pub(super) struct TentativeTrack {
    pub(super) place: Vec3,
    pub(super) detection: Detection,
    /// The image that shows it.
    pub(super) image: usize,
    sum: f64,
    stamp: f64,
}

/// All of them.
#[derive(Debug, Default)]
pub(super) struct TentativeTracks {
    tracks: Vec<TentativeTrack>,
}

impl TentativeTracks {
    /// Forgets who was not seen lately.
    pub(super) fn prune(&mut self, stamp: f64) {
        self.tracks.retain(|track| stamp - track.stamp < FORGOTTEN);
    }

    /// Takes a look in; `still`: what is seen has stood there all the time.
    pub(super) fn update(&mut self, stamp: f64, placed: PlacedDetection, image: usize, still: bool) {
        let PlacedDetection { root: place, detection, .. } = placed;
        let gain = detection.person - if still { STILL_COSTS } else { DETECTION_COST };
        let near = |track: &&mut TentativeTrack| track.place.distance(place) < SAME_PERSON;
        let before = self.tracks.iter_mut().find(near).map(|track| track.sum);
        self.tracks.retain(|track| track.place.distance(place) >= SAME_PERSON);
        let sum = (before.unwrap_or(0.0) + gain).max(0.0);
        self.tracks.push(TentativeTrack { place, detection, image, sum, stamp });
    }

    /// Those seen in the frame of this time.
    pub(super) fn updated_at(&self, stamp: f64) -> impl Iterator<Item = &TentativeTrack> {
        self.tracks.iter().filter(move |track| track.stamp == stamp)
    }

    /// Forgets those who are somebody else of these.
    pub(super) fn discard(&mut self, others: &[TentativeTrack]) {
        let same = |a: &TentativeTrack, b: &TentativeTrack| a.place.distance(b.place) < SAME_PERSON;
        self.tracks.retain(|track| !others.iter().any(|other| same(track, other)));
    }

    /// Takes out those seen in the frame of this time who are persons for sure.
    pub(super) fn take_confirmed(&mut self, stamp: f64) -> Vec<TentativeTrack> {
        let sure = |track: &mut TentativeTrack| track.stamp == stamp && track.sum >= ENOUGH_ODDS;
        self.tracks.extract_if(.., sure).collect()
    }
}
