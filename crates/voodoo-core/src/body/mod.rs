//! The tracked body: a tree of limbs joined by elastic bands, with named sites. Independent of sensors.

mod edit;
mod fit;
mod growth;
mod human;
mod joint;
pub(crate) mod kinematics;
mod model;
mod roles;
pub(crate) mod shoulders;
pub(crate) mod two_bone;

pub(crate) use edit::Pair;
pub(crate) use fit::MOST_STRETCH;
pub use human::HumanModel;
pub use joint::{Joint, JointKind};
pub(crate) use model::Model;
pub(crate) use roles::JointRole;
pub use roles::{LimbRole, Roles, Side};

use crate::error::{BodyError, Unexpected};
use crate::math::{PLACE, Pose, Vec3, is_place, is_rigid};
use crate::shape::TaperedEllipticCylinder;
use std::fmt::{Arguments, Display};
use std::sync::Arc;

/// One rigid part of a body. Its frame has z along the axis of the shape, from the proximal end to the distal one.
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Body, Limb, Site, TaperedEllipticCylinder};
///
/// let shape = TaperedEllipticCylinder::new(0.5, 0.03, 0.03, 0.02, 0.02)?;
/// let stick = Limb { name: "stick".into(), shape, parent: None, match_caps: [true; 2] };
/// let tip = Site { name: "tip".into(), limb: 0, position: Vec3::Z * shape.length() };
/// let body = Body::new("stick", vec![stick], vec![tip])?;
/// assert_eq!(body.site_position(&[Pose::IDENTITY], 0), Vec3::new(0.0, 0.0, 0.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// Name, unique in the body (`l_forearm`).
    pub name: String,
    /// Surface.
    pub shape: TaperedEllipticCylinder,
    /// Index of the parent and the joint to it; `None` for the root.
    pub parent: Option<(usize, Joint)>,
    /// Whether points may match the proximal and the distal cap. By default, caps at joints are excluded: the surface there lies
    /// inside the body, so its matches are wrong.
    pub match_caps: [bool; 2],
}

/// A named feature point fixed to a limb (H-Anim joint and site names).
///
/// [`Limb`] has an example.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Name, unique in the body (`l_wrist`).
    pub name: String,
    /// Index of its limb.
    pub limb: usize,
    /// Position in the limb frame, meters.
    pub position: Vec3,
}

/// Largest number of limbs: pairs of limbs are compared, and a million pairs take seconds.
const MOST_LIMBS: usize = 1_000;
/// Largest number of sites.
const MOST_SITES: usize = 10_000;

/// A tree of limbs; a parent always precedes its children.
///
/// ```
/// use voodoo_core::math::Pose;
/// use voodoo_core::{Body, HumanModel};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let standing = body.rest_pose(Pose::IDENTITY); // one pose for each limb
/// let wrist = body.site_position(&standing, body.site_index("l_wrist")?);
/// let ankle = body.site_position(&standing, body.site_index("l_ankle")?);
/// assert!(wrist.z > ankle.z);
/// # Ok::<(), voodoo_core::BodyError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    name: String,
    limbs: Vec<Limb>,
    sites: Vec<Site>,
    roles: Arc<Roles>,
}

impl Body {
    /// Builds and validates a body from its parts.
    pub fn new(name: impl Into<String>, limbs: Vec<Limb>, sites: Vec<Site>) -> Result<Self, BodyError> {
        let mut body = Self { name: name.into(), limbs, sites, roles: Arc::default() };
        body.check()?;
        body.roles = Arc::new(Roles::resolve(&body)?);
        Ok(body)
    }

    /// Name of the body.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The limbs, parents first.
    pub fn limbs(&self) -> &[Limb] {
        &self.limbs
    }

    /// The sites.
    pub fn sites(&self) -> &[Site] {
        &self.sites
    }

    /// The roles of its limbs, joints and sites on a human.
    pub fn roles(&self) -> &Roles {
        &self.roles
    }

