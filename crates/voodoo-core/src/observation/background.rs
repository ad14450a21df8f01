//! The static scene behind the body, learned from the depth images of each camera.

use std::ops::Range;

use crate::math::{Pose, widest};
use crate::observation::frame::{DepthImage, DepthPixels, Frame};

/// A pixel belongs to the background unless it lies more than this in front of it: meters, plus a fraction of the depth, because
/// the noise of depth cameras grows with depth.
const SCENE_MARGIN: (f32, f32) = (0.04, 0.012);
/// A return deeper than the learned depth by more than this replaces it (something stood in front before), meters.
const DEEPER: f32 = 0.15;
/// The two sides of a gap belong to one surface when their depths differ by less than this, meters: a wall at an oblique angle.
const ONE_WALL: f32 = 0.30;
/// Weight of a new return in the learned depth: approximately ten observations of a pixel average its noise.
const LEARNING: f32 = 0.1;
/// One row in this many is updated per frame, for speed: the scene is static.
const ROW_STEP: usize = 8;

/// A camera that moved by no more than this counts as static: meters, and radians. The odometry of a stationary robot varies by
/// less.
const STANDS: (f64, f64) = (0.003, 0.0015);
/// Value of the depth at pixels that show another person: any return there does not belong to this person.
pub(crate) const OTHERS: f32 = f32::MIN_POSITIVE;

/// Depth of the scene behind the body, one value per pixel; 0 where it is unknown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Background {
    pub(super) world_from_sensor: Option<Pose>,
    pub(super) width: usize,
    pub(super) depth: Vec<f32>,
    /// The ray `(x/z, y/z)` on which each depth was observed; empty while the camera has not moved: then it is the ray through
    /// the pixel center.
    pub(super) rays: Vec<[f32; 2]>,
    row: usize,
}

/// The backgrounds of all depth images, in the order of the frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Backgrounds {
    pub(super) images: Vec<Background>,
    /// For each point of each cloud, whether another person explains it; a missing entry means no.
    others: Vec<Vec<bool>>,
}

/// Distance between two poses: meters, and radians.
pub(super) fn pose_difference(a: &Pose, b: &Pose) -> (f64, f64) {
    (a.translation.distance(b.translation), a.rotation.angle_between(b.rotation))
}

/// Whether a camera is still at its previous pose.
fn is_static(a: &Pose, b: &Pose) -> bool {
    let (meters, radians) = pose_difference(a, b);
    a == b || (meters <= STANDS.0 && radians <= STANDS.1)
}

impl Background {
    /// Learned depth, row by row; empty when nothing was learned.
    pub(crate) fn depth(&self) -> &[f32] {
        &self.depth
    }

    /// Whether a return at `z` meters in pixel `index` belongs to the background.
    #[inline(always)]
    pub(crate) fn contains(depth: f32, z: f32) -> bool {
        depth > 0.0 && z > depth - SCENE_MARGIN.0 - SCENE_MARGIN.1 * depth
    }

    /// Whether this background belongs to the image: to the same camera at the same pose.
    pub(super) fn fits(&self, image: &DepthImage) -> bool {
        self.is_sized_like(image)
            && self.world_from_sensor.is_some_and(|known| is_static(&known, &image.world_from_sensor))
    }

    pub(super) fn is_sized_like(&self, image: &DepthImage) -> bool {
        self.width == image.camera.width() && self.depth.len() == image.pixels.len()
    }

    /// Updates a range of neighboring pixels, without a branch.
    fn learn(&mut self, image: &DepthImage, pixels: Range<usize>) {
        let scale = image.meters_per_unit as f32;
        let depth = &mut self.depth[pixels.clone()];
        widest(
            #[inline(always)]
            || match image.pixels {
                DepthPixels::U16(all) => {
                    depth
                        .iter_mut()
                        .zip(&all[pixels])
                        .for_each(|(depth, z)| *depth = learned(*depth, f32::from(*z) * scale));
                }
                DepthPixels::F32(all) => {
                    depth.iter_mut().zip(&all[pixels]).for_each(|(depth, z)| *depth = learned(*depth, *z * scale));
                }
            },
        );
    }
}

