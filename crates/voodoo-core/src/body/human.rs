//! The default humans: proportions as shares of the stature, standing with hanging arms at rest.

use super::{Body, Joint, Limb, Site};
use crate::error::BodyError;
use crate::math::{Mat3, Pose, Quat, Vec3};
use crate::shape::TaperedEllipticCylinder;

/// How finely the human is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HumanModel {
    /// Ten limbs and nine joints, as the papers have it (K06 III-C): torso, head, two limbs each arm and leg.
    Papers,
    /// Eighteen limbs: the torso split at the waist, neck, clavicles, hands and feet besides.
    #[default]
    Full,
}

// Heights of joint centres and segment lengths as shares of the stature: Drillis and Contini as tabulated in Winter,
// "Biomechanics and Motor Control of Human Movement", 4th ed., fig. 4.1. Hip joint centres: Bell, Pedersen and Brand, 1990.
const HIP: [f64; 2] = [0.052, 0.530];
const KNEE: f64 = 0.285;
const ANKLE: f64 = 0.039;
/// Forward, outward and height.
const SHOULDER: [f64; 3] = [0.009, 0.112, 0.818];
/// Forward, outward and height of the sternoclavicular joint's centre.
const STERNOCLAVICULAR: [f64; 3] = [0.015, 0.030, 0.800];
/// The middle of the shoulder's slope, beside the neck and at the arm: forward, outward and height.
const SLOPE: [[f64; 3]; 2] = [[-0.002, 0.024, 0.833], [0.002, 0.113, 0.824]];
const UPPER_ARM: f64 = 0.186;
/// The shoulder's muscle rises above the joint's centre.
const DELTOID: f64 = 0.022;
const FOREARM: f64 = 0.146;
const HAND: f64 = 0.095;
/// From the wrist to the knuckles.
const KNUCKLES: f64 = 0.075;
const HAND_CENTRE: f64 = 0.045;
const WAIST: f64 = 0.630;
const VC7: f64 = 0.860;
/// Forward and height, as of the other two: the neck leans forward.
const SKULLBASE: [f64; 2] = [0.024, 0.912];
const HEAD_CENTRE: [f64; 2] = [0.039, 0.937];
const ROOT: [f64; 2] = [0.005, 0.535];
const TOE: f64 = 0.115;
const HEEL: f64 = 0.035;

/// The middle of a limb's surface, [forward, outward] of the line of its joints, and its semi-axes [front, side], at the
/// proximal and the distal end.
struct Surface {
    middle: [[f64; 2]; 2],
    axes: [f64; 4],
}

// Where joints lie in the limbs, and how thick these are, is the mean of 120 bodies of all sizes (MakeHuman, CC0), as
// `scripts/calibrate_human` finds it. The calf's muscle lies behind its joints, the chest before the spine. What it leaves
// open are halves of the mean breadths and depths, and girths over 2 pi, of ANSUR II (Gordon et al., "2012 Anthropometric
// Survey of U.S. Army Personnel", 2014), both sexes, over stature: the papers' torso, clavicle, hand and foot.
/// The root stands upright at rest, in both models: its axis is the body's, and its middle the mean of both ends'.
const TORSO: Surface = surface([0.008, 0.0], [0.008, 0.0], dressed([0.068, 0.098, 0.064, 0.096]));
const PELVIS: Surface = surface([0.012, 0.0], [0.012, 0.0], dressed([0.072, 0.111, 0.058, 0.089]));
const THORAX: Surface = surface([0.030, 0.0], [0.009, 0.0], dressed([0.057, 0.099, 0.075, 0.099]));
/// Up and forward: the trapezius on the shoulder's slope.
const CLAVICLE: Surface = surface([0.0, 0.0], [0.0, 0.0], dressed([0.034, 0.040, 0.030, 0.034]));
const NECK: Surface = surface([0.002, 0.0], [0.025, 0.0], [0.035, 0.038, 0.035, 0.038]);
const HEAD: Surface = surface([0.037, 0.0], [0.026, 0.0], [0.053, 0.035, 0.062, 0.048]);
const UPPER_ARM_SURFACE: Surface = surface([-0.003, -0.005], [-0.001, 0.0], dressed([0.041, 0.035, 0.023, 0.021]));
const FOREARM_SURFACE: Surface = surface([0.003, -0.001], [-0.001, 0.0], dressed([0.025, 0.026, 0.015, 0.012]));
const HAND_SURFACE: Surface = surface([0.0, 0.0], [0.0, 0.0], [0.022, 0.012, 0.019, 0.010]);
const THIGH: Surface = surface([0.013, -0.010], [0.007, -0.004], dressed([0.064, 0.061, 0.037, 0.032]));
const CALF: Surface = surface([-0.017, 0.006], [-0.005, 0.006], dressed([0.040, 0.039, 0.023, 0.015]));
/// Up and outward: the sole is on the floor.
const FOOT: Surface = surface([0.020, 0.0], [0.014, 0.0], [0.020, 0.022, 0.014, 0.017]);
/// The bodies are undressed, people are not: trousers and a shirt, 9 mm of a stature of 1.75 m.
const CLOTHES: f64 = 0.005;

