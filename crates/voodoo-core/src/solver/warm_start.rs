//! Warm start: moves the body towards the named sites as a joint chain, before the solver's first step.
//!
//! The position of a hand constrains the whole arm, but in a solver that moves each limb separately it propagates by one joint
//! per step (K06 IV-B.7). Here the sites with positions and rays move the whole chain, each joint within its expected motion
//! (R07, J10).
//!
//! Where points are matched too, the limbs that lead to a site also follow their own points. Every other limb is held in place
//! by the information of its points: an arm that can reach its hand position does not move the trunk, and a leg without
//! measurements moves with its parent.

use super::{ChainSolver, Problem};
use crate::association::correspondence::SitePair;
use crate::body::kinematics::{joint_turn, place};
use crate::body::{Body, Model};
use crate::config::SolverKind;
use crate::fit::Context;
use crate::math::{Pose, refill, reset};
use crate::terms::normal_equations::{LimbBlock, NormalEquations};
use crate::terms::{Limits, Prior, Sites, Surface, Term};

/// Information of the heaviest site, in surface points of weight one. Only the proportions of weights matter in this solver, and
/// the limbs' own points correct the result in later steps.
const DRIVING_INFORMATION: f64 = 2.0;
/// Scale of the kernel, meters: large, because the sites may be far from the limbs.
const SCALE: f64 = 0.5;

/// Sites farther than this from their measurement move the chain before points are assigned, meters: points assigned to the limb at
/// its old pose would hold it there. And the number of such rounds.
const DRIVEN_FROM: f64 = 0.25;
const WARM_START_ROUNDS: usize = 4;
/// Rounds in which the chain follows the sites for the limbwise solver; each of them reassigns the points.
const LIMBWISE_ROUNDS: usize = 3;

/// Damped Gauss-Newton steps on the sites, and on the points where they are matched before the warm start.
#[derive(Debug, Default)]
pub(crate) struct WarmStart {
    chain: ChainSolver,
    joint_sigmas: Vec<f64>,
    /// The poses with closed joints: before the frame, now, and after a step of all limbs.
    start: Vec<Pose>,
    closed: Vec<Pose>,
    moved: Vec<Pose>,
    /// The limbs that the sites move.
    driven: Vec<bool>,
    /// With points: the limbs that follow their points, and the information that holds the others.
    following: Vec<bool>,
    held: NormalEquations,
}

impl WarmStart {
    /// Follows the named sites before the first step of a frame. Returns true to request another round. `problem.predicted` are the
    /// poses before the frame.
    pub(crate) fn prepare(&mut self, problem: Problem, poses: &mut [Pose]) -> bool {
        let (drives, rounds) = match problem.context.config.solver {
            SolverKind::Limbwise => (self.drives_all(problem), LIMBWISE_ROUNDS),
            SolverKind::Chain => (self.drives_far(problem), WARM_START_ROUNDS),
            SolverKind::Tree => return false,
        };
        if drives {
            self.step(problem, poses);
        }
        drives && problem.step + 1 < rounds
    }

    /// Lets all limbs move, with points matched; returns false without sites.
    fn drives_all(&mut self, problem: Problem) -> bool {
        let body = &problem.context.model.body;
        let count = body.limbs().len();
        reset(&mut self.driven, count, true);
        reset(&mut self.following, count, false);
        for pair in problem.correspondences.sites.iter().filter(|pair| pair.base_weight > 0.0) {
            self.following[pair.limb] = true;
            drive_from(body, pair.limb, &mut self.following);
        }
        self.following.contains(&true)
    }

    /// Whether sites far from their measured positions move their limbs in this frame, without points.
    fn drives_far(&mut self, problem: Problem) -> bool {
        if problem.step == 0 {
            let far = |pair: &&SitePair| pair.weight > 0.0 && (pair.across * (pair.x - pair.p)).length() > DRIVEN_FROM;
            self.following.clear();
            let body = &problem.context.model.body;
            reset(&mut self.driven, body.limbs().len(), false);
            for pair in problem.correspondences.sites.iter().filter(far) {
                drive_from(body, pair.limb, &mut self.driven);
            }
        }
        self.driven.contains(&true)
    }

