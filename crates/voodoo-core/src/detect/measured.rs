//! Detected joints as measurements of the tracked body. They hold what a frame hides, and what its surface shows wrongly because it
//! is not the body's: legs in a skirt, a trunk under a backpack.

use super::{Detected, DetectedJoint};
use crate::association::correspondence::{Correspondences, DETECTED, LimbMatches, SitePair};
use crate::body::Body;
use crate::math::{Mat3, Pose, Vec3};
use crate::terms::Term;
use crate::terms::normal_equations::NormalEquations;
use crate::visibility::FEW;

/// Factor on the information of a detected joint relative to that of surface points, whose errors are alike; and what is added to
/// it where the detection doubts the pose, see [`Detected::doubt`].
const ALIKE: f64 = 3.0;
const DOUBTED: f64 = 50.0;
/// Scale of the kernel of detected joints, in standard deviations: five in space. A joint that is sure and far off is wrong.
const FAR: f64 = 8.66;
/// Cost of a hypothesis for each joint that it puts elsewhere than detected, patches; and the distance that costs nothing, in
/// standard deviations along an axis: the length of a deviation in space.
const ELSEWHERE: f64 = 25.0;
const WITHIN: f64 = 1.7;
/// Distance of a limb's points, root mean square, from which on its surface is not that of the person, meters.
const UNLIKE: f64 = 0.03;

/// A detected joint of the body: its site, its position, world frame, its standard deviation along each axis, meters, and its
/// information, 1/m^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeasuredJoint {
    site: usize,
    position: Vec3,
    sigma: f64,
    information: f64,
}

/// A joint of the body and where it was detected, working frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DetectedPair {
    limb: usize,
    x: Vec3,
    p: Vec3,
    sigma: f64,
    information: f64,
}

impl Detected<'_> {
    /// How far trunk and legs at these poses, working frame, are from where they were detected: the mean squared deviation in
    /// space, in variances, beyond the one that is expected; from 0 to 1.
    fn doubt(&self, body: &Body, poses: &[Pose], origin: Vec3) -> f64 {
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

    /// Writes the joints to `joints`, for a body that is expected at these poses, working frame. `last` are the matches of the last
    /// frame: limbs whose points lay on them are doubted less.
    pub(crate) fn measure(
        &self,
        body: &Body,
        poses: &[Pose],
        origin: Vec3,
        last: &[LimbMatches],
        joints: &mut Vec<MeasuredJoint>,
    ) {
        let doubt = self.doubt(body, poses, origin);
        let off = |limb: usize| last.get(limb).map_or(1.0, roughness);
        let found = |joint: usize| Some((self.map.site(joint)?, self.joint(joint)?));
        joints.extend((0..self.detection.joints.len()).filter_map(found).map(|(site, joint)| {
            let limb = body.sites()[site].limb;
            let parent = body.limbs()[limb].parent.as_ref().map_or(limb, |(parent, _)| *parent);
            let factor = ALIKE + DOUBTED * doubt * off(limb).max(off(parent));
            let DetectedJoint { position, sigma, visible } = *joint;
            MeasuredJoint { site, position, sigma, information: visible * factor / (sigma * sigma) }
        }));
    }
}

/// Mean square of the distances of a limb's points in units of `UNLIKE`; at most 1, also where there are hardly any points.
fn roughness(matches: &LimbMatches) -> f64 {
    let (weight, square) = matches.weighed();
    if weight < FEW { 1.0 } else { (square / (weight * UNLIKE * UNLIKE)).min(1.0) }
}

impl Correspondences {
    /// Pairs the body's joints with the detected ones. The sites that are added have no weight: hypotheses that contradict them
    /// cost more.
    pub(crate) fn add_detected(&mut self, body: &Body, poses: &[Pose], joints: &[MeasuredJoint], origin: Vec3) {
        let Self { detected, sites, .. } = self;
        detected.clear();
        for MeasuredJoint { site, position, sigma, information } in joints {
            let limb = body.sites()[*site].limb;
            let (x, p) = (body.site_position(poses, *site), *position - origin);
            detected.push(DetectedPair { limb, x, p, sigma: *sigma, information: *information });
            let (bias, across, information) = (WITHIN * sigma, Mat3::IDENTITY, Mat3::ZERO);
            let (weight, base_weight, source) = (0.0, ELSEWHERE, DETECTED);
            sites.push(SitePair { limb, x, p, weight, base_weight, bias, across, information, source });
        }
    }
}

/// All detected joints.
#[derive(Debug)]
pub(crate) struct DetectedJoints<'a> {
    /// The pairs.
    pub pairs: &'a [DetectedPair],
}

impl Term for DetectedJoints<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for DetectedPair { limb, x, p, sigma, information } in self.pairs {
            let r = *x - *p;
            let far = r.length_squared() / (FAR * FAR * sigma * sigma);
            let information = information / ((1.0 + far) * (1.0 + far));
            normal.cost += information * r.length_squared();
            normal.limbs[*limb].add_point(&(Mat3::IDENTITY * information), *x, r);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::{Detection, JointMap};
    use crate::testing::{moved, standing};

    /// The measured joints of a detection at the poses of the standing body moved by `aside`, and the pairs for the standing body.
    fn measured(aside: Vec3, sigma: f64) -> (Vec<MeasuredJoint>, Correspondences) {
        let (model, poses) = standing();
        let (body, origin, there) = (&model.body, Vec3::X, moved(&poses, aside));
        let names: Vec<String> = body.sites().iter().map(|site| site.name.clone()).collect();
        let place = |site| body.site_position(&there, site) + origin;
        let joint = |site| Some(DetectedJoint { position: place(site), sigma, visible: 1.0 });
        let detection = Detection { joints: (0..names.len()).map(joint).collect(), ..Detection::default() };
        let map = JointMap::new(body, &names, &[]);
        let (mut joints, mut correspondences) = (Vec::new(), Correspondences::default());
        Detected { detection: &detection, map: &map }.measure(body, &poses, origin, &[], &mut joints);
        correspondences.add_detected(body, &poses, &joints, origin);
        (joints, correspondences)
    }

    #[test]
    fn a_detection_counts_more_where_it_is_farther_than_its_deviations() {
        let factor = |off: f64, sigma: f64| measured(off * Vec3::Y, sigma).0[0].information * sigma * sigma;
        assert!((factor(0.0, 0.03) - ALIKE).abs() < 1e-9 && (factor(0.1, 0.1) - ALIKE).abs() < 1e-9);
        assert!((factor(0.2, 0.03) - ALIKE - DOUBTED).abs() < 1e-9);
    }

    #[test]
    fn detected_joints_draw_the_body_and_their_sites_only_cost() {
        let (joints, correspondences) = measured(0.2 * Vec3::Y, 0.05);
        assert_eq!(correspondences.detected.len(), joints.len());
        let (model, poses) = standing();
        let mut normal = NormalEquations::default();
        normal.clear(poses.len());
        DetectedJoints { pairs: &correspondences.detected }.add(&model.body, &poses, &mut normal);
        let force: f64 = normal.limbs.iter().map(|block| block.g[4]).sum();
        let kernel = (1.0 + 0.04 / (FAR * 0.05).powi(2)).powi(-2);
        let expected: f64 = joints.iter().map(|joint| -0.2 * kernel * joint.information).sum();
        assert!((force - expected).abs() < 1e-6 * expected.abs(), "{force} {expected}");
        assert!(correspondences.sites.iter().all(|pair| pair.weight == 0.0 && pair.source == DETECTED));
    }
}
