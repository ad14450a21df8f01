//! The default humans: proportions as fractions of the stature, standing with hanging arms at rest.

use super::{Body, Joint, Limb, Site};
use crate::error::BodyError;
use crate::math::{Mat3, Pose, Quat, Vec3};
use crate::shape::TaperedEllipticCylinder;

/// The level of detail of the human model.
///
/// ```
/// use voodoo_core::{Body, HumanModel};
///
/// assert_eq!(Body::human(1.75, HumanModel::Papers)?.limbs().len(), 10);
/// assert_eq!(Body::human(1.75, HumanModel::Full)?.limbs().len(), 18);
/// # Ok::<(), voodoo_core::BodyError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HumanModel {
    /// Ten limbs and nine joints, as in the papers (K06 III-C): torso, head, two limbs for each arm and leg.
    Papers,
    /// Eighteen limbs: in addition the torso is split at the waist, and there are neck, clavicles, hands and feet.
    #[default]
    Full,
}

// Heights of joint centers and segment lengths as fractions of the stature: Drillis and Contini as tabulated in Winter,
// "Biomechanics and Motor Control of Human Movement", 4th ed., fig. 4.1. Hip joint centers: Bell, Pedersen and Brand, 1990.
const HIP: [f64; 2] = [0.052, 0.530];
const KNEE: f64 = 0.285;
const ANKLE: f64 = 0.039;
const SHOULDER: [f64; 2] = [0.112, 0.818];
/// Center of the sternoclavicular joint: forward, outward and height.
const STERNOCLAVICULAR: [f64; 3] = [0.015, 0.030, 0.800];
/// Start of the shoulder's slope beside the neck: outward and height.
const SLOPE: [f64; 2] = [0.025, 0.838];
const UPPER_ARM: f64 = 0.186;
/// Height of the deltoid muscle above the shoulder joint's center.
const DELTOID: f64 = 0.022;
const FOREARM: f64 = 0.146;
const HAND: f64 = 0.095;
/// Distance from the wrist to the knuckles.
const KNUCKLES: f64 = 0.075;
const HAND_CENTER: f64 = 0.045;
const WAIST: f64 = 0.630;
const VC7: f64 = 0.860;
const SKULLBASE: f64 = 0.912;
const TOE: f64 = 0.115;
const HEEL: f64 = 0.035;

// Semi-axes [front, side] at the proximal and the distal end: half of the mean breadths and depths, and girths over 2 pi, of
// ANSUR II (Gordon et al., "2012 Anthropometric Survey of U.S. Army Personnel", 2014), both sexes, over stature.
const TORSO: [f64; 4] = [0.068, 0.098, 0.064, 0.096];
const PELVIS: [f64; 4] = [0.068, 0.098, 0.064, 0.088];
const THORAX: [f64; 4] = [0.064, 0.090, 0.060, 0.092];
const PAPERS_HEAD: [f64; 4] = [0.046, 0.040, 0.050, 0.042];
/// The semi-axes point up and forward: the trapezius on the shoulder's slope.
const CLAVICLE: [f64; 4] = [0.034, 0.040, 0.030, 0.034];
const NECK: [f64; 4] = [0.036, 0.035, 0.034, 0.033];
const HEAD: [f64; 4] = [0.050, 0.040, 0.050, 0.042];
const UPPER_ARM_AXES: [f64; 4] = [0.031, 0.029, 0.025, 0.025];
const FOREARM_AXES: [f64; 4] = [0.026, 0.025, 0.018, 0.018];
const HAND_AXES: [f64; 4] = [0.022, 0.012, 0.019, 0.010];
const THIGH_AXES: [f64; 4] = [0.053, 0.051, 0.036, 0.036];
const CALF_AXES: [f64; 4] = [0.034, 0.034, 0.022, 0.022];
const FOOT_AXES: [f64; 4] = [0.020, 0.022, 0.014, 0.017];

/// One limb in the standing frame: x forward, y left, z up, origin on the floor between the feet; stature 1.
struct LimbSpec {
    name: String,
    standing_from_limb: Pose,
    length: f64,
    axes: [f64; 4],
    parent: Option<(usize, JointSpec)>,
    match_caps: [bool; 2],
}

/// A joint in the standing frame. Its frame has x along `flexion` and z along `along`; limits and motion in radians.
struct JointSpec {
    name: String,
    center: Vec3,
    flexion: Vec3,
    along: Vec3,
    semi_axes: [f64; 2],
    limits: [[f64; 2]; 3],
    motion: f64,
}

