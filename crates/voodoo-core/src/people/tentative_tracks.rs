//! Tentative tracks: persons that were detected and are not tracked yet.

use std::cmp::Reverse;

use crate::detect::{Detection, PlacedDetection};
use crate::math::Vec3;
use crate::observation::frame::{DetectedPerson, PositionRelation};
use crate::relocalize::ENOUGH_ODDS;

/// Standard deviation of a measured position with weight 1, meters.
const UNIT_SIGMA: f64 = 0.1;
/// Amount subtracted from the log odds of every detection, because the errors of successive detections of a static object are
/// correlated.
const DETECTION_COST: f64 = 1.0;
/// Detections within this distance of the last position are of the same person, meters; farther ones are of another.
pub(super) const SAME_PERSON: f64 = 0.5;
/// A tentative track without a detection for this long is deleted, seconds.
const FORGOTTEN: f64 = 0.5;

/// Detections of a possible person at one position.
#[derive(Debug)]
pub(super) struct TentativeTrack {
    pub(super) place: Vec3,
    pub(super) detection: Detection,
    /// Number of the image with the detection.
    pub(super) image: usize,
    /// Measured positions of sites, for a start at a detection that came with the frame; empty for one in an image.
    pub(super) positions: Vec<PositionRelation>,
    /// Whether a detection of the frame with this stamp came with it.
    given: bool,
    /// Sum of the log odds of its detections that it is a person, at least 0.
    pub(super) log_odds: f64,
    stamp: f64,
}

impl TentativeTrack {
    /// Returns the track of a person who was detected for the first time, in the image with this number.
    pub(super) fn in_image(stamp: f64, placed: PlacedDetection, image: usize) -> Self {
        let PlacedDetection { root: place, detection, .. } = placed;
        Self { place, log_odds: detection.person, detection, image, positions: Vec::new(), given: false, stamp }
    }

    /// Returns the track of a person at this position who came with the frame.
    pub(super) fn given(stamp: f64, place: Vec3, person: &DetectedPerson) -> Self {
        let (detection, positions) = (Detection::default(), person.positions.to_vec());
        Self { place, log_odds: person.person, detection, image: 0, positions, given: true, stamp }
    }

    /// Median standard deviation of the joints that are measured or visible, meters; infinite without any.
    fn sigma(&self) -> f64 {
        let given = self.positions.iter().map(|relation| UNIT_SIGMA / relation.weight.sqrt());
        let visible = self.detection.joints.iter().flatten().filter(|joint| joint.visible > 0.5);
        let mut sigmas: Vec<f64> = given.chain(visible.map(|joint| joint.sigma)).collect();
        sigmas.sort_by(f64::total_cmp);
        sigmas.get(sigmas.len() / 2).copied().unwrap_or(f64::INFINITY)
    }
}

/// All tentative tracks.
#[derive(Debug, Default)]
pub(super) struct TentativeTracks {
    tracks: Vec<TentativeTrack>,
}

impl TentativeTracks {
    /// Deletes tracks without a recent detection.
    pub(super) fn prune(&mut self, stamp: f64) {
        self.tracks.retain(|track| stamp - track.stamp < FORGOTTEN);
    }

    /// Updates with a detection, from whose log odds `static_odds` are subtracted if the object has been there from the start.
    pub(super) fn update(&mut self, mut found: TentativeTrack, static_odds: Option<f64>) {
        found.log_odds -= static_odds.unwrap_or(DETECTION_COST);
        let near = |track: &mut TentativeTrack| track.place.distance(found.place) < SAME_PERSON;
        let mut before = self.tracks.extract_if(.., near).fold(None, |first, track| first.or(Some(track)));
        if let Some(mut first) = before.take_if(|before| before.stamp == found.stamp) {
            // Of one frame the most confident detection in an image counts, which comes first. With one that came with the frame,
            // the surer one tells that it is a person, and the more precise one where.
            if first.given {
                let sum = first.log_odds.max(found.log_odds);
                first = if found.sigma() < first.sigma() { found } else { first };
                (first.log_odds, first.given) = (sum, true);
            }
            self.tracks.push(first);
            return;
        }
        found.log_odds = (before.map_or(0.0, |before| before.log_odds) + found.log_odds).max(0.0);
        self.tracks.push(found);
    }

    /// Returns the tracks that were detected in the frame with this stamp.
    pub(super) fn updated_at(&self, stamp: f64) -> impl Iterator<Item = &TentativeTrack> {
        self.tracks.iter().filter(move |track| track.stamp == stamp)
    }

    /// Deletes the tracks that coincide with one of `others`.
    pub(super) fn discard(&mut self, others: &[TentativeTrack]) {
        let same = |a: &TentativeTrack, b: &TentativeTrack| a.place.distance(b.place) < SAME_PERSON;
        self.tracks.retain(|track| !others.iter().any(|other| same(track, other)));
    }

    /// Removes and returns the tracks that were detected in the frame with this stamp and are confirmed: those that came with the
    /// frame first, then those who fill most of the image.
    pub(super) fn take_confirmed(&mut self, stamp: f64) -> Vec<TentativeTrack> {
        let sure = |track: &mut TentativeTrack| track.stamp == stamp && track.log_odds >= ENOUGH_ODDS;
        let mut confirmed: Vec<TentativeTrack> = self.tracks.extract_if(.., sure).collect();
        confirmed.sort_by_key(|track| (!track.given, Reverse(track.detection.pixels.len())));
        confirmed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::DetectedJoint;

    /// Whether the start is by the measured positions, and the log odds, where one frame has measured positions and a joint in an
    /// image, with a standard deviation and log odds each.
    fn kept(given: [f64; 2], in_image: [f64; 2]) -> (bool, f64) {
        let weight = (UNIT_SIGMA / given[0]).powi(2);
        let positions = [PositionRelation { site: 0, position: Vec3::ZERO, weight, bias: 0.0, source: 0 }];
        let mut tracks = TentativeTracks::default();
        let person = DetectedPerson { positions: &positions, person: given[1] };
        tracks.update(TentativeTrack::given(0.0, Vec3::ZERO, &person), Some(0.0));
        let joint = DetectedJoint { position: Vec3::ZERO, sigma: in_image[0], visible: 1.0 };
        let detection = Detection::new(vec![Some(joint), None], in_image[1]);
        let placed = PlacedDetection { index: 0, root: Vec3::X * 0.1, detection };
        tracks.update(TentativeTrack::in_image(0.0, placed, 0), Some(0.0));
        let confirmed = tracks.take_confirmed(0.0);
        assert_eq!(confirmed.len(), 1);
        (!confirmed[0].positions.is_empty(), confirmed[0].log_odds)
    }

    #[test]
    fn the_more_precise_of_two_detections_of_one_frame_is_the_start_and_the_surer_one_tells_that_it_is_a_person() {
        for odds in [[9.0, 1.0], [1.0, 9.0]] {
            assert_eq!(kept([0.07, odds[0]], [0.02, odds[1]]), (false, 9.0));
            assert_eq!(kept([0.01, odds[0]], [0.02, odds[1]]), (true, 9.0));
        }
    }
}
