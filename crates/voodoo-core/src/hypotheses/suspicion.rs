//! Whether the frame speaks against an arm or leg where it is.

use super::score::explain;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Matched};
use crate::math::{Points, Pose, WeightedPoints};
use crate::visibility::evidence::{EXPLAINED, Visibility, limb_visibility};

/// So many unexplained patches near an arm or leg make it suspect: an area of six by six centimetres. As many it has to show of
/// itself where unexplained points have drawn it.
pub(super) const SUSPICIOUS: f64 = 25.0;
/// It is idle when the patches that it alone explains are a smaller share of those it shows.
const IDLE: f64 = 0.3;
/// It is refuted when cameras see past a larger share of it.
const REFUTED: f64 = 0.2;
/// Either share is of this many patches at least (of those seen past, of the image): few patches flicker.
const LEAST_SHOWN: f64 = 20.0;
const LEAST_PAST: f64 = 12.0;

/// What an arm or leg explains now, and working memory.
#[derive(Debug, Default)]
pub(super) struct Suspicion {
    /// Points it is matched to.
    pub(super) own: WeightedPoints,
    /// Their distances to the nearest limb that does not belong to it.
    others: Vec<f32>,
    distances: Vec<f32>,
}

impl Suspicion {
    /// Room for a frame of so many candidates.
    pub(super) fn make_room(&mut self, count: usize) {
        self.own.clear();
        self.own.reserve(count);
        for distances in [&mut self.others, &mut self.distances] {
            distances.clear();
            distances.reserve(count);
        }
    }

    /// Whether the frame speaks against all of an arm or leg, and against what lies beyond its hinge.
    ///
    /// What cameras see past counts by its area in the image. Where unexplained points have drawn it there (`drawn`), it counts
    /// as if seen from the side, too: a thing that appears draws a calf along the ray, where nothing of it is seen. And it has
    /// to show itself: an arm behind the trunk may end at anything that comes into view there.
    pub(super) fn of(&mut self, context: Context, matched: Matched, chain: &TwoBone, drawn: bool) -> [bool; 2] {
        let upper = self.collect_own(matched, chain);
        let Self { own, others, distances } = self;
        distances_to_others(context, matched.poses, chain, &own.points, others, distances);
        let exclusive = |from: usize| -> f64 {
            let weighted = others[from..].iter().zip(&own.weights[from..]);
            weighted.filter(|(other, _)| f64::from(**other) > EXPLAINED).map(|(_, weight)| *weight).sum()
        };
        let body = &context.model.body;
        let mut seen = Visibility::default();
        let mut against = |limb: usize, exclusive: f64| {
            seen += limb_visibility(context.seen.views, &body.limbs()[limb], &matched.poses[limb]);
            exclusive <= IDLE * (seen.image.front_facing - seen.image.occluded).max(LEAST_SHOWN)
                || seen.image.free_space > (REFUTED * seen.image.front_facing).max(LEAST_PAST)
        };
        chain.ends.iter().for_each(|end| {
            against(*end, 0.0);
        });
        let lower = against(chain.lower, exclusive(upper));
        let upper = against(chain.upper, exclusive(0));
        let shown = seen.image.front_facing - seen.image.occluded - seen.image.free_space;
        let past = seen.side.free_space > (REFUTED * seen.side.front_facing).max(LEAST_SHOWN);
        let drawn = drawn && (past || shown < SUSPICIOUS);
        [upper || drawn, lower || drawn]
    }

    /// Collects the points it is matched to; returns how many of them lie on the upper limb.
    fn collect_own(&mut self, matched: Matched, chain: &TwoBone) -> usize {
        self.own.clear();
        let mut upper = 0;
        for limb in chain.limbs() {
            let matches = &matched.correspondences.limbs[limb];
            for (index, weight) in matches.weight.iter().enumerate() {
                if *weight > 0.0 {
                    let point = matches.measured.get(index).to_array().map(|value| value as f32);
                    self.own.push(point, f64::from(*weight));
                }
            }
            if limb == chain.upper {
                upper = self.own.len();
            }
        }
        upper
    }
}

/// Distances of points to the nearest limb that does not belong to an arm or leg.
pub(super) fn distances_to_others(
    context: Context,
    poses: &[Pose],
    chain: &TwoBone,
    points: &Points,
    others: &mut Vec<f32>,
    distances: &mut Vec<f32>,
) {
    others.clear();
    others.resize(points.len(), f32::INFINITY);
    for limb in (0..poses.len()).filter(|limb| !chain.limbs().any(|own| own == *limb)) {
        explain(&context.model.body, limb, poses, points, others, distances);
    }
}
