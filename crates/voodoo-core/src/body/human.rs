//! The default humans: proportions as fractions of the stature, standing with hanging arms at rest.

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

// Heights of joint centers and segment lengths as fractions of the stature: Drillis and Contini as tabulated in Winter,
// "Biomechanics and Motor Control of Human Movement", 4th ed., fig. 4.1. Hip joint centers: Bell, Pedersen and Brand, 1990.
const HIP: [f64; 2] = [0.052, 0.530];
const KNEE: f64 = 0.285;
const ANKLE: f64 = 0.039;
const SHOULDER: [f64; 2] = [0.112, 0.818];
/// Center of the sternoclavicular joint: forward, outward and height.
const STERNOCLAVICULAR: [f64; 3] = [0.015, 0.030, 0.800];
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

/// The surface of a limb relative to the line between its joints: how far the middles of its proximal and distal end lie in front
/// of and outside that line, and the semi-axes [front, side] at both ends.
#[derive(Clone, Copy)]
struct Surface {
    offsets: [[f64; 2]; 2],
    axes: [f64; 4],
}

/// Where limbs lie about their joints, and how thick they are, over stature.
struct Build {
    pelvis: Surface,
    thorax: Surface,
    neck: Surface,
    head: Surface,
    /// The semi-axes point up and forward: the trapezius on the shoulder's slope.
    clavicle: Surface,
    /// Where the clavicle begins beside the neck and ends above the shoulder joint: forward, outward and height.
    slope: [[f64; 3]; 2],
    upper_arm: Surface,
    forearm: Surface,
    thigh: Surface,
    calf: Surface,
    /// Heights of the middle of the foot's heel and toe.
    foot: [f64; 2],
    /// How far the root, the joints of the arms, and the base, the center and the tip of the skull lie in front of the hips.
    root: f64,
    arm: f64,
    skull: [f64; 3],
}

/// Half of the mean breadths and depths, and girths over 2 pi, of ANSUR II (Gordon et al., "2012 Anthropometric Survey of U.S.
/// Army Personnel", 2014), both sexes.
const ANSUR: Build = Build {
    pelvis: centered([0.068, 0.098, 0.064, 0.088]),
    thorax: centered([0.064, 0.090, 0.060, 0.092]),
    neck: centered([0.036, 0.035, 0.034, 0.033]),
    head: Surface { offsets: [[0.008, 0.0]; 2], axes: [0.050, 0.040, 0.050, 0.042] },
    clavicle: centered([0.034, 0.040, 0.030, 0.034]),
    slope: [[0.0, 0.025, 0.838], [0.0, SHOULDER[0], SHOULDER[1]]],
    upper_arm: centered([0.031, 0.029, 0.025, 0.025]),
    forearm: centered([0.026, 0.025, 0.018, 0.018]),
    thigh: centered([0.053, 0.051, 0.036, 0.036]),
    calf: centered([0.034, 0.034, 0.022, 0.022]),
    foot: [0.022; 2],
    root: 0.0,
    arm: 0.0,
    skull: [0.0, 0.008, 0.0],
};
/// The mean of 120 bodies (MakeHuman, CC0; `scripts/calibrate_human` prints it), 9 mm thicker for clothes.
const MEASURED: Build = Build {
    pelvis: Surface { offsets: [[0.012, 0.0], [0.012, 0.0]], axes: [0.077, 0.116, 0.063, 0.094] },
    thorax: Surface { offsets: [[0.030, 0.0], [0.009, 0.0]], axes: [0.062, 0.104, 0.080, 0.104] },
    neck: Surface { offsets: [[0.002, 0.0], [0.025, 0.0]], axes: [0.035, 0.038, 0.035, 0.038] },
    head: Surface { offsets: [[0.037, 0.0], [0.026, 0.0]], axes: [0.053, 0.035, 0.062, 0.048] },
    clavicle: centered([0.039, 0.045, 0.035, 0.039]),
    slope: [[-0.002, 0.024, 0.833], [0.002, 0.113, 0.824]],
    upper_arm: Surface { offsets: [[-0.003, -0.005], [-0.001, 0.0]], axes: [0.046, 0.040, 0.028, 0.026] },
    forearm: Surface { offsets: [[0.003, -0.001], [-0.001, 0.0]], axes: [0.030, 0.031, 0.020, 0.017] },
    thigh: Surface { offsets: [[0.013, -0.010], [0.007, -0.004]], axes: [0.069, 0.066, 0.042, 0.037] },
    calf: Surface { offsets: [[-0.017, 0.006], [-0.005, 0.006]], axes: [0.045, 0.044, 0.028, 0.020] },
    foot: [0.020, 0.014],
    root: 0.005,
    arm: 0.009,
    skull: [0.024, 0.039, 0.039],
};
/// Trunk and head of `Papers`; its other surfaces are those of `ANSUR`.
const TORSO: Surface = centered([0.068, 0.098, 0.064, 0.096]);
const PAPERS_HEAD: Surface = centered([0.046, 0.040, 0.050, 0.042]);
const HAND_SURFACE: Surface = centered([0.022, 0.012, 0.019, 0.010]);
const FOOT_SURFACE: Surface = centered([0.020, 0.022, 0.014, 0.017]);

