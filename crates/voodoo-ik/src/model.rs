//! A body, or a part of one, as a chain with exact joints. The unknowns are the vector of joint angles.

use voodoo_core::kinematics::hinge_axis;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
use voodoo_core::{Body, BodyError, JointKind, Limb, Unexpected};

/// How a link moves relative to its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// Not at all.
    Rigid,
    /// Three translations and a rotation vector.
    Free,
    /// One angle about an axis of the joint frame.
    Hinge(Vec3),
    /// A rotation vector in the joint frame on the parent.
    Ball,
}

/// One limb of the chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Index of the limb in the body.
    pub limb: usize,
    /// The parent link; `None`: the base.
    pub parent: Option<usize>,
    /// Joint frame on the parent.
    pub parent_from_joint: Pose,
    /// Inverse of the joint frame on the limb.
    pub joint_from_limb: Pose,
    /// The degrees of freedom of its joint.
    pub turn: Turn,
    /// Its first unknown.
    pub start: usize,
    /// The unknowns that move it.
    pub(super) movers: Vec<usize>,
}

/// The chain: everything that stays constant while it moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChainModel {
    links: Vec<Link>,
    names: Vec<String>,
    limits: Vec<[f64; 2]>,
}

/// Derivative of the world position of a point `x` on any limb distal to the joint: `omega x x + v` for a unit rate of the
/// unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Angular velocity, world axes.
    pub omega: Vec3,
    /// Velocity at the world's origin.
    pub v: Vec3,
}

/// Poses and derivatives at one vector of angles; memory to be reused.
#[derive(Clone, Debug, Default)]
pub struct Kinematics {
    /// World pose of every link.
    pub poses: Vec<Pose>,
    /// One column per unknown.
    pub columns: Vec<Column>,
}

impl ChainModel {
    /// Builds the chain of the chosen limbs of a body (all when `limbs` is empty). The limbs must be connected: each but the
    /// first is the child of another one.
    ///
    /// With `free_root`, position and rotation vector of the first limb in the base frame are six unknowns. Without it, the base
    /// frame is that of the first limb's parent, or of the limb itself where the body has no parent of it.
    pub fn new(body: &Body, limbs: &[usize], free_root: bool) -> Result<Self, BodyError> {
        if let Some(unknown) = limbs.iter().find(|limb| **limb >= body.limbs().len()) {
            return Err(Unexpected::new("limbs", "indices of limbs", unknown).into());
        }
        let mut model = Self::default();
        let is_chosen = |limb: &usize| limbs.is_empty() || limbs.contains(limb);
        for (limb, description) in body.limbs().iter().enumerate().filter(|(limb, _)| is_chosen(limb)) {
            model.add(limb, description, free_root)?;
        }
        Ok(model)
    }

    fn add(&mut self, limb: usize, description: &Limb, free_root: bool) -> Result<(), BodyError> {
        let (start, joint) = (self.names.len(), &description.parent);
        let parent = joint.as_ref().and_then(|(index, _)| self.links.iter().position(|link| link.limb == *index));
        let (valid, expected) =
            (parent.is_some() || self.links.is_empty(), "limbs that hang together, parents included");
        Unexpected::unless(valid, "limbs", expected, format_args!("{} without its parent", description.name))?;
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let first = self.links.is_empty();
        let (mut parent_from_joint, mut joint_from_limb) = (Pose::IDENTITY, Pose::IDENTITY);
        let turn = match joint {
            _ if first && free_root => {
                self.names.extend(["x", "y", "z", "rx", "ry", "rz"].map(|axis| format!("root_{axis}")));
                self.limits.extend([free; 6]);
                Turn::Free
            }
            None => Turn::Rigid,
            Some((_, joint)) => {
                (parent_from_joint, joint_from_limb) = (joint.parent_from_joint, joint.limb_from_joint.inverse());
                if joint.kind() == JointKind::Hinge {
                    let axis = hinge_axis(joint);
                    self.names.push(format!("{}_flexion", joint.name));
                    self.limits.push(joint.limits.map_or(free, |limits| limits[usize::from(axis == Vec3::Y)]));
                    Turn::Hinge(axis)
                } else {
                    self.names.extend(["rx", "ry", "rz"].map(|axis| format!("{}_{axis}", joint.name)));
                    self.limits.extend(joint.limits.unwrap_or([free; 3]));
                    Turn::Ball
                }
            }
        };
        let mut movers = parent.map_or_else(Vec::new, |parent| self.links[parent].movers.clone());
        movers.extend(start..self.names.len());
        self.links.push(Link { limb, parent, parent_from_joint, joint_from_limb, turn, start, movers });
        Ok(())
    }

