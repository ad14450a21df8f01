//! Position uncertainty of limbs where only images without depth show the body: accumulates the information of edges over frames.
//!
//! An edge gives information in one direction only. The distance of a limb from a camera is not observed unless a second camera
//! sees the limb from another side. The filter keeps the joint information matrix of all unknowns of the chain. The information
//! fades as the body moves, and grows by that of each frame's edges.

use super::{FittedPose, MAX_SIGMA, USUAL_MOTION};
use crate::body::kinematics::freedoms;
use crate::body::{Body, Model};
use crate::math::{Vec3, factor, refill, reset};
use crate::solver::{ChainSolver, SITE_SCALE};
use crate::terms::{Edges, Sites, Term};

/// Standard deviation of every unknown of a pose that the user set, radians and meters.
const AS_SET: f64 = 0.03;
/// Fraction of the edge information that counts for limbs outside arms and legs: clothes hang on the trunk, hair on the head.
const LOOSE: f64 = 0.1;
/// Smallest fraction of the edge information that counts for a limb, for limbs without supporting lines.
const MIN_WEIGHT: f64 = 1e-3;

/// Estimate of the uncertainty of a pose, updated from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct EdgeFilter {
    chain: ChainSolver,
    /// Information of all unknowns after the last frame, lower triangle.
    known: Vec<f64>,
    /// Inverse variance of each unknown's motion since the last frame, and working memory.
    still: Vec<f64>,
    factored: Vec<f64>,
    solved: Vec<f64>,
    /// Standard deviation of the distal end of every limb, meters; empty before the first frame.
    sigma: Vec<f64>,
}

impl EdgeFilter {
    /// Resets the filter for a newly set pose.
    pub(crate) fn forget(&mut self) {
        self.known.clear();
        self.sigma.clear();
    }

    /// Whether a frame was observed since the pose was set.
    pub(crate) fn is_known(&self) -> bool {
        !self.known.is_empty()
    }

    /// Standard deviation of the position of a limb's distal end after the last frame, meters; infinite where it is not known.
    pub(crate) fn end_sigma(&self, limb: usize) -> f64 {
        self.sigma.get(limb).copied().unwrap_or(f64::INFINITY)
    }

    /// Updates the filter with a frame.
    pub(crate) fn observe(&mut self, found: FittedPose) {
        let FittedPose { model: Model { body, .. }, poses, .. } = found;
        self.expect(body, found.time_scale);
        self.sum_terms(found);
        let Self { chain, known, sigma, .. } = self;
        sigma.clear();
        let add = |h: &mut [f64]| {
            known.iter_mut().zip(&*h).for_each(|(known, added)| *known += added);
            h.copy_from_slice(known);
        };
        if !chain.factor(body, poses, add) {
            know_alone(known, self.still.len(), MAX_SIGMA);
            return;
        }
        for (limb, part) in body.limbs().iter().enumerate() {
            let end = poses[limb] * (part.shape.length() * Vec3::Z);
            let end = chain.of_limb(limb, end);
            sigma.push((3..6).map(|axis| end[(axis, axis)]).sum::<f64>().sqrt());
        }
    }

    /// Reduces the information by the possible motion: every joint may have moved, and the root as far as the limits allow.
    fn expect(&mut self, body: &Body, time_scale: f64) {
        let Self { known, still, factored, solved, .. } = self;
        still.clear();
        for limb in body.limbs() {
            let sigma = limb.parent.as_ref().map_or(MAX_SIGMA, |(_, joint)| USUAL_MOTION * joint.motion * time_scale);
            still.extend((0..freedoms(limb)).map(|_| 1.0 / (sigma * sigma)));
        }
        let n = still.len();
        if known.len() != n * n {
            know_alone(known, n, AS_SET);
            return;
        }
        // (A^-1 + Q)^-1 = A - A (A + Q^-1)^-1 A, with A + Q^-1 = L^T L and L^T Y = A: A - Y^T Y.
        factored.clone_from(known);
        factored.iter_mut().step_by(n + 1).zip(&*still).for_each(|(value, still)| *value += still);
        refill(solved, (0..n * n).map(|index| known[(index / n).max(index % n) * n + (index / n).min(index % n)]));
        if !factor(factored, n) {
            know_alone(known, n, MAX_SIGMA);
            return;
        }
        for row in (0..n).rev() {
            let (before, rest) = solved.split_at_mut(row * n);
            let own = &mut rest[..n];
            own.iter_mut().for_each(|value| *value /= factored[row * n + row]);
            for (other, values) in before.chunks_exact_mut(n).enumerate() {
                let factor_value = factored[row * n + other];
                if factor_value != 0.0 {
                    values.iter_mut().zip(&*own).for_each(|(value, own)| *value -= factor_value * own);
                }
            }
            for (index, values) in known.chunks_exact_mut(n).enumerate() {
                let factor_value = own[index];
                values[..=index].iter_mut().zip(&*own).for_each(|(value, own)| *value -= factor_value * own);
            }
        }
    }