#[derive(Default)]
struct Builder {
    parts: Vec<LimbSpec>,
    sites: Vec<(String, usize, Vec3)>,
}

impl Builder {
    fn limb(
        &mut self,
        name: impl Into<String>,
        start: Vec3,
        rotation: Quat,
        length: f64,
        axes: [f64; 4],
        parent: Option<(usize, JointSpec)>,
        match_caps: [bool; 2],
    ) -> usize {
        let standing_from_limb = Pose::from_parts(start, rotation);
        self.parts.push(LimbSpec { name: name.into(), standing_from_limb, length, axes, parent, match_caps });
        self.parts.len() - 1
    }

    fn site(&mut self, name: impl Into<String>, limb: usize, position: Vec3) {
        self.sites.push((name.into(), limb, position));
    }

    /// Adds the pelvis or torso, and the parts of the trunk above it. Returns the limbs that carry the legs and the arms.
    fn trunk(&mut self, model: HumanModel) -> (usize, usize) {
        let up = Quat::IDENTITY;
        let link = |name: &str, height: f64, semi_axes: [f64; 2], limits, motion| JointSpec {
            name: name.into(),
            center: Vec3::Z * height,
            flexion: Vec3::Y,
            along: Vec3::Z,
            semi_axes,
            limits,
            motion,
        };
        let neck = |semi_axis: f64| link("vc7", VC7, [semi_axis; 2], [[-0.9, 1.0], [-0.7, 0.7], [-1.2, 1.2]], 0.15);
        let (legs, arms) = match model {
            HumanModel::Papers => {
                let torso = self.limb("torso", Vec3::Z * 0.490, up, 0.345, TORSO, None, [false; 2]);
                (torso, torso)
            }
            HumanModel::Full => {
                let pelvis = self.limb("pelvis", Vec3::Z * 0.485, up, WAIST - 0.485, PELVIS, None, [false; 2]);
                let spine = link("vl3", WAIST, [0.04; 2], [[-0.5, 1.3], [-0.6, 0.6], [-0.8, 0.8]], 0.12);
                let thorax =
                    self.limb("thorax", Vec3::Z * WAIST, up, 0.830 - WAIST, THORAX, Some((pelvis, spine)), [false; 2]);
                (pelvis, thorax)
            }
        };
        let head = match model {
            HumanModel::Papers => {
                self.limb("head", Vec3::Z * VC7, up, 0.135, PAPERS_HEAD, Some((arms, neck(0.02))), [false, true])
            }
            HumanModel::Full => {
                let bottom = self.limb("neck", Vec3::Z * 0.830, up, 0.080, NECK, Some((arms, neck(0.02))), [false; 2]);
                let skull = link("skullbase", SKULLBASE, [0.015; 2], [[-0.6, 0.6], [-0.4, 0.4], [-0.8, 0.8]], 0.10);
                self.limb("head", Vec3::new(0.008, 0.0, 0.880), up, 0.115, HEAD, Some((bottom, skull)), [false, true])
            }
        };
        self.site("humanoid_root", legs, Vec3::Z * 0.535);
        self.site(
            "vc7",
            self.parts[head]
                .parent
                .as_ref()
                .map_or(head, |(parent, _)| if model == HumanModel::Full { *parent } else { head }),
            Vec3::Z * VC7,
        );
        self.site("skullbase", head, Vec3::Z * SKULLBASE);
        self.site("head_center", head, Vec3::new(0.008, 0.0, 0.937));
        self.site("skull_tip", head, Vec3::Z * 0.997);
        (legs, arms)
    }

