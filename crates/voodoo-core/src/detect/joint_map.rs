//! Maps a detector's names to a body. They are resolved once, when the detector or the body is set.

use super::skeleton::Skeleton;
use super::{DetectedJoint, Detection};
use crate::body::{Body, JointRole};

const STATURE: &str = "stature";

/// Mapping of a detector's joints and lengths to a body. Joints and lengths are numbered in the detector's order.
#[derive(Clone, Debug, Default)]
pub(crate) struct JointMap {
    /// The body's site with the name of each joint.
    pub(super) sites: Vec<Option<usize>>,
    /// Number of lengths.
    pub(super) lengths: usize,
    /// Joints and lengths of a person's skeleton.
    pub(super) skeleton: Skeleton,
    /// Joints that give the trunk's position and orientation; for a body without shoulders and hips, all joints that it has.
    pub(crate) trunk: Vec<usize>,
    /// Knees and ankles.
    pub(super) legs: Vec<usize>,
    /// For every limb: the joint to its parent, the other joints on it, and its length.
    hangs_by: Vec<Option<usize>>,
    on_limb: Vec<Vec<usize>>,
    length_of_limb: Vec<Option<usize>>,
    /// The stature, if the detector reports it.
    pub(crate) stature: Option<usize>,
}

impl JointMap {
    /// Resolves joints and lengths with these names on a body.
    pub(crate) fn new(body: &Body, joints: &[String], lengths: &[String]) -> Self {
        let sites: Vec<Option<usize>> = joints.iter().map(|name| body.site_index(name).ok()).collect();
        let named: Vec<Option<JointRole>> = joints.iter().map(|name| JointRole::from_name(name)).collect();
        let joint =
            |role: JointRole| (0..sites.len()).find(|index| named[*index] == Some(role) && sites[*index].is_some());
        let joint_of_site = |site: usize| sites.iter().position(|own| *own == Some(site));
        let length = |name: &str| lengths.iter().position(|length| length == name);
        let skeleton = Skeleton::new(joint, length);
        let Skeleton { arms, legs, .. } = &skeleton;
        // Left before right, because sums depend on the order.
        let shoulders = arms.iter().map(|arm| arm[0]);
        let mut trunk: Vec<usize> = shoulders.chain(legs.iter().map(|leg| leg[0])).flatten().collect();
        if trunk.is_empty() {
            trunk = (0..joints.len()).filter(|index| sites[*index].is_some()).collect();
        }
        let roles = body.roles();
        let limbs = 0..body.limbs().len();
        let on_limb = |limb: usize| {
            let own = body.sites().iter().enumerate().filter(|(_, site)| site.limb == limb);
            own.filter(|(site, _)| roles.joint_site(limb) != Some(*site))
                .filter_map(|(site, _)| joint_of_site(site))
                .collect()
        };
        Self {
            trunk,
            legs: [1, 2].into_iter().flat_map(|joint| legs.map(|leg| leg[joint])).flatten().collect(),
            skeleton,
            hangs_by: limbs.clone().map(|limb| roles.joint_site(limb).and_then(joint_of_site)).collect(),
            on_limb: limbs.clone().map(on_limb).collect(),
            length_of_limb: limbs.map(|limb| length(length_of(roles.joint(limb)))).collect(),
            stature: length(STATURE),
            lengths: lengths.len(),
            sites,
        }
    }

    /// The body's site for a joint.
    pub(crate) fn site(&self, joint: usize) -> Option<usize> {
        self.sites.get(joint).copied().flatten()
    }

    /// The length of a limb of the body, if the detector reports it. All parts of the trunk share one length.
    pub(crate) fn length_of_limb(&self, limb: usize) -> Option<usize> {
        self.length_of_limb.get(limb).copied().flatten()
    }
}

/// The name of a limb's length, by the joint to its parent. Limbs on other joints belong to the trunk.
fn length_of(joint: Option<JointRole>) -> &'static str {
    match joint {
        Some(JointRole::Sternoclavicular(_)) => "shoulder_width",
        Some(JointRole::Shoulder(_)) => "upper_arm",
        Some(JointRole::Elbow(_)) => "forearm",
        Some(JointRole::Hip(_)) => "thigh",
        Some(JointRole::Knee(_)) => "shank",
        Some(JointRole::NeckBase) => "neck",
        _ => "trunk",
    }
}

/// A detection with the mapping of its joints to the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detected<'a> {
    /// The detection.
    pub detection: &'a Detection,
    /// The mapping of its joints and lengths to the body.
    pub map: &'a JointMap,
}

impl<'a> Detected<'a> {
    /// The joint with this index.
    pub(crate) fn joint(&self, index: usize) -> Option<&'a DetectedJoint> {
        self.detection.joints.get(index)?.as_ref()
    }

    /// The detected joints that the body has, each with its site.
    pub(crate) fn on_sites(&self) -> impl Iterator<Item = (usize, &'a DetectedJoint)> + '_ {
        (0..self.detection.joints.len()).filter_map(|joint| Some((self.map.site(joint)?, self.joint(joint)?)))
    }

    /// The joint between a limb and its parent.
    pub(crate) fn hangs_by(&self, limb: usize) -> Option<&'a DetectedJoint> {
        self.joint(self.map.hangs_by.get(limb).copied().flatten()?)
    }

    /// The first detected joint on a limb other than the joint to its parent.
    pub(crate) fn on_limb(&self, limb: usize) -> Option<&'a DetectedJoint> {
        self.map.on_limb.get(limb)?.iter().find_map(|joint| self.joint(*joint))
    }

    /// The stature, meters, and its relative standard deviation, if they were reported.
    pub(crate) fn stature(&self) -> Option<[f64; 2]> {
        self.detection.lengths.get(self.map.stature?).copied()
    }

    /// The detected ankles.
    pub(crate) fn ankles(&self) -> impl Iterator<Item = &'a DetectedJoint> + '_ {
        self.map.skeleton.legs.iter().filter_map(|leg| self.joint(leg[2]?))
    }
}
