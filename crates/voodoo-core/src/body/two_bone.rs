//! Two-bone chains (arms and legs). Other configurations of them are tried when the current one leaves points unexplained or
//! contradicts the images.

use crate::body::kinematics::{hinge_axis, place};
use crate::body::{Body, Joint, JointKind};
use crate::math::{Mat3, Pose, Quat, Vec3};
use crate::observation::frame::Ground;

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
        for (lower, upper, hinge) in body.joints() {
            let Some((trunk, ball)) = &limbs[upper].parent else { continue };
            if hinge.kind() != JointKind::Hinge || ball.kind() == JointKind::Hinge {
                continue;
            }
            let ends: Vec<_> = body.joints().filter(|(_, parent, _)| *parent == lower).collect();
            let first = (hinge.parent_from_joint.translation - ball.limb_from_joint.translation).length();
            let reach = |(end, _, joint): &(usize, usize, &Joint)| {
                // A foot is perpendicular to the calf: only the component along the calf lengthens the bone.
                let along = joint.parent_from_limb_at_rest().rotation * Vec3::Z;
                GRASP * limbs[*end].shape.length() * along.z.max(0.0)
            };
            let second = limbs[lower].shape.length() + ends.iter().map(reach).fold(0.0, f64::max);
            let leg = *trunk == 0 && ball.parent_from_joint.translation.z < 0.5 * limbs[0].shape.length();
            let ends = ends.into_iter().map(|(end, ..)| end).collect();
            found.push(Self { upper, lower, ends, lengths: [first, second], leg });
        }
        found
    }

    /// All limbs of the chain.
    pub(crate) fn limbs(&self) -> impl Iterator<Item = usize> + '_ {
        [self.upper, self.lower].into_iter().chain(self.ends.iter().copied())
    }

    /// Whether a limb is one of the chain.
    pub(crate) fn has(&self, limb: usize) -> bool {
        self.limbs().any(|own| own == limb)
    }

    /// Center of the ball joint.
    pub(crate) fn root(&self, body: &Body, poses: &[Pose]) -> Vec3 {
        match &body.limbs()[self.upper].parent {
            Some((parent, joint)) => poses[*parent] * joint.parent_from_joint.translation,
            None => poses[self.upper].translation,
        }
    }

    /// Directions of the two bones of a leg on which the body stands or sits: the lower one is upright, with its foot on the floor,
    /// and the upper one is bent forward as far as that takes.
    pub(crate) fn standing(&self, body: &Body, poses: &[Pose], floor: Ground) -> [Vec3; 2] {
        let joint = |limb: usize| body.limbs()[limb].parent.as_ref();
        let Some(((trunk, ball), (_, hinge))) = joint(self.upper).zip(joint(self.lower)) else {
            return [-floor.normal; 2];
        };
        let bends = hinge.limits.as_ref().map_or(1.0, |limits| limits.iter().flatten().sum::<f64>().signum());
        let straight = poses[*trunk].rotation * ball.parent_from_limb_at_rest().rotation;
        let axis = straight * hinge.parent_from_joint.rotation * (bends * hinge_axis(hinge));
        // Who lies on a side has no direction to the front.
        let Some(forward) = axis.cross(floor.normal).try_normalize() else { return [-floor.normal; 2] };
        let thickness = |end: &usize| 2.0 * body.limbs()[*end].shape.b0();
        let height = self.lengths[1] + self.ends.iter().map(thickness).fold(0.0, f64::max);
        let drop = ((floor.height(self.root(body, poses)) - height) / self.lengths[0]).clamp(-1.0, 1.0);
        [forward * (1.0 - drop * drop).sqrt() - floor.normal * drop, -floor.normal]
    }

    /// Rotations of the two bones in these directions relative to their parents, without a twist, where the trunk has this one.
    pub(crate) fn turned(&self, body: &Body, mut parent: Quat, directions: [Vec3; 2]) -> [Quat; 2] {
        let mut turn = |limb: usize, direction: Vec3| {
            let joint = body.limbs()[limb].parent.as_ref().map(|(_, joint)| joint.parent_from_limb_at_rest().rotation);
            let straight = parent * joint.unwrap_or_default();
            let from_straight = Quat::from_rotation_arc(straight * Vec3::Z, direction.normalize_or(Vec3::Z));
            let relative = parent.inverse() * from_straight * straight;
            parent = from_straight * straight;
            relative
        };
        [turn(self.upper, directions[0]), turn(self.lower, directions[1])]
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

    /// The human with its root at this height above the floor, in its rest pose, its legs, and the floor.
    fn at_height(height: f64) -> (Body, Vec<Pose>, Vec<TwoBone>, Ground) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = body.rest_pose(Pose::from_translation(Vec3::Z * height));
        let legs: Vec<TwoBone> = TwoBone::from_body(&body).into_iter().filter(|chain| chain.leg).collect();
        assert_eq!(legs.len(), 2);
        (body, poses, legs, Ground { normal: Vec3::Z, offset: 0.0 })
    }

    #[test]
    fn who_is_high_enough_stands_and_who_is_lower_sits_with_the_feet_on_the_floor() {
        let (body, poses, legs, floor) = at_height(1.2);
        assert!(legs.iter().all(|leg| leg.standing(&body, &poses, floor) == [-Vec3::Z; 2]));
        let (body, poses, legs, floor) = at_height(0.55);
        for leg in legs {
            let directions = leg.standing(&body, &poses, floor);
            let knee = leg.root(&body, &poses) + leg.lengths[0] * directions[0];
            let [foot, thickness] = [knee.z - leg.lengths[1], 2.0 * body.limbs()[leg.ends[0]].shape.b0()];
            assert!((foot - thickness).abs() < 1e-9 && directions[0].x > 0.9, "{foot}, {directions:?}");
            assert_eq!(directions[1], -Vec3::Z);
        }
    }

    #[test]
    fn bones_turned_into_directions_point_there() {
        let (body, poses, legs, _) = at_height(0.9);
        let directions = [Vec3::new(0.8, 0.1, -0.6), Vec3::new(-0.3, 0.0, -1.0)].map(Vec3::normalize);
        let trunk = Quat::from_axis_angle(Vec3::Y, 0.3) * poses[0].rotation;
        for leg in legs {
            let [upper, lower] = leg.turned(&body, trunk, directions);
            let found = [trunk * upper, trunk * upper * lower].map(|rotation| rotation * Vec3::Z);
            assert!(found.iter().zip(directions).all(|(found, direction)| found.distance(direction) < 1e-9));
        }
    }

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