const fn surface(near: [f64; 2], far: [f64; 2], axes: [f64; 4]) -> Surface {
    Surface { middle: [near, far], axes }
}

const fn dressed([a0, b0, a1, b1]: [f64; 4]) -> [f64; 4] {
    [a0 + CLOTHES, b0 + CLOTHES, a1 + CLOTHES, b1 + CLOTHES]
}

/// One limb in the standing frame: x forward, y left, z up, origin on the floor between the feet; stature 1.
struct Part {
    name: String,
    standing_from_limb: Pose,
    length: f64,
    axes: [f64; 4],
    parent: Option<(usize, Link)>,
    match_caps: [bool; 2],
}

/// A joint in the standing frame. Its frame has x along `flexion` and z along `along`; limits and motion in radians.
struct Link {
    name: String,
    centre: Vec3,
    flexion: Vec3,
    along: Vec3,
    semi_axes: [f64; 2],
    limits: [[f64; 2]; 3],
    motion: f64,
}

impl Surface {
    /// Its middle at the ends of a limb between two places of the standing frame, on a side (left = 1).
    fn along(&self, ends: [Vec3; 2], side: f64) -> [Vec3; 2] {
        let [near, far] = self.middle.map(|[forward, outward]| Vec3::new(forward, side * outward, 0.0));
        [ends[0] + near, ends[1] + far]
    }

    /// The same between two heights of the trunk.
    fn upright(&self, low: f64, high: f64) -> [Vec3; 2] {
        self.along([Vec3::Z * low, Vec3::Z * high], 1.0)
    }
}

#[derive(Default)]
struct Builder {
    parts: Vec<Part>,
    sites: Vec<(String, usize, Vec3)>,
}

impl Builder {
    fn limb(
        &mut self,
        name: impl Into<String>,
        [start, end]: [Vec3; 2],
        front: Vec3,
        axes: [f64; 4],
        parent: Option<(usize, Link)>,
        match_caps: [bool; 2],
    ) -> usize {
        let (length, along) = (start.distance(end), (end - start).normalize());
        let front = front.reject_from_normalized(along).normalize();
        let rotation = Quat::from_mat3(&Mat3::from_cols(front, along.cross(front), along));
        let standing_from_limb = Pose::from_parts(start, rotation);
        self.parts.push(Part { name: name.into(), standing_from_limb, length, axes, parent, match_caps });
        self.parts.len() - 1
    }

    fn site(&mut self, name: impl Into<String>, limb: usize, position: Vec3) {
        self.sites.push((name.into(), limb, position));
    }