    fn arm(&mut self, model: HumanModel, prefix: &str, side: f64, thorax: usize) {
        let named = |name: &str| format!("{prefix}_{name}");
        let shoulder = Vec3::new(0.0, side * SHOULDER[0], SHOULDER[1]);
        let elbow = shoulder - Vec3::Z * UPPER_ARM;
        let wrist = elbow - Vec3::Z * FOREARM;
        // The joint's y axis points backward: negative rotations about it raise the left arm sideways.
        let shoulder_limits = [[-1.2, 3.2], mirrored([-3.2, 0.8], side), mirrored([-1.6, 1.6], side)];
        let carrier = match model {
            HumanModel::Papers => thorax,
            HumanModel::Full => self.clavicle(prefix, side, shoulder, thorax),
        };
        let upper = self.limb(
            named("upperarm"),
            shoulder + Vec3::Z * DELTOID,
            hanging(),
            UPPER_ARM + DELTOID,
            UPPER_ARM_AXES,
            Some((carrier, arm_link(named("shoulder"), shoulder, [0.0; 2], shoulder_limits, 0.35))),
            [false; 2],
        );
        self.site(named("shoulder"), upper, shoulder);
        let (length, caps) = match model {
            // The ten-limb model has no hand: its forearm ends at the knuckles.
            HumanModel::Papers => (FOREARM + KNUCKLES, [false, true]),
            HumanModel::Full => (FOREARM, [false; 2]),
        };
        let link = arm_link(named("elbow"), elbow, [0.02, 0.0], [[-0.1, 2.7], [0.0; 2], [0.0; 2]], 0.45);
        let forearm = self.limb(named("forearm"), elbow, hanging(), length, FOREARM_AXES, Some((upper, link)), caps);
        let last = match model {
            HumanModel::Papers => forearm,
            HumanModel::Full => {
                let limits = [[-1.2, 1.2], [-0.5, 0.5], [-1.5, 1.5]];
                let link = arm_link(named("wrist"), wrist, [0.012; 2], limits, 0.3);
                self.limb(named("hand"), wrist, hanging(), HAND, HAND_AXES, Some((forearm, link)), [false, true])
            }
        };
        self.site(named("elbow"), forearm, elbow);
        self.site(named("wrist"), last, wrist);
        self.site(named("hand"), last, wrist - Vec3::Z * HAND_CENTER);
    }

    /// Adds a clavicle. It carries the arm and moves slightly on the chest: a raised arm raises its shoulder.
    fn clavicle(&mut self, prefix: &str, side: f64, shoulder: Vec3, thorax: usize) -> usize {
        // z outward along the slope of the shoulder, x up.
        let start = Vec3::new(0.0, side * SLOPE[0], SLOPE[1]);
        let outward = (shoulder - start).normalize();
        let up = (Vec3::Z - outward * outward.z).normalize();
        let rotation = Quat::from_mat3(&Mat3::from_cols(up, outward.cross(up), outward));
        let [x, y, z] = STERNOCLAVICULAR;
        let link = JointSpec {
            name: format!("{prefix}_sternoclavicular"),
            center: Vec3::new(x, side * y, z),
            // The joint's x axis points forward: positive rotations about it raise the left shoulder.
            flexion: Vec3::X,
            along: Vec3::Z,
            semi_axes: [0.0; 2],
            limits: [mirrored([-0.15, 0.70], side), [-0.1, 0.1], [-0.4, 0.4]],
            motion: 0.015,
        };
        let length = (shoulder - start).length();
        self.limb(format!("{prefix}_clavicle"), start, rotation, length, CLAVICLE, Some((thorax, link)), [false; 2])
    }

    fn leg(&mut self, model: HumanModel, prefix: &str, side: f64, pelvis: usize) {
        let down = hanging();
        let named = |name: &str| format!("{prefix}_{name}");
        let hip = Vec3::new(0.0, side * HIP[0], HIP[1]);
        let knee = Vec3::new(0.0, hip.y, KNEE);
        let ankle = Vec3::new(0.0, hip.y, ANKLE);
        let hip_limits = [[-0.6, 2.3], mirrored([-1.0, 0.5], side), mirrored([-0.8, 0.8], side)];
        let link_hip = JointSpec {
            name: named("hip"),
            center: hip,
            flexion: -Vec3::Y,
            along: -Vec3::Z,
            semi_axes: [0.02, 0.005],
            limits: hip_limits,
            motion: 0.25,
        };
        let thigh =
            self.limb(named("thigh"), hip, down, HIP[1] - KNEE, THIGH_AXES, Some((pelvis, link_hip)), [false; 2]);
        // A hanging calf bends backward, which is a rotation about the axis to the left.
        let link_knee = JointSpec {
            name: named("knee"),
            center: knee,
            flexion: Vec3::Y,
            along: -Vec3::Z,
            semi_axes: [0.028, 0.0],
            limits: [[-0.1, 2.6], [0.0; 2], [0.0; 2]],
            motion: 0.30,
        };
        self.site(named("hip"), thigh, hip);
        let (length, caps) = match model {
            HumanModel::Papers => (KNEE, [false, true]),
            HumanModel::Full => (KNEE - ANKLE, [false; 2]),
        };
        let calf = self.limb(named("calf"), knee, down, length, CALF_AXES, Some((thigh, link_knee)), caps);
        self.site(named("knee"), calf, knee);
        self.site(named("ankle"), calf, ankle);
        if model == HumanModel::Full {
            // z forward, x up.
            let forward = Quat::from_mat3(&Mat3::from_cols(Vec3::Z, -Vec3::Y, Vec3::X));
            let start = Vec3::new(-HEEL, hip.y, 0.022);
            let link = JointSpec {
                name: named("ankle"),
                center: ankle,
                flexion: -Vec3::Y,
                along: -Vec3::Z,
                semi_axes: [0.012; 2],
                limits: [[-0.8, 0.6], [-0.4, 0.4], [-0.4, 0.4]],
                motion: 0.20,
            };
            let foot =
                self.limb(named("foot"), start, forward, HEEL + TOE, FOOT_AXES, Some((calf, link)), [true, true]);
            self.site(named("toe"), foot, Vec3::new(TOE, hip.y, 0.012));
        }
    }

