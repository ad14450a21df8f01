//! Prediction and smoothness (R07 eq. 16-18, 26): pulls the twist of the root and the rotation of every joint towards the
//! predicted ones.
//!
//! R07's penalty is quadratic: if it is strong enough for a body at rest, it makes a fast body lag. Here the information of a
//! joint grows the less the measurements move it from the prediction ([`Prior::find_stillness`]), because a small deviation is
//! probably noise. The stillness is computed once per frame, from the deviation that the measurements alone cause. Computed
//! again in every step, it would feed back: a tighter prior makes the deviation smaller, which tightens the prior further, until
//! the joint sticks at its previous position.

use super::Term;
use super::surface::geman_mcclure;
use crate::body::Body;
use crate::math::{Pose, Quat, Vec3, rotation_vector};
use crate::terms::normal_equations::{NormalEquations, line};

/// Deviation, in standard deviations of the expected motion, at which the stillness is a quarter: smaller ones count as noise.
const WELL: f64 = 0.6;
/// Factor of the additional information for the root: a deviation that all limbs share is less likely to be noise.
const ROOT_FRACTION: f64 = 0.2;

/// Deviation from a predicted pose.
#[derive(Debug)]
pub(crate) struct Prior<'a> {
    /// Predicted poses, working frame.
    pub predicted: &'a [Pose],
    /// Standard deviations of the root: radians, meters.
    pub root: [f64; 2],
    /// Standard deviation of each joint's rotation, radians.
    pub joints: &'a [f64],
    /// Additional information of a root or joint that is still, as a multiple of its information.
    pub gain: f64,
    /// Stillness of the root (first) and of each joint, see [`Self::find_stillness`]; empty where none is still.
    pub stillness: &'a [f64],
    /// Where each joint rests when nothing shows it; empty for none.
    pub rests: &'a [Rest],
}

/// The rotation of a limb relative to its parent that it takes when nothing shows it, and the fraction of the way to it from the
/// prediction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rest {
    pub rotation: Quat,
    pub fraction: f64,
}

impl Prior<'_> {
    /// Writes the stillness of the root (first) and of each joint: 1 where they are as predicted, towards 0 where they move.
    pub(crate) fn find_stillness(&self, body: &Body, poses: &[Pose], stillness: &mut Vec<f64>) {
        let fraction = |deviation: f64| geman_mcclure(deviation, WELL);
        stillness.clear();
        stillness.extend(body.limbs().iter().enumerate().map(|(index, limb)| match &limb.parent {
            None => {
                let (r, d) = self.root_deviation(poses);
                fraction((r.length() / self.root[0]).hypot(d.length() / self.root[1]))
            }
            Some((parent, _)) => fraction(self.turn(poses, *parent, index).length() / self.joints[index]),
        }));
    }

    /// Rotation and translation of the root as separate terms, so that the lever to the working origin does not matter.
    fn root_deviation(&self, poses: &[Pose]) -> (Vec3, Vec3) {
        let turn = rotation_vector(poses[0].rotation * self.predicted[0].rotation.inverse());
        (turn, poses[0].translation - self.predicted[0].translation)
    }

    /// Rotation from the expected to the current orientation of a limb relative to its parent, in the parent frame.
    fn turn(&self, poses: &[Pose], parent: usize, limb: usize) -> Vec3 {
        let relative = |poses: &[Pose]| poses[parent].rotation.inverse() * poses[limb].rotation;
        let expected = match self.rests.get(limb) {
            Some(rest) if rest.fraction > 0.0 => relative(self.predicted).slerp(rest.rotation, rest.fraction),
            _ => relative(self.predicted),
        };
        rotation_vector(relative(poses) * expected.inverse())
    }
}

impl Term for Prior<'_> {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        let information = |sigma: f64, hold: f64| (1.0 + hold) / (sigma * sigma);
        let (r, d) = self.root_deviation(poses);
        let hold = |index: usize| self.stillness.get(index).map_or(0.0, |stillness| self.gain * stillness);
        let (turn, shift) =
            (information(self.root[0], ROOT_FRACTION * hold(0)), information(self.root[1], ROOT_FRACTION * hold(0)));
        let block = &mut normal.limbs[0];
        for (i, axis) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
            block.h[(i, i)] += turn;
            block.g[i] += turn * r[i];
            block.add_row(shift, &line(poses[0].translation, axis), d[i]);
        }
        for (index, parent, _) in body.joints() {
            // In world axes its derivative with respect to the relative rotation is one.
            let r = poses[parent].rotation * self.turn(poses, parent, index);
            let weight = information(self.joints[index], hold(index));
            normal.joints[index].add_turn(weight, r);
        }
    }
}