    /// Pelvis or torso, and all above the shoulders. Returns the limbs that carry the legs and the arms.
    fn trunk(&mut self, model: HumanModel) -> (usize, usize) {
        let link = |name: &str, centre: Vec3, semi_axes: [f64; 2], limits, motion| Link {
            name: name.into(),
            centre,
            flexion: Vec3::Y,
            along: Vec3::Z,
            semi_axes,
            limits,
            motion,
        };
        let neck =
            |semi_axis: f64| link("vc7", Vec3::Z * VC7, [semi_axis; 2], [[-0.9, 1.0], [-0.7, 0.7], [-1.2, 1.2]], 0.15);
        let skullbase = Vec3::new(SKULLBASE[0], 0.0, SKULLBASE[1]);
        let (legs, arms) = match model {
            HumanModel::Papers => {
                let torso = self.limb("torso", TORSO.upright(0.490, 0.835), Vec3::X, TORSO.axes, None, [false; 2]);
                (torso, torso)
            }
            HumanModel::Full => {
                let ends = PELVIS.upright(0.485, WAIST);
                let pelvis = self.limb("pelvis", ends, Vec3::X, PELVIS.axes, None, [false; 2]);
                let spine = link("vl3", Vec3::Z * WAIST, [0.04; 2], [[-0.5, 1.3], [-0.6, 0.6], [-0.8, 0.8]], 0.12);
                let ends = THORAX.upright(WAIST, 0.830);
                let thorax = self.limb("thorax", ends, Vec3::X, THORAX.axes, Some((pelvis, spine)), [false; 2]);
                (pelvis, thorax)
            }
        };
        let head = match model {
            HumanModel::Papers => {
                let ends = HEAD.upright(VC7, 0.995);
                self.limb("head", ends, Vec3::X, HEAD.axes, Some((arms, neck(0.02))), [false, true])
            }
            HumanModel::Full => {
                let ends = NECK.upright(0.830, 0.910);
                let bottom = self.limb("neck", ends, Vec3::X, NECK.axes, Some((arms, neck(0.02))), [false; 2]);
                let skull = link("skullbase", skullbase, [0.015; 2], [[-0.6, 0.6], [-0.4, 0.4], [-0.8, 0.8]], 0.10);
                let ends = HEAD.upright(0.880, 0.995);
                self.limb("head", ends, Vec3::X, HEAD.axes, Some((bottom, skull)), [false, true])
            }
        };
        self.site("humanoid_root", legs, Vec3::new(ROOT[0], 0.0, ROOT[1]));
        self.site(
            "vc7",
            self.parts[head]
                .parent
                .as_ref()
                .map_or(head, |(parent, _)| if model == HumanModel::Full { *parent } else { head }),
            Vec3::Z * VC7,
        );
        self.site("skullbase", head, skullbase);
        self.site("head_center", head, Vec3::new(HEAD_CENTRE[0], 0.0, HEAD_CENTRE[1]));
        self.site("skull_tip", head, Vec3::new(HEAD_CENTRE[0], 0.0, 0.997));
        (legs, arms)
    }

    fn arm(&mut self, model: HumanModel, prefix: &str, side: f64, thorax: usize) {
        let named = |name: &str| format!("{prefix}_{name}");
        let shoulder = Vec3::new(SHOULDER[0], side * SHOULDER[1], SHOULDER[2]);
        let elbow = shoulder - Vec3::Z * UPPER_ARM;
        let wrist = elbow - Vec3::Z * FOREARM;
        // The joint's y axis points backward: the left arm is raised sideways by negative turns about it.
        let shoulder_limits = [[-1.2, 3.2], mirrored([-3.2, 0.8], side), mirrored([-1.6, 1.6], side)];
        let carrier = match model {
            HumanModel::Papers => thorax,
            HumanModel::Full => self.clavicle(prefix, side, thorax),
        };
        let upper = self.limb(
            named("upperarm"),
            UPPER_ARM_SURFACE.along([shoulder + Vec3::Z * DELTOID, elbow], side),
            Vec3::X,
            UPPER_ARM_SURFACE.axes,
            Some((carrier, arm_link(named("shoulder"), shoulder, [0.0; 2], shoulder_limits, 0.35))),
            [false; 2],
        );
        self.site(named("shoulder"), upper, shoulder);
        let (end, caps) = match model {
            // The ten-limb model has no hand: its forearm ends at the knuckles.
            HumanModel::Papers => (wrist - Vec3::Z * KNUCKLES, [false, true]),
            HumanModel::Full => (wrist, [false; 2]),
        };
        let link = arm_link(named("elbow"), elbow, [0.02, 0.0], [[-0.1, 2.7], [0.0; 2], [0.0; 2]], 0.45);
        let ends = FOREARM_SURFACE.along([elbow, end], side);
        let forearm = self.limb(named("forearm"), ends, Vec3::X, FOREARM_SURFACE.axes, Some((upper, link)), caps);
        let last = match model {
            HumanModel::Papers => forearm,
            HumanModel::Full => {
                let limits = [[-1.2, 1.2], [-0.5, 0.5], [-1.5, 1.5]];
                let link = arm_link(named("wrist"), wrist, [0.012; 2], limits, 0.3);
                let ends = HAND_SURFACE.along([wrist, wrist - Vec3::Z * HAND], side);
                self.limb(named("hand"), ends, Vec3::X, HAND_SURFACE.axes, Some((forearm, link)), [false, true])
            }
        };
        self.site(named("elbow"), forearm, elbow);
        self.site(named("wrist"), last, wrist);
        self.site(named("hand"), last, wrist - Vec3::Z * HAND_CENTRE);
    }

