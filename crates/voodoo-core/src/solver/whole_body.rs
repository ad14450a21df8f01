//! All limbs at once: the terms are summed into one system, which the chain or the tree solves.

use super::lengths::Lengths;
use super::schedule::narrowed;
use super::{
    ChainSolver, DAMPING, Gate, LIMIT_SIGMA, Problem, Reassociation, Schedule, Solver, TreeSolver, WarmStart,
    WarmStartInput,
};
use crate::body::{JointKind, Pair};
use crate::config::Config;
use crate::math::{Pose, Vec3};
use crate::terms::normal_equations::NormalEquations;
use crate::terms::{Contour, Floor, Limits, Penetration, Posture, Prior, Regions, Sites, Surface, Term};

/// Standard deviation of an axis that lies in another limb or below the floor, meters.
const OVERLAP_SIGMA: f64 = 0.03;
/// Scatter of the points about the body from which deviations count as noise in full, in units of `point_sigma`.
const ROUGH: f64 = 0.35;
/// From this step on, what is left of a deviation from the prediction may be noise: before, the body has to find its points.
const STILL_FROM: usize = 3;
/// Where points are measured, all steps of a frame but the last go so many times as far as the linear system says: closest points
/// follow the body, so what they ask for is only a part of the way (P. Besl and N. McKay, "A Method for Registration of 3-D
/// Shapes", IEEE PAMI 1992, whose accelerated steps go on along a line as well).
const OVER_RELAXATION: f64 = 1.4;
/// A limb with this many matched patches moves freely; one with fewer in proportion less, down to the second share.
const FREE_WEIGHT: f64 = 20.0;
const HIDDEN_MOTION: f64 = 0.1;
/// Share by which a hand, foot or head that does not show at all is drawn to its posture at rest in 1/30 s: else it would keep for
/// ever how it was seen last. In a quarter of a second it comes half of the way.
const TO_REST: f64 = 0.1;
/// By contours alone every joint moves by so much at least, radians: no points hold a shoulder where it is not.
const LEAST_MOTION: f64 = 0.1;
/// By contours alone a joint that turns little is held to where it is at rest by a standard deviation of this share of half of its
/// range, times `motion_scale`.
const POSTURE: f64 = 1.0;
/// Information that holds a length's relative change back in one frame, and that draws it to the length set.
pub(crate) const LENGTH_INFORMATION: [f64; 2] = [1e4, 5e2];
/// Least scale of the kernel of sites, meters: they were gated before, and a limb that is lost comes from far.
pub(crate) const SITE_SCALE: f64 = 0.15;
/// Sites farther than this from their measurement drive the chain before the points are assigned, meters; rounds of it.
const DRIVEN_FROM: f64 = 0.25;
const WARM_START_ROUNDS: usize = 4;

/// Damped Gauss-Newton on robust terms.
#[derive(Debug, Default)]
pub(crate) struct WholeBody {
    normal: NormalEquations,
    chain: ChainSolver,
    /// Moves the limbs instead of the chain, if there.
    tree: Option<TreeSolver>,
    lengths: Lengths,
    warm_start: WarmStart,
    joint_sigmas: Vec<f64>,
    /// Shares by which joints are drawn to their turns at rest.
    rests: Vec<f64>,
    /// Weight of the sites on each limb and beyond it.
    sites: Vec<f64>,
    /// Weight of the edges of colors on each limb.
    edges: Vec<f64>,
    /// A sphere around each limb.
    spheres: Vec<(Vec3, f64)>,
    stillness: Stillness,
}

/// How calm the root and the joints are, as the step has said in which a frame began to hold them, and the last step.
#[derive(Debug, Default)]
struct Stillness {
    joints: Vec<f64>,
    step: usize,
    holds: Vec<f64>,
}

