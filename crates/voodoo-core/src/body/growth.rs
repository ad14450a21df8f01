//! Proportions of growth: the head and the trunk of a child are larger than those of an adult of the same stature, its arms and
//! legs are shorter (Snyder et al., "Anthropometry of Infants, Children, and Youths to Age 18", 1977: head length, sitting height,
//! crotch height).

use super::{Body, LimbRole};
use crate::error::BodyError;
use crate::math::{Aabb, Pose, Vec3};

/// Stature from which on proportions are those of an adult, meters.
const GROWN: f64 = 1.55;
/// Relative change of head, trunk, arms and legs, and of the girth of arms and legs, per meter below that stature.
const GROWTH: [f64; 5] = [0.84, 0.13, -0.13, -0.23, 0.09];
/// Highest point above the lowest point of the skeleton of a standing adult, over stature.
const UPRIGHT: f64 = 0.98;

impl Body {
    /// The body with the proportions of a person of another stature, and its own overall scale.
    pub(crate) fn with_proportions_of(&self, stature: f64) -> Self {
        self.grown(self.upright() / UPRIGHT, stature)
    }

    /// The body with proportions of one stature changed to those of another.
    fn grown(&self, from: f64, to: f64) -> Self {
        // Relative to an adult of the same stature.
        let size = |stature: f64, change: f64| 1.0 + change * (GROWN - stature).max(0.0);
        let [head, trunk, arm, leg, girth] = GROWTH.map(|change| size(to, change) / size(from, change));
        let mut body = self.clone();
        for limb in 0..body.limbs.len() {
            let Some(role) = body.roles.limb(limb) else { continue };
            let (size, girth) = match role {
                LimbRole::Head => (head, 1.0),
                LimbRole::Pelvis | LimbRole::Thorax | LimbRole::Neck | LimbRole::Clavicle(_) => (trunk, 1.0),
                LimbRole::UpperArm(_) | LimbRole::Forearm(_) | LimbRole::Hand(_) => (arm, girth),
                LimbRole::Thigh(_) | LimbRole::Calf(_) | LimbRole::Foot(_) => (leg, girth),
            };
            body.reshape(limb, size, [size * girth; 4], |position| position * size);
        }
        body
    }

    /// Height of the highest above the lowest point of the skeleton at rest, meters.
    fn upright(&self) -> f64 {
        let rest = self.rest_pose(Pose::IDENTITY);
        let limbs = self.limbs.iter().zip(&rest);
        let ends = limbs.flat_map(|(limb, pose)| [0.0, limb.shape.length()].map(|along| *pose * (Vec3::Z * along)));
        Aabb::from_points(ends).extents().z.max(0.0)
    }

    /// An adult of stature 1 as a person of this stature.
    pub(super) fn scaled_to(&self, stature: f64) -> Result<Self, BodyError> {
        let grown = self.grown(GROWN, stature);
        grown.scaled(stature * self.upright() / grown.upright())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::HumanModel;

    #[test]
    fn children_have_larger_heads_and_shorter_legs_at_their_stature() {
        for model in [HumanModel::Papers, HumanModel::Full, HumanModel::Measured] {
            let unit = |stature: f64| Body::human(stature, model).unwrap().scaled(1.0 / stature).unwrap();
            let (adult, child) = (unit(1.7), unit(0.92));
            let part = |body: &Body, limb: &str| body.limbs()[body.limb_index(limb).unwrap()].shape.length();
            let ratio = |limb: &str| part(&child, limb) / part(&adult, limb);
            // Snyder et al., 1977, at three years.
            for (limb, expected) in [("head", 1.52), ("l_thigh", 0.87), ("l_upperarm", 0.94)] {
                assert!((ratio(limb) / expected - 1.0).abs() < 0.06, "{limb} of {model:?}: {}", ratio(limb));
            }
            assert!((child.upright() / adult.upright() - 1.0).abs() < 1e-9);
            let tall = unit(1.9);
            assert!(
                tall.limbs().iter().zip(adult.limbs()).all(|(a, b)| (a.shape.a0() / b.shape.a0() - 1.0).abs() < 1e-9)
            );
        }
    }

    #[test]
    fn proportions_are_those_of_the_stature_whatever_body_they_are_taken_from() {
        let [adult, child] = [1.75, 1.1].map(|stature| Body::human(stature, HumanModel::Measured).unwrap());
        assert_eq!(adult.with_proportions_of(1.65), adult);
        let head = |body: &Body| body.limbs()[body.limb_index("head").unwrap()].shape.length() / body.upright();
        assert!((head(&adult.with_proportions_of(1.1)) / head(&child) - 1.0).abs() < 0.01);
        assert!((head(&child.with_proportions_of(1.75)) / head(&adult) - 1.0).abs() < 0.03);
    }
}
