//! The arm or leg is where pictures show its colours: its upper limb in all directions, then its lower one on the best of these.

use std::f64::consts::{PI, TAU};

use super::{Pool, Propose};
use crate::body::kinematics::{hinge_axis, place};
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::hypotheses::score::limit_strain;
use crate::math::{Pose, Quat, Vec3};

/// Directions of the upper limb that are tried, and how many of them with a lower limb.
const DIRECTIONS: usize = 128;
const UPPER_LIMBS: usize = 12;
/// Turns of the upper limb about its own axis that are tried, radians, none, one and two either way; and bends of the hinge between
/// its limits.
const TWIST: f64 = 0.5;
const BENDS: usize = 5;
/// Steps of the last look about the best: turns, radians.
const CLOSER: [f64; 2] = [0.15, 0.08];
/// A direction that breaks limits by more than this, in patches, is not looked at.
const BROKEN: f64 = 10.0;

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
            for twist in [0.0, 1.0, -1.0, 2.0, -2.0].map(|step| step * TWIST) {
                for bend in 0..BENDS {
                    let share = (bend as f64 + 0.5) / BENDS as f64;
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
        for step in CLOSER {
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
            let height = 1.0 - (2 * index + 1) as f64 / DIRECTIONS as f64;
            let (s, c) = f64::sin_cos(PI * (3.0 - f64::sqrt(5.0)) * index as f64 % TAU);
            let around = (1.0 - height * height).max(0.0).sqrt();
            let to = if index < DIRECTIONS { Vec3::new(around * c, around * s, height) } else { now };
            let turn = Quat::from_rotation_arc(now, to);
            trial.clear();
            trial.extend_from_slice(poses);
            set(at, trial, turn, 0.0, 0.0);
            let broken = limit_strain(body, trial, chain.upper);
            if broken > BROKEN {
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
    let [low, high] = hinge.limits.map_or([0.0, 0.8 * PI], |limits| limits[if axis == Vec3::X { 0 } else { 1 }]);
    let flexion = Quat::from_axis_angle(axis, low + bend * (high - low));
    poses[chain.lower] = place(hinge, &poses[chain.upper], flexion);
    for end in &chain.ends {
        if let Some((parent, joint)) = &body.limbs()[*end].parent {
            poses[*end] = place(joint, &poses[*parent], Quat::IDENTITY);
        }
    }
}
