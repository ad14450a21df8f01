//! Proposes the joint rotations of the previous frame: the arm or leg moves rigidly with its parent.

use super::{Pool, Propose};
use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::Pose;

/// Proposal with the joint rotations of the previous frame.
#[derive(Debug)]
pub(in crate::hypotheses) struct CarriedByParent;

impl Propose for CarriedByParent {
    fn propose(&mut self, at: Extremity, _history: &[History], rough: &mut RoughSearch, pool: &mut Pool) {
        let previous = at.context.previous;
        if previous.len() != at.matched.poses.len() {
            return;
        }
        let body = &at.context.model.body;
        let carry = |poses: &mut [Pose]| move_with_parent(at.chain(), body, previous, poses);
        let least = rough.changed(at, carry, pool.least, &mut pool.points.poses);
        if least < pool.least {
            pool.least = least;
            pool.points.set(Basis::Points);
        }
    }
}

/// Sets the limbs of an arm or leg in `now` such that their poses relative to their parents are those in `then`.
fn move_with_parent(chain: &TwoBone, body: &Body, then: &[Pose], now: &mut [Pose]) {
    for limb in chain.limbs() {
        if let Some((parent, _)) = &body.limbs()[limb].parent {
            now[limb] = now[*parent] * then[*parent].inverse() * then[limb];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::math::{Quat, Vec3};

    #[test]
    fn a_chain_moves_rigidly_with_its_parent_and_no_other_limb_moves() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let then = body.rest_pose(Pose::IDENTITY);
        let motion = Pose::from_parts(Vec3::new(0.3, -0.2, 0.1), Quat::from_rotation_z(0.4));
        for chain in TwoBone::from_body(&body) {
            let mut now: Vec<Pose> = then.iter().map(|pose| motion * *pose).collect();
            let expected = now.clone();
            // The current poses of the arm must not matter.
            chain.limbs().for_each(|limb| now[limb] = Pose::IDENTITY);
            move_with_parent(&chain, &body, &then, &mut now);
            for (found, expected) in now.iter().zip(&expected) {
                assert!((found.translation - expected.translation).length() < 1e-12);
                assert!(found.rotation.angle_between(expected.rotation) < 1e-6);
            }
        }
    }
}
