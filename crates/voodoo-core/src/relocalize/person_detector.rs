//! Detections of the tracked person, or of any person while there is none: for the start of a track, for recovery of a lost body,
//! and to verify a track.

use super::detection_check::ELSEWHERE;
use super::{Reasons, Relocalizer};
use crate::body::Body;
use crate::detect::{Detected, DetectionQuery, PlacedDetection, Surroundings};
use crate::math::Vec3;
use crate::observation::frame::{Frame, Ground};
use crate::observation::ownership::OwnershipMask;

impl Relocalizer {
    /// Drops the detection of this frame.
    pub(crate) fn forget(&mut self) {
        (self.detection, self.person_odds) = (None, None);
    }

    /// Returns the detection of this frame, if there is one.
    pub(crate) fn detected(&self) -> Option<Detected<'_>> {
        self.detection.as_ref().map(|detection| Detected { detection: &detection.detection, map: &self.detector.map })
    }

    /// Returns the index of the image and the pixels of the detection.
    pub(crate) fn own_pixels(&self) -> (usize, Vec<usize>) {
        let found = self.detection.as_ref();
        (self.image, found.map_or_else(Vec::new, |found| found.detection.pixels.clone()))
    }

    /// Records how the track was started: `auto_initialized` by the detector, whose detection tells the floor, or by the user.
    pub(crate) fn record_start(&mut self, auto_initialized: bool) {
        self.check.auto_initialized = auto_initialized;
        self.floor = self.detected().filter(|_| auto_initialized).and_then(floor_under);
    }

    /// Runs the detector on the owned part of a frame where that is due. `root` is the expected position of the body, world frame.
    pub(crate) fn detect(
        &mut self,
        body: &Body,
        frame: &Frame,
        ownership: OwnershipMask,
        root: Vec3,
        reasons: Reasons,
    ) {
        self.forget();
        if !self.check.is_due(frame.stamp, reasons, ownership.others) || !self.detector.knows {
            return;
        }
        let query = if reasons.anywhere { DetectionQuery::Any } else { DetectionQuery::Near(root) };
        for (number, image) in frame.images.iter().enumerate() {
            let (owners, own) = (ownership.owners(number), Some(ownership.own));
            let around =
                Surroundings { ground: frame.ground, excluded: frame.excluded, owners, own, ..Surroundings::default() };
            for found in self.detector.detect(body, image, &around, query) {
                // Of several images the nearest detection counts, or the most confident one.
                let cost = |found: &PlacedDetection| match query {
                    DetectionQuery::Near(place) => found.root.distance(place),
                    _ => -found.detection.person,
                };
                if self.detection.as_ref().is_none_or(|best| cost(&found) < cost(best)) {
                    (self.image, self.detection) = (number, Some(found));
                }
            }
            if let (DetectionQuery::Near(place), Some((person, bounds))) = (query, self.detector.nearest())
                && bounds.contains(place)
            {
                self.person_odds = Some(self.person_odds.map_or(person, |before| before.max(person)));
            }
        }
    }
}

/// Returns the floor on which a detected person stands. A plane at another height than the ankles, such as a table, is not the
/// floor.
fn floor_under(detection: Detected) -> Option<Ground> {
    detection.detection.floor.filter(|floor| {
        let above = detection.ankles().map(|ankle| floor.normal.dot(ankle.position) - floor.offset);
        above.fold(f64::INFINITY, f64::min).abs() < ELSEWHERE
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::detect::{DetectedJoint, Detection, JointMap};

    #[test]
    fn a_plane_at_the_ankles_is_the_floor_and_one_at_another_height_is_not() {
        let body = Body::human(1.75, HumanModel::Full).unwrap_or_else(|error| unreachable!("{error}"));
        let names = ["l_ankle", "r_ankle", "l_shoulder"].map(String::from);
        let map = JointMap::new(&body, &names, &[]);
        let is_kept = |offset: f64, ankle: f64| {
            let joint = |z| Some(DetectedJoint { position: Vec3::new(2.0, 0.0, z), sigma: 0.05, visible: 1.0 });
            let floor = Some(Ground { normal: Vec3::Z, offset });
            let detection =
                Detection { joints: [ankle, ankle, 1.0].map(joint).to_vec(), floor, ..Detection::default() };
            floor_under(Detected { detection: &detection, map: &map }).is_some()
        };
        assert!(is_kept(0.0, 0.08) && is_kept(-0.3, -0.25));
        assert!(!is_kept(0.7, 0.08) && !is_kept(0.0, 0.6));
    }
}