impl Solver for WholeBody {
    fn solve(&mut self, problem: &Problem, poses: &mut [Pose]) {
        self.sum_terms(problem, poses, true);
        let follows = problem.step + 1 < problem.config.max_steps && !contours_alone(problem);
        let stride = if follows { OVER_RELAXATION } else { 1.0 };
        match &mut self.tree {
            Some(tree) => tree.step(problem.body, &self.normal, DAMPING, stride, problem.config.band_sigma, poses),
            None => self.chain.step(problem.body, &self.normal, DAMPING, stride, poses),
        }
    }

    fn lengths(&mut self, problem: &Problem, poses: &[Pose], pairs: &[Pair], pull: &[f64], change: &mut [f64]) -> bool {
        self.sum_terms(problem, poses, false);
        let Self { normal, chain, lengths, .. } = self;
        chain.lengths(problem.body, normal, poses, pairs, (LENGTH_INFORMATION[0], pull), change, lengths)
    }

    fn prepare(&mut self, problem: &Problem, poses: &mut [Pose]) -> bool {
        // From so far, points that are thought to lie on the limb where it was would hold it there.
        if self.tree.is_some() || !self.warm_start.drives_far(problem, DRIVEN_FROM) {
            return false;
        }
        self.warm_start.step(problem, poses);
        problem.step + 1 < WARM_START_ROUNDS
    }

    fn schedule(&self, config: &Config) -> Schedule {
        let gate = |distance: f64| Gate { box_margin: distance, distance };
        Schedule {
            gates: [gate(config.gate_start), gate(config.gate_end)],
            reassociation: Reassociation::EverySecondStep,
            warm_start: WarmStartInput::Sites,
            bands: false,
            visible_side: config.facing,
            whole_body: true,
        }
    }
}

impl WholeBody {
    /// The same terms, solved with elastic bands.
    pub(crate) fn tree() -> Self {
        Self { tree: Some(TreeSolver::default()), ..Self::default() }
    }

    /// The normal equations at `poses`, with or without the sites that may always be off.
    fn sum_terms(&mut self, problem: &Problem, poses: &[Pose], biased: bool) {
        self.weigh_sites(problem, poses.len(), biased);
        self.expect_motion(problem);
        let Problem { body, correspondences, predicted, config, .. } = problem;
        let information = 1.0 / (config.point_sigma * config.point_sigma);
        let scale = narrowed(config.kernel_start, config.kernel_end, problem.step);
        let root = [config.root_turn_sigma, config.root_shift_sigma]
            .map(|sigma| sigma * problem.time_scale * config.motion_scale);
        let edge_information = 1.0 / (config.depth_contour_sigma * config.depth_contour_sigma);
        let surface = Surface { correspondences, information, tangential_weight: config.tangential_weight, scale };
        let sites = Sites { correspondences, information, scale: (3.0 * scale).max(SITE_SCALE), biased };
        let contour = Contour { pairs: &correspondences.contour, information: edge_information, scale: 2.0 * scale };
        let regions = Regions { pairs: &correspondences.regions };
        let gain = still_prior_gain(problem, information);
        let free = Prior { predicted, root, joints: &self.joint_sigmas, holds: &[], rests: &self.rests };
        let holds = self.stillness.prior_gains(problem, &free, poses, gain);
        let prior = Prior { holds, ..free };
        let limits = Limits { sigma: LIMIT_SIGMA };
        self.spheres.clear();
        self.spheres.extend(body.limbs().iter().zip(poses).map(|(limb, pose)| limb.shape.sphere(pose)));
        let penetration = Penetration { sigma: OVERLAP_SIGMA, spheres: &self.spheres };
        let posture = Posture { fraction: POSTURE * config.motion_scale };
        let floor = problem.floor.map(|plane| Floor { plane, sigma: OVERLAP_SIGMA });
        // The objective: one more term is a file and a line here.
        let terms: [Option<&dyn Term>; 9] = [
            Some(&surface),
            Some(&sites),
            Some(&contour),
            Some(&regions),
            Some(&prior),
            config.limits.then_some(&limits),
            contours_alone(problem).then_some(&posture),
            config.penetration.then_some(&penetration),
            floor.as_ref().filter(|_| config.penetration).map(|floor| floor as &dyn Term),
        ];
        self.normal.clear(poses.len());
        for term in terms.into_iter().flatten() {
            term.add(body, poses, &mut self.normal);
        }
    }

