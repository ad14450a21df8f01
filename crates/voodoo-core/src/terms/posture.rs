//! Rest posture: pulls joints with a small range of motion towards their rest position.
//!
//! Depth from one side gives little evidence for a twist of the spine, and two cameras on opposite sides almost none for a
//! rotation about their line of sight, while errors of neighboring measurements are correlated. Without this term, the pelvis
//! rotates and the spine twists a little farther with every frame, and nothing pulls them back.

use super::Term;
use super::limits::add_angles;
use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::NormalEquations;

/// A component with a range larger than this, radians, is left free: those of shoulders, elbows and knees, and the bending of
/// hips and back.
const SWINGS: f64 = 1.7;

/// All joints that have limits.
#[derive(Debug)]
pub(crate) struct Posture {
    /// Standard deviation of each component of a joint's rotation, as a fraction of half of its range.
    pub fraction: f64,
}

impl Term for Posture {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        add_angles(body, poses, normal, |angle, [low, high]| {
            let range = high - low;
            let sigma = 0.5 * range * self.fraction;
            // At rest the rotation is zero, or the nearest value within the limits.
            let off = angle - 0.0_f64.clamp(low, high);
            (range > 0.0 && range < SWINGS).then_some((1.0 / (sigma * sigma), off))
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{raised, standing, turned};

    fn cost(body: &Body, poses: &[Pose]) -> f64 {
        let mut normal = NormalEquations::default();
        normal.clear(poses.len());
        Posture { fraction: 0.25 }.add(body, poses, &mut normal);
        // The least squares of a joint's residuals, of which no two are about the same axis.
        normal.joints.iter().map(|joint| joint.g.dot(&(joint.h.pseudo_inverse(1e-9).unwrap() * joint.g))).sum()
    }

    #[test]
    fn who_stands_or_raises_an_arm_costs_nothing_and_a_turned_pelvis_does() {
        let (model, poses) = standing();
        let body = &model.body;
        let (arm_up, _) = raised(&model, &poses, 1.0);
        assert!(cost(body, &poses) < 1e-12 && cost(body, &arm_up) < 1e-12);
        let mut twisted = poses.clone();
        twisted[0] = turned(&poses[..1], poses[0].translation, poses[0].rotation * crate::math::Vec3::Z, 0.3)[0];
        // A waist and two hips, each slightly more than one standard deviation from rest.
        assert!((2.0..12.0).contains(&cost(body, &twisted)), "{}", cost(body, &twisted));
    }
}
