//! Warm start: named sites drive the body. Before a solver that moves each limb alone sees a frame, the joint chain follows the sites.
//!
//! A position of a hand says something about the whole arm, but a limb alone hears of it one joint a step (K06 IV-B.7). Here
//! the sites with positions and rays move the chain as one, each joint by no more than its motion allows (R07, J10).
//!
//! With points the limbs on the way to a site follow their own along with it, and every other limb is held where it is by as
//! many points as it has: an arm that can reach its hand leaves the trunk alone, and a leg that nothing measures is carried.

use super::{ChainSolver, DAMPING, LIMIT_SIGMA, Problem};
use crate::association::correspondence::SitePair;
use crate::body::Body;
use crate::body::kinematics::{joint_turn, place};
use crate::math::Pose;
use crate::terms::normal_equations::{LimbBlock, NormalEquations};
use crate::terms::{Limits, Prior, Sites, Surface, Term};

/// Information of the heaviest site in surface points of weight one. Only the proportions of weights matter in this solver,
/// and the limbs' own points have their say afterwards.
const DRIVING_INFORMATION: f64 = 2.0;
/// Scale of the kernel, meters: sites that drive come from far.
const SCALE: f64 = 0.5;

/// Damped Gauss-Newton steps on the sites, and the points where they are matched before.
#[derive(Debug, Default)]
pub(crate) struct WarmStart {
    normal: NormalEquations,
    chain: ChainSolver,
    joint_sigmas: Vec<f64>,
    /// The poses with their joints closed: before the frame, now, and before the last step.
    start: Vec<Pose>,
    closed: Vec<Pose>,
    before: Vec<Pose>,
    moved: Vec<Pose>,
    /// The limbs that are driven.
    driven: Vec<bool>,
    /// With points: the limbs that follow theirs, and what holds the others.
    following: Vec<bool>,
    held: NormalEquations,
}

impl WarmStart {
    /// Lets all limbs move, against their points; false without sites.
    pub(crate) fn drives_all(&mut self, problem: &Problem) -> bool {
        let count = problem.body.limbs().len();
        self.driven.clear();
        self.driven.resize(count, true);
        self.following.clear();
        self.following.resize(count, false);
        for pair in problem.correspondences.sites.iter().filter(|pair| pair.base_weight > 0.0) {
            self.following[pair.limb] = true;
            drive_from(problem.body, pair.limb, &mut self.following);
        }
        self.following.contains(&true)
    }

    /// Whether sites farther than `from` meters from where they were seen lead their limbs alone in this frame.
    pub(crate) fn drives_far(&mut self, problem: &Problem, from: f64) -> bool {
        if problem.step == 0 {
            let far = |pair: &&SitePair| pair.weight > 0.0 && (pair.across * (pair.x - pair.p)).length() > from;
            self.following.clear();
            self.driven.clear();
            self.driven.resize(problem.body.limbs().len(), false);
            for pair in problem.correspondences.sites.iter().filter(far) {
                drive_from(problem.body, pair.limb, &mut self.driven);
            }
        }
        self.driven.contains(&true)
    }

    /// One step: the limbs move as those of a body with closed joints would; gaps that the bands left stay as they are.
    pub(crate) fn step(&mut self, problem: &Problem, poses: &mut [Pose]) {
        let Problem { body, correspondences, config, .. } = problem;
        if problem.step == 0 {
            self.start.clear();
            self.start.extend_from_slice(poses);
            close(body, &mut self.start);
            self.closed.clone_from(&self.start);
        }
        let time_scale = problem.time_scale * config.motion_scale;
        self.joint_sigmas.clear();
        self.joint_sigmas.extend(
            body.limbs().iter().map(|part| part.parent.as_ref().map_or(1.0, |(_, joint)| joint.motion) * time_scale),
        );
        let root = [config.root_turn_sigma, config.root_shift_sigma].map(|sigma| sigma * time_scale);
        self.normal.clear(poses.len());
        // Beside points a site within its bias must not count as much as any other.
        let with_points = !self.following.is_empty();
        let weights = correspondences.sites.iter().map(|pair| if with_points { pair.base_weight } else { pair.weight });
        let heaviest = weights.fold(f64::MIN_POSITIVE, f64::max);
        let information = DRIVING_INFORMATION / (heaviest * config.point_sigma * config.point_sigma);
        if with_points {
            self.add_points(problem, information);
        }
        let terms: [&dyn Term; 3] = [
            &Sites { correspondences, information, scale: SCALE, biased: true },
            &Prior { predicted: &self.start, root, joints: &self.joint_sigmas, holds: &[], rests: &[] },
            &Limits { sigma: LIMIT_SIGMA },
        ];
        for term in terms {
            term.add(body, &self.closed, &mut self.normal);
        }
        self.before.clone_from(&self.closed);
        self.chain.step(body, &self.normal, DAMPING, 1.0, &mut self.closed);
        // The others stay where they were.
        self.moved.clone_from(&self.closed);
        for (limb, part) in body.limbs().iter().enumerate() {
            self.closed[limb] = match &part.parent {
                Some((parent, joint)) if self.driven[limb] => {
                    let turn = joint_turn(joint, &self.moved[*parent], &self.moved[limb]);
                    place(joint, &self.closed[*parent], turn)
                }
                None if self.driven[limb] => self.moved[limb],
                _ => self.before[limb],
            };
        }
        for ((pose, before), after) in poses.iter_mut().zip(&self.before).zip(&self.closed) {
            *pose = *after * before.inverse() * *pose;
            pose.rotation = pose.rotation.normalize();
        }
    }

    /// Points of the limbs that follow draw them, those of the others hold them where they are.
    fn add_points(&mut self, problem: &Problem, information: f64) {
        let Problem { body, correspondences, config, .. } = problem;
        let surface =
            |slide| Surface { correspondences, information, tangential_weight: slide, scale: config.kernel_start };
        // Limbs that follow may slide along themselves.
        surface(config.tangential_weight).add(body, &self.closed, &mut self.normal);
        self.held.clear(self.closed.len());
        surface(1.0).add(body, &self.closed, &mut self.held);
        let blocks = self.normal.limbs.iter_mut().zip(&self.held.limbs);
        for ((block, held), _) in blocks.zip(&self.following).filter(|(_, follows)| !**follows) {
            *block = LimbBlock { h: held.h, ..LimbBlock::default() };
        }
    }
}

/// Closes the joints from the root outwards, orientations kept.
fn close(body: &Body, poses: &mut [Pose]) {
    for (index, limb) in body.limbs().iter().enumerate() {
        if let Some((parent, joint)) = &limb.parent {
            let turn = joint_turn(joint, &poses[*parent], &poses[index]);
            poses[index] = place(joint, &poses[*parent], turn);
        }
    }
}

/// Marks the limbs from `limb` to the first whose parent carries several.
fn drive_from(body: &Body, limb: usize, driven: &mut [bool]) {
    let mut next = Some(limb);
    while let Some(limb) = next {
        let Some((parent, _)) = &body.limbs()[limb].parent else { break };
        driven[limb] = true;
        let carried = body.limbs().iter().filter(|other| other.parent.as_ref().is_some_and(|(limb, _)| limb == parent));
        next = (carried.count() == 1).then_some(*parent);
    }
}
