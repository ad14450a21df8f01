//! How far a pose may be off: covariances of limbs, joints and sites.
//!
//! What is measured of a limb holds it as in the solver, but thousands of pixels are not thousands of measurements: they err
//! alike, by how the limb differs from its model. So a limb's points count as so many independent ones at most, and the places
//! of joints and sites in their limbs are known to a centimeter only. What a frame does not prove of a limb hardly counts.
//! Every unknown of the chain also remembers how well it was known, and by how much it may have moved since: what nothing
//! measures grows more uncertain with every frame.

mod covariances;
mod edge_filter;

pub use covariances::Covariances;
pub(crate) use edge_filter::EdgeFilter;

use crate::association::correspondence::Correspondences;
use crate::body::kinematics::{freedoms, joint_axes};
use crate::body::{Body, Pair};
use crate::config::Config;
use crate::math::{Pose, Vec3};
use crate::sizes::girth::ALIKE;
use crate::solver::{ChainSolver, LENGTH_INFORMATION, Lengths, SITE_SCALE, Spread};
use crate::terms::normal_equations::NormalEquations;
use crate::terms::{Contour, Regions, Sites, Surface, Term};

/// So many surface points a meter of limb err independently at most.
const PATCHES_PER_METER: f64 = 50.0;
/// Share of what is measured of a limb that counts where the frame does not prove the limb right.
const UNPROVEN: f64 = 0.012;
/// Unexpected motion of a joint in 1/30 s, as a share of what its `motion` allows.
const USUAL_MOTION: f64 = 0.35;
/// Standard deviation of an unknown at most: radians of a turn, meters of the root's place.
const MAX_SIGMA: f64 = 0.5;

/// How far a joint or site lies from its place in the limb, meters: models and persons differ by that. Of a body that was set,
/// and of one that was found, whose sizes nobody told.
const SITE_SIGMA: [f64; 2] = [0.01, 0.015];

/// What is known of a pose, from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Uncertainty {
    normal: NormalEquations,
    system: ChainSolver,
    spread: Spread,
    /// Of every unknown, after the last frame.
    variance: Vec<f64>,
    information: Vec<f64>,
    /// Information of the relative length of every pair of limbs since the pose was set, and of this frame.
    known: Vec<f64>,
    length_information: Vec<f64>,
    work: Lengths,
}

/// A frame's pose and what speaks for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FittedPose<'a> {
    /// What is tracked.
    pub body: &'a Body,
    /// Where it is, working frame.
    pub poses: &'a [Pose],
    /// What was matched there.
    pub correspondences: &'a Correspondences,
    /// Limbs of one length that are refined.
    pub pairs: &'a [Pair],
    /// The sizes were found as well as the pose.
    pub sizes_found: bool,
    /// Seconds since the last frame, as multiples of 1/30 s.
    pub time_scale: f64,
    /// Parameters.
    pub config: &'a Config,
}

impl Uncertainty {
    /// Nothing is known of the pose that comes next but that it was set.
    pub(crate) fn forget(&mut self) {
        self.variance.clear();
        self.known.clear();
    }

    /// Covariances of a frame's pose; `proven` says of which limbs it shows that they are where they are thought to be.
    pub(crate) fn estimate(
        &mut self,
        found: FittedPose,
        proven: impl Fn(usize) -> bool,
        covariances: &mut Covariances,
    ) {
        self.expect(found);
        self.sum_terms(found, proven);
        let Self { normal, system, spread, variance, information, .. } = self;
        if !system.factor_information(found.body, normal, found.poses, information) {
            covariances.forget(found.body);
            return;
        }
        covariances.clear();
        variance.clear();
        for (limb, part) in found.body.limbs().iter().enumerate() {
            let pose = &found.poses[limb];
            let own = spread.of_joint(system, limb);
            let count = part.parent.as_ref().map_or(6, |(_, joint)| freedoms(joint));
            variance.extend((0..count).map(|index| own[(index, index)]));
            let axes = part
                .parent
                .as_ref()
                .map_or([Vec3::X, Vec3::Y, Vec3::Z], |(parent, joint)| joint_axes(joint, &found.poses[*parent]).0);
            let site_sigma = SITE_SIGMA[usize::from(found.sizes_found)];
            covariances.push_limb(&spread.of_limb(system, limb, pose.translation), site_sigma, &own, axes);
        }
        for site in found.body.sites() {
            covariances.push_site(site.limb, found.poses[site.limb].rotation * site.position);
        }
        self.learn_lengths(found);
        for (pair, known) in found.pairs.iter().zip(&self.known) {
            for limb in pair {
                covariances.lengths[*limb] = found.body.limbs()[*limb].shape.length() / known.sqrt();
            }
        }
    }

    /// Adds what the frame says of the limbs' lengths: frames err alike.
    fn learn_lengths(&mut self, found: FittedPose) {
        let Self { system, known, length_information, work, .. } = self;
        work.information(system, found.body, found.poses, found.pairs, length_information);
        known.resize(found.pairs.len(), LENGTH_INFORMATION[1]);
        for (known, length_information) in known.iter_mut().zip(length_information) {
            *known += *length_information / ALIKE;
        }
    }

    /// Information of every unknown before the frame: as well as it was known, and moved since.
    fn expect(&mut self, found: FittedPose) {
        let Self { variance, information, .. } = self;
        let FittedPose { body, time_scale, config, .. } = found;
        information.clear();
        let mut expect = |sigma: f64| {
            let moved = (sigma * time_scale).powi(2);
            let before = variance.get(information.len()).copied().unwrap_or(moved);
            information.push(1.0 / (before + moved).min(MAX_SIGMA * MAX_SIGMA));
        };
        for limb in body.limbs() {
            match &limb.parent {
                None => {
                    for sigma in [config.root_turn_sigma, config.root_shift_sigma] {
                        (0..3).for_each(|_| expect(config.motion_scale * sigma));
                    }
                }
                Some((_, joint)) => {
                    let count = freedoms(joint);
                    (0..count).for_each(|_| expect(USUAL_MOTION * joint.motion));
                }
            }
        }
    }

    /// What the frame says of every limb, as far as its parts err independently.
    fn sum_terms(&mut self, found: FittedPose, proven: impl Fn(usize) -> bool) {
        let FittedPose { body, poses, correspondences, config, .. } = found;
        let (information, scale) = (1.0 / (config.point_sigma * config.point_sigma), config.kernel_end);
        let edges = 1.0 / (config.depth_contour_sigma * config.depth_contour_sigma);
        let surface = Surface { correspondences, information, tangential_weight: config.tangential_weight, scale };
        let sites = Sites { correspondences, information, scale: SITE_SCALE, biased: true };
        let contour = Contour { pairs: &correspondences.contour, information: edges, scale: 2.0 * scale };
        let regions = Regions { pairs: &correspondences.regions };
        self.normal.clear(poses.len());
        for term in [&surface as &dyn Term, &sites, &contour, &regions] {
            term.add(body, poses, &mut self.normal);
        }
        for (limb, block) in self.normal.limbs.iter_mut().enumerate() {
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

    /// What is told of the standing body in frames of which so many prove each limb; the sums of variances of every site.
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
            fit.match_last(context, &poses);
            let mut uncertainty = Uncertainty::default();
            let mut covariances = Covariances::default();
            (0..frames)
                .map(|frame| {
                    let correspondences = fit.correspondences();
                    let (body, config) = (&model.body, &config);
                    let found = FittedPose {
                        body,
                        poses: &poses,
                        correspondences,
                        pairs: &pairs,
                        sizes_found,
                        time_scale: 1.0,
                        config,
                    };
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