/// Learned depth of a pixel after a return at `z`.
#[inline(always)]
fn learned(depth: f32, z: f32) -> f32 {
    let change = z - depth;
    let near = if change.abs() < DEEPER { depth + LEARNING * change } else { depth };
    let new = if (depth == 0.0) | (z > depth + DEEPER) { z } else { near };
    if (z > 0.0) & (z < f32::INFINITY) { new } else { depth }
}

impl Backgrounds {
    /// The background of this image, if its camera has not moved.
    pub(crate) fn of_image(&self, image: &DepthImage) -> Option<&Background> {
        self.images.iter().find(|background| background.fits(image))
    }

    /// The learned depths of this image.
    pub(crate) fn depth_mut(&mut self, image: &DepthImage) -> Option<&mut [f32]> {
        let known = self.images.iter_mut().find(|background| background.fits(image));
        known.map(|background| background.depth.as_mut_slice())
    }

    /// Whether another person explains a point of a cloud, by the indices of cloud and point.
    pub(super) fn is_others(&self, cloud: usize, point: usize) -> bool {
        self.others.get(cloud).is_some_and(|others| others.get(point).copied().unwrap_or(false))
    }

    /// Stores which points of the clouds other persons explain: those for whose owner `is_others` returns true.
    pub(super) fn mark_others_points(&mut self, owners: &[Vec<u16>], is_others: impl Fn(u16) -> bool) {
        self.others.resize_with(owners.len(), Vec::new);
        for (others, owners) in self.others.iter_mut().zip(owners) {
            others.clear();
            others.extend(owners.iter().map(|owner| is_others(*owner)));
        }
    }

    /// Copies the learned depths of another scene for each image of the frame, then lets `change` modify them.
    pub(super) fn adopt(&mut self, frame: &Frame, scene: &Self, mut change: impl FnMut(usize, &mut [f32])) {
        self.images.resize_with(frame.images.len(), Background::default);
        for (number, (image, own)) in frame.images.iter().zip(&mut self.images).enumerate() {
            (own.world_from_sensor, own.width) = (Some(image.world_from_sensor), image.camera.width());
            own.depth.clear();
            match scene.of_image(image) {
                Some(known) => own.depth.extend_from_slice(&known.depth),
                None => own.depth.resize(image.pixels.len(), 0.0),
            }
            change(number, &mut own.depth);
        }
    }

    /// Gives every image of a frame a background, if only an empty one. `moved` is called with the index of each image whose
    /// camera moved, and with whether the learned depths were carried over.
    pub(crate) fn register(&mut self, frame: &Frame, mut moved: impl FnMut(usize, bool)) {
        for (number, image) in frame.images.iter().enumerate() {
            if self.of_image(image).is_none() {
                let (_, carried) = self.carry_over(image, frame);
                moved(number, carried);
            }
        }
    }

