//! What the poses of a frame cost: one score by which hypotheses are compared, in unexplained patches.

use crate::body::Body;
use crate::body::kinematics::joint_turn;
use crate::body::two_bone::TwoBone;
use crate::math::{Pose, ShortestAxis, Vec3};
use crate::observation::candidates::REFERENCE_PATCH;
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::Frame;
use crate::tracker::Tracker;
use crate::visibility::evidence::{Visibility, limb_visibility, unexplained};

/// A joint limit broken by this, or a joint turned by this since the last frame, costs one unexplained patch; radians.
const LIMIT_STRAIN: f64 = 0.1;
const MOTION_STRAIN: f64 = 0.6;
/// Places along a limb that are looked at, and how deep (metres) one lies in another limb when it is inside.
const PLACES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
const INSIDE: f64 = 0.01;

/// Cost of a pose in unexplained patches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost {
    /// What cameras say against it: points that no limb explains, and surface that they see past.
    pub(crate) evidence: f64,
    /// That, what hides, and the strain of all arms and legs.
    pub(crate) total: f64,
}

impl Tracker {
    /// What the current poses cost.
    pub(crate) fn overall_cost(&self, frame: &Frame) -> Cost {
        let views =
            DepthViews { frame, backgrounds: &self.backgrounds, segmented: &self.segmented, origin: self.origin };
        let limbs = self.body.limbs().iter().zip(&self.poses);
        let mut seen = Visibility::default();
        limbs.for_each(|(limb, pose)| seen += limb_visibility(views, limb, pose));
        let strain: f64 = self.chains.iter().map(|chain| self.strain(chain, &self.poses)).sum();
        let total: f64 = self.candidates.weight.iter().map(|weight| f64::from(*weight)).sum();
        let points = unexplained(&self.correspondences, total);
        Cost { evidence: points + seen.image.free_space, total: points + seen.cost() + strain }
    }

    /// Patches of a chain whose axis lies inside another limb: there is no room for it.
    fn inside(&self, chain: &TwoBone, poses: &[Pose]) -> f64 {
        let mut cost = 0.0;
        for limb in chain.limbs() {
            let shape = &self.body.limbs()[limb].shape;
            let patches = 2.0 * shape.length() * shape.b0().max(shape.b1()) / REFERENCE_PATCH;
            // The joint of the upper limb lies inside its parent.
            let first = if limb == chain.upper { 2 } else { 0 };
            for place in &PLACES[first..] {
                let point = poses[limb] * Vec3::new(0.0, 0.0, place * shape.length());
                let within = (0..poses.len()).filter(|other| !chain.limbs().any(|own| own == *other)).any(|other| {
                    let shape = &self.body.limbs()[other].shape;
                    // Most limbs are too far away to hold it.
                    let reach = shape.length() + shape.a0().max(shape.b0()).max(shape.a1()).max(shape.b1());
                    (point - poses[other].translation).length_squared() < reach * reach
                        && shape.approximate_distance(poses[other].inverse_transform_point(point)) < -INSIDE
                });
                cost += if within { patches / PLACES.len() as f64 } else { 0.0 };
            }
        }
        cost
    }

    /// Cost of broken joint limits, of missed sites and of motion since the last frame, in unexplained patches.
    pub(crate) fn strain(&self, chain: &TwoBone, poses: &[Pose]) -> f64 {
        let mut cost = 0.0;
        for limb in [chain.upper, chain.lower] {
            let Some((parent, joint)) = &self.body.limbs()[limb].parent else { continue };
            let turn = joint_turn(joint, &poses[*parent], &poses[limb]);
            cost += limit_strain(&self.body, poses, limb);
            if self.previous.len() == poses.len() {
                let before = joint_turn(joint, &self.previous[*parent], &self.previous[limb]);
                let moved = (turn * before.inverse()).to_scaled_axis_shortest().length() / MOTION_STRAIN;
                cost += moved * moved;
            }
        }
        cost + self.inside(chain, poses) + self.sites_missed(chain, poses)
    }
}

/// Cost of the broken limits of the joint of a limb, in unexplained patches.
pub(crate) fn limit_strain(body: &Body, poses: &[Pose], limb: usize) -> f64 {
    let Some((parent, joint)) = &body.limbs()[limb].parent else { return 0.0 };
    let Some(limits) = &joint.limits else { return 0.0 };
    let turn = joint_turn(joint, &poses[*parent], &poses[limb]).to_scaled_axis_shortest();
    let excess = |(axis, [low, high]): (usize, &[f64; 2])| {
        ((low - turn[axis]).max(turn[axis] - high).max(0.0) / LIMIT_STRAIN).powi(2)
    };
    limits.iter().enumerate().map(excess).sum()
}