    /// Index of a limb.
    pub fn limb_index(&self, name: &str) -> Result<usize, BodyError> {
        find("limb", name, self.limbs.iter().map(|limb| limb.name.as_str()))
    }

    /// Index of a site.
    pub fn site_index(&self, name: &str) -> Result<usize, BodyError> {
        find("site", name, self.sites.iter().map(|site| site.name.as_str()))
    }

    /// The parent of a limb.
    pub fn parent(&self, limb: usize) -> Option<usize> {
        self.limbs[limb].parent.as_ref().map(|(parent, _)| *parent)
    }

    /// True when one of the two limbs is the parent of the other.
    pub(crate) fn adjacent(&self, first: usize, second: usize) -> bool {
        self.parent(first) == Some(second) || self.parent(second) == Some(first)
    }

    /// Whether two limbs are neither joined nor joined to the same parent. Limbs that are joined overlap near their joints in any
    /// pose.
    pub(crate) fn are_apart(&self, first: usize, second: usize) -> bool {
        let (own, other) = (self.parent(first), self.parent(second));
        first != second && !self.adjacent(first, second) && (own != other || own.is_none())
    }

    /// Every joint with its limb and that limb's parent, parents first: limb, parent, joint.
    pub(crate) fn joints(&self) -> impl DoubleEndedIterator<Item = (usize, usize, &Joint)> {
        let limbs = self.limbs.iter().enumerate();
        limbs.filter_map(|(limb, part)| part.parent.as_ref().map(|(parent, joint)| (limb, *parent, joint)))
    }

    /// Pairs of a clavicle and the upper arm that it carries. Other limbs that a user attached to a clavicle are not arms.
    pub(crate) fn clavicles(&self) -> impl Iterator<Item = [usize; 2]> {
        let is_arm = |limb| matches!(self.roles.joint(limb), Some(JointRole::Shoulder(_)));
        let arms = self.joints().filter(move |(limb, parent, _)| is_arm(*limb) && self.roles.is_clavicle(*parent));
        arms.map(|(limb, parent, _)| [parent, limb])
    }

    /// The children of a limb.
    pub fn children(&self, limb: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.limbs.len()).filter(move |other| self.parent(*other) == Some(limb))
    }

    /// World poses of all limbs with every joint closed and at rest.
    pub fn rest_pose(&self, world_from_root: Pose) -> Vec<Pose> {
        let mut poses = Vec::with_capacity(self.limbs.len());
        for limb in &self.limbs {
            let pose = match &limb.parent {
                None => world_from_root,
                Some((parent, joint)) => poses[*parent] * joint.parent_from_limb_at_rest(),
            };
            poses.push(pose);
        }
        poses
    }

    /// Position of a site in the world. A site at the center of a joint lies midway between the joint centers on the two limbs.
    pub fn site_position(&self, world_from_limb: &[Pose], site: usize) -> Vec3 {
        let Site { limb, position, .. } = self.sites[site];
        let position = world_from_limb[limb].transform_point(position);
        match &self.limbs[limb].parent {
            Some((parent, joint)) if self.roles.joint_site(limb) == Some(site) => {
                0.5 * (position + world_from_limb[*parent].transform_point(joint.parent_from_joint.translation))
            }
            _ => position,
        }
    }

    /// The limb whose surface is nearest to a point (approximately, see [`TaperedEllipticCylinder::approximate_distance`]); the
    /// first of equals.
    pub(crate) fn closest_limb(&self, world_from_limb: &[Pose], point: Vec3) -> usize {
        let limbs = self.limbs.iter().zip(world_from_limb);
        let distances = limbs.map(|(limb, pose)| limb.shape.approximate_distance(pose.inverse_transform_point(point)));
        distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(closest, _)| closest)
    }

    fn check(&self) -> Result<(), Unexpected> {
        Unexpected::unless(!self.limbs.is_empty(), "body", "at least one limb", "none")?;
        let (limbs, sites) = (self.limbs.len(), self.sites.len());
        let (fits, found) = (limbs <= MOST_LIMBS && sites <= MOST_SITES, format_args!("{limbs} and {sites}"));
        Unexpected::unless(fits, "body", "at most 1,000 limbs and 10,000 sites", found)?;
        check_letters("name", &self.name)?;
        for (index, limb) in self.limbs.iter().enumerate() {
            let key = format_args!("limbs.{}", limb.name);
            check_name(key, &limb.name, self.limbs[..index].iter().map(|other| &other.name))?;
            let parent_key = format_args!("{key}.parent");
            let Some((parent, joint)) = &limb.parent else {
                Unexpected::unless(index == 0, parent_key, "a parent (only the first limb is the root)", "none")?;
                continue;
            };
            let (expected, found) = ("a limb that stands before this one", format_args!("limb {parent}"));
            Unexpected::unless(*parent < index, parent_key, expected, found)?;
            check_letters(format_args!("{key}.joint.name"), &joint.name)?;
            check_joint(format_args!("{key}.joint"), joint)?;
        }
        for (index, site) in self.sites.iter().enumerate() {
            let key = format_args!("sites.{}", site.name);
            check_name(key, &site.name, self.sites[..index].iter().map(|other| &other.name))?;
            Unexpected::unless(site.limb < limbs, format_args!("{key}.limb"), "the index of a limb", site.limb)?;
            let (key, found) = (format_args!("{key}.position"), site.position.to_array());
            Unexpected::unless(is_place(site.position), key, PLACE, format_args!("{found:?}"))?;
        }
        Ok(())
    }
}