const fn centered(axes: [f64; 4]) -> Surface {
    Surface { offsets: [[0.0; 2]; 2], axes }
}

impl Surface {
    /// The ends of the surface of a left (`side` = 1), right (-1) or central limb (0) whose joints' line has these ends.
    fn ends(&self, line: [Vec3; 2], side: f64) -> [Vec3; 2] {
        std::array::from_fn(|end| {
            let [forward, outward] = self.offsets[end];
            line[end] + Vec3::new(forward, side * outward, 0.0)
        })
    }
}

/// The parts of a human in the standing frame: x forward, y left, z up, origin on the floor between the feet; stature 1.
struct Builder {
    /// The ten limbs of the papers, which have no hands and feet.
    papers: bool,
    build: &'static Build,
    /// Side of what is added, and how its names begin: left 1, right -1, center 0.
    side: f64,
    prefix: &'static str,
    limbs: Vec<Limb>,
    /// Pose of each limb in the standing frame.
    poses: Vec<Pose>,
    sites: Vec<Site>,
}

impl Builder {
    fn named(&self, name: &str) -> String {
        format!("{}{name}", self.prefix)
    }

    /// A place on the side of what is added.
    fn aside(&self, [x, y, z]: [f64; 3]) -> Vec3 {
        Vec3::new(x, self.side * y, z)
    }

