//! Projects the poses of loosely joined limbs (K07's elastic joints) to angles of the chain.

use super::goal::{Aim, Goal};
use super::model::{ChainModel, Turn};
use super::solver::{IkProblem, IkSolver, SolverOptions};
use voodoo_core::kinematics::joint_turn;
use voodoo_core::math::{Pose, Vec3, reset, rotation_vector};
use voodoo_core::{Body, Joint};

/// Lever that weights a limb's rotation about its axis against its position, meters: approximately the radius of an arm.
const GIRTH: f64 = 0.05;

/// Reads the joint angles from `poses` (one per limb of the body, world frame); gaps at the joints are ignored. The result is
/// within the limits.
pub fn read(body: &Body, model: &ChainModel, world_from_base: &Pose, poses: &[Pose], angles: &mut Vec<f64>) {
    reset(angles, model.freedoms(), 0.0);
    for link in model.links() {
        let joint: Option<&(usize, Joint)> = body.limbs()[link.limb].parent.as_ref();
        let world_from_limb = &poses[link.limb];
        let turned = joint.map(|(parent, joint)| rotation_vector(joint_turn(joint, &poses[*parent], world_from_limb)));
        let value = &mut angles[link.start..];
        match (link.turn, turned) {
            (Turn::Free, _) => {
                let pose = world_from_base.inv_mul(world_from_limb);
                value[..3].copy_from_slice(&pose.translation.to_array());
                value[3..6].copy_from_slice(&rotation_vector(pose.rotation).to_array());
            }
            (Turn::Hinge(axis), Some(turned)) => value[0] = turned.dot(axis),
            (Turn::Ball, Some(turned)) => value[..3].copy_from_slice(&turned.to_array()),
            _ => {}
        }
    }
    for (angle, [low, high]) in angles.iter_mut().zip(model.limits()) {
        *angle = angle.clamp(*low, *high);
    }
}

/// Finds the angles of the closed chain nearest to `poses`: least squares over both ends and the girth of every limb.
pub fn project(body: &Body, model: &ChainModel, world_from_base: &Pose, poses: &[Pose], angles: &mut Vec<f64>) {
    read(body, model, world_from_base, poses, angles);
    let mut goals = Vec::with_capacity(4 * model.links().len());
    for (index, link) in model.links().iter().enumerate() {
        let end = Vec3::Z * body.limbs()[link.limb].shape.length();
        for point in [Vec3::ZERO, end, GIRTH * Vec3::X, GIRTH * Vec3::Y] {
            let aim = Aim::Position(poses[link.limb].transform_point(point));
            goals.push(Goal { link: index, point, aim, weight: 1.0, level: 0 });
        }
    }
    let options = SolverOptions { steps: 20, tolerance: 1e-9, still: 1e-8, ..SolverOptions::default() };
    let problem = IkProblem { model, base: *world_from_base, goals: &goals, criterion: None, rest: &[], options };
    IkSolver::default().solve(&problem, angles);
}
