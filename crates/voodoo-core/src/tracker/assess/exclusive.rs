//! What each limb explains and no other but its neighbours.

use crate::body::Body;
use crate::math::{Points, Pose};
use crate::observation::candidates::Candidates;
use crate::visibility::evidence::EXPLAINED;

/// Candidates that are looked at, about: costs time in proportion.
const EXCLUSIVE_SAMPLE: usize = 250;

/// Weight of such candidates, and working memory.
#[derive(Debug, Default)]
pub(super) struct Exclusive {
    /// By limb.
    pub(super) weight: Vec<f64>,
    /// The part of it that no depth image gave.
    pub(super) clouds: Vec<f64>,
    sample: Points,
    distances: Vec<f32>,
    /// Distances of the whole sample, limb after limb.
    all: Vec<f32>,
}

impl Exclusive {
    /// Counts anew.
    pub(super) fn count(&mut self, body: &Body, poses: &[Pose], candidates: &Candidates) {
        let Self { weight, clouds, sample, distances, all } = self;
        let count = poses.len();
        let pixels = candidates.cameras.last().map_or(0, |(end, _)| *end as usize);
        for counts in [&mut *weight, &mut *clouds] {
            counts.clear();
            counts.resize(count, 0.0);
        }
        let step = (candidates.len() / EXCLUSIVE_SAMPLE).max(1);
        let points = &candidates.points;
        sample.clear();
        for index in (0..points.len()).step_by(step) {
            sample.push([points.x[index], points.y[index], points.z[index]]);
        }
        all.clear();
        for (limb, pose) in body.limbs().iter().zip(poses) {
            limb.shape.approximate_distances(pose, sample, distances);
            all.extend(distances.iter().map(|distance| distance.abs()));
        }
        for place in 0..sample.len() {
            let distance = |limb: usize| all[limb * sample.len() + place];
            let closest = (1..count).fold(0, |best, limb| if distance(limb) < distance(best) { limb } else { best });
            if distance(closest) >= EXPLAINED as f32 {
                continue;
            }
            let rival = |other: &usize| {
                *other != closest && distance(*other) <= EXPLAINED as f32 && !body.adjacent(*other, closest)
            };
            if (0..count).find(rival).is_none() {
                let candidate = f64::from(candidates.weight[place * step]) * step as f64;
                weight[closest] += candidate;
                clouds[closest] += if place * step < pixels { 0.0 } else { candidate };
            }
        }
    }
}
