//! Solves for all limbs at once: sums the terms into one system, which the chain or the tree solves.

use super::schedule::narrowed;
use super::{ChainSolver, Problem, TreeSolver};
use crate::body::{JointKind, Model};
use crate::config::SolverKind;
use crate::fit::Context;
use crate::math::{Pose, Quat, Vec3, refill, reset};
use crate::terms::{DetectedJoints, Floor, Limits, Measurements, Penetration, Posture, Prior, Rest, Term};

/// Scatter of the points about the body at which the still prior has its full gain, in units of `point_sigma`.
const ROUGH: f64 = 0.35;
/// From this step on, a remaining deviation from the prediction may be noise; in earlier steps the points are still being
/// matched.
const STILL_FROM: usize = 3;
/// Over-relaxation: where points are measured, every step of a frame but the last is longer by this fraction. Closest points move
/// with the body, so the linear system yields only a part of the way (P. Besl and N. McKay, "A Method for Registration of 3-D
/// Shapes", IEEE PAMI 1992, whose accelerated steps also extrapolate along a line). Edges of color do not.
const OVER_RELAXATION: f64 = 0.4;
/// Weight of matched patches from which a limb moves freely. With less, its expected motion is reduced in proportion, down to
/// the fraction below.
const FREE_WEIGHT: f64 = 20.0;
const HIDDEN_MOTION: f64 = 0.1;
/// Fraction by which a fully occluded hand, foot or head is pulled towards its rest posture per 1/30 s; otherwise it would keep
/// its last observed posture forever. It covers half of the way in a quarter of a second.
const TO_REST: f64 = 0.1;
/// The same for a leg, which swings while its person walks: half of the way in three quarters of a second.
const LEG_TO_REST: f64 = 0.03;
/// Minimum scale of the kernel of sites, meters: sites were gated before, and a lost limb has a large residual.
pub(crate) const SITE_SCALE: f64 = 0.15;

/// Damped Gauss-Newton on robust terms.
#[derive(Debug, Default)]
pub(crate) struct WholeBody {
    /// The normal equations, and what solves them with exact joints.
    pub(crate) chain: ChainSolver,
    /// Solves for the limbs instead of the chain, with elastic bands at the joints.
    tree: TreeSolver,
    joint_sigmas: Vec<f64>,
    /// Where joints rest that nothing shows.
    rests: Vec<Rest>,
    /// Weight of the sites on each limb and its descendants.
    sites: Vec<f64>,
    /// Weight of the color edges on each limb.
    edges: Vec<f64>,
    /// Fraction of points in the weight of points and color edges, 1 without any.
    points: f64,
    /// Bounding sphere of each limb.
    spheres: Vec<(Vec3, f64)>,
    /// Stillness of the root and the joints, computed in the step in which the still prior begins; and the last step.
    stillness: Vec<f64>,
    last_step: usize,
}

impl WholeBody {
    /// One update of all poses (working frame).
    pub(crate) fn solve(&mut self, problem: Problem, poses: &mut [Pose]) {
        self.sum_terms(problem, poses, true);
        let Context { model: Model { body, .. }, config, .. } = problem.context;
        let follows = problem.step + 1 < config.max_steps;
        let stride = if follows { 1.0 + self.points * OVER_RELAXATION } else { 1.0 };
        match config.solver {
            SolverKind::Tree => self.tree.step(body, &self.chain.normal, stride, config.band_sigma, poses),
            _ => self.chain.step(body, stride, poses),
        }
    }

    /// Sums the normal equations at `poses`, with or without the sites that have a bias.
    pub(crate) fn sum_terms(&mut self, problem: Problem, poses: &[Pose], biased: bool) {
        self.weigh_sites(problem, poses.len(), biased);
        self.expect_motion(problem);
        let Problem { context, correspondences, predicted, step } = problem;
        let Context { model: Model { body, .. }, config, .. } = context;
        let information = config.point_information();
        let scale = narrowed(config.kernel_start, config.kernel_end, step);
        let root = [config.root_turn_sigma, config.root_shift_sigma]
            .map(|sigma| sigma * context.time_scale * config.motion_scale);
        let scales = [scale, (3.0 * scale).max(SITE_SCALE)];
        let measurements = Measurements { correspondences, config, scales, biased };
        let gain = still_prior_gain(problem, information);
        let (joints, rests) = (&self.joint_sigmas, &self.rests);
        let free = Prior { predicted, root, joints, rests, gain, stillness: &[] };
        // Each frame, and each hypothesis in it, starts at a step that is not after the last one of its predecessor.
        if step <= self.last_step || step == STILL_FROM {
            free.find_stillness(body, poses, &mut self.stillness);
        }
        self.last_step = step;
        let prior = Prior { stillness: &self.stillness, ..free };
        refill(&mut self.spheres, body.limbs().iter().zip(poses).map(|(limb, pose)| limb.shape.sphere(pose)));
        let penetration = Penetration { spheres: &self.spheres };
        let posture = Posture { fraction: config.motion_scale };
        let floor = context.observation.floor().map(|plane| Floor { plane });
        // The cost function: a new term is a new file and a line here.
        let detected = DetectedJoints { pairs: &correspondences.detected };
        let terms: [Option<&dyn Term>; 7] = [
            Some(&measurements),
            biased.then_some(&detected),
            Some(&prior),
            config.limits.then_some(&Limits),
            Some(&posture),
            config.penetration.then_some(&penetration),
            floor.as_ref().filter(|_| config.penetration).map(|floor| floor as &dyn Term),
        ];
        self.chain.normal.clear(poses.len());
        for term in terms.into_iter().flatten() {
            term.add(body, poses, &mut self.chain.normal);
        }
    }