fn check_name<'a>(
    key: impl Display,
    name: &str,
    mut before: impl Iterator<Item = &'a String>,
) -> Result<(), Unexpected> {
    Unexpected::unless(!name.is_empty(), &key, "a name", "an empty one")?;
    check_letters(&key, name)?;
    let is_new = !before.any(|known| known == name);
    Unexpected::unless(is_new, key, "a name of its own", format_args!("{name:?}, which is already taken"))
}

/// Rejects characters that break file formats: tabs and line breaks separate table cells, braces delimit trees of bones.
fn check_letters(key: impl Display, name: &str) -> Result<(), Unexpected> {
    let breaks = |letter: char| letter.is_control() || matches!(letter, '{' | '}' | '\u{2028}' | '\u{2029}');
    let (expected, found) = ("a name without tabs, line breaks and braces", format_args!("{name:?}"));
    Unexpected::unless(!name.contains(breaks), key, expected, found)
}

fn check_joint(key: impl Display, joint: &Joint) -> Result<(), Unexpected> {
    let check = |valid: bool, field: &str, expected, found: Arguments| {
        Unexpected::unless(valid, format_args!("{key}.{field}"), expected, found)
    };
    let Joint { semi_axes, weight, motion, limits, .. } = joint;
    let valid = semi_axes.iter().all(|axis| axis.is_finite() && *axis >= 0.0);
    check(valid, "semi_axes", "two finite lengths, zero or more", format_args!("{semi_axes:?}"))?;
    let valid = weight.is_finite() && *weight > 0.0;
    check(valid, "weight", "a finite weight above zero", format_args!("{weight}"))?;
    let valid = motion.is_finite() && *motion > 0.0;
    check(valid, "motion", "a finite angle above zero", format_args!("{motion}"))?;
    if let Some(limits) = limits {
        let valid = limits.iter().all(|[low, high]| low <= high && low.is_finite() && high.is_finite());
        check(valid, "limits", "three pairs (least, greatest) of radians", format_args!("{limits:?}"))?;
    }
    for (field, pose) in [("parent_from_joint", &joint.parent_from_joint), ("limb_from_joint", &joint.limb_from_joint)]
    {
        check(is_rigid(pose), field, "a finite position and a unit quaternion", format_args!("{pose:?}"))?;
    }
    Ok(())
}

fn find<'a>(what: &'static str, name: &str, names: impl Iterator<Item = &'a str> + Clone) -> Result<usize, BodyError> {
    names.clone().position(|known| known == name).ok_or_else(|| BodyError::Unknown {
        what,
        name: name.into(),
        known: names.map(String::from).collect(),
    })
}
