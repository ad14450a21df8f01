//! Assigns each pixel and each free point of a frame to the person whose surface explains it.

use std::ops::RangeBounds;

use crate::body::Body;
use crate::math::{Aabb, Points, Pose, Vec3, refill, reset, shifted};
use crate::observation::background::{Background, Backgrounds};
use crate::observation::candidates::{body_box, image_window};
use crate::observation::frame::{Cloud, DepthImage, DepthPixels, Frame, Scope};
use crate::observation::ownership::{NO_OWNER, OwnershipMask};

/// Distance from its expected position within which a surface explains a measurement, meters: the reach of the candidate search.
const REACH: f32 = 0.12;

/// Limit for the number of sampled pixels in a row: neighboring pixels on one surface are merged.
const COLUMNS: usize = 106;
/// Depths of neighboring pixels on one surface differ by less than this, meters.
const LIKE_DEPTH: f32 = 0.05;

/// A body at its predicted poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct PredictedBody<'a> {
    pub(super) number: u16,
    pub(super) body: &'a Body,
    /// World frame.
    pub(super) poses: &'a [Pose],
}

/// The owners of all pixels and free points, and working memory.
#[derive(Debug, Default)]
pub(super) struct PixelAssignment {
    /// Numbers of the bodies that pixels and points were assigned to.
    assigned: Vec<u16>,
    /// The owner of each pixel, image after image, and then of each point, cloud after cloud.
    pub(super) owners: Vec<Vec<u16>>,
    distances: Vec<f32>,
    /// Depths of a row, meters.
    depth: Vec<f32>,
    queries: Points,
    /// For each query its first pixel, and the number of pixels that it represents.
    pixels: Vec<(u32, u32)>,
    nearest: Vec<f32>,
    limb: Vec<f32>,
}

impl PixelAssignment {
    /// Returns the ownership mask of a person for this frame.
    pub(super) fn ownership<'a>(&'a self, number: usize, scene: &'a Backgrounds) -> OwnershipMask<'a> {
        let own = number as u16;
        let others = self.assigned.iter().filter(|assigned| **assigned != own).count();
        OwnershipMask { owners: &self.owners, own, others, scene }
    }

    /// Returns the number of pixels and free points that a person explains.
    pub(super) fn count(&self, number: usize) -> usize {
        self.owners.iter().flatten().filter(|owner| usize::from(**owner) == number).count()
    }

    /// Releases the pixels and free points that are assigned to the bodies with these numbers.
    pub(super) fn release(&mut self, numbers: impl RangeBounds<usize>) {
        let is_released = |owner: &u16| numbers.contains(&usize::from(*owner));
        if self.assigned.iter().any(is_released) {
            self.owners.iter_mut().flatten().filter(|owner| is_released(owner)).for_each(|owner| *owner = NO_OWNER);
        }
    }

