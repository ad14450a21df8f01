//! Raises the shoulder of a raised arm: the scapulohumeral rhythm (Inman, Saunders and Abbott, "Observations on the function of
//! the shoulder joint", 1944).
//!
//! The rotation of a clavicle is hardly visible to a camera. If the clavicle stayed fixed, the shoulder of an arm that is
//! stretched upwards would be 8 to 13 cm too low, and the arm with it.

use super::Body;
use crate::math::{Pose, Quat, Vec3};

/// Rotation of the clavicle per rotation of the arm above the horizontal.
const RHYTHM: f64 = 0.3;

/// Rotates the clavicles of `predicted` by the change in the arms' elevation above the horizontal from `previous` to `current`.
/// The arms keep their directions, and joints stay closed.
pub(crate) fn raise_shoulders(body: &Body, previous: &[Pose], current: &[Pose], predicted: &mut [Pose]) {
    let limbs = body.limbs();
    let mut raised = false;
    for [clavicle, arm] in body.clavicles() {
        let (Some((_, shoulder)), Some((trunk, joint))) = (&limbs[arm].parent, &limbs[clavicle].parent) else {
            continue;
        };
        let rest = joint.parent_from_limb_at_rest();
        let hanging = rest.rotation * (shoulder.parent_from_limb_at_rest().rotation * Vec3::Z);
        let usual = |poses: &[Pose]| {
            let along = poses[*trunk].rotation.inverse() * (poses[arm].rotation * Vec3::Z);
            RHYTHM * (-hanging.dot(along)).clamp(0.0, 1.0).asin()
        };
        let more = usual(current) - usual(previous);
        if more == 0.0 {
            continue;
        }
        let axis = joint.parent_from_joint.rotation * Vec3::X;
        let lever = rest * shoulder.parent_from_joint.translation - joint.parent_from_joint.translation;
        let up = if axis.cross(lever).dot(hanging) > 0.0 { -axis } else { axis };
        let turn = Quat::from_axis_angle(predicted[*trunk].rotation * up, more);
        let pose = &mut predicted[clavicle];
        pose.rotation = (turn * pose.rotation).normalize();
        raised = true;
    }
    if raised {
        body.close_joints(predicted);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::testing::farthest;

    /// A body, and its poses with the left arm raised sideways by `angle` from hanging, radians.
    fn sideways(angle: f64) -> (Body, Vec<Pose>) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut poses = body.rest_pose(Pose::IDENTITY);
        for name in ["l_upperarm", "l_forearm", "l_hand"] {
            let limb = body.limb_index(name).unwrap();
            poses[limb].rotation = Quat::from_axis_angle(Vec3::X, angle) * poses[limb].rotation;
        }
        body.close_joints(&mut poses);
        (body, poses)
    }

    #[test]
    fn an_arm_that_rises_beyond_the_horizontal_raises_its_shoulder_and_sinks_with_it() {
        let (body, up) = sideways(2.5);
        let (_, level) = sideways(1.5);
        let mut predicted = up.clone();
        raise_shoulders(&body, &level, &up, &mut predicted);
        let height = |poses: &[Pose], site: &str| body.site_position(poses, body.site_index(site).unwrap()).z;
        let rise = height(&predicted, "l_shoulder") - height(&up, "l_shoulder");
        assert!((0.01..0.06).contains(&rise), "{rise}");
        assert_eq!(height(&predicted, "r_shoulder"), height(&up, "r_shoulder"));
        for (pose, before) in predicted.iter().zip(&up).skip(body.limb_index("l_upperarm").unwrap()) {
            assert!(pose.rotation.angle_between(before.rotation) < 1e-6, "arms keep their directions");
        }
        raise_shoulders(&body, &up, &level, &mut predicted);
        assert!(farthest(&predicted, &up) < 1e-9);
    }

    #[test]
    fn an_arm_below_the_horizontal_raises_nothing() {
        let (body, level) = sideways(1.5);
        let (_, hanging) = sideways(0.2);
        let mut predicted = level.clone();
        raise_shoulders(&body, &hanging, &level, &mut predicted);
        assert_eq!(predicted, level);
    }
}
