//! Detected joints as measurements of the tracked body. They hold what a frame hides, and what its surface shows wrongly because it
//! is not the body's: legs in a skirt, a trunk under a backpack.

use super::{Detected, DetectedJoint};
use crate::association::correspondence::{Correspondences, DetectedPair};
use crate::body::Body;
use crate::math::{Pose, Vec3, reset};

/// By how many times its own a detected joint's information grows where the pose deviates from the detection, see
/// [`Detected::excess_deviation`]: a surface that is not the body's has hundreds of points.
const EXCESS_GAIN: f64 = 5.0;

/// A detected joint of the body: its site, its position, world frame, its standard deviation along each axis, meters, and its
/// information, 1/m^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeasuredJoint {
    site: usize,
    position: Vec3,
    sigma: f64,
    information: f64,
}

impl Detected<'_> {
    /// How far trunk and legs at these poses, working frame, are from where they were detected: the mean squared deviation in
    /// space, in variances, beyond the one that is expected; from 0 to 1.
    fn excess_deviation(&self, body: &Body, poses: &[Pose], origin: Vec3) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for joint in self.map.trunk().iter().chain(self.map.legs()) {
            if let (Some(joint), Some(site)) = (self.joint(*joint), self.map.site(*joint)) {
                let apart = body.site_position(poses, site) + origin - joint.position;
                sum += apart.length_squared() / (3.0 * joint.sigma * joint.sigma);
                count += 1.0;
            }
        }
        (sum / count.max(1.0) - 1.0).clamp(0.0, 1.0)
    }

    /// Writes the probability that each limb is visible: the largest of its detected joints; 1 where none was detected.
    pub(crate) fn visible_limbs(&self, body: &Body, limbs: &mut Vec<f32>) {
        reset(limbs, body.limbs().len(), f32::NAN);
        for (site, joint) in self.on_sites() {
            for limb in joined_limbs(body, site) {
                // The larger of a number and `NAN` is the number.
                limbs[limb] = limbs[limb].max(joint.visible as f32);
            }
        }
        limbs.iter_mut().filter(|visible| visible.is_nan()).for_each(|visible| *visible = 1.0);
    }

    /// Writes the joints to `joints`, for a body that is expected at these poses, working frame.
    pub(crate) fn measure(&self, body: &Body, poses: &[Pose], origin: Vec3, joints: &mut Vec<MeasuredJoint>) {
        let factor = 1.0 + EXCESS_GAIN * self.excess_deviation(body, poses, origin);
        joints.extend(self.on_sites().map(|(site, joint)| {
            let DetectedJoint { position, sigma, visible } = *joint;
            MeasuredJoint { site, position, sigma, information: visible * factor / (sigma * sigma) }
        }));
    }
}

/// The limb of a joint's site and its parent, or twice the limb of the root.
fn joined_limbs(body: &Body, site: usize) -> [usize; 2] {
    let limb = body.sites()[site].limb;
    [limb, body.parent(limb).unwrap_or(limb)]
}

impl Correspondences {
    /// Pairs the body's joints with the detected ones.
    pub(crate) fn add_detected(&mut self, body: &Body, poses: &[Pose], joints: &[MeasuredJoint], origin: Vec3) {
        self.detected.clear();
        self.detected.extend(joints.iter().map(|joint| {
            let MeasuredJoint { site, position, sigma, information } = *joint;
            let (limb, local) = (body.sites()[site].limb, body.sites()[site].position);
            DetectedPair { limb, local, x: poses[limb] * local, p: position - origin, sigma, information }
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::{Detection, JointMap};
    use crate::testing::{moved, standing};

    /// The measured joints of a detection at the poses of the standing body moved by `aside`, for the standing body.
    fn measured(aside: Vec3, sigma: f64) -> Vec<MeasuredJoint> {
        let (model, poses) = standing();
        let (body, origin, there) = (&model.body, Vec3::X, moved(&poses, aside));
        let names: Vec<String> = body.sites().iter().map(|site| site.name.clone()).collect();
        let place = |site| body.site_position(&there, site) + origin;
        let joint = |site| Some(DetectedJoint { position: place(site), sigma, visible: 1.0 });
        let detection = Detection { joints: (0..names.len()).map(joint).collect(), ..Detection::default() };
        let map = JointMap::new(body, &names, &[]);
        let mut joints = Vec::new();
        Detected { detection: &detection, map: &map }.measure(body, &poses, origin, &mut joints);
        joints
    }

    #[test]
    fn a_detection_counts_more_where_it_is_farther_than_its_deviations() {
        let factor = |off: f64, sigma: f64| measured(off * Vec3::Y, sigma)[0].information * sigma * sigma;
        assert!((factor(0.0, 0.03) - 1.0).abs() < 1e-9 && (factor(0.1, 0.1) - 1.0).abs() < 1e-9);
        assert!((factor(0.2, 0.03) - 1.0 - EXCESS_GAIN).abs() < 1e-9);
    }

    #[test]
    fn a_limb_is_as_visible_as_the_better_seen_of_its_joints() {
        let (model, poses) = standing();
        let body = &model.body;
        let names = ["l_shoulder", "l_elbow", "l_wrist"].map(String::from);
        let map = JointMap::new(body, &names, &[]);
        let joint = |visible| Some(DetectedJoint { position: poses[0].translation, sigma: 0.1, visible });
        let detection = Detection { joints: [0.9, 0.5, 0.25].map(joint).to_vec(), ..Detection::default() };
        let mut limbs = Vec::new();
        Detected { detection: &detection, map: &map }.visible_limbs(body, &mut limbs);
        let of = |name| limbs[body.limbs().iter().position(|limb| limb.name == name).unwrap_or_default()];
        assert_eq!(["l_upperarm", "l_forearm", "l_hand", "r_forearm"].map(of), [0.9, 0.5, 0.25, 1.0]);
    }
}
