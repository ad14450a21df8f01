//! Covariances of limb poses, joint angles and site positions.
//!
//! Measurements of a limb constrain it as in the solver, but thousands of pixels are not thousands of independent measurements:
//! their errors are correlated through the difference between the limb and its model. So the number of independent points of a
//! limb is limited, and the positions of joints and sites in their limbs are known only to one centimeter. Measurements of a limb
//! that the frame does not confirm have little weight. Every unknown of the chain also keeps its earlier uncertainty, increased
//! by its possible motion since: an unknown that nothing measures grows more uncertain with every frame.

mod covariances;
mod edge_filter;

pub use covariances::Covariances;
pub(crate) use edge_filter::EdgeFilter;

use crate::association::correspondence::Correspondences;
use crate::body::kinematics::{freedoms, joint_axes};
use crate::body::{Model, Pair};
use crate::config::Config;
use crate::math::{Pose, Vec3};
use crate::sizes::LENGTH_SIGMA;
use crate::sizes::girth::ALIKE;
use crate::solver::{ChainSolver, SITE_SCALE};
use crate::terms::{Measurements, Term};

/// Maximum number of surface points per meter of limb with independent errors.
const PATCHES_PER_METER: f64 = 50.0;
/// Weight of a limb's measurements where the frame does not confirm the limb.
const UNPROVEN: f64 = 0.012;
/// Unexpected motion of a joint in 1/30 s, as a fraction of what its `motion` allows.
const USUAL_MOTION: f64 = 0.35;
/// Greatest standard deviation of an unknown: radians for rotations, meters for the root's position.
const MAX_SIGMA: f64 = 0.5;

/// Standard deviation of a joint's or site's position in its limb, meters: models and persons differ by this much. First for a
/// body that the user set, then for an auto-initialized body of unknown size.
const SITE_SIGMA: [f64; 2] = [0.01, 0.015];

/// Estimate of the uncertainty of a pose, updated from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Uncertainty {
    chain: ChainSolver,
    /// Variance of every unknown after the last frame.
    variance: Vec<f64>,
    information: Vec<f64>,
    /// Information of the relative length of every pair of limbs, accumulated since the pose was set.
    known: Vec<f64>,
}

/// A frame's pose and the measurements that support it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FittedPose<'a> {
    /// The tracked model.
    pub model: &'a Model,
    /// Its poses, working frame.
    pub poses: &'a [Pose],
    /// Correspondences at these poses.
    pub correspondences: &'a Correspondences,
    /// Groups of limbs with a common length that is refined.
    pub pairs: &'a [Pair],
    /// Whether the sizes were estimated along with the pose.
    pub sizes_found: bool,
    /// Seconds since the last frame, as multiples of 1/30 s.
    pub time_scale: f64,
    /// Parameters.
    pub config: &'a Config,
}

impl Uncertainty {
    /// Resets the estimate for a newly set pose.
    pub(crate) fn forget(&mut self) {
        self.variance.clear();
        self.known.clear();
    }

    /// Writes the covariances of a frame's pose; `proven` states which limbs the frame confirms at their estimated poses.
    pub(crate) fn estimate(
        &mut self,
        found: FittedPose,
        proven: impl Fn(usize) -> bool,
        covariances: &mut Covariances,
    ) {
        self.expect(found);
        self.sum_terms(found, proven);
        let Self { chain, variance, information, known } = self;
        let body = &found.model.body;
        covariances.forget(body);
        let step = information.len() + 1;
        let add = |h: &mut [f64]| h.iter_mut().step_by(step).zip(&*information).for_each(|(value, own)| *value += own);
        if !chain.factor(body, found.poses, add) {
            return;
        }
        variance.clear();
        for (limb, part) in body.limbs().iter().enumerate() {
            let own = chain.of_joint(limb);
            variance.extend((0..freedoms(part)).map(|index| own[(index, index)]));
            let parent = part.parent.as_ref();
            let axes = parent.map_or(Vec3::AXES, |(parent, joint)| joint_axes(joint, &found.poses[*parent]).0);
            covariances.set_turn(limb, &own, axes);
            let covariance = chain.of_limb(limb, found.poses[limb].translation);
            covariances.set_limb(limb, &covariance, SITE_SIGMA[usize::from(found.sizes_found)]);
        }
        for (index, site) in body.sites().iter().enumerate() {
            covariances.set_site(index, site.limb, found.poses[site.limb].rotation * site.position);
        }
        known.resize(found.pairs.len(), 1.0 / (LENGTH_SIGMA * LENGTH_SIGMA));
        let lengths = chain.length_information(body, found.poses, found.pairs);
        for ((pair, known), information) in found.pairs.iter().zip(known).zip(lengths) {
            // Errors of successive frames are correlated.
            *known += information / ALIKE;
            for limb in pair {
                covariances.lengths[*limb] = body.limbs()[*limb].shape.length() / known.sqrt();
            }
        }
    }

