//! Girths from the edges of color regions, where no depth is available.

use nalgebra::Matrix3;

use super::girth::{GIRTH_STEPS, Girth, GirthSystem, follow_girth, kernel, start_girth};
use crate::association::correspondence::EdgePair;
use crate::body::{Body, Model};
use crate::fit::{Fit, Setting};
use crate::math::{Pose, Vec3};
use crate::shape::TaperedEllipticCylinder;

/// Number of neighboring lines that have the information of one, because their edge errors are correlated.
const LINES_ALIKE: f64 = 3.0;
/// Number of frames from one girth update to the next.
const GIRTHS_EVERY: u32 = 4;
/// Lateral standard deviation of a tracked limb's axis, meters.
const AXIS_SIGMA: f64 = 0.02;

/// Prior standard deviation of the length of hands, feet and heads, meters.
const TIP_SIGMA: f64 = 0.03;
/// Prior relative standard deviation of a limb's length where the lengths of the others are known.
const PROPORTION_SIGMA: f64 = 0.05;

/// An edge in the frame of its limb: foot, normal, distance, meters, and weight.
type LimbEdge = (Vec3, Vec3, f64, f64);

/// Returns the edges of a limb.
fn edges_of(pairs: &[EdgePair], limb: usize, working_from_limb: Pose) -> impl Iterator<Item = LimbEdge> {
    pairs.iter().filter(move |pair| pair.limb == limb).map(move |pair| {
        let foot = working_from_limb.inverse_transform_point(pair.x);
        let normal = working_from_limb.rotation.inverse() * pair.normal;
        (foot, normal, pair.distance, kernel(pair.distance) * pair.information / LINES_ALIKE)
    })
}

/// Returns the normal equations of a limb's edges.
fn system(shape: &TaperedEllipticCylinder, edges: impl Iterator<Item = LimbEdge>) -> GirthSystem {
    let mut system = GirthSystem::default();
    edges.for_each(|(foot, normal, distance, weight)| system.add(shape, foot, normal, distance, weight));
    system
}

/// Returns the factor by which a limb with a free distal end is longer, from the edges along the rim of that end.
fn tip(shape: &TaperedEllipticCylinder, edges: impl Iterator<Item = LimbEdge>) -> f64 {
    let (mut h, mut g) = (1.0 / (TIP_SIGMA * TIP_SIGMA), 0.0);
    for (_, normal, distance, weight) in edges.filter(|(foot, ..)| !(foot.z < shape.length() * 0.999)) {
        h += weight * normal.z * normal.z;
        g += weight * normal.z * distance;
    }
    1.0 + g / (h * shape.length())
}

/// Estimates of the surfaces of all limbs; empty where depth determines them.
#[derive(Debug, Default)]
pub(super) struct ColorGirths {
    limbs: Vec<Girth>,
    /// Frames since the last girth update.
    frames: u32,
}

impl ColorGirths {
    /// Fits the limbs' surfaces to color edges where colors compare poses.
    pub(super) fn start(&mut self, setting: Setting, model: &mut Model, poses: &mut [Pose], fit: &mut Fit) {
        if !setting.with_model(model).compares_colors() {
            return;
        }
        (self.limbs, self.frames) = (vec![Girth::default(); poses.len()], 0);
        equalize_pairs(model, poses);
        for _ in 0..GIRTH_STEPS {
            fit.match_single_edges(setting.with_model(model), poses);
            for limb in 0..self.limbs.len() {
                let edges = || edges_of(&fit.correspondences.regions, limb, poses[limb]);
                let part = &model.body.limbs()[limb];
                if part.match_caps[1] {
                    let longer = tip(&part.shape, edges());
                    model.body.change_tip(limb, longer);
                }
                let system = system(&model.body.limbs()[limb].shape, edges());
                start_girth(&mut self.limbs, limb, &system, 1.0, &mut model.body, &mut poses[limb]);
            }
        }
    }

