//! Evidence of a detection for the pose of a limb.

use crate::body::Body;
use crate::detect::Detected;
use crate::math::{Pose, Vec3};
use crate::visibility::EXPLAINED;

/// Returns the log odds that a limb's pose is right, from the detected positions of the proximal joints of `limbs`: the limb
/// itself and the next one. The sum over both joints contradicts a limb if the detection is far from most of it, even if one
/// joint agrees. Poses are in the working frame, whose origin in the world is `origin`.
pub(super) fn detection_log_odds(
    detected: Detected,
    body: &Body,
    poses: &[Pose],
    origin: Vec3,
    limbs: [Option<usize>; 2],
) -> f64 {
    let apart = |limb: usize| {
        let (parent, joint) = body.limbs()[limb].parent.as_ref()?;
        let detected = detected.hangs_by(limb)?;
        let tracked = poses[*parent] * joint.parent_from_joint.translation + origin;
        // For a right joint the expected square along an axis is the variance. The tracked position has the tolerance `EXPLAINED`,
        // the distance within which a limb explains a point.
        let variance = detected.sigma * detected.sigma + EXPLAINED * EXPLAINED;
        let apart = (tracked - detected.position).to_array();
        Some(apart.iter().map(|along| 0.5 * (1.0 - along * along / variance)).sum::<f64>())
    };
    limbs.into_iter().flatten().filter_map(apart).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::{DetectedJoint, Detection, JointMap};
    use crate::testing::standing;

    /// Log odds of the first arm's limbs for a detection with this standard deviation that is displaced by `aside`.
    fn log_odds(aside: Vec3, sigma: f64) -> [f64; 2] {
        let (model, poses) = standing();
        let body = &model.body;
        let names: Vec<String> = body.sites().iter().map(|site| site.name.clone()).collect();
        let place = |site| body.site_position(&poses, site) + aside + Vec3::X;
        let joint = |site| Some(DetectedJoint { position: place(site), sigma, visible: 1.0 });
        let detection = Detection { joints: (0..names.len()).map(joint).collect(), ..Detection::default() };
        let detected = Detected { detection: &detection, map: &JointMap::new(body, &names, &[]) };
        let arm = &model.extremities[0];
        [(arm.upper, Some(arm.lower)), (arm.lower, arm.ends.first().copied())]
            .map(|(limb, next)| detection_log_odds(detected, body, &poses, Vec3::X, [Some(limb), next]))
    }

    #[test]
    fn a_detection_supports_a_near_limb_and_contradicts_a_far_one_according_to_its_sigma() {
        for (there, aside) in log_odds(Vec3::ZERO, 0.03).into_iter().zip(log_odds(0.2 * Vec3::X, 0.03)) {
            assert!((there - 3.0).abs() < 1e-9 && aside < -10.0, "{there} {aside}");
        }
        assert!(
            log_odds(0.2 * Vec3::X, 0.2).iter().all(|value| *value > 0.0),
            "a detection of large sigma does not contradict"
        );
    }
}
