//! The default humans, standing with hanging arms at rest: their parts are described in TOML.

use serde::Deserialize;

use super::roles::split;
use super::{Body, Joint, Limb, Site};
use crate::error::{BodyError, Unexpected};
use crate::math::{Mat3, Pose, Quat, Vec3};
use crate::shape::TaperedEllipticCylinder;

/// The level of detail of the human model.
///
/// ```
/// use voodoo_core::{Body, HumanModel};
///
/// assert_eq!(Body::human(1.75, HumanModel::Papers)?.limbs().len(), 10);
/// assert_eq!(Body::human(1.75, HumanModel::default())?.limbs().len(), 18);
/// # Ok::<(), voodoo_core::BodyError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HumanModel {
    /// Ten limbs and nine joints, as in the papers (K06 III-C): torso, head, two limbs for each arm and leg.
    Papers,
    /// Eighteen limbs: in addition the torso is split at the waist, and there are neck, clavicles, hands and feet. Limbs lie
    /// around the lines between their joints and have the girths of an anthropometric survey.
    Full,
    /// The same limbs with the mean joints and girths of 120 bodies in clothes.
    #[default]
    Measured,
}

/// The parts of a human of stature 1 in the standing frame: x forward, y left, z up, origin on the floor between the feet.
#[derive(Deserialize)]
struct Parts {
    /// Limbs of trunk and head, parents first.
    middle: Vec<Part>,
    /// Limbs of the left arm and leg, which the right ones mirror.
    left: Vec<Part>,
}

/// A limb, and the sites on it.
#[derive(Deserialize)]
struct Part {
    name: String,
    /// Middles of its proximal and its distal end.
    ends: [Vec3; 2],
    /// a0, b0, a1, b1
    semi_axes: [f64; 4],
    /// Where the x axis of its frame points as far as possible; `None`: forward.
    front: Option<Vec3>,
    #[serde(default)]
    match_caps: [bool; 2],
    #[serde(default)]
    sites: Vec<(String, Vec3)>,
    joint: Option<Link>,
}

/// The joint of a limb to its parent. Its frame has x along `flexion` and z along `along`.
#[derive(Deserialize)]
struct Link {
    name: String,
    parent: String,
    center: Vec3,
    flexion: Vec3,
    along: Vec3,
    semi_axes: [f64; 2],
    limits: [[f64; 2]; 3],
    motion: f64,
}

#[derive(Default)]
struct Builder {
    limbs: Vec<Limb>,
    /// Pose of each limb in the standing frame.
    poses: Vec<Pose>,
    sites: Vec<Site>,
}

impl Builder {
    /// Adds a limb whose names begin with `prefix`, mirrored for the right side (`side` = -1, otherwise 1).
    fn add(&mut self, part: &Part, prefix: &str, side: f64) -> Result<(), Unexpected> {
        let named = |name: &str| format!("{prefix}{name}");
        let place = |at: Vec3| Vec3::new(at.x, side * at.y, at.z);
        let (name, [start, end], [a0, b0, a1, b1]) = (named(&part.name), part.ends.map(place), part.semi_axes);
        let length = (end - start).length();
        let along = (end - start) / length;
        let front = part.front.unwrap_or(Vec3::X);
        let x = (front - along * front.dot(along)).normalize();
        let rotation = Quat::from_mat3(&Mat3::from_cols(x, along.cross(x), along));
        let pose = Pose::from_parts(start, rotation);
        let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1)?;
        let joint = |link: &Link| {
            // Of a pair the one on the same side: it was added last.
            let parent = self.limbs.iter().rposition(|limb| split(&limb.name).1 == link.parent)?;
            let axes = [link.flexion, link.along.cross(link.flexion), link.along];
            let turn = Quat::from_mat3(&Mat3::from_cols(axes[0], axes[1], axes[2]));
            let center = Pose::from_parts(place(link.center), turn);
            let mut limits = link.limits;
            // A mirror reverses rotations about the axes that lie in its plane.
            for ([low, high], _) in limits.iter_mut().zip(axes).filter(|(_, axis)| side < 0.0 && axis.y == 0.0) {
                (*low, *high) = (0.0 - *high, 0.0 - *low);
            }
            let joint = Joint {
                name: named(&link.name),
                parent_from_joint: self.poses[parent].inv_mul(&center),
                limb_from_joint: pose.inv_mul(&center),
                semi_axes: link.semi_axes,
                weight: 1.0,
                limits: Some(limits),
                motion: link.motion,
            };
            Some((parent, joint))
        };
        let parent = part.joint.as_ref().and_then(joint);
        let limb = self.limbs.len();
        self.sites.extend(part.sites.iter().map(|(site, at)| {
            let position = pose.inverse_transform_point(place(*at));
            Site { name: named(site), limb, position }
        }));
        self.limbs.push(Limb { name, shape, parent, match_caps: part.match_caps });
        self.poses.push(pose);
        Ok(())
    }
}

impl Body {
    /// A human of a stature in meters, standing with hanging arms at rest. Below 1.55 m the proportions are those of a child.
    ///
    /// Limb frames have z from the proximal to the distal end, x forward (feet: up) in the standing pose. Hinges rotate about the
    /// joint frame's x axis; a positive angle is flexion.
    pub fn human(stature: f64, model: HumanModel) -> Result<Self, BodyError> {
        Unexpected::unless((0.3..=3.0).contains(&stature), "stature", "meters from 0.3 to 3.0", stature)?;
        let text = match model {
            HumanModel::Papers => include_str!("human/papers.toml"),
            HumanModel::Full => include_str!("human/full.toml"),
            HumanModel::Measured => include_str!("human/measured.toml"),
        };
        let parts: Parts = toml::from_str(text).map_err(|error| Unexpected::new("human", "parts of a human", error))?;
        let mut builder = Builder::default();
        for part in &parts.middle {
            builder.add(part, "", 1.0)?;
        }
        for (prefix, side) in [("l_", 1.0), ("r_", -1.0)] {
            for part in &parts.left {
                builder.add(part, prefix, side)?;
            }
        }
        Body::new("human", builder.limbs, builder.sites)?.scaled_to(stature)
    }
}
