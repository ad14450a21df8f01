//! What is remembered of the body for the time when it is lost: how it stands at rest and how it stood when last tracked.

use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::observation::candidates::{REFERENCE_PATCH, body_box};
use crate::observation::segments::Segment;

/// A segment shows at least this share of the surface that a camera can see of the body: the rest may be hidden.
const LEAST_SURFACE: f64 = 0.25;
/// Its extents as shares of the body's height at rest: the longer one at least, and all at most.
const EXTENTS: [f64; 2] = [0.35, 1.5];

/// Poses of the whole body, working frame.
pub(super) type Place = Vec<Pose>;

/// How the body may stand, and how large it is.
#[derive(Debug, Default)]
pub(super) struct Postures {
    /// Poses at rest with the root at the origin, and as last tracked (working frame of then).
    pub(super) rest: Vec<Pose>,
    pub(super) tracked: Vec<Pose>,
    /// When it was last tracked, seconds.
    pub(super) tracked_at: Option<f64>,
    /// Up in the world: the floor's normal, else as the body stood when it was set.
    pub(super) up: Vec3,
    /// Height at rest, metres, and surface that a camera can see of it, patches.
    height: f64,
    patches: f64,
}

impl Postures {
    /// Learns a body and how it was set.
    pub(super) fn restart(&mut self, body: &Body, poses: &[Pose]) {
        self.rest = body.rest_pose(Pose::identity());
        let bounds = body_box(body, &self.rest, 0.0);
        self.height = bounds.extents().max_element();
        let area = |shape: &crate::shape::TaperedEllipticCylinder| {
            0.5 * shape.length() * (shape.a0() + shape.a1() + shape.b0() + shape.b1())
        };
        self.patches = body.limbs().iter().map(|limb| area(&limb.shape)).sum::<f64>() / REFERENCE_PATCH;
        self.up = poses.first().map_or(Vec3::Z, |pose| pose.rotation * Vec3::Z);
        self.tracked.clear();
        self.tracked.extend_from_slice(poses);
        self.tracked_at = None;
    }

    /// Remembers a tracked body.
    pub(super) fn remember(&mut self, poses: &[Pose], stamp: f64) {
        self.tracked.clear();
        self.tracked.extend_from_slice(poses);
        self.tracked_at = Some(stamp);
    }

    /// One of both.
    pub(super) fn posture(&self, tracked: bool) -> &[Pose] {
        if tracked { &self.tracked } else { &self.rest }
    }

    /// The part of a direction that is level.
    pub(super) fn level(&self, v: Vec3) -> Vec3 {
        v - self.up * v.dot(self.up)
    }

    /// Whether a segment may be the body.
    pub(super) fn fits(&self, segment: &Segment) -> bool {
        let extents = segment.high - segment.low;
        let [least, most] = EXTENTS.map(|share| share * self.height);
        let tall = extents.dot(self.up.abs());
        let wide = (extents - self.up.abs() * tall).max_element();
        segment.patches > LEAST_SURFACE * self.patches && tall.max(wide) > least && tall < most && wide < most
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;

    fn segment(size: Vec3, patches: f64) -> Segment {
        Segment { centre: Vec3::ZERO, low: -0.5 * size, high: 0.5 * size, patches, view: Vec3::X }
    }

    #[test]
    fn a_segment_of_a_persons_size_fits_and_others_do_not() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut postures = Postures::default();
        postures.restart(&body, &body.rest_pose(Pose::identity()));
        let patches = postures.patches;
        assert!(postures.fits(&segment(Vec3::new(0.5, 0.6, 1.7), 0.5 * patches)));
        assert!(postures.fits(&segment(Vec3::new(1.2, 0.6, 0.5), 0.5 * patches)), "lying");
        assert!(!postures.fits(&segment(Vec3::new(0.5, 0.6, 1.7), 0.1 * patches)), "hardly anything");
        assert!(!postures.fits(&segment(Vec3::new(0.3, 0.3, 0.4), 0.5 * patches)), "a chair");
        assert!(!postures.fits(&segment(Vec3::new(0.5, 4.0, 2.0), 5.0 * patches)), "a wall");
    }
}
