//! What a detector says of the person who is tracked, or of anybody where nobody is: where to start, where a lost body is, and
//! whether a track is what it is taken for.

use crate::body::{Body, Model};
use crate::detect::{Detection, Detector, JOINTS, Surroundings, Wanted, lengths, take_lengths};
use crate::math::{Pose, Vec3};
use crate::observation::frame::Frame;
use crate::observation::observer::Own;
use crate::observation::share::Share;

/// Looks for people, from the first time on that it is asked to; keeps what it last saw.
#[derive(Debug, Default)]
pub(super) struct People {
    detector: Option<Detector>,
    seen: Option<Detection>,
    /// The image that shows it, and the pixels there.
    image: usize,
    pixels: Vec<usize>,
    /// Log odds that what stands at the place that was looked at is a person; the surest of all images.
    verdict: Option<f64>,
}

impl People {
    /// Whether a body has the joints that a detector tells.
    pub(super) fn know(body: &Body) -> bool {
        JOINTS.iter().all(|joint| body.sites().iter().any(|site| site.name == *joint))
    }

    /// What was seen in this frame.
    pub(super) fn seen(&self) -> Option<&Detection> {
        self.seen.as_ref()
    }

    /// The pixels that show it.
    pub(super) fn own(&self) -> Own<'_> {
        let pixels = if self.seen.is_some() { self.pixels.as_slice() } else { &[] };
        Own { image: self.image, pixels }
    }

    /// Log odds that what stands where the person was expected is a person, if anything of that size does.
    pub(super) fn verdict(&self) -> Option<f64> {
        self.verdict
    }

    /// Forgets what was seen.
    pub(super) fn forget(&mut self) {
        (self.seen, self.verdict) = (None, None);
    }

    /// Forgets who was seen farther than this from a place, metres: somebody else.
    pub(super) fn leave_out_beyond(&mut self, place: Vec3, distance: f64) {
        let near = |seen: &Detection| {
            seen.joint("humanoid_root").is_some_and(|root| root.position.distance(place) <= distance)
        };
        self.seen = self.seen.take().filter(near);
    }

    /// Looks at all depth images of a frame, or at its share of them; keeps and returns the surest person.
    pub(super) fn look(&mut self, frame: &Frame, share: Option<Share>, wanted: Wanted) -> Option<&Detection> {
        self.forget();
        if self.detector.is_none() {
            self.detector = Detector::new().ok();
        }
        let detector = self.detector.as_mut()?;
        for (number, image) in frame.images.iter().enumerate() {
            let (owners, own) = share.map_or((&[][..], None), |share| (share.owners(number), Some(share.own)));
            let around =
                Surroundings { ground: frame.ground, excluded: frame.excluded, owners, own, ..Surroundings::default() };
            let found = detector.detect(image, &around, wanted).first();
            let surer = |found: &&Detection| self.seen.as_ref().is_none_or(|best| found.person > best.person);
            if let Some(found) = found.filter(surer).cloned() {
                detector.mask(&found, &mut self.pixels);
                (self.image, self.seen) = (number, Some(found));
            }
            if let (Wanted::Near(place), Some((person, bounds))) = (wanted, detector.first_look())
                && bounds.contains_local_point(place)
            {
                self.verdict = Some(self.verdict.map_or(person, |before| before.max(person)));
            }
        }
        self.seen.as_ref()
    }
}

/// A body of a detected person's sizes, like on both sides, and the pose that fits the joints best, world frame.
pub(crate) fn sized(model: &Model, detection: &Detection) -> Option<(Body, Vec<Pose>)> {
    let body = with_sizes(&model.reference_body, &detection.sizes())?;
    let poses = posed(&body, detection)?;
    Some((body, poses))
}

/// A body with the lengths of `LENGTHS`, like on both sides.
fn with_sizes(reference: &Body, lengths: &[f64]) -> Option<Body> {
    let rest = reference.rest_pose(Pose::identity());
    let mut joints = Vec::with_capacity(JOINTS.len());
    for name in JOINTS {
        joints.push(reference.site_position(&rest, reference.site_index(name).ok()?));
    }
    take_lengths(&mut joints, lengths);
    reference.fit(&positions(reference, &joints), true).ok().map(|(body, _)| body)
}

/// The pose of a body that fits a detected person's joints best, world frame.
pub(super) fn posed(body: &Body, detection: &Detection) -> Option<Vec<Pose>> {
    let mut joints: Vec<Vec3> = detection.joints.iter().map(|joint| joint.position).collect();
    let rest = body.rest_pose(Pose::identity());
    let own: Option<Vec<Vec3>> =
        JOINTS.iter().map(|joint| Some(body.site_position(&rest, body.site_index(joint).ok()?))).collect();
    take_lengths(&mut joints, &lengths(&own?));
    body.fit(&positions(body, &joints), false).ok().map(|(_, poses)| poses)
}

/// Positions of a body's sites.
fn positions(body: &Body, joints: &[Vec3]) -> Vec<(usize, Vec3)> {
    JOINTS.iter().zip(joints).filter_map(|(name, position)| Some((body.site_index(name).ok()?, *position))).collect()
}
