//! The default human: ten limbs, nine joints (K06 III-C), from stature.

use super::{Body, Joint, Limb, Site};
use crate::error::BodyError;
use crate::geometry::{Mat3, Pose, Quat, Vec3};
use crate::shape::TaperedEllipticCylinder;

/// Landmarks and half-breadths of an adult as shares of the stature.
///
/// Heights of joint centres and segment lengths: Drillis and Contini as tabulated in Winter, "Biomechanics and Motor Control
/// of Human Movement", 4th ed., fig. 4.1 (shoulder 0.818, hip 0.530, knee 0.285, ankle 0.039, upper arm 0.186,
/// forearm 0.146, hand 0.108). Breadths and girths: means of ANSUR II (Gordon et al., "2012 Anthropometric Survey of U.S.
/// Army Personnel", 2014), both sexes, divided by stature. Hip joint centres: Bell, Pedersen and Brand, 1990.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HumanProportions;

impl HumanProportions {
    const HIP: [f64; 2] = [0.052, 0.530];
    const KNEE: f64 = 0.285;
    const ANKLE: f64 = 0.039;
    const SHOULDER: [f64; 2] = [0.112, 0.818];
    const UPPER_ARM: f64 = 0.186;
    const FOREARM: f64 = 0.146;
    const VC7: f64 = 0.860;
    const SKULLBASE: f64 = 0.912;
    /// Length, and the semi-axes to the front and to the side at the proximal and the distal end.
    const TORSO: [f64; 5] = [0.345, 0.068, 0.098, 0.064, 0.096];
    const HEAD: [f64; 5] = [0.135, 0.046, 0.040, 0.050, 0.042];
    /// The forearm ends at the knuckles: the ten-limb model has no hand.
    const UPPER_ARM_GIRTH: [f64; 4] = [0.031, 0.029, 0.025, 0.025];
    const FOREARM_GIRTH: [f64; 4] = [0.026, 0.025, 0.017, 0.019];
    const THIGH_GIRTH: [f64; 4] = [0.053, 0.051, 0.036, 0.036];
    const CALF_GIRTH: [f64; 4] = [0.034, 0.034, 0.022, 0.022];
    const TORSO_BOTTOM: f64 = 0.490;
    const HAND_CENTRE: f64 = 0.045;
    const HAND_END: f64 = 0.075;
    /// Half-lengths of the hinges and semi-axes of the neck's ellipse.
    const ELBOW_HINGE: f64 = 0.020;
    const KNEE_HINGE: f64 = 0.028;
    const HIP_HINGE: f64 = 0.020;
    const NECK: f64 = 0.020;
}

struct Part {
    name: String,
    /// Proximal end in the standing frame: x forward, y left, z up, origin on the floor.
    start: Vec3,
    upright: bool,
    /// Length, semi-axes (front, side) proximal and distal.
    shape: [f64; 5],
    parent: Option<(usize, Link)>,
    match_caps: [bool; 2],
}

struct Link {
    name: String,
    centre: Vec3,
    semi_axes: [f64; 2],
    /// Positive rotation about the joint's x axis is flexion: the axis points left at the knee and the hip... see `human`.
    flexion_axis: Vec3,
}