    /// Adds a limb whose joints' line is between two places. The x axis of its frame points to the `front` as far as possible. The
    /// ellipses of its joint are given in the standing frame.
    fn limb(
        &mut self,
        name: &str,
        surface: Surface,
        line: [Vec3; 2],
        front: Vec3,
        parent: Option<(usize, Joint)>,
        match_caps: [bool; 2],
    ) -> Result<usize, BodyError> {
        let (name, [start, end], [a0, b0, a1, b1]) = (self.named(name), surface.ends(line, self.side), surface.axes);
        let length = (end - start).length();
        let along = (end - start) / length;
        let x = (front - along * front.dot(along)).normalize();
        let rotation = Quat::from_mat3(&Mat3::from_cols(x, along.cross(x), along));
        let pose = Pose::from_parts(start, rotation);
        let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1)
            .map_err(|source| BodyError::Shape { key: format!("limbs.{name}"), source })?;
        let parent = parent.map(|(parent, joint)| {
            let parent_from_joint = self.poses[parent].inv_mul(&joint.parent_from_joint);
            (parent, Joint { parent_from_joint, limb_from_joint: pose.inv_mul(&joint.limb_from_joint), ..joint })
        });
        self.limbs.push(Limb { name, shape, parent, match_caps });
        self.poses.push(pose);
        Ok(self.limbs.len() - 1)
    }

    fn site(&mut self, name: &str, limb: usize, position: Vec3) {
        let position = self.poses[limb].inverse_transform_point(position);
        self.sites.push(Site { name: self.named(name), limb, position });
    }

    /// Adds the pelvis or torso, and the parts of the trunk above it. Returns the limbs that carry the legs and the arms.
    fn trunk(&mut self) -> Result<[usize; 2], BodyError> {
        let link = |name: &str, center: Vec3, semi_axis: f64, limits, motion| {
            joint(name, center, [Vec3::Y, Vec3::Z], [semi_axis; 2], limits, motion)
        };
        let vc7 = link("vc7", Vec3::Z * VC7, 0.02, [[-0.9, 1.0], [-0.7, 0.7], [-1.2, 1.2]], 0.15);
        let upright = |from: f64, to: f64| [Vec3::Z * from, Vec3::Z * to];
        let build = self.build;
        let [base, center, tip] = build.skull;
        let (front, none, top) = (Vec3::X, [false; 2], [false, true]);
        let [legs, arms, neck, skull] = if self.papers {
            let torso = self.limb("torso", TORSO, upright(0.490, 0.835), front, None, none)?;
            let head = self.limb("head", PAPERS_HEAD, upright(VC7, VC7 + 0.135), front, Some((torso, vc7)), top)?;
            [torso, torso, head, head]
        } else {
            let pelvis = self.limb("pelvis", build.pelvis, upright(0.485, WAIST), front, None, none)?;
            let spine = link("vl3", Vec3::Z * WAIST, 0.04, [[-0.5, 1.3], [-0.6, 0.6], [-0.8, 0.8]], 0.12);
            let chest = upright(WAIST, 0.830);
            let thorax = self.limb("thorax", build.thorax, chest, front, Some((pelvis, spine)), none)?;
            let neck = self.limb("neck", build.neck, upright(0.830, 0.910), front, Some((thorax, vc7)), none)?;
            let limits = [[-0.6, 0.6], [-0.4, 0.4], [-0.8, 0.8]];
            let skullbase = link("skullbase", Vec3::new(base, 0.0, SKULLBASE), 0.015, limits, 0.10);
            let head = self.limb("head", build.head, upright(0.880, 0.995), front, Some((neck, skullbase)), top)?;
            [pelvis, thorax, neck, head]
        };
        self.site("humanoid_root", legs, Vec3::new(build.root, 0.0, 0.535));
        self.site("vc7", neck, Vec3::Z * VC7);
        self.site("skullbase", skull, Vec3::new(base, 0.0, SKULLBASE));
        self.site("head_center", skull, Vec3::new(center, 0.0, 0.937));
        self.site("skull_tip", skull, Vec3::new(tip, 0.0, 0.997));
        Ok([legs, arms])
    }

    fn arm(&mut self, thorax: usize) -> Result<(), BodyError> {
        let (build, side) = (self.build, self.side);
        let shoulder = self.aside([build.arm, SHOULDER[0], SHOULDER[1]]);
        let elbow = shoulder - Vec3::Z * UPPER_ARM;
        let wrist = elbow - Vec3::Z * FOREARM;
        let carrier = if self.papers { thorax } else { self.clavicle(thorax)? };
        // The joint's y axis points backward: negative rotations about it raise the left arm sideways.
        let limits = [[-1.2, 3.2], mirrored([-3.2, 0.8], side), mirrored([-1.6, 1.6], side)];
        let link = joint(self.named("shoulder"), shoulder, hanging(), [0.0; 2], limits, 0.35);
        let line = [shoulder + Vec3::Z * DELTOID, elbow];
        let upper = self.limb("upperarm", build.upper_arm, line, Vec3::X, Some((carrier, link)), [false; 2])?;
        self.site("shoulder", upper, shoulder);
        // Without a hand, the forearm ends at the knuckles.
        let end = if self.papers { wrist - Vec3::Z * KNUCKLES } else { wrist };
        let (line, caps) = ([elbow, end], [false, self.papers]);
        let link = joint(self.named("elbow"), elbow, hanging(), [0.02, 0.0], [[-0.1, 2.7], [0.0; 2], [0.0; 2]], 0.45);
        let forearm = self.limb("forearm", build.forearm, line, Vec3::X, Some((upper, link)), caps)?;
        let mut last = forearm;
        if !self.papers {
            let limits = [[-1.2, 1.2], [-0.5, 0.5], [-1.5, 1.5]];
            let link = joint(self.named("wrist"), wrist, hanging(), [0.012; 2], limits, 0.3);
            let line = [wrist, wrist - Vec3::Z * HAND];
            last = self.limb("hand", HAND_SURFACE, line, Vec3::X, Some((forearm, link)), [false, true])?;
        }
        self.site("elbow", forearm, elbow);
        self.site("wrist", last, wrist);
        self.site("hand", last, wrist - Vec3::Z * HAND_CENTER);
        Ok(())
    }

    /// Adds a clavicle. It carries the arm and moves slightly on the chest: a raised arm raises its shoulder.
    fn clavicle(&mut self, thorax: usize) -> Result<usize, BodyError> {
        // The joint's x axis points forward: positive rotations about it raise the left shoulder.
        let limits = [mirrored([-0.15, 0.70], self.side), [-0.1, 0.1], [-0.4, 0.4]];
        let (name, center) = (self.named("sternoclavicular"), self.aside(STERNOCLAVICULAR));
        let link = joint(name, center, [Vec3::X, Vec3::Z], [0.0; 2], limits, 0.015);
        let line = self.build.slope.map(|place| self.aside(place));
        self.limb("clavicle", self.build.clavicle, line, Vec3::Z, Some((thorax, link)), [false; 2])
    }

    fn leg(&mut self, pelvis: usize) -> Result<(), BodyError> {
        let (build, side) = (self.build, self.side);
        let hip = self.aside([0.0, HIP[0], HIP[1]]);
        let knee = Vec3::new(0.0, hip.y, KNEE);
        let ankle = Vec3::new(0.0, hip.y, ANKLE);
        let limits = [[-0.6, 2.3], mirrored([-1.0, 0.5], side), mirrored([-0.8, 0.8], side)];
        let link = joint(self.named("hip"), hip, hanging(), [0.02, 0.005], limits, 0.25);
        let thigh = self.limb("thigh", build.thigh, [hip, knee], Vec3::X, Some((pelvis, link)), [false; 2])?;
        self.site("hip", thigh, hip);
        // A hanging calf bends backward, which is a rotation about the axis to the left.
        let limits = [[-0.1, 2.6], [0.0; 2], [0.0; 2]];
        let link = joint(self.named("knee"), knee, [Vec3::Y, -Vec3::Z], [0.028, 0.0], limits, 0.30);
        let end = if self.papers { knee - Vec3::Z * KNEE } else { ankle };
        let calf = self.limb("calf", build.calf, [knee, end], Vec3::X, Some((thigh, link)), [false, self.papers])?;
        self.site("knee", calf, knee);
        self.site("ankle", calf, ankle);
        if !self.papers {
            let [heel, toe] = build.foot;
            let line = [Vec3::new(-HEEL, hip.y, heel), Vec3::new(TOE, hip.y, toe)];
            let limits = [[-0.8, 0.6], [-0.4, 0.4], [-0.4, 0.4]];
            let link = joint(self.named("ankle"), ankle, hanging(), [0.012; 2], limits, 0.20);
            let foot = self.limb("foot", FOOT_SURFACE, line, Vec3::Z, Some((calf, link)), [true, true])?;
            self.site("toe", foot, Vec3::new(TOE, hip.y, 0.012));
        }
        Ok(())
    }
}

