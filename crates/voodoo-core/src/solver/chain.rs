//! Gauss-Newton over the whole body with exact joints: `H = J^T H_limbs J` (R07 eq. 10, method section 4.3).

use nalgebra::{Matrix6, Vector6};

use super::{DAMPING, FLOOR, LARGEST_TURN};
use crate::body::kinematics::{Chain, exp, hinge_axis, joint_axes, joint_turn, place, screw};
use crate::body::{Body, JointKind};
use crate::math::solve_in_place;
use crate::math::{Pose, Quat, Vec3, refill, reset};
use crate::terms::normal_equations::NormalEquations;

/// Working memory of the chain solver.
#[derive(Debug, Default)]
pub(crate) struct ChainSolver {
    /// The normal equations of the limbs, to which terms add.
    pub(crate) normal: NormalEquations,
    pub(super) chain: Chain,
    pub(super) screws: Vec<Vector6<f64>>,
    pub(super) composite: Vec<(Matrix6<f64>, Vector6<f64>)>,
    pub(super) h: Vec<f64>,
    pub(super) step: Vec<f64>,
    /// Of the relative lengths of pairs of limbs: mixed second derivatives with the pose unknowns, one row per pair; second
    /// derivatives; and gradient.
    pub(super) mixed: Vec<f64>,
    pub(super) reduced: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    /// Of covariances: columns of the half-solved system, one row per unknown; and the unknowns that move a limb, last one first.
    pub(super) rows: Vec<[f64; 6]>,
    pub(super) moving: Vec<usize>,
}

impl ChainSolver {
    /// One damped step from the normal equations at `poses`, scaled by `stride`; afterwards the joints are exactly closed.
    pub(crate) fn step(&mut self, body: &Body, stride: f64, poses: &mut [Pose]) {
        self.assemble(body, poses, DAMPING);
        if solve_in_place(&mut self.h, &mut self.step, self.chain.freedoms()) {
            self.apply(body, stride, poses);
        }
    }

    pub(super) fn assemble(&mut self, body: &Body, poses: &[Pose], damping: f64) {
        let Self { normal, chain, screws, composite, h, step, .. } = self;
        chain.layout(body);
        let n = chain.freedoms();
        // The twist of every unknown: six of the root, then those of the joints.
        refill(screws, (0..6).map(|i| Vector6::ith(i, 1.0)));
        for (_, parent, joint) in body.joints() {
            let center = poses[parent] * joint.parent_from_joint.translation;
            let (axes, count) = joint_axes(joint, &poses[parent]);
            screws.extend(axes[..count].iter().map(|axis| screw(*axis, center)));
        }
        // Blocks of a limb and all its descendants, leaf to root.
        refill(composite, normal.limbs.iter().map(|block| (block.h, block.g)));
        for limb in (1..composite.len()).rev() {
            let (h, g) = composite[limb];
            let parent = &mut composite[chain.parent[limb]];
            parent.0 += h;
            parent.1 += g;
        }
        reset(h, n * n, 0.0);
        reset(step, n, 0.0);
        for limb in 0..composite.len() {
            let (block, gradient) = &composite[limb];
            for row in chain.unknowns(limb) {
                let force = block * screws[row];
                step[row] = -screws[row].dot(gradient);
                // The degrees of freedom of every ancestor move this limb too.
                for ancestor in chain.up_from(limb) {
                    for column in chain.unknowns(ancestor).take_while(|column| *column <= row) {
                        h[row * n + column] = force.dot(&screws[column]);
                    }
                }
            }
        }
        for limb in 1..composite.len() {
            let block = &normal.joints[limb];
            let rows = chain.unknowns(limb);
            for row in rows.clone() {
                let turn = screws[row].fixed_rows::<3>(0);
                let force = block.h * turn;
                step[row] -= turn.dot(&block.g);
                for column in rows.start..=row {
                    h[row * n + column] += force.dot(&screws[column].fixed_rows::<3>(0));
                }
            }
        }
        for row in 0..n {
            h[row * n + row] += damping * h[row * n + row] + FLOOR;
        }
    }

    fn apply(&mut self, body: &Body, stride: f64, poses: &mut [Pose]) {
        let Self { chain, step, .. } = self;
        let largest = step
            .iter()
            .enumerate()
            .filter(|(i, _)| !(3..6).contains(i))
            .fold(0.0_f64, |most, (_, value)| most.max(value.abs()));
        let shrink = stride.min(LARGEST_TURN / largest.max(f64::MIN_POSITIVE));
        let part = |index: usize| shrink * step[index];
        // Joint rotations are computed from the old poses before their parents move. Children come after parents, so iterate
        // backwards.
        for (limb, parent, joint) in body.joints().rev() {
            let (turn, start) = (joint_turn(joint, &poses[parent], &poses[limb]), chain.unknowns(limb).start);
            let more = match joint.kind() {
                JointKind::Hinge => hinge_axis(joint) * part(start),
                _ => Vec3::new(part(start), part(start + 1), part(start + 2)),
            };
            // The slot stores the joint's new rotation until the forward pass sets the limb pose.
            poses[limb] = Pose::from_parts(Vec3::ZERO, (Quat::from_scaled_axis(more) * turn).normalize());
        }
        poses[0] = exp(&Vector6::from_fn(|i, _| part(i))) * poses[0];
        poses[0].rotation = poses[0].rotation.normalize();
        for (limb, parent, joint) in body.joints() {
            poses[limb] = place(joint, &poses[parent], poses[limb].rotation);
            poses[limb].rotation = poses[limb].rotation.normalize();
        }
    }
}
