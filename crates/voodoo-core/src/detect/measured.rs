//! Detected joints as measurements of the tracked body. They hold what a frame hides, and what its surface shows wrongly because it
//! is not the body's: legs in a skirt, a trunk under a backpack.

use super::{Detected, DetectedJoint};
use crate::association::correspondence::DetectedPair;
use crate::body::Body;
use crate::math::{Points, Pose, Vec3, refill, reset};

/// By how many times its own a detected joint's information grows where the pose deviates from the detection, see
/// [`Detected::excess_deviation`]: a surface that is not the body's has hundreds of points.
const EXCESS_GAIN: f64 = 5.0;

/// Scale of the kernel of a point's distance from the limb that was detected, in standard deviations of the detected joints.
const OWN_SIGMAS: f64 = 4.0;

impl Detected<'_> {
    /// How far trunk and legs at these poses, working frame, are from where they were detected: the mean squared deviation in
    /// space, in variances, beyond the one that is expected; from 0 to 1.
    fn excess_deviation(&self, body: &Body, poses: &[Pose], origin: Vec3) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for joint in self.map.trunk.iter().chain(&self.map.legs) {
            if let (Some(joint), Some(site)) = (self.joint(*joint), self.map.site(*joint)) {
                let apart = body.site_position(poses, site) + origin - joint.position;
                sum += apart.length_squared() / (3.0 * joint.sigma * joint.sigma);
                count += 1.0;
            }
        }
        (sum / count.max(1.0) - 1.0).clamp(0.0, 1.0)
    }

    /// Writes where the limbs were detected, for points in the working frame.
    pub(crate) fn locate(&self, body: &Body, origin: Vec3, limbs: &mut DetectedLimbs) {
        let DetectedLimbs { visible, bones } = limbs;
        reset(visible, body.limbs().len(), None);
        for (site, joint) in self.on_sites() {
            let limb = body.sites()[site].limb;
            for limb in [Some(limb), body.parent(limb)].into_iter().flatten() {
                visible[limb] = Some(visible[limb].unwrap_or_default().max(joint.visible));
            }
        }
        let bone = |child: usize| {
            let limb = body.parent(child)?;
            let end = |limb| self.hangs_by(limb).map(|joint| (joint.position - origin, joint.sigma));
            Some(DetectedBone { limb, ends: [end(limb)?, end(child)?] })
        };
        refill(bones, (0..body.limbs().len()).filter_map(bone));
        bones.sort_unstable_by_key(|bone| bone.limb);
    }

    /// Pairs the joints of a body that is expected at these poses, working frame, with the detected ones.
    pub(crate) fn measure(&self, body: &Body, poses: &[Pose], origin: Vec3, pairs: &mut Vec<DetectedPair>) {
        let factor = 1.0 + EXCESS_GAIN * self.excess_deviation(body, poses, origin);
        pairs.extend(self.on_sites().map(|(site, joint)| {
            let DetectedJoint { position, sigma, visible } = *joint;
            DetectedPair { site, p: position - origin, sigma, information: visible * factor / (sigma * sigma) }
        }));
    }
}

/// Where the limbs were detected; empty without a detection.
#[derive(Debug, Default)]
pub(crate) struct DetectedLimbs {
    /// For each limb: the largest probability of its detected joints that they are visible; `None` without any.
    visible: Vec<Option<f64>>,
    bones: Vec<DetectedBone>,
}

/// The detected joints between a limb and its parent and between the limb and a child, working frame, with their standard
/// deviations; meters.
#[derive(Debug)]
struct DetectedBone {
    limb: usize,
    ends: [(Vec3, f64); 2],
}

impl DetectedLimbs {
    /// Weighs points, working frame, by the probability that they show a limb of this radius: points elsewhere, of furniture or
    /// clothes, would hold or draw it.
    pub(crate) fn weigh(&self, limb: usize, radius: f64, points: &Points, weights: &mut [f32]) {
        let Some(visible) = self.visible.get(limb).copied().flatten() else { return };
        // Bones are in the order of their limbs.
        let first = self.bones.partition_point(|bone| bone.limb < limb);
        let bones = &self.bones[first..self.bones.partition_point(|bone| bone.limb <= limb)];
        for (index, weight) in weights.iter_mut().enumerate() {
            let beyond =
                bones.iter().map(|bone| bone.beyond(radius, points.get(index))).reduce(f64::min).unwrap_or(0.0);
            *weight *= (visible / (1.0 + (beyond / OWN_SIGMAS).powi(2)).powi(2)) as f32;
        }
    }

    /// Forgets the detection.
    pub(crate) fn clear(&mut self) {
        self.visible.clear();
        self.bones.clear();
    }
}

impl DetectedBone {
    /// How far a point is from the surface with this radius, in standard deviations; 0 inside.
    fn beyond(&self, radius: f64, point: Vec3) -> f64 {
        let [(from, first), (to, last)] = self.ends;
        let (offset, along) = (point - from, to - from);
        let share = (offset.dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (offset.distance(share * along) - radius).max(0.0) / (first + share * (last - first))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::detect::{Detection, JointMap};
    use crate::testing::{moved, standing};

    /// The measured joints of a detection at the poses of the standing body moved by `aside`, for the standing body.
    fn measured(aside: Vec3, sigma: f64) -> Vec<DetectedPair> {
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
    fn points_are_a_limbs_own_where_it_was_detected_as_far_as_it_is_visible() {
        let (model, poses) = standing();
        let body = &model.body;
        let names = ["l_shoulder", "l_elbow", "l_wrist"].map(String::from);
        let map = JointMap::new(body, &names, &[]);
        let place = |name: &String| body.site_position(&poses, body.site_index(name).unwrap());
        let joint = |(name, visible)| Some(DetectedJoint { position: place(name) + Vec3::X, sigma: 0.05, visible });
        let joints = names.iter().zip([0.9, 0.5, 0.25]).map(joint).collect();
        let detection = Detection { joints, ..Detection::default() };
        let mut limbs = DetectedLimbs::default();
        Detected { detection: &detection, map: &map }.locate(body, Vec3::X, &mut limbs);
        const RADIUS: f64 = 0.04;
        // The weight of a point beside the middle of a limb, beyond its surface by this distance.
        let weight = |name: &str, beyond: f64| {
            let limb = body.limbs().iter().position(|limb| limb.name == name).unwrap();
            let middle = poses[limb] * (0.5 * body.limbs()[limb].shape.length() * Vec3::Z);
            let aside = (RADIUS + beyond) * (poses[limb].rotation * Vec3::X);
            let (mut points, mut weights) = (Points::default(), [1.0]);
            points.push((middle + aside).as_vec3().to_array());
            limbs.weigh(limb, RADIUS, &points, &mut weights);
            f64::from(weights[0])
        };
        let near = |weight: f64, expected: f64| (weight - expected).abs() < 0.01;
        for (name, visible) in [("l_upperarm", 0.9), ("l_forearm", 0.5)] {
            assert!(near(weight(name, -0.01), visible) && near(weight(name, OWN_SIGMAS * 0.05), 0.25 * visible));
        }
        // Only one end of the hand was detected, none of the right arm.
        assert!(near(weight("l_hand", 1.0), 0.25) && near(weight("r_forearm", 1.0), 1.0));
    }
}
