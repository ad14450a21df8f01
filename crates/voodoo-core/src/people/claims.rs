//! Whose surface explains each pixel of a frame.

use crate::body::Body;
use crate::math::{Aabb, Points, Pose, Vec3, shifted};
use crate::observation::background::{Background, Backgrounds};
use crate::observation::candidates::{body_box, image_window};
use crate::observation::frame::{DepthImage, Frame};
use crate::observation::share::NOBODY;

/// A surface explains what lies within this of where it is expected, metres: as far as candidates are looked for.
const REACH: f32 = 0.20;

/// Neighbours in a row stand for one another so that a row has at most about this many.
const COLUMNS: usize = 106;
/// On one surface depths of neighbours differ by less, metres.
const LIKE_DEPTH: f32 = 0.05;

/// A body where it is expected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Claimant<'a> {
    pub(super) number: u16,
    pub(super) body: &'a Body,
    /// World frame.
    pub(super) poses: &'a [Pose],
}

/// The owners of all pixels, and working memory.
#[derive(Debug, Default)]
pub(super) struct Claims {
    owners: Vec<Vec<u16>>,
    distances: Vec<f32>,
    queries: Points,
    /// The first pixel that each query stands for, and how many.
    pixels: Vec<(u32, u32)>,
    nearest: Vec<f32>,
    limb: Vec<f32>,
}

impl Claims {
    /// Image after image, the number of who explains each pixel.
    pub(super) fn owners(&self) -> &[Vec<u16>] {
        &self.owners
    }

    /// Gives every pixel that is no scene to the body whose surface is nearest, within reach.
    pub(super) fn settle<'a>(
        &mut self,
        frame: &Frame,
        scene: &Backgrounds,
        bodies: impl Iterator<Item = Claimant<'a>> + Clone,
    ) {
        self.owners.resize_with(frame.images.len(), Vec::new);
        for (number, image) in frame.images.iter().enumerate() {
            self.owners[number].clear();
            self.owners[number].resize(image.pixels.len(), NOBODY);
            self.distances.clear();
            self.distances.resize(image.pixels.len(), REACH);
            let background = scene.of(image).map_or(&[][..], Background::depth);
            for claimant in bodies.clone() {
                self.claim(number, image, background, claimant);
            }
        }
    }

    fn claim(&mut self, number: usize, image: &DepthImage, background: &[f32], claimant: Claimant) {
        let Claimant { body, poses, .. } = claimant;
        let Some(origin) = poses.first().map(|root| root.translation) else { return };
        self.gather(image, background, origin, &body_box(body, poses, f64::from(REACH)));
        let Self { owners, distances, queries, pixels, nearest, limb } = self;
        nearest.clear();
        nearest.resize(queries.len(), REACH);
        for (own, pose) in body.limbs().iter().zip(poses) {
            own.shape.approximate_distances(&shifted(pose, origin), queries, limb);
            nearest.iter_mut().zip(limb.iter()).for_each(|(nearest, limb)| *nearest = nearest.min(*limb));
        }
        for ((pixel, run), distance) in pixels.iter().zip(nearest.iter()) {
            let pixel = *pixel as usize..(*pixel + *run) as usize;
            for (before, owner) in distances[pixel.clone()].iter_mut().zip(&mut owners[number][pixel]) {
                if *distance < *before {
                    (*before, *owner) = (*distance, claimant.number);
                }
            }
        }
    }

    /// The returns within a box of the world that are no scene, about `origin`: of neighbours on one surface the first stands for
    /// all.
    fn gather(&mut self, image: &DepthImage, background: &[f32], origin: Vec3, bounds: &Aabb) {
        let (columns, rows) = image_window(image, &image.world_from_sensor, bounds);
        let together = (image.width / COLUMNS).max(1);
        let scale = image.metres_per_unit as f32;
        self.queries.clear();
        self.pixels.clear();
        for row in rows {
            let (mut index, end) = (row * image.width + columns.start, row * image.width + columns.end);
            while index < end {
                let z = image.pixels.get(index) * scale;
                let mut run = 1;
                if z > 0.0 && z.is_finite() && !background.get(index).is_some_and(|depth| Background::holds(*depth, z))
                {
                    let last = end.min(index + together);
                    while index + run < last && (image.pixels.get(index + run) * scale - z).abs() < LIKE_DEPTH {
                        run += 1;
                    }
                    let point = image.world_from_sensor * image.back_project(index, z);
                    if bounds.contains_local_point(point) {
                        self.queries.push((point - origin).to_array().map(|value| value as f32));
                        self.pixels.push((index as u32, run as u32));
                    }
                }
                index += run;
            }
        }
    }
}