    /// Adds the frame's information on every limb, weighted by how strongly the limb is supported.
    fn sum_terms(&mut self, found: FittedPose) {
        let FittedPose { model: Model { body, extremities, .. }, poses, correspondences, config, .. } = found;
        let normal = &mut self.chain.normal;
        normal.clear(poses.len());
        Edges { pairs: &correspondences.regions, scale: f64::INFINITY }.add(body, poses, normal);
        for (limb, block) in normal.limbs.iter_mut().enumerate() {
            let support_net =
                correspondences.region_support.get(limb).map_or(0.0, |support| support.own - support.against);
            let weight = (support_net.max(0.0) * support_net).max(MIN_WEIGHT);
            let loose = !extremities.iter().any(|chain| chain.has(limb));
            block.h *= if loose { LOOSE * weight } else { weight };
        }
        let information = config.point_information();
        Sites { correspondences, information, scale: SITE_SCALE, biased: true }.add(body, poses, normal);
    }
}

/// Diagonal information: each of `n` unknowns is known independently.
fn know_alone(known: &mut Vec<f64>, n: usize, sigma: f64) {
    reset(known, n * n, 0.0);
    known.iter_mut().step_by(n + 1).for_each(|value| *value = 1.0 / (sigma * sigma));
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::association::correspondence::{Correspondences, EdgePair, RegionSupport};
    use crate::config::Config;
    use crate::math::Pose;
    use crate::testing::standing;

    /// Edges of all limbs, seen by cameras that look at right angles to `normals`; either all edges support their limb, or none
    /// does.
    fn edges(model: &Model, poses: &[Pose], normals: &[Vec3], own: f64) -> Correspondences {
        let mut found = Correspondences::default();
        for (limb, part) in model.body.limbs().iter().enumerate() {
            for (step, normal) in (0..8).flat_map(|step| normals.iter().map(move |normal| (step, *normal))) {
                let x = poses[limb] * (f64::from(step) / 7.0 * part.shape.length() * Vec3::Z);
                found.regions.push(EdgePair { limb, x, normal, distance: 0.0, information: 1e4, source: 0 });
            }
            found.region_support.push(RegionSupport { own, ..RegionSupport::default() });
        }
        found
    }

    /// Updates a filter with a frame of these edges.
    fn observe(filter: &mut EdgeFilter, model: &Model, poses: &[Pose], correspondences: &Correspondences) {
        let (pairs, sizes_found, time_scale, config) = (&[], false, 1.0, &Config::default());
        filter.observe(FittedPose { model, poses, correspondences, pairs, sizes_found, time_scale, config });
    }

    /// Standard deviations of a forearm's distal end in frames with such edges.
    fn sigmas(frames: &[(&[Vec3], f64)]) -> Vec<f64> {
        let (model, poses) = standing();
        let lower = model.extremities[crate::testing::first_arm(&model)].lower;
        let mut filter = EdgeFilter::default();
        let sigma = |(normals, own): &(&[Vec3], f64)| {
            observe(&mut filter, &model, &poses, &edges(&model, &poses, normals, *own));
            filter.end_sigma(lower)
        };
        frames.iter().map(sigma).collect()
    }

    #[test]
    fn what_no_camera_sees_is_known_less_from_frame_to_frame_and_at_once_when_one_does() {
        let (two, one): (&[Vec3], &[Vec3]) = (&Vec3::AXES, &[Vec3::X, Vec3::Y]);
        let both = sigmas(&[(two, 1.0); 20]);
        assert!(both.iter().all(|sigma| *sigma < 0.05), "{both:?}");
        let filter = sigmas(&[&[(two, 1.0)][..], &[(one, 1.0); 18], &[(two, 1.0)]].concat());
        assert!((2..19).all(|frame| filter[frame] >= filter[frame - 1] - 1e-9), "{filter:?}");
        assert!(filter[18] > 3.0 * both[18] && filter[19] < 1.2 * both[19], "{filter:?}");
    }

    #[test]
    fn edges_that_do_not_speak_for_their_limb_report_little() {
        let normals: &[Vec3] = &Vec3::AXES;
        let [sure, weak] = [1.0, 0.0].map(|own| sigmas(&[(normals, own); 10])[9]);
        assert!(weak > 2.0 * sure, "{weak} {sure}");
    }

    #[test]
    fn old_information_fades_as_the_dense_inverse_has_it() {
        let (model, poses) = standing();
        let mut filter = EdgeFilter::default();
        let found = edges(&model, &poses, &[Vec3::X, Vec3::Z], 0.7);
        observe(&mut filter, &model, &poses, &found);
        let n = filter.still.len();
        let whole = |known: &[f64]| DMatrix::from_fn(n, n, |i, j| known[i.max(j) * n + i.min(j)]);
        let before = whole(&filter.known);
        filter.expect(&model.body, 2.0);
        let moved = DMatrix::from_fn(n, n, |i, j| if i == j { 1.0 / filter.still[i] } else { 0.0 });
        let expected = (before.try_inverse().unwrap() + moved).try_inverse().unwrap();
        assert!((whole(&filter.known) - &expected).amax() < 1e-6 * expected.amax());
    }

    #[test]
    fn nothing_is_known_before_the_first_frame() {
        let mut filter = EdgeFilter::default();
        assert_eq!(filter.end_sigma(0), f64::INFINITY);
        let (model, poses) = standing();
        observe(&mut filter, &model, &poses, &edges(&model, &poses, &[Vec3::X], 1.0));
        assert!(filter.end_sigma(0) < 0.1);
        filter.forget();
        assert_eq!(filter.end_sigma(0), f64::INFINITY);
    }
}