    /// Whether no depth image has been received yet.
    pub(crate) fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.images.clear();
    }

    /// Starts from a frame in which the body pose is known. `forget_body` sets the depths that may be the body's to 0; the
    /// others are scene.
    pub(crate) fn start(&mut self, frame: &Frame, mut forget_body: impl FnMut(&DepthImage, &mut [f32])) {
        self.images.clear();
        for image in frame.images {
            let depths = (0..image.pixels.len()).map(|index| image.pixels.get(index) * image.meters_per_unit as f32);
            let mut depth: Vec<f32> = depths.map(|z| if z > 0.0 && z.is_finite() { z } else { 0.0 }).collect();
            forget_body(image, &mut depth);
            self.images.push(Background {
                world_from_sensor: Some(image.world_from_sensor),
                width: image.camera.width(),
                depth,
                rays: Vec::new(),
                row: 0,
            });
        }
    }

    /// Guesses the scene that the body has hidden since the start from the pixels beside it in the same row: linearly between
    /// the two sides, or the deeper one where they are far apart.
    pub(crate) fn fill(&mut self) {
        for background in &mut self.images {
            for row in background.depth.chunks_mut(background.width.max(1)) {
                fill_row(row);
            }
        }
    }

    /// Continues learning outside the window (columns, rows) that can show the body, a few rows per frame. The learned depths of
    /// a camera that moved are carried over; those of a camera without an image in this frame are kept.
    pub(crate) fn update(&mut self, frame: &Frame, mut window: impl FnMut(&DepthImage) -> [Range<usize>; 2]) {
        for image in frame.images {
            let known = self.images.iter().position(|background| background.fits(image));
            let index = known.unwrap_or_else(|| self.carry_over(image, frame).0);
            let background = &mut self.images[index];
            let [columns, rows] = window(image);
            background.row = (background.row + 1) % ROW_STEP;
            for row in (background.row..image.camera.height()).step_by(ROW_STEP) {
                let (start, end) = (row * image.camera.width(), (row + 1) * image.camera.width());
                if rows.contains(&row) {
                    background.learn(image, start..start + columns.start);
                    background.learn(image, start + columns.end..end);
                } else {
                    background.learn(image, start..end);
                }
            }
        }
    }
}

fn fill_row(row: &mut [f32]) {
    let mut start = 0;
    while let Some(gap) = row[start..].iter().position(|depth| *depth <= 0.0) {
        let first = start + gap;
        let end = row[first..].iter().position(|depth| *depth > 0.0).map_or(row.len(), |length| first + length);
        let (left, right) = (first.checked_sub(1).map(|index| row[index]), row.get(end).copied());
        let count = (end - first + 1) as f32;
        for index in first..end {
            let t = (index - first + 1) as f32 / count;
            row[index] = match (left, right) {
                (Some(a), Some(b)) if (a - b).abs() < ONE_WALL => a + t * (b - a),
                (Some(a), Some(b)) => a.max(b),
                (a, b) => a.or(b).unwrap_or(0.0),
            };
        }
        start = end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::testing::pinhole;

    #[test]
    fn a_gap_is_filled_from_its_sides() {
        let mut row = [0.0, 3.0, 0.0, 0.0, 3.3, 0.0, 1.0, 0.0, 2.5, 0.0];
        fill_row(&mut row);
        let expected = [3.0, 3.0, 3.1, 3.2, 3.3, 3.3, 1.0, 2.5, 2.5, 2.5];
        assert!(row.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6), "{row:?}");
        let mut nothing = [0.0; 3];
        fill_row(&mut nothing);
        assert_eq!(nothing, [0.0; 3]);
    }

    #[test]
    fn a_silent_camera_is_remembered_and_a_moved_one_starts_anew() {
        let pixels = [3.0_f32; 4 * ROW_STEP];
        let image = |x: f64| DepthImage {
            pixels: DepthPixels::F32(&pixels),
            camera: pinhole(4, ROW_STEP, [4.0, 4.0, 2.0, 4.0]),
            meters_per_unit: 1.0,
            world_from_sensor: Pose::from_translation(Vec3::new(x, 0.0, 0.0)),
            weight: 1.0,
            source: 0,
        };
        let mut backgrounds = Backgrounds::default();
        let mut learn = |images: &[DepthImage]| {
            let frame = Frame { images, ..Frame::empty(0.0) };
            backgrounds.update(&frame, |_| [0..0, 0..0]);
            [0.0, 1.0, 2.0].map(|x| {
                let learned = backgrounds.of_image(&image(x)).map(Background::depth);
                learned.map(|depth| depth.iter().filter(|depth| **depth > 0.0).count() / 4)
            })
        };
        assert_eq!(learn(&[image(0.0), image(1.0)]), [Some(1), Some(1), None]);
        assert_eq!(learn(&[]), [Some(1), Some(1), None]);
        assert_eq!(learn(&[image(1.0)]), [Some(1), Some(2), None], "the other one is silent");
        assert_eq!(learn(&[image(2.0), image(1.0)]), [None, Some(3), Some(1)], "the other one moved");
    }
}