    /// Carries the arm and moves a little on the chest: a raised arm raises its shoulder.
    fn clavicle(&mut self, prefix: &str, side: f64, thorax: usize) -> usize {
        // z outward along the slope of the shoulder, x up.
        let ends = SLOPE.map(|[x, y, z]| Vec3::new(x, side * y, z));
        let [x, y, z] = STERNOCLAVICULAR;
        let link = Link {
            name: format!("{prefix}_sternoclavicular"),
            centre: Vec3::new(x, side * y, z),
            // The joint's x axis points forward: the left shoulder is raised by positive turns about it.
            flexion: Vec3::X,
            along: Vec3::Z,
            semi_axes: [0.0; 2],
            limits: [mirrored([-0.15, 0.70], side), [-0.1, 0.1], [-0.4, 0.4]],
            motion: 0.015,
        };
        self.limb(format!("{prefix}_clavicle"), ends, Vec3::Z, CLAVICLE.axes, Some((thorax, link)), [false; 2])
    }

    fn leg(&mut self, model: HumanModel, prefix: &str, side: f64, pelvis: usize) {
        let named = |name: &str| format!("{prefix}_{name}");
        let hip = Vec3::new(0.0, side * HIP[0], HIP[1]);
        let knee = Vec3::new(0.0, hip.y, KNEE);
        let ankle = Vec3::new(0.0, hip.y, ANKLE);
        let hip_limits = [[-0.6, 2.3], mirrored([-1.0, 0.5], side), mirrored([-0.8, 0.8], side)];
        let link_hip = Link {
            name: named("hip"),
            centre: hip,
            flexion: -Vec3::Y,
            along: -Vec3::Z,
            semi_axes: [0.02, 0.005],
            limits: hip_limits,
            motion: 0.25,
        };
        let ends = THIGH.along([hip, knee], side);
        let thigh = self.limb(named("thigh"), ends, Vec3::X, THIGH.axes, Some((pelvis, link_hip)), [false; 2]);
        // A hanging calf bends backward: about the axis to the left.
        let link_knee = Link {
            name: named("knee"),
            centre: knee,
            flexion: Vec3::Y,
            along: -Vec3::Z,
            semi_axes: [0.028, 0.0],
            limits: [[-0.1, 2.6], [0.0; 2], [0.0; 2]],
            motion: 0.30,
        };
        self.site(named("hip"), thigh, hip);
        let (end, caps) = match model {
            HumanModel::Papers => (Vec3::new(ankle.x, ankle.y, 0.0), [false, true]),
            HumanModel::Full => (ankle, [false; 2]),
        };
        let ends = CALF.along([knee, end], side);
        let calf = self.limb(named("calf"), ends, Vec3::X, CALF.axes, Some((thigh, link_knee)), caps);
        self.site(named("knee"), calf, knee);
        self.site(named("ankle"), calf, ankle);
        if model == HumanModel::Full {
            let [[heel, _], [toe, _]] = FOOT.middle;
            let ends = [Vec3::new(-HEEL, hip.y, heel), Vec3::new(TOE, hip.y, toe)];
            let link = Link {
                name: named("ankle"),
                centre: ankle,
                flexion: -Vec3::Y,
                along: -Vec3::Z,
                semi_axes: [0.012; 2],
                limits: [[-0.8, 0.6], [-0.4, 0.4], [-0.4, 0.4]],
                motion: 0.20,
            };
            // z forward, x up.
            let foot = self.limb(named("foot"), ends, Vec3::Z, FOOT.axes, Some((calf, link)), [true, true]);
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
                let standing_from_joint = Pose::from_parts(link.centre, Quat::from_mat3(&axes));
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

/// A joint of a hanging arm.
fn arm_link(name: String, centre: Vec3, semi_axes: [f64; 2], limits: [[f64; 2]; 3], motion: f64) -> Link {
    Link { name, centre, flexion: -Vec3::Y, along: -Vec3::Z, semi_axes, limits, motion }
}

/// A range for the left side (`side` = 1), mirrored for the right one.
fn mirrored([low, high]: [f64; 2], side: f64) -> [f64; 2] {
    if side > 0.0 { [low, high] } else { [-high, -low] }
}

impl Body {
    /// A human of a stature in metres, standing with hanging arms at rest.
    ///
    /// Limb frames have z from the proximal to the distal end, x forward (feet: up) in the standing pose. Hinges turn about
    /// the joint frame's x axis; a positive angle is flexion.
    pub fn human(stature: f64, model: HumanModel) -> Result<Self, BodyError> {
        if !(0.3..=3.0).contains(&stature) {
            return Err(BodyError::Value {
                key: "stature".into(),
                expected: "metres from 0.3 to 3.0",
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