    /// One step: each limb moves as it would with closed joints; gaps that the bands left are kept.
    fn step(&mut self, problem: Problem, poses: &mut [Pose]) {
        let Problem { context, correspondences, .. } = problem;
        let Context { model: Model { body, .. }, config, .. } = context;
        if problem.step == 0 {
            poses.clone_into(&mut self.start);
            close(body, &mut self.start);
            self.closed.clone_from(&self.start);
        }
        let time_scale = context.time_scale * config.motion_scale;
        let motions = body.limbs().iter().map(|part| part.parent.as_ref().map_or(1.0, |(_, joint)| joint.motion));
        refill(&mut self.joint_sigmas, motions.map(|motion| motion * time_scale));
        let root = [config.root_turn_sigma, config.root_shift_sigma].map(|sigma| sigma * time_scale);
        self.chain.normal.clear(poses.len());
        // Where points are used, the weights are those before the reduction for bias: otherwise a site within its bias would
        // count fully.
        let with_points = !self.following.is_empty();
        let weights = correspondences.sites.iter().map(|pair| if with_points { pair.base_weight } else { pair.weight });
        let heaviest = weights.fold(f64::MIN_POSITIVE, f64::max);
        let information = DRIVING_INFORMATION / (heaviest * config.point_sigma * config.point_sigma);
        if with_points {
            self.add_points(problem, information);
        }
        let terms: [&dyn Term; 3] = [
            &Sites { correspondences, information, scale: SCALE, biased: true },
            &Prior { predicted: &self.start, root, joints: &self.joint_sigmas, gain: 0.0, stillness: &[], rests: &[] },
            &Limits,
        ];
        for term in terms {
            term.add(body, &self.closed, &mut self.chain.normal);
        }
        self.moved.clone_from(&self.closed);
        self.chain.step(body, 1.0, &mut self.moved);
        for (limb, pose) in poses.iter_mut().enumerate() {
            let before = self.closed[limb];
            // Limbs that are not driven keep their poses.
            if self.driven[limb] {
                self.closed[limb] = body.limbs()[limb].parent.as_ref().map_or(self.moved[limb], |(parent, joint)| {
                    let turn = joint_turn(joint, &self.moved[*parent], &self.moved[limb]);
                    place(joint, &self.closed[*parent], turn)
                });
            }
            *pose = self.closed[limb] * before.inverse() * *pose;
            pose.rotation = pose.rotation.normalize();
        }
    }

    /// Points of the following limbs pull them; points of the other limbs hold those in place.
    fn add_points(&mut self, problem: Problem, information: f64) {
        let Problem { context: Context { model, config, .. }, correspondences, .. } = problem;
        let body = &model.body;
        let surface =
            |slide| Surface { correspondences, information, tangential_weight: slide, scale: config.kernel_start };
        // Following limbs may slide along their own axis.
        surface(config.tangential_weight).add(body, &self.closed, &mut self.chain.normal);
        self.held.clear(self.closed.len());
        surface(1.0).add(body, &self.closed, &mut self.held);
        let blocks = self.chain.normal.limbs.iter_mut().zip(&self.held.limbs);
        for ((block, held), _) in blocks.zip(&self.following).filter(|(_, follows)| !**follows) {
            *block = LimbBlock { h: held.h, ..LimbBlock::default() };
        }
    }
}

/// Closes the joints from the root outwards, keeping orientations.
fn close(body: &Body, poses: &mut [Pose]) {
    for (limb, parent, joint) in body.joints() {
        let turn = joint_turn(joint, &poses[parent], &poses[limb]);
        poses[limb] = place(joint, &poses[parent], turn);
    }
}

/// Marks `limb` and its ancestors, up to the first limb whose parent has several children.
fn drive_from(body: &Body, limb: usize, driven: &mut [bool]) {
    let mut next = Some(limb);
    while let Some(limb) = next {
        let Some(parent) = body.parent(limb) else { break };
        driven[limb] = true;
        next = (body.children(parent).count() == 1).then_some(parent);
    }
}