    /// A site speaks for every joint between it and the root: what a hand is seen to do, its arm does.
    fn weigh_sites(&mut self, problem: &Problem, limbs: usize, biased: bool) {
        self.sites.clear();
        self.sites.resize(limbs, 0.0);
        for pair in problem.correspondences.sites.iter().filter(|pair| biased || pair.bias <= 0.0) {
            self.sites[pair.limb] += pair.weight;
        }
        for (limb, part) in problem.body.limbs().iter().enumerate().rev() {
            if let Some((parent, _)) = &part.parent {
                self.sites[*parent] += self.sites[limb];
            }
        }
    }

    /// Standard deviation of every joint's motion.
    fn expect_motion(&mut self, problem: &Problem) {
        let information = 1.0 / (problem.config.point_sigma * problem.config.point_sigma);
        self.edges.clear();
        self.edges.resize(problem.body.limbs().len(), 0.0);
        for pair in &problem.correspondences.regions {
            self.edges[pair.limb] += pair.information / information;
        }
        let contours_alone = contours_alone(problem);
        self.joint_sigmas.clear();
        self.rests.clear();
        for (limb, part) in problem.body.limbs().iter().enumerate() {
            let motion = part.parent.as_ref().map_or(1.0, |(_, joint)| joint.motion);
            let motion = if contours_alone { motion.max(LEAST_MOTION) } else { motion };
            // A limb that hardly shows keeps to what is expected: a few stray points must not swing it.
            let measured = problem.correspondences.limbs[limb].total_weight() + self.sites[limb] + self.edges[limb];
            let measured_fraction = (measured / FREE_WEIGHT).min(1.0);
            let end = part.match_caps[1] && !contours_alone;
            let rests = end && part.parent.as_ref().is_some_and(|(_, joint)| joint.kind() == JointKind::Elliptic);
            self.rests.push(if rests {
                ((1.0 - measured_fraction) * TO_REST * problem.time_scale).min(1.0)
            } else {
                0.0
            });
            let measured_fraction = measured_fraction.max(HIDDEN_MOTION);
            self.joint_sigmas.push(motion * measured_fraction * problem.time_scale * problem.config.motion_scale);
        }
    }
}

impl Stillness {
    /// How much tighter the root and each joint are held in this step, at most by `gain`.
    fn prior_gains(&mut self, problem: &Problem, prior: &Prior, poses: &[Pose], gain: f64) -> &[f64] {
        let Self { joints, step, holds } = self;
        // A frame, and every hypothesis in it, begins with an earlier step than the last one before.
        let anew = problem.step <= *step || joints.len() != poses.len();
        *step = problem.step;
        if anew || problem.step == STILL_FROM {
            prior.stillness(problem.body, poses, joints);
        }
        holds.clear();
        holds.extend(joints.iter().map(|stillness| gain * stillness));
        holds
    }
}

/// Whether edges of colors are matched and no points.
fn contours_alone(problem: &Problem) -> bool {
    let Problem { correspondences, .. } = problem;
    !correspondences.regions.is_empty() && correspondences.limbs.iter().all(|matches| matches.candidate.is_empty())
}

/// How much tighter small deviations from the prediction are held, in this step.
fn still_prior_gain(problem: &Problem, information: f64) -> f64 {
    let Problem { correspondences, config, step, .. } = problem;
    // After the last step only lengths are asked for: a pose held tightly would let them bear every deviation.
    let holds = (STILL_FROM..config.max_steps).contains(step);
    // Points that lie closer to the body than they are trusted to are not at rest by chance: what they show is motion.
    let scatter = if holds { correspondences.scatter(config.kernel_end).unwrap_or(0.0) } else { 0.0 };
    config.still_prior_gain * (scatter * information / (ROUGH * ROUGH)).min(1.0)
}