    /// Assigns every foreground pixel and every free point to the body with the nearest surface, within reach.
    pub(super) fn assign<'a>(
        &mut self,
        frame: &Frame,
        scene: &Backgrounds,
        bodies: impl Iterator<Item = PredictedBody<'a>> + Clone,
    ) {
        refill(&mut self.assigned, bodies.clone().map(|body| body.number));
        let mut owners = std::mem::take(&mut self.owners);
        owners.resize_with(frame.images.len() + frame.clouds.len(), Vec::new);
        let (of_images, of_clouds) = owners.split_at_mut(frame.images.len());
        for (image, owners) in frame.images.iter().zip(of_images) {
            let background = scene.depth(image);
            let gather = |own: &mut Self, origin, bounds: &Aabb| own.gather(image, background, origin, bounds);
            self.assign_all(image.pixels.len(), bodies.clone(), owners, gather);
        }
        for (cloud, owners) in frame.clouds.iter().zip(of_clouds) {
            let free = if cloud.scope == Scope::Free { cloud.points.len() } else { 0 };
            let gather = |own: &mut Self, origin, bounds: &Aabb| own.gather_cloud(cloud, origin, bounds);
            self.assign_all(free, bodies.clone(), owners, gather);
        }
        self.owners = owners;
    }

    /// Assigns `count` pixels or points, which have no owner yet, to the body with the nearest surface; `gather` finds those in a
    /// box.
    fn assign_all<'a>(
        &mut self,
        count: usize,
        bodies: impl Iterator<Item = PredictedBody<'a>>,
        owners: &mut Vec<u16>,
        gather: impl Fn(&mut Self, Vec3, &Aabb),
    ) {
        reset(&mut self.distances, count, REACH);
        reset(owners, count, NO_OWNER);
        for predicted in bodies.filter(|_| count > 0) {
            if let Some(origin) = predicted.poses.first().map(|root| root.translation) {
                self.queries.clear();
                self.pixels.clear();
                gather(self, origin, &body_box(predicted.body, predicted.poses, f64::from(REACH)));
                self.assign_nearest(predicted, origin, owners);
            }
        }
    }

    /// Assigns pixels of an image, be they of the known scene or not, to the body with the nearest surface, within reach. The bodies
    /// are numbered from `first` on.
    pub(super) fn assign_segment(
        &mut self,
        image: &DepthImage,
        number: usize,
        pixels: &[usize],
        first: usize,
        bodies: &[(Body, Vec<Pose>)],
    ) {
        let bodies = (first as u16..).zip(bodies).map(|(number, (body, poses))| PredictedBody { number, body, poses });
        let Some(origin) = bodies.clone().find_map(|body| body.poses.first()).map(|root| root.translation) else {
            return;
        };
        self.assigned.extend(bodies.clone().map(|body| body.number));
        self.queries.clear();
        self.pixels.clear();
        for pixel in pixels {
            let z = image.pixels.get(*pixel) * image.meters_per_unit as f32;
            let point = image.world_from_sensor * image.back_project(*pixel, z);
            self.queries.push((point - origin).as_vec3().to_array());
            self.pixels.push((*pixel as u32, 1));
        }
        let mut owners = std::mem::take(&mut self.owners[number]);
        reset(&mut self.distances, owners.len(), REACH);
        bodies.for_each(|body| self.assign_nearest(body, origin, &mut owners));
        self.owners[number] = owners;
    }

    /// Assigns to a body the gathered points, relative to `origin`, that no other body is nearer to.
    fn assign_nearest(&mut self, predicted: PredictedBody, origin: Vec3, owners: &mut [u16]) {
        let Self { distances, queries, pixels, nearest, limb, .. } = self;
        let PredictedBody { number, body, poses } = predicted;
        reset(nearest, queries.len(), REACH);
        for (own, pose) in body.limbs().iter().zip(poses) {
            own.shape.approximate_distances(&shifted(pose, origin), queries, limb);
            nearest.iter_mut().zip(limb.iter()).for_each(|(nearest, limb)| *nearest = nearest.min(*limb));
        }
        for ((pixel, run), distance) in pixels.iter().zip(nearest.iter()) {
            let pixel = *pixel as usize..(*pixel + *run) as usize;
            for (before, owner) in distances[pixel.clone()].iter_mut().zip(&mut owners[pixel]) {
                if *distance < *before {
                    (*before, *owner) = (*distance, number);
                }
            }
        }
    }

    /// Gathers the points of a cloud within a box of the world, relative to `origin`.
    fn gather_cloud(&mut self, cloud: &Cloud, origin: Vec3, bounds: &Aabb) {
        for index in 0..cloud.points.len() {
            let point = cloud.world_from_sensor * cloud.points.get(index);
            if bounds.contains(point) {
                self.queries.push((point - origin).as_vec3().to_array());
                self.pixels.push((index as u32, 1));
            }
        }
    }

    /// Gathers the foreground returns within a box of the world, relative to `origin`. Of neighboring pixels on one surface the
    /// first represents all.
    fn gather(&mut self, image: &DepthImage, background: &[f32], origin: Vec3, bounds: &Aabb) {
        let [columns, rows] = image_window(image, &image.world_from_sensor, bounds);
        let together = (image.camera.width() / COLUMNS).max(1);
        let scale = image.meters_per_unit as f32;
        let Self { queries, pixels, depth, .. } = self;
        depth.clear();
        depth.reserve(image.camera.width());
        for row in rows {
            let start = row * image.camera.width();
            let span = start + columns.start..start + columns.end;
            depth.clear();
            match image.pixels {
                DepthPixels::U16(all) => depth.extend(all[span.clone()].iter().map(|pixel| f32::from(*pixel) * scale)),
                DepthPixels::F32(all) => depth.extend(all[span.clone()].iter().map(|pixel| pixel * scale)),
            }
            // Where there is no return, or the scene, the depth is 0.
            for z in depth.iter_mut() {
                *z = if *z > 0.0 && *z < f32::INFINITY { *z } else { 0.0 };
            }
            for (z, scene) in depth.iter_mut().zip(background.get(span).unwrap_or(&[])) {
                *z = if Background::contains(*scene, *z) { 0.0 } else { *z };
            }
            let mut column = columns.start;
            while column < columns.end {
                let z = depth[column - columns.start];
                if z == 0.0 {
                    column += 1;
                    continue;
                }
                let last = columns.end.min(column + together);
                let mut run = 1;
                while column + run < last && (depth[column + run - columns.start] - z).abs() < LIKE_DEPTH {
                    run += 1;
                }
                let [x, y] = image.camera.pixel_ray(column, row);
                let point = image.world_from_sensor * (f64::from(z) * Vec3::new(x, y, 1.0));
                if bounds.contains(point) {
                    queries.push((point - origin).as_vec3().to_array());
                    pixels.push(((start + column) as u32, run as u32));
                }
                column += run;
            }
        }
    }
}
