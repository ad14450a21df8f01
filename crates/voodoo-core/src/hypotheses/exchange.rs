//! The two legs exchanged: clothed alike, each lies on the colours of the other, and only both together can come right.
//!
//! By then sizes have followed the wrong ones: exchanged legs that explain as much are followed beside the body for some frames.

use super::score::{Cost, GAIN};
use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::math::{Pose, Vec3, shifted};

/// One looks in so many frames, and in every one in which a leg is in doubt.
const EVERY: usize = 4;
/// What explains a smaller share of what is explained now is not refined: legs that stand right lose more when they are exchanged.
const WORTH_A_LOOK: f64 = 0.88;
/// What is followed explains this share at least, and is given up after so many frames.
const WORTH_FOLLOWING: f64 = 0.96;
const FOLLOWED: usize = 8;
/// What has to be gained in all, patches, and what one frame counts for at most: it may be disturbed.
const GAINED: f64 = 4.0 * GAIN;
const MOST_GAINED: f64 = 2.0 * GAIN;
/// A pelvis that turns by more than this, radians, is another body's: the legs alone were exchanged.
const MOST_TURNED: f64 = 0.5;

/// When one looks, and where the legs would be.
#[derive(Debug, Default)]
pub(super) struct Exchange {
    /// The body with exchanged legs, working frame.
    pub(super) poses: Vec<Pose>,
    /// The same as it was found in the frame before, world, and for how many frames; empty if it is not followed.
    followed: Vec<Pose>,
    age: usize,
    /// What it has gained since it was looked at first, patches.
    gained: f64,
    frames: usize,
}

impl Exchange {
    /// Forgets what was, and makes room for a body of so many limbs.
    pub(super) fn prepare(&mut self, limbs: usize) {
        (self.frames, self.age, self.gained) = (0, 0, 0.0);
        for poses in [&mut self.poses, &mut self.followed] {
            poses.clear();
            poses.reserve(limbs);
        }
    }

    /// Whether to look in this frame; to be called in every one.
    pub(super) fn is_due(&mut self, doubtful: bool) -> bool {
        self.frames = (self.frames + 1) % EVERY;
        self.frames == 0 || doubtful || self.goes_on()
    }

    /// It is followed from the frame before.
    pub(super) fn goes_on(&self) -> bool {
        !self.followed.is_empty()
    }

    /// Puts each of two legs where the other one is, or where it was found to be in the frame before.
    pub(super) fn put(&mut self, body: &Body, legs: [&TwoBone; 2], poses: &[Pose], origin: Vec3) {
        self.poses.clear();
        if self.goes_on() {
            self.poses.extend(self.followed.iter().map(|pose| shifted(pose, origin)));
            return;
        }
        self.poses.extend_from_slice(poses);
        for (own, other) in [(legs[0], legs[1]), (legs[1], legs[0])] {
            own.put(body, &mut self.poses, poses[other.lower].translation, other.end(poses));
        }
    }

    /// Whether exchanged legs explain nearly as much as those of now, as they are.
    pub(super) fn is_worth_a_look(&self, now: Cost, exchanged: Cost) -> bool {
        exchanged.evidence < WORTH_A_LOOK * now.evidence
    }

    /// Takes note of what a frame says of it, found at `exchanged` while the body is at `now`; true when it is to be taken.
    pub(super) fn gains(&mut self, costs: [Cost; 2], [now, exchanged]: [&[Pose]; 2]) -> bool {
        let gain = costs[0].total - costs[1].total;
        self.gained = (self.gained + gain.min(MOST_GAINED)).max(0.0);
        self.age += 1;
        let turned = exchanged[0].rotation.angle_between(now[0].rotation);
        let close = costs[1].evidence < WORTH_FOLLOWING * costs[0].evidence && turned < MOST_TURNED;
        let taken = close && self.gained > GAINED;
        if taken || !close || self.age > FOLLOWED {
            (self.age, self.gained) = (0, 0.0);
        }
        taken
    }

    /// Keeps what was found of it, if it is followed.
    pub(super) fn keep(&mut self, poses: &[Pose], origin: Vec3) {
        self.followed.clear();
        if self.age > 0 {
            self.followed.extend(poses.iter().map(|pose| shifted(pose, -origin)));
        }
    }
}