    /// The limbs, parents first.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Names of the unknowns: `root_x` ... `root_rz`; `NAME_flexion` for a hinge; `NAME_rx`, `NAME_ry`, `NAME_rz` otherwise.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Least and greatest value of every unknown; infinite where there is no limit.
    pub fn limits(&self) -> &[[f64; 2]] {
        &self.limits
    }

    /// Number of unknowns.
    pub fn freedoms(&self) -> usize {
        self.names.len()
    }

    /// The link of a limb of the body.
    pub fn link_of(&self, limb: usize) -> Option<usize> {
        self.links.iter().position(|link| link.limb == limb)
    }

    /// Forward kinematics and its derivative (R07 eq. 10): poses of all links and the screw of every unknown.
    pub fn place(&self, world_from_base: &Pose, angles: &[f64], at: &mut Kinematics) {
        let Kinematics { poses, columns } = at;
        poses.clear();
        columns.clear();
        for link in &self.links {
            let world_from_parent = link.parent.map_or(*world_from_base, |parent| poses[parent]);
            let mut joint = world_from_parent * link.parent_from_joint;
            let value = &angles[link.start..];
            let rotation = match link.turn {
                Turn::Rigid => Quat::IDENTITY,
                Turn::Hinge(axis) => {
                    let (sine, cosine) = (0.5 * value[0]).sin_cos();
                    let omega = joint.rotation * axis;
                    columns.push(Column { omega, v: joint.translation.cross(omega) });
                    Quat::from_xyzw(axis.x * sine, axis.y * sine, axis.z * sine, cosine)
                }
                Turn::Ball => ball(Vec3::from_slice(value), &joint, columns),
                Turn::Free => {
                    let axes = Mat3::from_quat(joint.rotation);
                    columns.extend([axes.x_axis, axes.y_axis, axes.z_axis].map(|v| Column { omega: Vec3::ZERO, v }));
                    joint.translation += joint.rotation * Vec3::from_slice(value);
                    ball(Vec3::from_slice(&value[3..]), &joint, columns)
                }
            };
            poses.push(Pose::from_parts(joint.translation, joint.rotation * rotation) * link.joint_from_limb);
        }
    }

    /// Brings rotation vectors without limits back to at most pi, so that they stay away from the singularity at 2 pi.
    pub fn normalize(&self, angles: &mut [f64]) {
        for link in &self.links {
            let start = match link.turn {
                Turn::Ball => link.start,
                Turn::Free => link.start + 3,
                _ => continue,
            };
            if self.limits[start..start + 3].iter().any(|[low, high]| low.is_finite() || high.is_finite()) {
                continue;
            }
            let v = Vec3::from_slice(&angles[start..]);
            let angle = v.length();
            if angle > std::f64::consts::PI {
                let turns = (angle / std::f64::consts::TAU).round();
                let shorter = v * (1.0 - turns * std::f64::consts::TAU / angle);
                angles[start..start + 3].copy_from_slice(&shorter.to_array());
            }
        }
    }
}

/// Rotation of a ball joint; pushes its three columns, `J_left(v) e_i` about the joint's center.
fn ball(v: Vec3, joint: &Pose, columns: &mut Vec<Column>) -> Quat {
    let (rotation, b, c) = turn(v);
    let axes = Mat3::from_quat(joint.rotation);
    for e in Vec3::AXES {
        let first = v.cross(e);
        let omega = axes * (e + b * first + c * v.cross(first));
        columns.push(Column { omega, v: joint.translation.cross(omega) });
    }
    rotation
}

/// Rotation of a rotation vector and the two factors of its left Jacobian `I + b [v] + c [v]^2`, `b = (1 - cos t)/t^2`,
/// `c = (t - sin t)/t^3`.
fn turn(v: Vec3) -> (Quat, f64, f64) {
    let square = v.length_squared();
    if square < 1e-6 {
        let half = 0.5 - square / 48.0;
        let rotation = Quat::from_xyzw(v.x * half, v.y * half, v.z * half, 1.0 - square / 8.0).normalize();
        return (rotation, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0);
    }
    let angle = square.sqrt();
    let (sine, cosine) = (0.5 * angle).sin_cos();
    let k = sine / angle;
    // 1 - cos t = 2 sin^2(t/2), sin t = 2 sin(t/2) cos(t/2)
    let c = (angle - 2.0 * sine * cosine) / (square * angle);
    (Quat::from_xyzw(v.x * k, v.y * k, v.z * k, cosine), 2.0 * sine * sine / square, c)
}