    /// Updates the girths with color edges.
    pub(super) fn follow(&mut self, setting: Setting, model: &mut Model, poses: &[Pose], fit: &mut Fit) {
        self.frames = (self.frames + 1) % GIRTHS_EVERY;
        if self.limbs.is_empty() || self.frames != 0 {
            return;
        }
        fit.match_single_edges(setting.with_model(model), poses);
        for limb in 0..self.limbs.len() {
            let edges = edges_of(&fit.correspondences.regions, limb, poses[limb]);
            let system = system(&model.body.limbs()[limb].shape, edges);
            let errors = (AXIS_SIGMA, f64::from(GIRTHS_EVERY));
            follow_girth(&mut self.limbs, limb, &system, errors, Matrix3::zeros(), &mut model.body);
        }
    }
}

/// Gives both limbs of each pair a common length, because color contours alone correct a wrong start only slowly. The length is a
/// weighted mean of the average of both limbs and the length expected from the proportions of the other limbs. The weight of the
/// proportions grows with the differences within the pairs, which indicate how inaccurate the start is.
fn equalize_pairs(model: &mut Model, poses: &mut [Pose]) {
    let length = |body: &Body, limb: usize| body.limbs()[limb].shape.length();
    let pairs: Vec<_> = model.body.pairs().into_iter().filter(|pair| pair.len() == 2).collect();
    let [mut off, mut sum, mut usual] = [0.0; 3];
    for pair in &pairs {
        let [one, other] = [0, 1].map(|side| length(&model.body, pair[side]));
        off += (one - other).powi(2) / pairs.len() as f64;
        sum += 0.5 * (one + other);
        usual += length(&model.reference_body, pair[0]);
    }
    // The variance of the difference of two lengths is four times that of their mean.
    let off = 0.25 * off;
    for pair in &pairs {
        let [one, other] = [0, 1].map(|side| length(&model.body, pair[side]));
        let proportional = length(&model.reference_body, pair[0]) * sum / usual;
        let weight_of_proportion = off / (off + (PROPORTION_SIGMA * proportional).powi(2));
        let length = 0.5 * (one + other) * (1.0 - weight_of_proportion) + proportional * weight_of_proportion;
        for (limb, before) in pair.iter().zip([one, other]) {
            model.body.change_length(*limb, length / before);
        }
    }
    model.body.close_joints(poses);
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::standing;

    /// Mean relative error of the equalized lengths, for a start whose arms and legs have relative length errors `offsets`, left
    /// and right.
    fn off(offsets: [[f64; 2]; 4]) -> f64 {
        let (mut model, mut poses) = standing();
        let true_body = model.body.clone();
        let limb = |name: &str| true_body.limb_index(name).unwrap();
        for (name, offsets) in ["upperarm", "forearm", "thigh", "calf"].iter().zip(offsets) {
            for (side, offset) in ["l", "r"].iter().zip(offsets) {
                model.body.change_length(limb(&format!("{side}_{name}")), 1.0 + offset);
            }
        }
        equalize_pairs(&mut model, &mut poses);
        let ratio = |name: &str| {
            let length = |body: &Body| body.limbs()[limb(name)].shape.length();
            (length(&model.body) / length(&true_body) - 1.0).abs()
        };
        ["l_upperarm", "l_forearm", "l_thigh", "l_calf"].iter().map(|name| ratio(name) / 4.0).sum()
    }

    #[test]
    fn the_less_alike_pairs_are_the_more_are_lengths_those_of_proportion() {
        let alike = [[0.15, 0.15], [-0.1, -0.1], [0.05, 0.05], [-0.1, -0.1]];
        assert!((off(alike) - 0.1).abs() < 1e-9, "a person may have such limbs");
        let unequal = [[-0.3, 0.0], [-0.1, 0.2], [0.2, 0.0], [0.0, -0.2]];
        assert!(off(unequal) < 0.06, "{}; the means alone are 0.1 off", off(unequal));
    }
}
