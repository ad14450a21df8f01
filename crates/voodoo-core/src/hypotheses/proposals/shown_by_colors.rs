//! The arm or leg is where pictures show its colours: its upper limb in all directions, then its lower one on the best of these.

use std::f64::consts::PI;

use super::{Pool, Propose, SWIVELS, TURN, TURNS};
use crate::body::kinematics::{hinge_axis, place};
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::hypotheses::score::{GAIN, limit_strain};
use crate::math::{Pose, Quat, Vec3, on_spiral};

/// Directions of the upper limb that are tried.
const DIRECTIONS: usize = 128;
/// How many of them with a lower limb.
const UPPER_LIMBS: usize = 2 * SWIVELS;

/// Looks in all directions; working memory.
#[derive(Debug, Default)]
pub(in crate::hypotheses) struct ShownByColors {
    trial: Vec<Pose>,
    /// The best turns of the upper limb, in the world, and what they cost.
    kept: Vec<(f64, Quat)>,
}

impl Propose for ShownByColors {
    fn propose(&mut self, at: Extremity, _history: &[History], rough: &mut RoughSearch, pool: &mut Pool) {
        if at.regions.is_none() {
            return;
        }
        self.find_directions(at, rough);
        let mut best = None;
        for &(_, upper) in &self.kept {
            for twist in TURNS.map(|turn| 2.0 * turn) {
                for bend in 0..SWIVELS {
                    let share = (bend as f64 + 0.5) / SWIVELS as f64;
                    let change = |poses: &mut [Pose]| set(at, poses, upper, twist, share);
                    let least = rough.changed(at, change, pool.least, &mut pool.points.poses);
                    if least < pool.least {
                        pool.least = least;
                        best = Some((upper, twist, share));
                    }
                }
            }
        }
        let Some((mut upper, twist, mut share)) = best else { return };
        for step in [TURN, 0.5 * TURN] {
            for (turn, bend) in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO].into_iter().flat_map(|axis| {
                [-step, step].map(|angle| (axis * angle, if axis == Vec3::ZERO { angle } else { 0.0 }))
            }) {
                let tried = (Quat::from_scaled_axis(turn) * upper, (share + bend).clamp(0.0, 1.0));
                let change = |poses: &mut [Pose]| set(at, poses, tried.0, twist, tried.1);
                let least = rough.changed(at, change, pool.least, &mut pool.points.poses);
                if least < pool.least {
                    pool.least = least;
                    (upper, share) = tried;
                }
            }
        }
        pool.points.set(Basis::Points);
    }
}

impl ShownByColors {
    /// Room for a body of so many limbs.
    pub(in crate::hypotheses) fn make_room(&mut self, limbs: usize) {
        self.trial.clear();
        self.trial.reserve(limbs);
        self.kept.clear();
        self.kept.reserve(UPPER_LIMBS);
    }

    /// The turns of the upper limb that pictures speak for most.
    fn find_directions(&mut self, at: Extremity, rough: &mut RoughSearch) {
        let Self { trial, kept } = self;
        let (chain, body, poses) = (at.chain(), &at.context.model.body, at.matched.poses);
        kept.clear();
        let now = poses[chain.upper].rotation * Vec3::Z;
        for index in 0..=DIRECTIONS {
            // As evenly over the sphere as a spiral goes; and as it is.
            let to = if index < DIRECTIONS { on_spiral(index, DIRECTIONS) } else { now };
            let turn = Quat::from_rotation_arc(now, to);
            trial.clear();
            trial.extend_from_slice(poses);
            set(at, trial, turn, 0.0, 0.0);
            let broken = limit_strain(body, trial, chain.upper);
            if broken > 0.5 * GAIN {
                continue;
            }
            let cost = broken - rough.score.claimed(at, trial, [chain.upper].into_iter()).gained;
            let place = kept.partition_point(|(other, _)| *other <= cost);
            if place < UPPER_LIMBS {
                kept.truncate(UPPER_LIMBS - 1);
                kept.insert(place, (cost, turn));
            }
        }
    }
}

/// Turns the upper limb from where it is, then about its own axis, and bends the hinge to a share of what it can.
fn set(at: Extremity, poses: &mut [Pose], turn: Quat, twist: f64, bend: f64) {
    let (chain, body) = (at.chain(), &at.context.model.body);
    let (Some((_, ball)), Some((_, hinge))) = (&body.limbs()[chain.upper].parent, &body.limbs()[chain.lower].parent)
    else {
        return;
    };
    let rotation = turn * at.matched.poses[chain.upper].rotation * Quat::from_rotation_z(twist);
    poses[chain.upper] = Pose::from_parts(at.root() - rotation * ball.limb_from_joint.translation, rotation);
    let axis = hinge_axis(hinge);
    let [low, high] = hinge.limits.map_or([0.0, PI], |limits| limits[if axis == Vec3::X { 0 } else { 1 }]);
    let flexion = Quat::from_axis_angle(axis, low + bend * (high - low));
    poses[chain.lower] = place(hinge, &poses[chain.upper], flexion);
    for end in &chain.ends {
        if let Some((parent, joint)) = &body.limbs()[*end].parent {
            poses[*end] = place(joint, &poses[*parent], Quat::IDENTITY);
        }
    }
}
