//! Results of a step.

use crate::association::correspondence::{Correspondences, EdgePair, SitePair};
use crate::body::Body;
use crate::fit::Motion;
use crate::math::{Pose, Vec3, refill};
use crate::observation::candidates::Candidates;
use crate::uncertainty::Covariances;

/// How much a pose can be relied on.
///
/// [`Estimate`] has an example.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum Status {
    /// Measurements support the pose.
    Tracking,
    /// More than a quarter of the limbs are not measured, the measurements of a source are 15 cm from the pose, root mean square,
    /// or no measurement matches it.
    Degraded,
    /// Few measurements support the pose, or the observed surface is flat.
    Lost,
    /// There is no pose; the tracker searches for the body.
    #[default]
    Searching,
}

impl Status {
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
/// let estimate = tracker.step(&Frame { positions: &markers, ..Frame::empty(0.0) })?;
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

impl Estimate {
    /// Fills in everything but stamp, steps and status, without allocation once its buffers have grown.
    pub(super) fn fill(
        &mut self,
        body: &Body,
        motion: &Motion,
        correspondences: &Correspondences,
        candidates: &Candidates,
    ) {
        let (estimate, poses) = (self, &motion.poses);
        let measured = correspondences.mean_squared_distance().or_else(|| correspondences.mean_squared_edge());
        estimate.mean_squared_distance = measured.unwrap_or(f64::NAN);
        refill(&mut estimate.world_from_limb, motion.world_from_limb());
        refill(
            &mut estimate.sites,
            (0..body.sites().len()).map(|site| body.site_position(&estimate.world_from_limb, site)),
        );
        estimate.limb_points.clear();
        estimate.limb_residual.clear();
        estimate.joint_gaps.clear();
        for (index, limb) in body.limbs().iter().enumerate() {
            let matches = correspondences.limbs.get(index);
            let count = matches.map_or(0, |matches| matches.accepted());
            let (weight, sum) = matches.map_or((0.0, 0.0), |matches| matches.weighed());
            estimate.limb_points.push(count);
            estimate.limb_residual.push((sum / weight).sqrt());
            estimate.joint_gaps.push(limb.parent.as_ref().map_or(0.0, |(parent, joint)| {
                let on_parent = poses[*parent] * joint.parent_from_joint.translation;
                (on_parent - poses[index] * joint.limb_from_joint.translation).length()
            }));
        }
        let sources = &mut estimate.sources;
        sources.clear();
        for run in candidates.source.chunk_by(|source, next| source == next) {
            entry(sources, run[0]).count += run.len();
        }
        for matches in &correspondences.limbs {
            for ((candidate, weight), distance) in
                matches.candidate.iter().zip(&matches.weight).zip(&matches.surface.signed_distance)
            {
                if *weight > 0.0 {
                    entry(sources, candidates.source[*candidate as usize])
                        .add(f64::from(*weight), f64::from(distance * distance));
                }
            }
        }
        let of_site = |pair: &SitePair| (pair.source, pair.base_weight, (pair.x - pair.p).length_squared());
        let of_edge = |pair: &EdgePair| (pair.source, pair.information, pair.distance * pair.distance);
        let pairs = correspondences.sites.iter().map(of_site).chain(correspondences.regions.iter().map(of_edge));
        for (source, weight, square) in pairs {
            let report = entry(sources, source);
            report.count += 1;
            report.add(weight, square);
        }
        for source in sources {
            source.residual = (source.residual / source.weight).sqrt();
        }
    }
}

fn entry(sources: &mut Vec<SourceReport>, source: u16) -> &mut SourceReport {
    let index = usize::from(source);
    if sources.len() <= index {
        sources.resize(index + 1, SourceReport::default());
    }
    &mut sources[index]
}

impl SourceReport {
    /// Counts one matched measurement; `residual` holds the weighted sum until all are counted.
    fn add(&mut self, weight: f64, square: f64) {
        self.inliers += 1;
        self.weight += weight;
        self.residual += weight * square;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::testing::{before_wall, moved, standing, with_context, without_background};

    /// Estimate of the standing body and number of candidates, when the depth image shows it `off` meters behind its pose.
    fn filled(off: f64) -> (Estimate, usize) {
        let (model, poses) = standing();
        let config = without_background();
        let pixels = before_wall(&model.body, &moved(&poses, off * Vec3::Z));
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &poses, true);
            let mut motion = Motion::default();
            (motion.poses, motion.origin) = (poses.clone(), Vec3::new(1.0, 2.0, 3.0));
            let mut estimate = Estimate::default();
            // A second call replaces the results of the first.
            for _ in 0..2 {
                estimate.fill(&model.body, &motion, &fit.correspondences, context.observation.candidates);
            }
            (estimate, context.observation.candidates.len())
        })
    }

    #[test]
    fn poses_and_sites_are_in_the_world_and_joints_are_closed() {
        let (model, poses) = standing();
        let (estimate, _) = filled(0.0);
        let origin = Vec3::new(1.0, 2.0, 3.0);
        for (found, pose) in estimate.world_from_limb.iter().zip(&poses) {
            assert!(found.translation.distance(pose.translation + origin) < 1e-12);
        }
        for (index, site) in estimate.sites.iter().enumerate() {
            assert!(site.distance(model.body.site_position(&poses, index) + origin) < 1e-9);
        }
        assert!(estimate.joint_gaps.len() == poses.len() && estimate.joint_gaps.iter().all(|gap| *gap < 1e-9));
    }

    #[test]
    fn a_source_is_reported_once_with_all_it_gave_and_what_of_it_fits() {
        let [near, far] = [0.0, 0.04].map(|off| {
            let (estimate, candidates) = filled(off);
            assert_eq!(estimate.sources.len(), 1);
            let source = estimate.sources[0];
            assert_eq!((source.count, source.inliers), (candidates, estimate.limb_points.iter().sum()));
            assert!(source.inliers > 0 && source.inliers <= source.count);
            assert!((source.residual.powi(2) - estimate.mean_squared_distance).abs() < 1e-6);
            source.residual
        });
        assert!(near < 0.005 && (0.02..0.06).contains(&far), "{near} and {far} m");
    }
}
