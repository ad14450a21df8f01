//! What can be asked of a tracker between frames: body, configuration, last estimate, distances of places from the posed body.

use super::Tracker;
use super::estimate::Estimate;
use crate::body::Body;
use crate::config::Config;
use crate::error::TrackError;
use crate::math::{Points, Pose};
use crate::observation::frame::PointSlice;
use crate::regions::RegionLine;
use crate::shape::SurfaceBatch;

impl Tracker {
    /// The lines along which the last step looked for edges of colours in a camera's picture.
    pub fn region_lines(&self, camera: u16) -> impl Iterator<Item = RegionLine> + '_ {
        self.fit.regions().lines(camera)
    }

    /// The body in its current sizes.
    pub fn body(&self) -> &Body {
        &self.model.body
    }

    /// The parameters.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The last estimate.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// The poses expected at a time to come, world frame; none without a pose.
    pub(crate) fn expect(&self, stamp: f64, expected: &mut Vec<Pose>) {
        expected.clear();
        if self.is_started() {
            self.motion.expect(&self.model.body, stamp, self.config.prediction, expected);
        }
    }

    /// A pose was set.
    pub(super) fn is_started(&self) -> bool {
        !self.motion.poses.is_empty()
    }

    /// Signed distances of world points to the surface of every limb, metres, negative inside: limb by limb, a point each.
    pub fn limb_distances(&self, points: PointSlice) -> Result<Vec<Vec<f32>>, TrackError> {
        if !self.is_started() {
            return Err(TrackError::NotInitialised);
        }
        let mut queries = Points::default();
        for index in 0..points.len() {
            let point = points.get(index);
            if !point.is_finite() {
                return Err(TrackError::measurement(
                    "points",
                    "finite metres",
                    format!("{:?} in row {index}", point.to_array()),
                ));
            }
            queries.push((point - self.motion.origin).to_array().map(|value| value as f32));
        }
        let mut surface = SurfaceBatch::default();
        let limbs = self.model.body.limbs().iter().zip(&self.motion.poses);
        Ok(limbs
            .map(|(limb, pose)| {
                limb.shape.closest_points(pose, &queries, &mut surface);
                surface.signed_distance[..points.len()].to_vec()
            })
            .collect())
    }

    /// Signed distances of world points to the surface of the posed body, metres, negative inside.
    pub fn distance(&self, points: PointSlice) -> Result<Vec<f32>, TrackError> {
        let mut least = vec![f32::INFINITY; points.len()];
        for distances in self.limb_distances(points)? {
            for (least, distance) in least.iter_mut().zip(distances) {
                *least = least.min(distance);
            }
        }
        Ok(least)
    }
}
