//! Proposes the directions that explain the colors best: of the upper limb among directions on a sphere, then of the lower limb
//! at the best of these.

use std::f64::consts::{PI, TAU};

use super::{Pool, Propose, SWIVELS};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::{Pose, Vec3, make_room, refill};

/// Search over directions, with working memory.
#[derive(Debug, Default)]
pub(in crate::hypotheses) struct ColorDirections {
    /// The best directions of the upper limb, working frame, and their costs in ascending order.
    kept: Vec<(f64, Vec3)>,
}

impl Propose for ColorDirections {
    fn propose(&mut self, at: Extremity, rough: &mut RoughSearch, pool: &mut Pool) {
        if at.regions.is_none() {
            return;
        }
        self.find_directions(at, &mut rough.trial);
        let body = &at.context.model.body;
        for &(_, upper) in &self.kept {
            let bend = at.root() + at.chain.lengths[0] * upper;
            for lower in directions() {
                let change = |poses: &mut [Pose]| at.chain.place_between(body, poses, bend, bend + lower);
                pool.least = rough.changed(at, change, pool.least, &mut pool.points);
            }
        }
    }
}

impl ColorDirections {
    /// Finds the directions of the upper limb of lowest cost. The current direction is one of the candidates.
    fn find_directions(&mut self, at: Extremity, trial: &mut Vec<Pose>) {
        let Self { kept } = self;
        let (chain, body, poses) = (at.chain, &at.context.model.body, at.matched.poses);
        make_room(kept, SWIVELS);
        for upper in directions().chain([poses[chain.upper].rotation * Vec3::Z]) {
            refill(trial, poses.iter().copied());
            chain.place_between(body, trial, at.root() + upper, at.root() + 2.0 * upper);
            let cost = at.objective().limb(trial, chain.upper);
            let place = kept.partition_point(|(other, _)| *other <= cost);
            if place < SWIVELS {
                kept.truncate(SWIVELS - 1);
                kept.insert(place, (cost, upper));
            }
        }
    }
}

/// Directions on the unit sphere on a grid of `SWIVELS` polar angles and twice as many azimuths.
fn directions() -> impl Iterator<Item = Vec3> {
    let step = PI / SWIVELS as f64;
    (0..SWIVELS).flat_map(move |row| {
        let (height, around) = ((row as f64 + 0.5) * step).sin_cos();
        (0..2 * SWIVELS).map(move |column| {
            let (s, c) = (TAU * column as f64 / (2 * SWIVELS) as f64).sin_cos();
            Vec3::new(height * c, height * s, around)
        })
    })
}
