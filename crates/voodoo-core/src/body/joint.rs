//! Elastic-band joints (K07 section 4).

use crate::math::{Pose, Vec3};

/// A joint between a limb and its parent: one ellipse fixed to both of them.
///
/// The ellipse lies in the x-y plane of the joint frame. Both semi-axes zero: universal joint, one band. One positive:
/// hinge about that axis, two bands at its ends. Both positive: elliptic joint, four bands at the ends of the main axes.
/// Longer axes make the joint stiffer, a larger weight makes it tighter (K07 4.2).
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Joint, JointKind};
///
/// let elbow = Joint {
///     name: "l_elbow".into(),
///     parent_from_joint: Pose::from_translation(Vec3::Z * 0.3),
///     limb_from_joint: Pose::IDENTITY,
///     semi_axes: [0.05, 0.0],
///     weight: 1.0,
///     limits: Some([[0.0, 2.5], [0.0, 0.0], [0.0, 0.0]]),
///     motion: 0.3,
/// };
/// assert_eq!((elbow.kind(), elbow.band_points().count()), (JointKind::Hinge, 2));
/// let shoulder = Joint { semi_axes: [0.0, 0.0], limits: None, ..elbow };
/// assert_eq!((shoulder.kind(), shoulder.band_points().count()), (JointKind::Universal, 1));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, usually that of the site at its center (`l_elbow`).
    pub name: String,
    /// The ellipse on the parent.
    pub parent_from_joint: Pose,
    /// The ellipse on the limb itself.
    pub limb_from_joint: Pose,
    /// Semi-axes along x and y of the joint frame, meters.
    pub semi_axes: [f64; 2],
    /// Strength relative to the other joints of a limb.
    pub weight: f64,
    /// Minimum and maximum of each component of the joint's rotation vector (joint frame, radians); `None`: free.
    pub limits: Option<[[f64; 2]; 3]>,
    /// Standard deviation of the joint's unpredicted rotation in 1/30 s, radians.
    pub motion: f64,
}

/// The cases of K07 figure 3.
///
/// The semi-axes of a [`Joint`] select it; an example is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Three free rotations.
    Universal,
    /// One free rotation, about the joint frame's x axis (or y, when only the second semi-axis is positive).
    Hinge,
    /// Three restricted rotations.
    Elliptic,
}

impl Joint {
    /// The kind of joint that the semi-axes define.
    pub fn kind(&self) -> JointKind {
        match self.semi_axes.map(|axis| axis > 0.0) {
            [false, false] => JointKind::Universal,
            [true, true] => JointKind::Elliptic,
            _ => JointKind::Hinge,
        }
    }

    /// Ends of the bands in the joint frame. They are the same points on both limbs when the joint is closed.
    pub fn band_points(&self) -> impl Iterator<Item = Vec3> + use<> {
        let [a, b] = self.semi_axes;
        let (points, count) = match self.kind() {
            JointKind::Universal => ([Vec3::ZERO; 4], 1),
            JointKind::Hinge => {
                let end = Vec3::new(a, b, 0.0);
                ([end, -end, Vec3::ZERO, Vec3::ZERO], 2)
            }
            JointKind::Elliptic => ([Vec3::X * a, Vec3::X * -a, Vec3::Y * b, Vec3::Y * -b], 4),
        };
        points.into_iter().take(count)
    }

    /// Pose of the limb in its parent when the bands have length zero and the joint rotation is zero.
    pub(crate) fn parent_from_limb_at_rest(&self) -> Pose {
        self.parent_from_joint * self.limb_from_joint.inverse()
    }
}