    /// A site gives information on every joint between it and the root: the position of a hand constrains the arm.
    fn weigh_sites(&mut self, problem: Problem, limbs: usize, biased: bool) {
        reset(&mut self.sites, limbs, 0.0);
        for pair in problem.correspondences.sites.iter().filter(|pair| biased || pair.bias <= 0.0) {
            self.sites[pair.limb] += pair.weight;
        }
        for (limb, parent, _) in problem.context.model.body.joints().rev() {
            self.sites[parent] += self.sites[limb];
        }
    }

    /// Computes the standard deviation of every joint's motion.
    fn expect_motion(&mut self, problem: Problem) {
        let Problem { context, correspondences, .. } = problem;
        let Context { model: Model { body, .. }, config, time_scale, .. } = context;
        let information = config.point_information();
        reset(&mut self.edges, body.limbs().len(), 0.0);
        for pair in &correspondences.regions {
            self.edges[pair.limb] += pair.information / information;
        }
        self.joint_sigmas.clear();
        self.rests.clear();
        let mut all_points = 0.0;
        for (limb, part) in body.limbs().iter().enumerate() {
            let motion = part.parent.as_ref().map_or(1.0, |(_, joint)| joint.motion);
            let points = correspondences.limbs[limb].weighed().0;
            all_points += points;
            // A limb that is hardly visible stays near its prediction: a few stray points must not move it.
            let measured = points + self.sites[limb] + self.edges[limb];
            let measured_fraction = (measured / FREE_WEIGHT).min(1.0);
            let joint = part.parent.as_ref().map(|(_, joint)| joint);
            let rests = part.match_caps[1] && joint.is_some_and(|joint| joint.kind() == JointKind::Elliptic);
            self.rests.push(Rest {
                rotation: joint.map_or(Quat::IDENTITY, |joint| joint.parent_from_limb_at_rest().rotation),
                fraction: if rests { to_rest(context.time_scale, TO_REST, measured_fraction) } else { 0.0 },
            });
            let measured_fraction = measured_fraction.max(HIDDEN_MOTION);
            self.joint_sigmas.push(motion * measured_fraction * time_scale * config.motion_scale);
        }
        let edges: f64 = self.edges.iter().sum();
        self.points = if edges > 0.0 { all_points / (all_points + edges) } else { 1.0 };
        self.rest_legs(problem);
    }

    /// Lets legs that nothing shows stand or sit on the floor.
    fn rest_legs(&mut self, problem: Problem) {
        let Problem { context, correspondences, predicted, .. } = problem;
        let Context { model: Model { body, extremities, .. }, observation, config, .. } = context;
        let Some(floor) = observation.floor().filter(|_| config.penetration) else { return };
        for leg in extremities.iter().filter(|chain| chain.leg) {
            let trunk = body.parent(leg.upper).map_or(Quat::IDENTITY, |trunk| predicted[trunk].rotation);
            let rotations = leg.turned(body, trunk, leg.standing(body, predicted, floor));
            let visible = |limb: &usize| correspondences.limbs[*limb].weighed().0 + self.edges[*limb];
            let mut measured = leg.ends.iter().map(visible).sum::<f64>();
            for (limb, rotation) in [leg.lower, leg.upper].into_iter().zip(rotations.into_iter().rev()) {
                measured += visible(&limb);
                let fraction =
                    to_rest(context.time_scale, LEG_TO_REST, ((measured + self.sites[limb]) / FREE_WEIGHT).min(1.0));
                self.rests[limb] = Rest { rotation, fraction };
            }
        }
    }
}

/// Fraction of the way to its rest that a limb moves in a frame of which this fraction is measured, at `rate` where nothing is.
fn to_rest(time_scale: f64, rate: f64, measured: f64) -> f64 {
    (1.0 - measured) * (1.0 - (1.0 - rate).powf(time_scale))
}

/// Gain of the prior for small deviations from the prediction, in this step.
fn still_prior_gain(problem: Problem, information: f64) -> f64 {
    let Problem { context: Context { config, .. }, correspondences, step, .. } = problem;
    // After the last step only lengths are estimated: with a tight prior of the pose, they would absorb every deviation.
    let holds = (STILL_FROM..config.max_steps).contains(&step);
    // When points lie closer to the body than `point_sigma` suggests, a small deviation is motion and not noise.
    let scatter = if holds { correspondences.scatter(config.kernel_end).unwrap_or(0.0) } else { 0.0 };
    config.still_prior_gain * (scatter * information / (ROUGH * ROUGH)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limb_that_may_have_moved_twice_as_far_goes_two_steps_to_rest() {
        let left = |time_scale: f64| 1.0 - to_rest(time_scale, TO_REST, 0.0);
        assert!((left(2.0) - left(1.0) * left(1.0)).abs() < 1e-12 && left(1e3) >= 0.0);
        assert_eq!(to_rest(4.0, TO_REST, 1.0), 0.0);
    }
}
