//! Prediction and smoothness (R07 eq. 16-18, 26): the root's twist and every joint's turn are drawn to the predicted ones.
//!
//! R07's penalty is quadratic: what is strong enough for a body at rest makes a fast one late. Here a second well lies in the
//! middle of the first: a deviation that is small against what is expected is taken for noise and held tightly, a greater one
//! leaves the well and feels the wide one only.

use super::Term;
use super::surface::geman_mcclure;
use crate::body::Body;
use crate::math::{Pose, ShortestAxis, Vec3};
use crate::terms::normal_equations::NormalEquations;

/// Width of the inner well in standard deviations of the outer one: what is smaller than expected motion counts as noise.
const WELL: f64 = 0.6;
/// Share of it that holds the root: what all limbs agree on is less likely noise.
const ROOT_SHARE: f64 = 0.2;

/// Deviation from a predicted pose.
#[derive(Debug)]
pub struct Prior<'a> {
    /// Predicted poses, working frame.
    pub predicted: &'a [Pose],
    /// Standard deviations of the root: radians, metres.
    pub root: [f64; 2],
    /// Standard deviation of each joint's turn, radians.
    pub joints: &'a [f64],
    /// Information of the inner well as a multiple of the outer one's; 0: no inner well.
    pub still_gain: f64,
}

/// Cost and weight of a deviation `r` in the two wells of `sigma`.
fn hold(still_gain: f64, r: f64, sigma: f64) -> (f64, f64) {
    let information = 1.0 / (sigma * sigma);
    let (rho, kernel) = geman_mcclure(r, WELL * sigma);
    (information * (r * r + still_gain * rho), information * (1.0 + still_gain * kernel))
}

impl Term for Prior<'_> {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        // Root: rotation and position apart, so that the lever to the working origin does not matter.
        let r = (poses[0].rotation * self.predicted[0].rotation.inverse()).to_scaled_axis_shortest();
        let d = poses[0].translation - self.predicted[0].translation;
        let (turn_cost, turn) = hold(ROOT_SHARE * self.still_gain, r.length(), self.root[0]);
        let (shift_cost, shift) = hold(ROOT_SHARE * self.still_gain, d.length(), self.root[1]);
        normal.cost += turn_cost + shift_cost;
        let block = &mut normal.limbs[0];
        for (i, axis) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
            block.h[(i, i)] += turn;
            block.g[i] += turn * r[i];
            block.add_row(shift, &crate::terms::normal_equations::line(poses[0].translation, axis), d[i]);
        }
        for (index, limb) in body.limbs().iter().enumerate() {
            let Some((parent, _)) = &limb.parent else { continue };
            let relative = |poses: &[Pose]| poses[*parent].rotation.inverse() * poses[index].rotation;
            // Deviation in the parent's frame, then in world axes: its derivative by the relative turn is one.
            let turn = (relative(poses) * relative(self.predicted).inverse()).to_scaled_axis_shortest();
            let r = poses[*parent].rotation * turn;
            let (cost, weight) = hold(self.still_gain, r.length(), self.joints[index]);
            normal.joints[index].add_turn(weight, r);
            normal.cost += cost;
        }
    }
}
