//! Left-right swap of the legs. Legs of the same color can each explain the pixels of the other, and only a change of both
//! corrects this.
//!
//! The sizes may have adapted to the wrong legs before they are corrected. Legs that have a similar cost when swapped are
//! therefore tracked in parallel for some frames.

use super::objective::REVERSAL_MARGIN;
use super::refined::{REFINE, Refined};
use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Fit};
use crate::math::{Pose, Vec3, shifted};

/// Fraction of what the images explain that a swap worth refining may lose.
const HOPELESS: f64 = 0.15;
/// Number of frames between two tests, and for which a swap of about the same cost is tracked.
const RETRY_PERIOD: usize = 4;

/// The swapped legs, and the evidence for them.
#[derive(Debug, Default)]
pub(super) struct LegSwap {
    /// The body with swapped legs, working frame.
    poses: Vec<Pose>,
    /// Its refined poses in the last frame, world frame, and the number of frames for which it was tracked; empty if it is not
    /// tracked.
    followed: Vec<Pose>,
    age: usize,
    /// Decrease of cost by the swap, accumulated over these frames, nats.
    gained: f64,
    frames: usize,
}

impl LegSwap {
    /// Clears the state and reserves memory for a body of `limbs` limbs.
    pub(super) fn prepare(&mut self, limbs: usize) {
        (self.frames, self.age, self.gained) = (0, 0, 0.0);
        for poses in [&mut self.poses, &mut self.followed] {
            poses.clear();
            poses.reserve(limbs);
        }
    }

    /// Tests the swap if one of the legs is `contradicted`, while the swap is tracked, and otherwise once in every
    /// `RETRY_PERIOD` frames. Returns the number of ICP steps.
    pub(super) fn attempt(
        &mut self,
        context: Context,
        contradicted: impl Fn(usize) -> bool,
        refined: &mut Refined,
        fit: &mut Fit,
        poses: &mut Vec<Pose>,
        predicted: &mut Vec<Pose>,
    ) -> usize {
        let chains = &context.model.extremities;
        let mut legs = (0..chains.len()).filter(|index| chains[*index].leg);
        let (Some(one), Some(other), None) = (legs.next(), legs.next(), legs.next()) else { return 0 };
        if !self.is_due(contradicted(one) || contradicted(other)) {
            return 0;
        }
        let (origin, now) = (context.observation.origin(), refined.cost(context, fit, poses));
        self.swap_legs(&context.model.body, [&chains[one], &chains[other]], poses, origin);
        // A swap of correct legs explains clearly less of the images, even before it is refined.
        if !self.is_ongoing() && refined.cost(context, fit, &self.poses) > (1.0 - HOPELESS) * now {
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

    /// Whether to test the swap in this frame. To be called in every frame.
    fn is_due(&mut self, contradicted: bool) -> bool {
        self.frames = (self.frames + 1) % RETRY_PERIOD;
        self.frames == 0 || contradicted || self.is_ongoing()
    }

    /// Whether the swap was tracked in the last frame.
    fn is_ongoing(&self) -> bool {
        !self.followed.is_empty()
    }

    /// Sets the poses with each of two legs at the position of the other, or those of the last frame if the swap is tracked.
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

    /// Accumulates the evidence of a frame. Returns whether to accept the swap.
    fn accumulate(&mut self, now: f64, swapped: f64) -> bool {
        // No frame contributes more than half of the required gain, because a single frame may be disturbed.
        self.gained = (self.gained + (now - swapped).min(0.5 * REVERSAL_MARGIN)).max(0.0);
        self.age += 1;
        let close = swapped < now + REVERSAL_MARGIN;
        let taken = close && self.gained > REVERSAL_MARGIN;
        if taken || !close || self.age > RETRY_PERIOD {
            (self.age, self.gained) = (0, 0.0);
        }
        taken
    }

    /// Stores the poses for the next frame if the swap is tracked.
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

    #[test]
    fn each_leg_ends_where_the_other_one_did_and_no_other_limb_moves() {
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
    fn the_swap_is_accepted_after_several_better_frames_and_dropped_otherwise() {
        let (now, better, far) = (-240.0, -250.8, -180.0);
        let mut leg_swap = LegSwap::default();
        let decisions: Vec<bool> = (0..4).map(|_| leg_swap.accumulate(now, better)).collect();
        assert_eq!(decisions, [false, false, true, false], "no frame contributes more than half");
        let mut leg_swap = LegSwap::default();
        assert!([better, better, far, better, better].iter().all(|cost| !leg_swap.accumulate(now, *cost)));
        // A swap of the same cost is tracked for some frames.
        let (_, poses) = standing();
        let followed: Vec<bool> = (0..10)
            .map(|_| {
                leg_swap.accumulate(now, now);
                leg_swap.keep(&poses, Vec3::ZERO);
                leg_swap.is_ongoing()
            })
            .collect();
        assert_eq!(followed.iter().filter(|tracked| !**tracked).count(), 10 / (RETRY_PERIOD + 1), "{followed:?}");
    }

    #[test]
    fn the_swap_is_tested_periodically_and_at_once_for_a_contradicted_leg() {
        let mut leg_swap = LegSwap::default();
        let due: Vec<bool> = (0..8).map(|_| leg_swap.is_due(false)).collect();
        assert_eq!(due.iter().filter(|due| **due).count(), 8 / RETRY_PERIOD);
        assert!(leg_swap.is_due(true));
    }
}
