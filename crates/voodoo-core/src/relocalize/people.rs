//! What a detector says of the person who is tracked, or of anybody where nobody is: where to start, where a lost body is, and
//! whether a track is what it is taken for.

use super::doubt::ELSEWHERE;
use crate::body::{Body, Model};
use crate::detect::{Detection, Detector, JOINTS, Surroundings, Wanted, lengths, take_lengths};
use crate::math::{Pose, Vec3};
use crate::observation::frame::{Frame, Ground};
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
    /// The floor on which it stood when it was found, world frame.
    pub(super) floor: Option<Ground>,
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

    /// Keeps the floor on which what was seen stands, if it was `found` there; else forgets it.
    pub(super) fn keep_floor(&mut self, found: bool) {
        self.floor = if found { self.under_feet() } else { None };
    }

    /// The floor on which it stands; a table below which its feet are is none.
    fn under_feet(&self) -> Option<Ground> {
        let seen = self.seen()?;
        let above = |floor: &Ground, name| Some(floor.normal.dot(seen.joint(name)?.position) - floor.offset);
        seen.floor.filter(|floor| {
            let ankles = [above(floor, "l_ankle"), above(floor, "r_ankle")].into_iter().flatten();
            let lowest = ankles.fold(f64::INFINITY, f64::min);
            lowest.abs() < ELSEWHERE
        })
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

    /// Forgets who was seen where it is not the person: the place of its root, world frame.
    pub(super) fn leave_out(&mut self, not_there: impl Fn(Vec3) -> bool) {
        let there = |seen: &Detection| seen.joint("humanoid_root").is_some_and(|root| !not_there(root.position));
        self.seen = self.seen.take().filter(there);
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
                && bounds.contains(place)
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
    let rest = reference.rest_pose(Pose::IDENTITY);
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
    let rest = body.rest_pose(Pose::IDENTITY);
    let own: Option<Vec<Vec3>> =
        JOINTS.iter().map(|joint| Some(body.site_position(&rest, body.site_index(joint).ok()?))).collect();
    take_lengths(&mut joints, &lengths(&own?));
    body.fit(&positions(body, &joints), false).ok().map(|(_, poses)| poses)
}

/// Whether a body has the sizes of a detected person, each within so many of its standard deviations.
pub(super) fn is_sized_like(body: &Body, detection: &Detection, sigmas: f64) -> bool {
    let rest = body.rest_pose(Pose::IDENTITY);
    let joints: Option<Vec<Vec3>> =
        JOINTS.iter().map(|joint| Some(body.site_position(&rest, body.site_index(joint).ok()?))).collect();
    let own = joints.map_or_else(Vec::new, |joints| lengths(&joints));
    let like = |(own, [length, sigma]): (&f64, &[f64; 2])| (own / length).ln().abs() <= sigmas * sigma;
    own.iter().zip(&detection.lengths).all(like)
}

/// Positions of a body's sites.
fn positions(body: &Body, joints: &[Vec3]) -> Vec<(usize, Vec3)> {
    JOINTS.iter().zip(joints).filter_map(|(name, position)| Some((body.site_index(name).ok()?, *position))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::DetectedJoint;

    #[test]
    fn a_plane_under_the_feet_is_the_floor_and_a_table_above_them_is_none() {
        let floor_at = |offset: f64, ankle: f64| {
            let joint = |name: &&str| {
                let z = if name.ends_with("ankle") { ankle } else { 1.0 };
                DetectedJoint { position: Vec3::new(2.0, 0.0, z), sigma: 0.05, visible: 1.0 }
            };
            let ground = Ground { normal: Vec3::Z, offset };
            let joints = JOINTS.iter().map(joint).collect();
            let seen = Some(Detection { joints, floor: Some(ground), ..Detection::default() });
            let mut people = People { seen, ..People::default() };
            people.keep_floor(true);
            let kept = people.floor.is_some();
            people.keep_floor(false);
            assert_eq!(people.floor, None);
            kept
        };
        assert!(floor_at(0.0, 0.08) && floor_at(-0.3, -0.25));
        assert!(!floor_at(0.7, 0.08) && !floor_at(0.0, 0.6));
    }
}
