//! Distances of places in the world from the limbs of the posed body.

use super::Tracker;
use crate::error::TrackError;
use crate::math::Points;
use crate::observation::frame::PointSlice;
use crate::shape::SurfaceBatch;

impl Tracker {
    /// Signed distances of world points to the surface of every limb, metres, negative inside: limb by limb, a point each.
    pub fn limb_distances(&self, points: PointSlice) -> Result<Vec<Vec<f32>>, TrackError> {
        if !self.started {
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
            queries.push((point - self.origin).to_array().map(|value| value as f32));
        }
        let mut surface = SurfaceBatch::default();
        let limbs = self.body.limbs().iter().zip(&self.poses);
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