impl Body {
    /// The ten-limb human of the papers, standing with hanging arms at rest.
    ///
    /// `stature` in metres. Limb frames have z from the proximal to the distal end and x forward in the standing pose; the
    /// hinges turn about the joint frame's x axis and a positive angle is flexion.
    pub fn human(stature: f64) -> Result<Self, BodyError> {
        if !(0.3..=3.0).contains(&stature) {
            return Err(BodyError::Value {
                key: "stature".into(),
                expected: "metres from 0.3 to 3.0",
                found: stature.to_string(),
            });
        }
        use HumanProportions as H;
        let side_point = |side: f64, [y, z]: [f64; 2]| Vec3::new(0.0, side * y, z);
        let part = |name: String, start, girth: [f64; 4], length, parent, match_caps| Part {
            name,
            start,
            upright: false,
            shape: [length, girth[0], girth[1], girth[2], girth[3]],
            parent: Some(parent),
            match_caps,
        };
        let mut parts = vec![
            Part {
                name: "torso".into(),
                start: Vec3::Z * H::TORSO_BOTTOM,
                upright: true,
                shape: H::TORSO,
                parent: None,
                match_caps: [false, false],
            },
            Part {
                name: "head".into(),
                start: Vec3::Z * H::VC7,
                upright: true,
                shape: H::HEAD,
                parent: Some((
                    0,
                    Link {
                        name: "vc7".into(),
                        centre: Vec3::Z * H::VC7,
                        semi_axes: [H::NECK; 2],
                        flexion_axis: Vec3::Y,
                    },
                )),
                match_caps: [false, true],
            },
        ];
        let mut sites = vec![
            ("humanoid_root".to_owned(), 0, Vec3::Z * 0.535),
            ("vc7".into(), 1, Vec3::Z * H::VC7),
            ("skullbase".into(), 1, Vec3::Z * H::SKULLBASE),
            ("head_center".into(), 1, Vec3::new(0.008, 0.0, 0.937)),
            ("skull_tip".into(), 1, Vec3::Z * 0.997),
        ];
        for (prefix, side) in [("l", 1.0), ("r", -1.0)] {
            let named = |name: &str| format!("{prefix}_{name}");
            let link = |name: &str, centre, semi_axis, flexion_axis| Link {
                name: named(name),
                centre,
                semi_axes: [semi_axis, 0.0],
                flexion_axis,
            };
            let shoulder = side_point(side, H::SHOULDER);
            let elbow = shoulder - Vec3::Z * H::UPPER_ARM;
            let wrist = elbow - Vec3::Z * H::FOREARM;
            let hip = side_point(side, H::HIP);
            let knee = Vec3::new(0.0, hip.y, H::KNEE);
            let ankle = Vec3::new(0.0, hip.y, H::ANKLE);
            let arm = parts.len();
            // A hanging forearm turns forward about the axis to the right, a hanging calf backward about the one to the left.
            let (to_right, to_left) = (-Vec3::Y, Vec3::Y);
            parts.push(part(
                named("upperarm"),
                shoulder,
                H::UPPER_ARM_GIRTH,
                H::UPPER_ARM,
                (0, link("shoulder", shoulder, 0.0, to_right)),
                [false; 2],
            ));
            parts.push(part(
                named("forearm"),
                elbow,
                H::FOREARM_GIRTH,
                H::FOREARM + H::HAND_END,
                (arm, link("elbow", elbow, H::ELBOW_HINGE, to_right)),
                [false, true],
            ));
            parts.push(part(
                named("thigh"),
                hip,
                H::THIGH_GIRTH,
                H::HIP[1] - H::KNEE,
                (0, link("hip", hip, H::HIP_HINGE, to_right)),
                [false; 2],
            ));
            parts.push(part(
                named("calf"),
                knee,
                H::CALF_GIRTH,
                H::KNEE,
                (arm + 2, link("knee", knee, H::KNEE_HINGE, to_left)),
                [false, true],
            ));
            sites.extend([
                (named("shoulder"), arm, shoulder),
                (named("elbow"), arm + 1, elbow),
                (named("wrist"), arm + 1, wrist),
                (named("hand"), arm + 1, wrist - Vec3::Z * H::HAND_CENTRE),
                (named("hip"), arm + 2, hip),
                (named("knee"), arm + 3, knee),
                (named("ankle"), arm + 3, ankle),
            ]);
        }
        assemble("human", parts, sites)?.scaled(stature)
    }
}

/// Limbs with their frames and joints from parts given in one standing frame.
fn assemble(name: &str, parts: Vec<Part>, sites: Vec<(String, usize, Vec3)>) -> Result<Body, BodyError> {
    let downward = Quat::from_axis_angle(Vec3::X, std::f64::consts::PI);
    let standing_from_limb: Vec<Pose> = parts
        .iter()
        .map(|part| Pose::from_parts(part.start, if part.upright { Quat::IDENTITY } else { downward }))
        .collect();
    let mut limbs = Vec::with_capacity(parts.len());
    for (index, part) in parts.into_iter().enumerate() {
        let [length, a0, b0, a1, b1] = part.shape;
        let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1)
            .map_err(|source| BodyError::Shape { key: format!("limbs.{}", part.name), source })?;
        let parent = part.parent.map(|(parent, link)| {
            let z = standing_from_limb[index].rotation * Vec3::Z;
            let axes = Mat3::from_cols(link.flexion_axis, z.cross(link.flexion_axis), z);
            let standing_from_joint = Pose::from_parts(link.centre, Quat::from_mat3(&axes));
            let joint = Joint {
                name: link.name,
                parent_from_joint: standing_from_limb[parent].inv_mul(&standing_from_joint),
                limb_from_joint: standing_from_limb[index].inv_mul(&standing_from_joint),
                semi_axes: link.semi_axes,
                weight: 1.0,
            };
            (parent, joint)
        });
        limbs.push(Limb { name: part.name, shape, parent, match_caps: part.match_caps });
    }
    let sites = sites
        .into_iter()
        .map(|(name, limb, point)| Site {
            name,
            limb,
            position: standing_from_limb[limb].inverse_transform_point(point),
        })
        .collect();
    Body::new(name, limbs, sites)
}
