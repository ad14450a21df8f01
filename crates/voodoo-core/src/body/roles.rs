//! The roles of limbs, joints and sites on a human, resolved from their names once.
//!
//! This is the only place in the core that compares names; all other code uses indices. A body without human names has no roles,
//! and features that need roles are disabled for it.

use super::{Body, Limb};
use crate::error::Unexpected;

/// Side of the body, as the person's own left or right; see [`Roles`] for an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Names that begin with `l_`.
    Left,
    /// Names that begin with `r_`.
    Right,
}

impl Side {
    /// Left, right.
    pub(crate) const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// The side of a limb, joint or site with this name.
    pub fn of(name: &str) -> Option<Self> {
        split(name).0
    }
}

/// An enumeration of roles on the human, some of them once for each side, and its function `from_name`.
macro_rules! roles {
    ($(#[$doc:meta])* $visibility:vis enum $roles:ident {
        $($(#[$note:meta])* $role:ident = $($name:literal)|+),+;
        $($(#[$side_note:meta])* $side_role:ident(side) = $stem:literal),+;
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $visibility enum $roles {
            $($(#[$note])* $role,)*
            $($(#[$side_note])* $side_role(Side),)*
        }

        impl $roles {
            pub(crate) fn from_name(name: &str) -> Option<Self> {
                Some(match split(name) {
                    $((None, $($name)|+) => Self::$role,)*
                    $((Some(side), $stem) => Self::$side_role(side),)*
                    _ => return None,
                })
            }
        }
    };
}

roles! {
    /// A limb of the human; see [`Roles`] for an example.
    pub enum LimbRole {
        /// `pelvis`
        Pelvis = "pelvis",
        /// `thorax`; or `torso`, the whole trunk.
        Thorax = "thorax" | "torso",
        /// `neck`
        Neck = "neck",
        /// `head`
        Head = "head";
        /// `l_clavicle`
        Clavicle(side) = "clavicle",
        /// `l_upperarm`
        UpperArm(side) = "upperarm",
        /// `l_forearm`
        Forearm(side) = "forearm",
        /// `l_hand`
        Hand(side) = "hand",
        /// `l_thigh`
        Thigh(side) = "thigh",
        /// `l_calf`
        Calf(side) = "calf",
        /// `l_foot`
        Foot(side) = "foot";
    }
}

roles! {
    /// A joint of the human, or a site: that at a joint's center, or one of those that detectors report beside them (H-Anim
    /// names).
    pub(crate) enum JointRole {
        /// The center of the hips.
        Root = "humanoid_root",
        /// Between pelvis and thorax.
        Waist = "vl3",
        /// Between thorax and neck.
        NeckBase = "vc7",
        /// Between neck and head.
        SkullBase = "skullbase",
        /// The center of the head.
        HeadCenter = "head_center";
        /// Between thorax and clavicle.
        Sternoclavicular(side) = "sternoclavicular",
        /// Between clavicle, or thorax, and upper arm.
        Shoulder(side) = "shoulder",
        /// Between upper arm and forearm.
        Elbow(side) = "elbow",
        /// Between forearm and hand.
        Wrist(side) = "wrist",
        /// The center of the hand.
        Hand(side) = "hand",
        /// Between pelvis and thigh.
        Hip(side) = "hip",
        /// Between thigh and calf.
        Knee(side) = "knee",
        /// Between calf and foot.
        Ankle(side) = "ankle";
    }
}

impl JointRole {
    /// The preceding joint of the same arm or leg.
    fn before(self) -> Option<Self> {
        match self {
            Self::Shoulder(side) => Some(Self::Sternoclavicular(side)),
            Self::Elbow(side) => Some(Self::Shoulder(side)),
            Self::Wrist(side) => Some(Self::Elbow(side)),
            Self::Knee(side) => Some(Self::Hip(side)),
            Self::Ankle(side) => Some(Self::Knee(side)),
            _ => None,
        }
    }
}

/// The roles of the limbs, joints and sites of a body on a human. They follow from names and do not depend on sizes.
///
/// ```
/// use voodoo_core::{Body, HumanModel, LimbRole, Side};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let forearm = body.limb_index("l_forearm")?;
/// assert_eq!(body.roles().limb(forearm), Some(LimbRole::Forearm(Side::Left)));
/// assert_eq!(Side::of("r_wrist"), Some(Side::Right));
/// # Ok::<(), voodoo_core::BodyError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Roles {
    /// For each limb: its role, the role of the joint to its parent, and the site named like that joint.
    limbs: Vec<Option<LimbRole>>,
    joints: Vec<Option<JointRole>>,
    joint_sites: Vec<Option<usize>>,
    groups: Vec<u16>,
}

impl Roles {
    /// Resolves the names of a body in which parents precede their children.
    ///
    /// # Errors
    /// [`Unexpected`] when a limb and its joint are named after different sides, or when a joint of an arm or leg does not
    /// follow the preceding one. Detections and statistics of human joints would otherwise be applied to the wrong limbs.
    pub(super) fn resolve<'a>(body: &'a Body) -> Result<Self, Unexpected> {
        let (limbs, sites) = (body.limbs(), body.sites());
        let joint_name = |limb: &'a Limb| limb.parent.as_ref().map(|(_, joint)| joint.name.as_str());
        let site = |name: &str| sites.iter().position(|site| site.name == name);
        let roles = Self {
            limbs: limbs.iter().map(|limb| LimbRole::from_name(&limb.name)).collect(),
            joints: limbs.iter().map(|limb| joint_name(limb).and_then(JointRole::from_name)).collect(),
            joint_sites: limbs.iter().map(|limb| joint_name(limb).and_then(site)).collect(),
            groups: groups(limbs),
        };
        let opposite = |limb: usize, name: &str| {
            let sides = roles.limb(limb).and(Side::of(&limbs[limb].name)).zip(Side::of(name));
            sides.is_some_and(|(own, other)| own != other)
        };
        for (index, hangs_on, joint) in body.joints() {
            let Some(role) = roles.joints[index] else { continue };
            let key = format_args!("limbs.{}.joint.name", limbs[index].name);
            Unexpected::unless(!opposite(index, &joint.name), key, "a joint of the limb's own side", &joint.name)?;
            // A second joint of the same name belongs to another limb that is attached there.
            let before = role.before().filter(|_| roles.limb_at(role) == Some(index));
            let Some(before) = before.and_then(|before| roles.limb_at(before)) else { continue };
            let follows = std::iter::successors(Some(hangs_on), |limb| body.parent(*limb)).any(|limb| limb == before);
            let expected = format_args!("a joint of a limb that hangs on {}", limbs[before].name);
            Unexpected::unless(follows, key, expected, format_args!("{} on {}", joint.name, limbs[hangs_on].name))?;
        }
        for site in sites {
            let (key, found) = (format_args!("sites.{}.limb", site.name), &limbs[site.limb].name);
            let valid = JointRole::from_name(&site.name).is_none() || !opposite(site.limb, &site.name);
            Unexpected::unless(valid, key, "a limb of the site's own side", found)?;
        }
        Ok(roles)
    }

    /// The role of a limb.
    pub fn limb(&self, limb: usize) -> Option<LimbRole> {
        self.limbs.get(limb).copied().flatten()
    }

    /// The role of the joint between a limb and its parent.
    pub(crate) fn joint(&self, limb: usize) -> Option<JointRole> {
        self.joints.get(limb).copied().flatten()
    }

    /// The limb whose joint to its parent has this role; the first of several.
    fn limb_at(&self, joint: JointRole) -> Option<usize> {
        self.joints.iter().position(|role| *role == Some(joint))
    }

    /// The site at the center of the joint between a limb and its parent, found by the joint's name, whatever its role.
    pub(crate) fn joint_site(&self, limb: usize) -> Option<usize> {
        self.joint_sites.get(limb).copied().flatten()
    }

    /// Whether the joint of a limb to its parent is a sternoclavicular joint.
    pub(crate) fn is_clavicle(&self, limb: usize) -> bool {
        matches!(self.joint(limb), Some(JointRole::Sternoclavicular(_)))
    }

    /// The limb of the same name on the other side.
    pub(crate) fn counterpart(&self, limb: usize) -> Option<usize> {
        let group = self.groups.get(limb)?;
        (0..self.groups.len()).find(|other| *other != limb && self.groups[*other] == *group)
    }

    /// A group number for each limb, shared by a limb and its counterpart on the other side; counted from 0, for any body.
    pub(crate) fn groups(&self) -> &[u16] {
        &self.groups
    }
}

/// Splits a name into its side and the rest.
pub(super) fn split(name: &str) -> (Option<Side>, &str) {
    match (name.strip_prefix("l_"), name.strip_prefix("r_")) {
        (Some(stem), _) => (Some(Side::Left), stem),
        (_, Some(stem)) => (Some(Side::Right), stem),
        _ => (None, name),
    }
}

/// Group numbers from the limbs' names without their sides.
fn groups<'a>(limbs: &'a [Limb]) -> Vec<u16> {
    let mut stems: Vec<&str> = Vec::new();
    let number = |limb: &'a Limb| {
        let own = split(&limb.name).1;
        let known = stems.iter().position(|stem| *stem == own);
        known.unwrap_or_else(|| {
            stems.push(own);
            stems.len() - 1
        }) as u16
    };
    limbs.iter().map(number).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::{HumanModel, Joint, Site};
    use crate::error::BodyError;
    use crate::math::{Pose, Vec3};
    use crate::shape::TaperedEllipticCylinder;

    fn human(model: HumanModel) -> Body {
        Body::human(1.75, model).unwrap()
    }

    /// A chain of limbs from pairs of a limb's name and the name of the joint to the limb before, with sites in the middle of
    /// those joints.
    fn chain(names: &[[&str; 2]]) -> Result<Body, BodyError> {
        let shape = TaperedEllipticCylinder::new(0.3, 0.05, 0.05, 0.05, 0.05).unwrap();
        let joint = |name: &str| Joint {
            name: name.into(),
            parent_from_joint: Pose::IDENTITY,
            limb_from_joint: Pose::IDENTITY,
            semi_axes: [0.0; 2],
            weight: 1.0,
            limits: None,
            motion: 0.3,
        };
        let limb = |(index, [name, by]): (usize, &[&str; 2])| Limb {
            name: (*name).into(),
            shape,
            parent: (index > 0).then(|| (index - 1, joint(by))),
            match_caps: [true; 2],
        };
        let site = |(limb, [_, by]): (usize, &[&str; 2])| Site { name: (*by).into(), limb, position: Vec3::ZERO };
        let sites = names.iter().enumerate().skip(1).map(site).collect();
        Body::new("thing", names.iter().enumerate().map(limb).collect(), sites)
    }

    fn site_at(body: &Body, joint: JointRole) -> Option<usize> {
        body.sites().iter().position(|site| JointRole::from_name(&site.name) == Some(joint))
    }

    #[test]
    fn every_limb_and_joint_of_the_human_has_a_role() {
        for (model, carrier) in [(HumanModel::Full, "l_clavicle"), (HumanModel::Papers, "torso")] {
            let body = human(model);
            let roles = body.roles();
            for (limb, description) in body.limbs().iter().enumerate() {
                assert!(roles.limb(limb).is_some(), "{}", description.name);
                let Some((_, joint)) = &description.parent else { continue };
                assert_eq!(roles.limb_at(roles.joint(limb).unwrap()), Some(limb), "{}", joint.name);
            }
            let name = |limb: Option<usize>| body.limbs()[limb.unwrap()].name.as_str();
            assert_eq!(name(roles.limb_at(JointRole::Elbow(Side::Left))), "l_forearm");
            let upper_arm = roles.limb_at(JointRole::Shoulder(Side::Left)).unwrap();
            assert_eq!(roles.limb(upper_arm), Some(LimbRole::UpperArm(Side::Left)));
            assert_eq!(name(body.limbs()[upper_arm].parent.as_ref().map(|(parent, _)| *parent)), carrier);
            for side in Side::BOTH {
                for joint in [JointRole::Shoulder, JointRole::Elbow, JointRole::Hip, JointRole::Knee].map(|of| of(side))
                {
                    let limb = roles.limb_at(joint).unwrap();
                    assert_eq!(roles.joint_site(limb), site_at(&body, joint));
                    assert_eq!(body.sites()[site_at(&body, joint).unwrap()].limb, limb);
                }
                assert!(
                    site_at(&body, JointRole::Wrist(side)).is_some()
                        && site_at(&body, JointRole::Ankle(side)).is_some()
                );
            }
        }
    }

    #[test]
    fn the_full_human_raises_two_clavicles_and_that_of_the_papers_none() {
        let body = human(HumanModel::Full);
        let named = body.clavicles().map(|pair| pair.map(|limb| body.limbs()[limb].name.as_str()));
        assert_eq!(named.collect::<Vec<_>>(), [["l_clavicle", "l_upperarm"], ["r_clavicle", "r_upperarm"]]);
        assert!(human(HumanModel::Papers).clavicles().next().is_none());
    }

    #[test]
    fn the_two_of_a_pair_are_one_group_and_numbers_leave_no_gap() {
        let body = human(HumanModel::Full);
        let groups = body.roles().groups();
        let of = |name: &str| groups[body.limb_index(name).unwrap()];
        assert_eq!([of("l_calf"), of("l_hand")], [of("r_calf"), of("r_hand")]);
        assert_ne!(of("l_calf"), of("l_thigh"));
        // Four limbs of the trunk and head, and seven on each side.
        assert_eq!((groups.len(), groups.iter().max()), (18, Some(&10)));
    }

    #[test]
    fn a_lamp_has_no_roles_but_its_joints_have_sites() {
        let lamp = chain(&[["foot", ""], ["lower_arm", "ankle"], ["upper_arm", "elbow"], ["shade", "ball"]]).unwrap();
        let roles = lamp.roles();
        assert!(lamp.clavicles().next().is_none());
        assert!((0..4).all(|limb| roles.limb(limb).is_none() && roles.joint(limb).is_none()));
        assert_eq!([0, 1, 2, 3].map(|limb| roles.joint_site(limb)), [None, Some(0), Some(1), Some(2)]);
        assert_eq!(roles.groups(), [0, 1, 2, 3]);
    }

    #[test]
    fn a_body_with_one_arm_has_the_roles_of_that_arm() {
        let (body, _) = human(HumanModel::Full).without_limb("r_upperarm").unwrap();
        let roles = body.roles();
        assert_eq!(roles.limb_at(JointRole::Elbow(Side::Right)), None);
        assert_eq!(site_at(&body, JointRole::Wrist(Side::Right)), None);
        assert_eq!(body.clavicles().count(), 1);
        let hand = roles.limb_at(JointRole::Wrist(Side::Left)).unwrap();
        assert_eq!(body.limbs()[hand].name, "l_hand");
        let leg = site_at(&body, JointRole::Knee(Side::Right)).unwrap();
        assert_eq!(body.sites()[leg].name, "r_knee");
    }

    #[test]
    fn what_is_added_has_its_role_and_a_second_joint_of_a_name_takes_none_away() {
        let body = human(HumanModel::Full);
        let hand = body.limb_index("r_hand").unwrap();
        let joint = body.limbs()[hand].parent.as_ref().unwrap().1.clone();
        let body = body.with_limb("racket", "l_hand", body.limbs()[hand].shape, joint, Vec::new()).unwrap();
        assert_eq!(body.roles().limb_at(JointRole::Wrist(Side::Right)), Some(hand));
        assert_eq!(body.roles().limb(body.limbs().len() - 1), None);
    }

    #[test]
    fn a_body_that_is_named_wrongly_is_refused() {
        let refused = |names: &[[&str; 2]]| {
            let error = chain(names).unwrap_err();
            assert!(matches!(error, BodyError::Value { .. }));
            error.to_string()
        };
        assert_eq!(
            refused(&[["torso", ""], ["l_upperarm", "l_shoulder"], ["r_forearm", "l_elbow"]]),
            "limbs.r_forearm.joint.name: expected a joint of the limb's own side, found l_elbow"
        );
        assert_eq!(
            refused(&[["torso", ""], ["low", "l_elbow"], ["high", "l_shoulder"]]),
            "limbs.low.joint.name: expected a joint of a limb that hangs on high, found l_elbow on torso"
        );
        // Without its shoulder, an elbow may be attached anywhere.
        assert!(chain(&[["torso", ""], ["low", "l_elbow"], ["high", "r_shoulder"]]).is_ok());
        let body = human(HumanModel::Papers);
        let mut sites = body.sites().to_vec();
        sites[body.site_index("l_knee").unwrap()].limb = body.limb_index("r_calf").unwrap();
        assert_eq!(
            Body::new("human", body.limbs().to_vec(), sites).unwrap_err().to_string(),
            "sites.l_knee.limb: expected a limb of the site's own side, found r_calf"
        );
    }
}
