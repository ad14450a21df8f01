//! How far limbs may be off where pictures are all that shows them: what their edges have told, from frame to frame.
//!
//! An edge tells of one direction only. How far away a limb is, no camera sees; where a second one does not see it either, or
//! from the same side, nothing does. What was known of every unknown of the chain is kept with all that ties it to others,
//! fades as the body moves, and grows by what this frame's edges tell.

use super::{MOST_UNSURE, USUAL_MOTION};
use crate::association::correspondence::Correspondences;
use crate::body::kinematics::freedoms;
use crate::body::two_bone::TwoBone;
use crate::body::{Body, Model};
use crate::config::Config;
use crate::math::{Pose, Vec3};
use crate::solver::{ChainSolver, SITE_SCALE, Spread};
use crate::terms::normal_equations::NormalEquations;
use crate::terms::{Regions, Sites, Term};

/// Standard deviation of every unknown of a pose that was set, radians and metres.
const AS_SET: f64 = 0.03;
/// Share of what edges tell of a limb that is no part of an arm or leg: clothes hang on the trunk, hair on the head.
const LOOSE: f64 = 0.1;
/// What is told of a limb of which no line speaks: so little.
const LEAST_TOLD: f64 = 1e-3;

/// What is known of a pose, from frame to frame.
#[derive(Debug, Default)]
pub struct ByEdges {
    normal: NormalEquations,
    system: ChainSolver,
    spread: Spread,
    /// Information of all unknowns, lower triangle, and the variance of each, after the last frame.
    known: Vec<f64>,
    variance: Vec<f64>,
    /// Of every limb's far end, metres; empty before the first frame.
    sigma: Vec<f64>,
}

impl ByEdges {
    /// Nothing is known of the pose that comes next but that it was set.
    pub fn forget(&mut self) {
        self.known.clear();
        self.sigma.clear();
    }

    /// Standard deviation of where a limb ends, metres, after the last frame; infinite where that is not known.
    pub fn end_sigma(&self, limb: usize) -> f64 {
        self.sigma.get(limb).copied().unwrap_or(f64::INFINITY)
    }

    /// Takes what was matched at `poses`, so many times 1/30 s after the last frame.
    pub fn observe(
        &mut self,
        model: &Model,
        poses: &[Pose],
        correspondences: &Correspondences,
        time_scale: f64,
        config: &Config,
    ) {
        let body = &model.body;
        self.expect(body, time_scale);
        self.sum_terms(body, &model.extremities, poses, correspondences, config);
        let Self { normal, system, spread, known, variance, sigma } = self;
        sigma.clear();
        if !system.factor_added(body, normal, poses, known) {
            known.clear();
            return;
        }
        variance.clear();
        for (limb, part) in body.limbs().iter().enumerate() {
            let own = spread.of_joint(system, limb);
            variance.extend((0..count(body, limb)).map(|index| own[(index, index)]));
            let end = poses[limb] * (part.shape.length() * Vec3::Z);
            let end = spread.of_limb(system, limb, end);
            sigma.push((3..6).map(|axis| end[(axis, axis)]).sum::<f64>().sqrt());
        }
    }

    /// What was known fades: each unknown may have moved, the root as far as anything can.
    fn expect(&mut self, body: &Body, time_scale: f64) {
        let Self { known, variance, .. } = self;
        let n: usize = (0..body.limbs().len()).map(|limb| count(body, limb)).sum();
        if known.len() != n * n {
            known.clear();
            known.resize(n * n, 0.0);
            known.iter_mut().step_by(n + 1).for_each(|value| *value = 1.0 / (AS_SET * AS_SET));
            return;
        }
        let mut unknowns = variance.iter_mut();
        for limb in 0..body.limbs().len() {
            let motion = body.limbs()[limb].parent.as_ref().map_or(f64::INFINITY, |(_, joint)| joint.motion);
            let moved = (USUAL_MOTION * motion * time_scale).powi(2);
            for before in unknowns.by_ref().take(count(body, limb)) {
                // The share of its standard deviation then in that of now.
                *before = (*before / (*before + moved).min(MOST_UNSURE * MOST_UNSURE)).sqrt();
            }
        }
        for (row, values) in known.chunks_exact_mut(n).enumerate() {
            let own = variance[row];
            values.iter_mut().zip(&*variance).for_each(|(value, other)| *value *= own * other);
        }
    }

    /// What the frame tells of every limb, by how much of what it shows speaks for it.
    fn sum_terms(
        &mut self,
        body: &Body,
        extremities: &[TwoBone],
        poses: &[Pose],
        correspondences: &Correspondences,
        config: &Config,
    ) {
        let normal = &mut self.normal;
        normal.clear(poses.len());
        Regions { pairs: &correspondences.regions }.add(body, poses, normal);
        for (limb, block) in normal.limbs.iter_mut().enumerate() {
            let said = correspondences.region_support.get(limb).map_or(0.0, |support| support.own[0] - support.against[0]);
            let told = (said.max(0.0) * said).max(LEAST_TOLD);
            let loose = extremities.iter().flat_map(TwoBone::limbs).all(|other| other != limb);
            block.h *= if loose { LOOSE * told } else { told };
        }
        let information = 1.0 / (config.point_sigma * config.point_sigma);
        Sites { correspondences, information, scale: SITE_SCALE, biased: true }.add(body, poses, normal);
    }
}

/// Number of unknowns of a limb's joint, or of the root.
fn count(body: &Body, limb: usize) -> usize {
    body.limbs()[limb].parent.as_ref().map_or(6, |(_, joint)| freedoms(joint))
}
