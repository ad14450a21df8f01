//! Queries of a tracker between frames: body, configuration, last estimate, distances of points from the posed body.

use super::BodyTracker;
use super::estimate::Estimate;
use crate::body::Body;
use crate::config::Config;
use crate::error::{TrackError, Unexpected};
use crate::math::{Aabb, Points, Pose, Vec3, shifted};
use crate::observation::frame::{Frame, PointSlice, check_poses};
use crate::regions::{ColorRegions, Posed, RegionLine};
use crate::shape::SurfaceBatch;

/// Length of the line of sight that is evaluated, meters: more than a trunk's width, and half a forearm's.
const SEARCHED_DEPTH: f64 = 0.75;
/// Number of samples along it.
const PLACES: usize = 30;
/// Bound on the error of distances in single precision: meters, and fraction of the distance.
const ROUNDING: f64 = 1e-3;

impl BodyTracker {
    /// Returns the lines along which the last step searched for color edges in a camera's picture.
    pub fn region_lines(&self, camera: u16) -> impl Iterator<Item = RegionLine> + '_ {
        self.fit.regions.lines(camera)
    }

    /// Returns the probability, 0 to 1, that each pixel of a frame's pictures shows the body, by the learned colors: picture
    /// after picture, row by row. The body is at `poses` (world frame), or at its current poses with `None`. Cameras without
    /// learned colors learn them at these poses.
    pub fn segment(&mut self, frame: &Frame, poses: Option<&[Pose]>) -> Result<Vec<Vec<f32>>, TrackError> {
        self.at_poses(frame, poses, ColorRegions::segment)
    }

    /// Learns the body's colors in a frame's pictures, with the body at `poses` (world frame), or at its current poses with
    /// `None`.
    pub fn learn_colors(&mut self, frame: &Frame, poses: Option<&[Pose]>) -> Result<(), TrackError> {
        self.at_poses(frame, poses, ColorRegions::learn_at)
    }

    fn at_poses<R>(
        &mut self,
        frame: &Frame,
        poses: Option<&[Pose]>,
        work: impl FnOnce(&mut ColorRegions, Posed) -> R,
    ) -> Result<R, TrackError> {
        match poses {
            Some(poses) => check_poses(&self.model.body, poses)?,
            None => self.started()?,
        }
        frame.check(&self.model.body, None)?;
        self.check_colors(frame)?;
        let current: Vec<Pose> = self.motion.world_from_limb().collect();
        let (body, previous, origin) = (&self.model.body, &[][..], Vec3::ZERO);
        Ok(work(&mut self.fit.regions, Posed { frame, body, poses: poses.unwrap_or(&current), previous, origin }))
    }

    /// Returns the body in its current sizes.
    pub fn body(&self) -> &Body {
        &self.model.body
    }

    /// Returns the configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Returns the last estimate.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Predicts the poses at a future time, world frame. `expected` is empty without a pose.
    pub(crate) fn predict(&mut self, stamp: f64, expected: &mut Vec<Pose>) {
        expected.clear();
        if self.is_started() {
            let origin = self.motion.origin;
            let poses = self.motion.expect(&self.model.body, stamp, self.config.prediction);
            expected.extend(poses.iter().map(|pose| shifted(pose, -origin)));
        }
    }

    /// Whether the tracker has a pose.
    pub(super) fn is_started(&self) -> bool {
        !self.motion.poses.is_empty()
    }

    /// Returns an error without a pose.
    pub(super) fn started(&self) -> Result<(), TrackError> {
        if self.is_started() { Ok(()) } else { Err(TrackError::NotInitialized) }
    }

    /// Returns the signed distances of world points to the surface of every limb, meters, negative inside: one vector for each
    /// limb, with one value for each point.
    pub fn limb_distances(&self, points: PointSlice) -> Result<Vec<Vec<f32>>, TrackError> {
        let queries = self.queries(points)?;
        let mut surface = SurfaceBatch::default();
        let limbs = self.model.body.limbs().iter().zip(&self.motion.poses);
        Ok(limbs
            .map(|(limb, pose)| {
                limb.shape.closest_points(pose, &queries, &mut surface);
                surface.signed_distance[..points.len()].to_vec()
            })
            .collect())
    }

    /// Returns the signed distances of world points to the surface of the posed body, meters, negative inside.
    pub fn distance(&self, points: PointSlice) -> Result<Vec<f32>, TrackError> {
        let queries = self.queries(points)?;
        let mut least = vec![f32::INFINITY; points.len()];
        let (mut surface, mut near, mut chosen) = (SurfaceBatch::default(), Points::default(), Vec::new());
        for (limb, pose) in self.model.body.limbs().iter().zip(&self.motion.poses) {
            // A point outside of the limb's box that is farther from the box than from another limb needs no closest point.
            // Inside the box it may have a smaller signed distance.
            let bounds = limb.shape.aabb(pose);
            [&mut near.x, &mut near.y, &mut near.z].into_iter().for_each(Vec::clear);
            chosen.clear();
            for (index, least) in least.iter().enumerate() {
                let point = [queries.x[index], queries.y[index], queries.z[index]];
                let place = Vec3::from_array(point.map(f64::from));
                let away = (bounds.mins - place).max(place - bounds.maxs).max(Vec3::ZERO).length();
                if away - ROUNDING * (1.0 + away) < f64::from(least.max(0.0)) {
                    near.push(point);
                    chosen.push(index);
                }
            }
            limb.shape.closest_points(pose, &near, &mut surface);
            for (index, distance) in chosen.iter().zip(&surface.signed_distance) {
                least[*index] = least[*index].min(*distance);
            }
        }
        Ok(least)
    }

    /// Returns for each site position the length of the line of sight, towards the camera's focal point, that lies inside the
    /// posed body; world frame, meters. Where the body occludes a joint, a network guesses its position with no less confidence.
    pub fn body_before(&self, sites: &[Vec3], camera: Vec3) -> Result<Vec<f64>, TrackError> {
        self.started()?;
        let poses: Vec<Pose> = self.motion.world_from_limb().map(|pose| pose.inverse()).collect();
        let limbs = || self.model.body.limbs().iter().zip(&poses);
        let hidden = |site: &Vec3| {
            let towards = camera - *site;
            let reach = towards.length().min(SEARCHED_DEPTH);
            let direction = towards / towards.length().max(1e-9);
            let mut inside = [false; PLACES];
            let far = |step: usize| (step as f64 + 0.5) / PLACES as f64 * reach;
            for (limb, limb_from_world) in limbs() {
                let (start, along) = (limb_from_world.transform_point(*site), limb_from_world.rotation * direction);
                // Most limbs do not meet the line of sight.
                let line = Aabb::from_points([0, PLACES - 1].map(|step| start + far(step) * along));
                let bounds = limb.shape.local_aabb().enlarged(ROUNDING);
                if (line.maxs.cmplt(bounds.mins) | line.mins.cmpgt(bounds.maxs)).any() {
                    continue;
                }
                for (step, inside) in inside.iter_mut().enumerate() {
                    *inside = *inside || limb.shape.contains(start + far(step) * along);
                }
            }
            inside.iter().filter(|inside| **inside).count() as f64 / PLACES as f64 * reach
        };
        Ok(sites.iter().map(hidden).collect())
    }

    /// Returns world points in the working frame of the posed body.
    fn queries(&self, points: PointSlice) -> Result<Points, TrackError> {
        self.started()?;
        let mut queries = Points::default();
        for index in 0..points.len() {
            let point = points.get(index);
            let found = format_args!("{:?} in row {index}", point.to_array());
            Unexpected::unless(point.is_finite(), "points", "finite meters", found)?;
            queries.push((point - self.motion.origin).as_vec3().to_array());
        }
        Ok(queries)
    }
}