    fn finish(self, name: &str) -> Result<Body, BodyError> {
        let poses: Vec<Pose> = self.parts.iter().map(|part| part.standing_from_limb).collect();
        let mut limbs = Vec::with_capacity(poses.len());
        for (index, part) in self.parts.into_iter().enumerate() {
            let [a0, b0, a1, b1] = part.axes;
            let shape = TaperedEllipticCylinder::new(part.length, a0, b0, a1, b1)
                .map_err(|source| BodyError::Shape { key: format!("limbs.{}", part.name), source })?;
            let parent = part.parent.map(|(parent, link)| {
                let axes = Mat3::from_cols(link.flexion, link.along.cross(link.flexion), link.along);
                let standing_from_joint = Pose::from_parts(link.center, Quat::from_mat3(&axes));
                let joint = Joint {
                    name: link.name,
                    parent_from_joint: poses[parent].inv_mul(&standing_from_joint),
                    limb_from_joint: poses[index].inv_mul(&standing_from_joint),
                    semi_axes: link.semi_axes,
                    weight: 1.0,
                    limits: Some(link.limits),
                    motion: link.motion,
                };
                (parent, joint)
            });
            limbs.push(Limb { name: part.name, shape, parent, match_caps: part.match_caps });
        }
        let sites = self
            .sites
            .into_iter()
            .map(|(name, limb, point)| Site { name, limb, position: poses[limb].inverse_transform_point(point) })
            .collect();
        Body::new(name, limbs, sites)
    }
}

/// Orientation of a hanging limb: z points down, x stays forward.
fn hanging() -> Quat {
    Quat::from_axis_angle(Vec3::X, std::f64::consts::PI)
}

/// A joint of a hanging arm.
fn arm_link(name: String, center: Vec3, semi_axes: [f64; 2], limits: [[f64; 2]; 3], motion: f64) -> JointSpec {
    JointSpec { name, center, flexion: -Vec3::Y, along: -Vec3::Z, semi_axes, limits, motion }
}

/// A range for the left side (`side` = 1), mirrored for the right one.
fn mirrored([low, high]: [f64; 2], side: f64) -> [f64; 2] {
    if side > 0.0 { [low, high] } else { [-high, -low] }
}

impl Body {
    /// A human of a stature in meters, standing with hanging arms at rest.
    ///
    /// Limb frames have z from the proximal to the distal end, x forward (feet: up) in the standing pose. Hinges rotate about the
    /// joint frame's x axis; a positive angle is flexion.
    pub fn human(stature: f64, model: HumanModel) -> Result<Self, BodyError> {
        if !(0.3..=3.0).contains(&stature) {
            return Err(BodyError::Value {
                key: "stature".into(),
                expected: "meters from 0.3 to 3.0",
                found: stature.to_string(),
            });
        }
        let mut builder = Builder::default();
        let (legs, arms) = builder.trunk(model);
        for (prefix, side) in [("l", 1.0), ("r", -1.0)] {
            builder.arm(model, prefix, side, arms);
            builder.leg(model, prefix, side, legs);
        }
        builder.finish("human")?.scaled(stature)
    }
}
