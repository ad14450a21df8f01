//! Results of a step.

use crate::math::{Pose, Vec3};
use crate::uncertainty::Covariances;

/// How much a pose can be relied on.
///
/// [`Estimate`] has an example.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum Status {
    /// Measurements support the pose.
    Tracking,
    /// More than a quarter of the limbs are not measured, or the measurements of a source are 15 cm from the pose, root mean
    /// square.
    Degraded,
    /// Few measurements support the pose, or the observed surface is flat.
    Lost,
    /// There is no pose; the tracker searches for the body.
    #[default]
    Searching,
}

impl Status {
    /// All values.
    pub const ALL: &[Self] = &[Self::Tracking, Self::Degraded, Self::Lost, Self::Searching];

    /// Returns the name used in results and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::Degraded => "degraded",
            Self::Lost => "lost",
            Self::Searching => "searching",
        }
    }
}

/// How much the pose of one limb can be relied on.
///
/// [`Estimate`] has an example.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum LimbStatus {
    /// Measurements support it.
    Measured,
    /// Occluded, out of view, or without evidence that another limb would not explain as well: given by its joints and the
    /// prediction.
    Inferred,
    /// It should be visible in its pose, but is not.
    #[default]
    Lost,
}

impl LimbStatus {
    /// All values.
    pub const ALL: &[Self] = &[Self::Measured, Self::Inferred, Self::Lost];

    /// Returns the name used in results and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Inferred => "inferred",
            Self::Lost => "lost",
        }
    }
}

/// Contribution of one source to a step.
///
/// [`Estimate`] has an example.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub struct SourceReport {
    /// Number of measurements of the source that were candidates.
    pub count: usize,
    /// Number of those that matched the body.
    pub inliers: usize,
    /// Sum of the weights of the matched measurements.
    pub weight: f64,
    /// Root of the weighted mean of the squared distances of the matched measurements, meters; NaN without any.
    pub residual: f64,
}

/// Pose and quality of one frame. World frame, meters, seconds.
///
/// ```
/// use voodoo_core::math::Pose;
/// use voodoo_core::{Body, Config, Frame, HumanModel, LimbStatus, PositionRelation, Status, Tracker};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let standing = body.rest_pose(Pose::IDENTITY);
/// let mut tracker = Tracker::new(body.clone(), Config::default())?;
/// tracker.reset_pose(&standing)?;
/// let marker = |site| {
///     let position = body.site_position(&standing, site);
///     PositionRelation { site, position, weight: 20.0, bias: 0.0, source: 0 }
/// };
/// let markers: Vec<_> = (0..body.sites().len()).map(marker).collect();
/// let estimate = tracker.step(&Frame::empty(0.0).with_positions(&markers))?;
///
/// assert_eq!(estimate.status, Status::Tracking);
/// assert_eq!(estimate.limb_status[body.limb_index("l_forearm")?], LimbStatus::Measured);
/// assert_eq!(estimate.sources[0].inliers, markers.len());
/// let wrist = body.site_index("l_wrist")?;
/// let variance = estimate.covariances.sites[wrist]; // 3 x 3, m^2
/// println!("{}, standard deviation along x {:.3} m", estimate.sites[wrist], variance.x_axis.x.sqrt());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct Estimate {
    /// Time of the frame; NaN after a reset and before the first one.
    pub stamp: f64,
    /// Reliability of the pose.
    pub status: Status,
    /// Reliability of every limb's pose.
    pub limb_status: Vec<LimbStatus>,
    /// Probability that the distal end of every limb is within 10 cm of its position, fitted to depth images; NaN before the first
    /// frame. The status is `Measured` from 0.8 on.
    pub limb_probability: Vec<f64>,
    /// Pose of every limb.
    pub world_from_limb: Vec<Pose>,
    /// Position of every site.
    pub sites: Vec<Vec3>,
    /// Weighted mean of the squared distances of all measurements to the final pose; NaN without any.
    pub mean_squared_distance: f64,
    /// ICP steps used.
    pub steps: usize,
    /// Number of matched points of every limb.
    pub limb_points: Vec<usize>,
    /// Root of the mean squared distance of every limb's points, meters; NaN without points.
    pub limb_residual: Vec<f64>,
    /// Distance between the two centers of the joint of every limb to its parent; 0 for the root.
    pub joint_gaps: Vec<f64>,
    /// Contribution of each source.
    pub sources: Vec<SourceReport>,
    /// Covariances of limb poses, joint angles and site positions.
    pub covariances: Covariances,
}

impl Default for Estimate {
    /// Returns the estimate of a tracker without a pose: nothing measured.
    fn default() -> Self {
        Self {
            stamp: f64::NAN,
            status: Status::default(),
            limb_status: Vec::new(),
            limb_probability: Vec::new(),
            world_from_limb: Vec::new(),
            sites: Vec::new(),
            mean_squared_distance: f64::NAN,
            steps: 0,
            limb_points: Vec::new(),
            limb_residual: Vec::new(),
            joint_gaps: Vec::new(),
            sources: Vec::new(),
            covariances: Covariances::default(),
        }
    }
}
