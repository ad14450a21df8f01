//! Two-bone chains (arms and legs). Other configurations of them are tried when the current one leaves points unexplained or
//! contradicts the images.

use crate::body::kinematics::{hinge_axis, place};
use crate::body::{Body, JointKind};
use crate::math::{Mat3, Pose, Quat, Vec3};

/// The chain ends at this fraction of the length of what is attached to its lower limb: in the middle of a fist.
const GRASP: f64 = 0.6;
/// Distance that is kept from a fully stretched and a fully folded chain, meters: there the bend has no direction.
const SLACK: f64 = 1e-3;
/// The same distance as a fraction of the shorter bone, used where it is smaller, as for a toy body.
const SLACK_FRACTION: f64 = 0.1;
/// A chain bent by less than this (sine) counts as straight and keeps its hinge axis.
const STRETCHED: f64 = 0.05;

/// A ball joint followed by a hinge: an arm or a leg.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TwoBone {
    /// The limb at the ball joint.
    pub upper: usize,
    /// The limb at the hinge.
    pub lower: usize,
    /// Descendants of the lower limb.
    pub ends: Vec<usize>,
    /// Lengths of the two bones, meters; the second includes what is attached to it.
    pub lengths: [f64; 2],
    /// Whether it is attached to the proximal end of the body's root limb, so that the body stands on it.
    pub leg: bool,
}

impl TwoBone {
    /// All arms and legs of a body.
    pub(crate) fn from_body(body: &Body) -> Vec<Self> {
        let limbs = body.limbs();
        let mut found = Vec::new();
        for (lower, limb) in limbs.iter().enumerate() {
            let Some((upper, hinge)) = &limb.parent else { continue };
            let Some((trunk, ball)) = &limbs[*upper].parent else { continue };
            if hinge.kind() != JointKind::Hinge || ball.kind() == JointKind::Hinge {
                continue;
            }
            let ends: Vec<usize> = body.children(lower).collect();
            let first = (hinge.parent_from_joint.translation - ball.limb_from_joint.translation).length();
            let reach = |end: &usize| {
                let shape = &limbs[*end].shape;
                // A foot is perpendicular to the calf: only the component along the calf lengthens the bone.
                let along = limbs[*end]
                    .parent
                    .as_ref()
                    .map_or(Vec3::Z, |(_, joint)| joint.parent_from_limb_at_rest().rotation * Vec3::Z);
                GRASP * shape.length() * along.z.max(0.0)
            };
            let second = limb.shape.length() + ends.iter().map(reach).fold(0.0, f64::max);
            let leg = *trunk == 0 && ball.parent_from_joint.translation.z < 0.5 * limbs[0].shape.length();
            found.push(Self { upper: *upper, lower, ends, lengths: [first, second], leg });
        }
        found
    }

    /// All limbs of the chain.
    pub(crate) fn limbs(&self) -> impl Iterator<Item = usize> + '_ {
        [self.upper, self.lower].into_iter().chain(self.ends.iter().copied())
    }

    /// Center of the ball joint.
    pub(crate) fn root(&self, body: &Body, poses: &[Pose]) -> Vec3 {
        match &body.limbs()[self.upper].parent {
            Some((parent, joint)) => poses[*parent] * joint.parent_from_joint.translation,
            None => poses[self.upper].translation,
        }
    }

    /// Length of the stretched chain.
    pub(crate) fn stretched_length(&self) -> f64 {
        self.lengths[0] + self.lengths[1]
    }

    /// Poses the chain so that its end is as near to `target` as it can reach, with the bend rotated by `swivel` radians about
    /// the line to the target. The joints stay closed.
    pub(crate) fn reach(&self, body: &Body, poses: &mut [Pose], target: Vec3, swivel: f64) {
        let root = self.root(body, poses);
        let [first, second] = self.lengths;
        let line = target - root;
        let slack = SLACK.min(SLACK_FRACTION * first.min(second));
        let distance = line.length().max((first - second).abs() + slack).min(first + second - slack);
        let direction = line.try_normalize().unwrap_or(-Vec3::Z);
        let along = (first * first - second * second + distance * distance) / (2.0 * distance);
        let off = (first * first - along * along).max(0.0).sqrt();
        let side = Quat::from_axis_angle(direction, swivel) * direction.any_orthonormal_vector();
        let bend = root + direction * along + side * off;
        let end = root + direction * distance;
        self.place_between(body, poses, bend, end);
    }

    /// Position of the chain's end.
    pub(crate) fn end(&self, poses: &[Pose]) -> Vec3 {
        poses[self.lower] * (Vec3::Z * self.lengths[1])
    }

    /// Poses the chain so that it bends towards the position `bend` and ends in the direction of the position `end`. The joints
    /// stay closed.
    pub(crate) fn place_between(&self, body: &Body, poses: &mut [Pose], bend: Vec3, end: Vec3) {
        let root = self.root(body, poses);
        let (Some((_, ball)), Some((_, hinge))) = (&body.limbs()[self.upper].parent, &body.limbs()[self.lower].parent)
        else {
            return;
        };
        let (u, f) = ((bend - root).normalize_or_zero(), (end - bend).normalize_or_zero());
        let axis = u.cross(f);
        // A straight limb keeps its current hinge axis.
        let current = poses[self.upper].rotation * (hinge.parent_from_joint.rotation * hinge_axis(hinge));
        let axis = if axis.length() > STRETCHED { axis } else { current - u * current.dot(u) };
        let local_u = (hinge.parent_from_joint.translation - ball.limb_from_joint.translation).normalize_or_zero();
        let local_axis = hinge.parent_from_joint.rotation * hinge_axis(hinge);
        let (Some(world), Some(local)) = (basis(u, axis), basis(local_u, local_axis)) else { return };
        let rotation = Quat::from_mat3(&(world * local.transpose())).normalize();
        poses[self.upper] = Pose::from_parts(root - rotation * ball.limb_from_joint.translation, rotation);
        let flexion = u.dot(f).clamp(-1.0, 1.0).acos();
        poses[self.lower] = place(hinge, &poses[self.upper], Quat::from_axis_angle(hinge_axis(hinge), flexion));
        for index in &self.ends {
            if let Some((parent, joint)) = &body.limbs()[*index].parent {
                poses[*index] = place(joint, &poses[*parent], Quat::IDENTITY);
            }
        }
    }
}

/// Right-handed axes with the first along `main` and the second nearest to `other`.
fn basis(main: Vec3, other: Vec3) -> Option<Mat3> {
    let second = (other - main * other.dot(main)).try_normalize()?;
    Some(Mat3::from_cols(main, second, main.cross(second)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;

    #[test]
    fn reaches_targets_on_bodies_of_any_size() {
        for scale in [1.0, 1e-3] {
            let body = Body::human(1.75, HumanModel::Full).unwrap().scaled(scale).unwrap();
            let rest = body.rest_pose(Pose::IDENTITY);
            for chain in TwoBone::from_body(&body) {
                let target = chain.root(&body, &rest) + Vec3::new(0.6, 0.2, -0.3) * chain.stretched_length();
                for swivel in 0..6 {
                    let mut poses = rest.clone();
                    chain.reach(&body, &mut poses, target, f64::from(swivel));
                    let end = chain.end(&poses);
                    assert!(
                        (end - target).length() < 0.02 * scale,
                        "{:?} misses by {}",
                        chain,
                        (end - target).length()
                    );
                }
            }
        }
    }
}