    /// Computes the information of every unknown before the frame: that after the last frame, reduced by the motion since.
    fn expect(&mut self, found: FittedPose) {
        let Self { variance, information, .. } = self;
        let FittedPose { model, time_scale, config, .. } = found;
        information.clear();
        let mut expect = |sigma: f64| {
            let moved = (sigma * time_scale).powi(2);
            let before = variance.get(information.len()).copied().unwrap_or(moved);
            information.push(1.0 / (before + moved).min(MAX_SIGMA * MAX_SIGMA));
        };
        for limb in model.body.limbs() {
            match &limb.parent {
                None => {
                    for sigma in [config.root_turn_sigma, config.root_shift_sigma] {
                        (0..3).for_each(|_| expect(config.motion_scale * sigma));
                    }
                }
                Some((_, joint)) => (0..freedoms(limb)).for_each(|_| expect(USUAL_MOTION * joint.motion)),
            }
        }
    }

    /// Sums the frame's information on every limb, limited to the number of independent measurements.
    fn sum_terms(&mut self, found: FittedPose, proven: impl Fn(usize) -> bool) {
        let FittedPose { model: Model { body, .. }, poses, correspondences, config, .. } = found;
        let normal = &mut self.chain.normal;
        normal.clear(poses.len());
        let scales = [config.kernel_end, SITE_SCALE];
        Measurements { correspondences, config, scales, biased: true }.add(body, poses, normal);
        for (limb, block) in normal.limbs.iter_mut().enumerate() {
            let most = PATCHES_PER_METER * body.limbs()[limb].shape.length();
            let lines = correspondences.regions.iter().filter(|pair| pair.limb == limb).count();
            let alike = most / (most + correspondences.measured_weight(limb) + lines as f64);
            block.h *= if proven(limb) { alike } else { UNPROVEN * alike };
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::testing::{before_wall, first_arm, standing, with_context, without_background};

    /// Covariances of the standing body after each of `frames` frames, in which `proven` states whether a frame confirms a limb;
    /// and the sums of variances of every site.
    fn estimated(
        frames: usize,
        sizes_found: bool,
        proven: impl Fn(usize, usize) -> bool,
    ) -> Vec<(Covariances, Vec<f64>)> {
        let (model, poses) = standing();
        let config = without_background();
        let pairs = model.body.pairs();
        with_context(&before_wall(&model.body, &poses), &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &poses, true);
            let mut uncertainty = Uncertainty::default();
            let mut covariances = Covariances::default();
            (0..frames)
                .map(|frame| {
                    let (model, poses, pairs, config) = (&model, &poses, &pairs, &config);
                    let (correspondences, time_scale) = (&fit.correspondences, 1.0);
                    let found = FittedPose { model, poses, correspondences, pairs, sizes_found, time_scale, config };
                    uncertainty.estimate(found, |limb| proven(frame, limb), &mut covariances);
                    let trace = |site: &crate::math::Mat3| site.col(0)[0] + site.col(1)[1] + site.col(2)[2];
                    (covariances.clone(), covariances.sites.iter().map(trace).collect())
                })
                .collect()
        })
    }

    #[test]
    fn what_is_visible_is_known_to_centimeters_and_its_lengths_ever_better() {
        let frames = estimated(30, false, |_, _| true);
        for variance in &frames[29].1 {
            let sigma = (variance / 3.0).sqrt();
            assert!((0.008..0.05).contains(&sigma), "{sigma} m");
        }
        let followed = |covariances: &Covariances| -> Vec<f64> {
            covariances.lengths.iter().copied().filter(|sigma| sigma.is_finite()).collect()
        };
        let (first, last) = (followed(&frames[0].0), followed(&frames[29].0));
        assert!(first.len() > 8 && first.iter().zip(&last).all(|(first, last)| last < first), "{first:?} {last:?}");
    }

    #[test]
    fn joints_of_a_body_whose_sizes_nobody_reported_are_known_less_and_its_turns_as_well() {
        let [given, found] = [false, true].map(|sizes_found| estimated(3, sizes_found, |_, _| true).remove(2));
        let more = 3.0 * (SITE_SIGMA[1].powi(2) - SITE_SIGMA[0].powi(2));
        for (given, found) in given.1.iter().zip(&found.1) {
            assert!((found - given - more).abs() < 1e-9);
        }
        assert_eq!(given.0.turns, found.0.turns);
    }

    #[test]
    fn an_arm_that_nothing_proves_is_known_less_from_frame_to_frame_and_at_once_when_it_shows() {
        let (model, _) = standing();
        let chain = &model.extremities[first_arm(&model)];
        let hidden: Vec<usize> = chain.limbs().collect();
        let frames = estimated(41, false, |frame, limb| !(5..40).contains(&frame) || !hidden.contains(&limb));
        let hand = model.body.sites().iter().position(|site| hidden[2..].contains(&site.limb)).unwrap();
        let knee = model.body.site_index("l_knee").unwrap();
        let sigma = |frame: usize, site: usize| frames[frame].1[site].sqrt();
        for frame in 5..39 {
            assert!(sigma(frame + 1, hand) >= sigma(frame, hand) - 1e-9, "{frame}");
        }
        assert!(sigma(39, hand) > 3.0 * sigma(4, hand) && sigma(39, hand) < 1.0, "{}", sigma(39, hand));
        assert!(sigma(40, hand) < 1.2 * sigma(4, hand));
        assert!((sigma(39, knee) / sigma(4, knee) - 1.0).abs() < 0.1, "a leg knows nothing of it");
    }
}
