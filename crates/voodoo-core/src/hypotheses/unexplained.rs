//! Candidates that no limb explains.

use crate::fit::{Context, Matched};
use crate::math::{Vec3, WeightedPoints};
use crate::visibility::evidence::EXPLAINED;

/// A larger share of the frame's weight than this unexplained is clutter: a heap of points in it says nothing.
const CLUTTER: f64 = 0.15;

/// What the current matches leave unexplained.
#[derive(Debug, Default)]
pub(super) struct Unexplained {
    points: WeightedPoints,
    /// So much is unexplained that a heap of it says nothing.
    pub(super) cluttered: bool,
    /// Distance of every candidate to the nearest limb it is matched to.
    nearest: Vec<f32>,
}

impl Unexplained {
    /// Collects them anew.
    pub(super) fn collect(&mut self, context: Context, matched: Matched) {
        let candidates = context.seen.candidates;
        let Self { points, cluttered, nearest } = self;
        points.clear();
        // Room for the worst case at once, not when the first hard frame comes.
        points.reserve(candidates.len());
        nearest.clear();
        nearest.resize(candidates.len(), f32::INFINITY);
        for matches in &matched.correspondences.limbs {
            for (candidate, distance) in matches.candidate.iter().zip(&matches.surface.signed_distance) {
                let nearest = &mut nearest[*candidate as usize];
                // A refused match (a cap inside the body) still explains its point.
                *nearest = nearest.min(distance.abs());
            }
        }
        for (index, distance) in nearest.iter().enumerate() {
            if f64::from(*distance) > EXPLAINED {
                let all = &candidates.points;
                points.push([all.x[index], all.y[index], all.z[index]], f64::from(candidates.weight[index]));
            }
        }
        let all: f64 = candidates.weight.iter().map(|weight| f64::from(*weight)).sum();
        *cluttered = points.total() > CLUTTER * all;
    }

    /// Those within `reach` metres of a place, into `near`.
    pub(super) fn near(&self, place: Vec3, reach: f64, near: &mut WeightedPoints) {
        near.clear();
        for index in 0..self.points.len() {
            let (point, weight) = self.points.get(index);
            if (point - place).length() < reach {
                near.push(point.to_array().map(|value| value as f32), weight);
            }
        }
    }
}
