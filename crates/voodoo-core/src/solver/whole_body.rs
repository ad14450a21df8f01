//! All limbs at once: the terms are summed into one system, which the chain or the tree solves.

use super::lengths::Lengths;
use super::{ChainSolver, Gate, Problem, Solver, TreeSolver, WarmStart};
use crate::body::Pair;
use crate::config::Config;
use crate::math::Pose;
use crate::terms::normal_equations::NormalEquations;
use crate::terms::{Contour, Limits, Penetration, Prior, Sites, Surface, Term};

/// Standard deviation of a violated joint limit, radians: 3 degrees.
const LIMIT_SIGMA: f64 = 0.05;
/// Standard deviation of an axis that lies in another limb, metres.
const OVERLAP_SIGMA: f64 = 0.03;
/// Factor from step to step.
const NARROWING: f64 = 0.7;
/// Scatter of the points about the body from which deviations count as noise in full, in units of `point_sigma`.
const ROUGH: f64 = 0.35;
/// From this step on, what is left of a deviation from the prediction may be noise: before, the body has to find its points.
const CALM_FROM: usize = 3;
/// From this step on, only every second one assigns points and looks for edges.
const RENEWED: usize = 2;
/// A limb with this many matched patches moves freely; one with fewer in proportion less, down to the second share.
const SHOWN: f64 = 20.0;
const HIDDEN_MOTION: f64 = 0.1;
/// Information that holds a length's relative change back in one frame, and that draws it to the length set.
const LENGTH_INFORMATION: [f64; 2] = [1e4, 5e2];
/// Least scale of the kernel of sites, metres: they were gated before, and a limb that is lost comes from far.
const SITE_SCALE: f64 = 0.15;
/// Sites farther than this from their measurement lead the chain before the points are assigned, metres; rounds of it.
const LED_FROM: f64 = 0.25;
const LEAD: usize = 4;
/// Relative damping of the normal matrix.
const DAMPING: f64 = 1e-3;

/// Gates and kernels narrow from step to step: far points pull while the pose is rough.
fn narrowed(start: f64, end: f64, step: usize) -> f64 {
    (start * NARROWING.powi(step.min(1000) as i32)).max(end)
}

/// Damped Gauss-Newton on robust terms.
#[derive(Debug, Default)]
pub struct WholeBody {
    normal: NormalEquations,
    chain: ChainSolver,
    /// Moves the limbs instead of the chain, if there.
    tree: Option<TreeSolver>,
    lengths: Lengths,
    guide: WarmStart,
    joint_sigmas: Vec<f64>,
    /// Weight of the sites on each limb and beyond it.
    sites: Vec<f64>,
}

impl Solver for WholeBody {
    fn solve(&mut self, problem: &Problem, poses: &mut [Pose]) {
        self.sum_terms(problem, poses, true);
        match &mut self.tree {
            Some(tree) => tree.step(problem.body, &self.normal, DAMPING, problem.config.band_sigma, poses),
            None => self.chain.step(problem.body, &self.normal, DAMPING, poses),
        }
    }

    fn lengths(&mut self, problem: &Problem, poses: &[Pose], pairs: &[Pair], change: &mut [f64]) -> bool {
        self.sum_terms(problem, poses, false);
        let Self { normal, chain, lengths, .. } = self;
        chain.lengths(problem.body, normal, poses, pairs, LENGTH_INFORMATION, change, lengths)
    }

    fn lead(&mut self, problem: &Problem, poses: &mut [Pose]) -> bool {
        // From so far, points that are thought to lie on the limb where it was would hold it there.
        if self.tree.is_some() || !self.guide.leads(problem, LED_FROM) {
            return false;
        }
        self.guide.step(problem, poses);
        problem.step + 1 < LEAD
    }

    fn gate(&self, config: &Config, step: usize) -> Gate {
        let distance = narrowed(config.gate_start, config.gate_end, step);
        Gate { box_margin: distance, distance }
    }

    fn renews(&self, step: usize) -> bool {
        step < RENEWED || (step - RENEWED).is_multiple_of(2)
    }

    fn starts_from_prediction(&self) -> bool {
        true
    }

    fn faces_cameras(&self) -> bool {
        true
    }
}

impl WholeBody {
    /// The same terms, solved with elastic bands.
    pub fn tree() -> Self {
        Self { tree: Some(TreeSolver::default()), ..Self::default() }
    }

    /// The normal equations at `poses`, with or without the sites that may always be off.
    fn sum_terms(&mut self, problem: &Problem, poses: &[Pose], biased: bool) {
        let Problem { body, correspondences, predicted, config, .. } = problem;
        let information = 1.0 / (config.point_sigma * config.point_sigma);
        let scale = narrowed(config.kernel_start, config.kernel_end, problem.step);
        // A site speaks for every joint between it and the root: what a hand is seen to do, its arm does.
        self.sites.clear();
        self.sites.resize(poses.len(), 0.0);
        for pair in correspondences.sites.iter().filter(|pair| biased || pair.bias <= 0.0) {
            self.sites[pair.limb] += pair.weight;
        }
        for (limb, part) in body.limbs().iter().enumerate().rev() {
            if let Some((parent, _)) = &part.parent {
                self.sites[*parent] += self.sites[limb];
            }
        }
        self.joint_sigmas.clear();
        for (limb, part) in body.limbs().iter().enumerate() {
            let motion = part.parent.as_ref().map_or(1.0, |(_, joint)| joint.motion);
            // A limb that hardly shows keeps to what is expected: a few stray points must not swing it.
            let measured = correspondences.limbs[limb].total_weight() + self.sites[limb];
            let shown = (measured / SHOWN).clamp(HIDDEN_MOTION, 1.0);
            self.joint_sigmas.push(motion * shown * problem.pace * config.motion_scale);
        }
        let root =
            [config.root_turn_sigma, config.root_shift_sigma].map(|sigma| sigma * problem.pace * config.motion_scale);
        // After the last step only lengths are asked for: a pose held tightly would let them bear every deviation.
        let calm = (CALM_FROM..config.max_steps).contains(&problem.step);
        // Points that lie closer to the body than they are trusted to are not at rest by chance: what they show is motion.
        let scatter = if calm { correspondences.scatter(config.kernel_end).unwrap_or(0.0) } else { 0.0 };
        let calm = config.calm * (scatter * information / (ROUGH * ROUGH)).min(1.0);
        self.normal.clear(poses.len());
        let edge_information = 1.0 / (config.outline_sigma * config.outline_sigma);
        let terms: [&dyn Term; 4] = [
            &Surface { correspondences, information, tangential_weight: config.slide, scale },
            &Sites { correspondences, information, scale: (3.0 * scale).max(SITE_SCALE), biased },
            &Contour { pairs: &correspondences.contour, information: edge_information, scale: 2.0 * scale },
            &Prior { predicted, root, joints: &self.joint_sigmas, still_gain: calm },
        ];
        for term in terms {
            term.add(body, poses, &mut self.normal);
        }
        if config.limits {
            Limits { sigma: LIMIT_SIGMA }.add(body, poses, &mut self.normal);
        }
        if config.penetration {
            Penetration { sigma: OVERLAP_SIGMA }.add(body, poses, &mut self.normal);
        }
    }
}
