//! The two legs exchanged: clothed alike, each lies on the colors of the other, and only both together can come right.
//!
//! By then sizes have followed the wrong ones: exchanged legs that explain as much are followed beside the body for some frames.

use super::persistence::REST;
use super::refined::{REFINE, Refined};
use super::score::{Cost, SURE_GAIN};
use super::unexplained::CLUTTER;
use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Fit};
use crate::math::{Pose, Vec3, shifted};

/// When one looks, and where the legs would be.
#[derive(Debug, Default)]
pub(super) struct LegSwap {
    /// The body with exchanged legs, working frame.
    poses: Vec<Pose>,
    /// The same as it was found in the frame before, world, and for how many frames; empty if it is not followed.
    followed: Vec<Pose>,
    age: usize,
    /// What it has gained since it was looked at first, patches.
    gained: f64,
    frames: usize,
}

impl LegSwap {
    /// Forgets what was, and makes room for a body of so many limbs.
    pub(super) fn prepare(&mut self, limbs: usize) {
        (self.frames, self.age, self.gained) = (0, 0, 0.0);
        for poses in [&mut self.poses, &mut self.followed] {
            poses.clear();
            poses.reserve(limbs);
        }
    }

    /// Tries the legs where the other one is, if a leg is `is_suspect` or it is time to look. Returns the number of ICP steps.
    pub(super) fn attempt(
        &mut self,
        context: Context,
        is_suspect: impl Fn(usize) -> bool,
        refined: &mut Refined,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &mut Vec<Pose>,
    ) -> usize {
        let chains = &context.model.extremities;
        let mut legs = (0..chains.len()).filter(|index| chains[*index].leg);
        let (Some(one), Some(other), None) = (legs.next(), legs.next(), legs.next()) else { return 0 };
        if !self.is_due(is_suspect(one) || is_suspect(other)) {
            return 0;
        }
        let (origin, now) = (context.observation.origin(), refined.cost(context, fit, poses));
        self.swap_legs(&context.model.body, [&chains[one], &chains[other]], poses, origin);
        // Legs that stand right lose more when they are exchanged, before they are refined.
        if !self.is_ongoing() && refined.cost(context, fit, &self.poses).evidence > (1.0 - CLUTTER) * now.evidence {
            return 0;
        }
        let cost = refined.refine(context, fit, &self.poses);
        if self.accumulate(now, cost) {
            poses.clone_from(&refined.poses);
            predicted.clone_from(&self.poses);
        } else {
            fit.swap_matches(&mut refined.matched);
        }
        self.keep(&refined.poses, origin);
        REFINE
    }

    /// Whether to look in this frame; to be called in every one.
    fn is_due(&mut self, is_suspect: bool) -> bool {
        self.frames = (self.frames + 1) % REST;
        self.frames == 0 || is_suspect || self.is_ongoing()
    }

    /// It is followed from the frame before.
    fn is_ongoing(&self) -> bool {
        !self.followed.is_empty()
    }

    /// Puts each of two legs where the other one is, or where it was found to be in the frame before.
    fn swap_legs(&mut self, body: &Body, legs: [&TwoBone; 2], poses: &[Pose], origin: Vec3) {
        self.poses.clear();
        if self.is_ongoing() {
            self.poses.extend(self.followed.iter().map(|pose| shifted(pose, origin)));
            return;
        }
        self.poses.extend_from_slice(poses);
        for (own, other) in [(legs[0], legs[1]), (legs[1], legs[0])] {
            own.place_between(body, &mut self.poses, poses[other.lower].translation, other.end(poses));
        }
    }

    /// Takes note of what a frame says of it; true when it is to be taken.
    fn accumulate(&mut self, now: Cost, swapped: Cost) -> bool {
        // No frame counts for more than half: it may be disturbed.
        self.gained = (self.gained + (now.total - swapped.total).min(0.5 * SURE_GAIN)).max(0.0);
        self.age += 1;
        let close = swapped.evidence < now.evidence + SURE_GAIN;
        let taken = close && self.gained > SURE_GAIN;
        if taken || !close || self.age > REST {
            (self.age, self.gained) = (0, 0.0);
        }
        taken
    }

    /// Keeps what was found of it, if it is followed.
    fn keep(&mut self, poses: &[Pose], origin: Vec3) {
        self.followed.clear();
        if self.age > 0 {
            self.followed.extend(poses.iter().map(|pose| shifted(pose, -origin)));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::standing;

    fn cost(explained: f64) -> Cost {
        Cost { evidence: -explained, total: -explained }
    }

    #[test]
    fn each_leg_ends_where_the_other_one_did_and_nothing_else_moves() {
        let (model, poses) = standing();
        let legs: Vec<&TwoBone> = model.extremities.iter().filter(|chain| chain.leg).collect();
        let mut leg_swap = LegSwap::default();
        leg_swap.swap_legs(&model.body, [legs[0], legs[1]], &poses, Vec3::ZERO);
        for (own, other) in [(legs[0], legs[1]), (legs[1], legs[0])] {
            let way = own.end(&leg_swap.poses).distance(other.end(&poses));
            assert!(way < 0.08, "{way} m");
            assert!(own.root(&model.body, &leg_swap.poses).distance(own.root(&model.body, &poses)) < 1e-9);
        }
        for limb in (0..poses.len()).filter(|limb| !legs.iter().any(|leg| leg.limbs().any(|own| own == *limb))) {
            assert_eq!(leg_swap.poses[limb], poses[limb]);
        }
    }

    #[test]
    fn it_is_taken_when_several_frames_report_so_and_dropped_when_they_do_not() {
        let (now, better, far) = (cost(2000.0), cost(2090.0), cost(1500.0));
        let mut leg_swap = LegSwap::default();
        let decisions: Vec<bool> = (0..4).map(|_| leg_swap.accumulate(now, better)).collect();
        assert_eq!(decisions, [false, false, true, false], "no frame counts for more than half");
        let mut leg_swap = LegSwap::default();
        assert!([better, better, far, better, better].iter().all(|cost| !leg_swap.accumulate(now, *cost)));
        // What is as good is followed for some frames.
        let (_, poses) = standing();
        let followed: Vec<bool> = (0..10)
            .map(|_| {
                leg_swap.accumulate(now, now);
                leg_swap.keep(&poses, Vec3::ZERO);
                leg_swap.is_ongoing()
            })
            .collect();
        assert_eq!(followed.iter().filter(|goes_on| !**goes_on).count(), 10 / (REST + 1), "{followed:?}");
    }

    #[test]
    fn one_looks_every_so_often_and_at_once_where_a_leg_is_uncertain() {
        let mut leg_swap = LegSwap::default();
        let due: Vec<bool> = (0..8).map(|_| leg_swap.is_due(false)).collect();
        assert_eq!(due.iter().filter(|due| **due).count(), 8 / REST);
        assert!(leg_swap.is_due(true));
    }
}