/// A joint whose ellipses are given in the standing frame. Its frame has x along `flexion` and z along `along`; limits and motion in
/// radians.
fn joint(
    name: impl Into<String>,
    center: Vec3,
    [flexion, along]: [Vec3; 2],
    semi_axes: [f64; 2],
    limits: [[f64; 2]; 3],
    motion: f64,
) -> Joint {
    let axes = Mat3::from_cols(flexion, along.cross(flexion), along);
    let pose = Pose::from_parts(center, Quat::from_mat3(&axes));
    let (parent_from_joint, limb_from_joint) = (pose, pose);
    let (weight, limits) = (1.0, Some(limits));
    Joint { name: name.into(), parent_from_joint, limb_from_joint, semi_axes, weight, limits, motion }
}

/// Flexion and direction of the joints of a hanging limb.
fn hanging() -> [Vec3; 2] {
    [-Vec3::Y, -Vec3::Z]
}

/// A range for the left side (`side` = 1), mirrored for the right one.
fn mirrored([low, high]: [f64; 2], side: f64) -> [f64; 2] {
    if side > 0.0 { [low, high] } else { [-high, -low] }
}

impl Body {
    /// A human of a stature in meters, standing with hanging arms at rest. Below 1.55 m the proportions are those of a child.
    ///
    /// Limb frames have z from the proximal to the distal end, x forward (feet: up) in the standing pose. Hinges rotate about the
    /// joint frame's x axis; a positive angle is flexion.
    pub fn human(stature: f64, model: HumanModel) -> Result<Self, BodyError> {
        Unexpected::unless((0.3..=3.0).contains(&stature), "stature", "meters from 0.3 to 3.0", stature)?;
        let papers = model == HumanModel::Papers;
        let build = if model == HumanModel::Measured { &MEASURED } else { &ANSUR };
        let (limbs, poses, sites) = Default::default();
        let mut builder = Builder { papers, build, side: 0.0, prefix: "", limbs, poses, sites };
        let [legs, arms] = builder.trunk()?;
        for (prefix, side) in [("l_", 1.0), ("r_", -1.0)] {
            (builder.prefix, builder.side) = (prefix, side);
            builder.arm(arms)?;
            builder.leg(legs)?;
        }
        Body::new("human", builder.limbs, builder.sites)?.scaled_to(stature)
    }
}
