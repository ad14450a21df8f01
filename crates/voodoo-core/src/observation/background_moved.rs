//! Carries a learned scene over to a new camera pose: its surfaces are static in the world.

use super::background::{Background, Backgrounds, SCENE_STEP, pose_difference};
use super::candidates::columns_f32;
use super::frame::{DepthImage, Frame};
use crate::math::{Vec3, reset};

/// A camera that moved by more than this between two images counts as a different camera: meters, and radians.
const LEAPS: (f64, f64) = (0.5, 0.5);
/// A background without an image for this time belongs to no camera any more, seconds.
const GONE: f64 = 3.0;
/// Surfaces nearer to the camera plane than this are not carried over, meters: no sensor measures there.
const NEAREST_CARRIED: f32 = 0.1;

impl Backgrounds {
    /// Gives an image that has none a background. If the same camera learned one at another pose nearby, that is carried over to the
    /// current pose; otherwise the background is empty, in the slot of one that belongs to no camera any more, if there is one.
    pub(super) fn carry_over(&mut self, image: &DepthImage, frame: &Frame) {
        let gone = |background: &Background| !frame.images.iter().any(|image| background.fits(image));
        let leap = |background: &Background| {
            let (meters, radians) = pose_difference(&background.world_from_sensor, &image.world_from_sensor);
            let is_near = background.is_sized_like(image) && meters <= LEAPS.0 && radians <= LEAPS.1;
            if is_near { meters / LEAPS.0 + radians / LEAPS.1 } else { f64::INFINITY }
        };
        let left = self.images.iter().enumerate().filter(|(_, background)| gone(background));
        let left = left.map(|(index, background)| (index, leap(background), frame.stamp - background.seen));
        let usable = left.filter(|(_, leap, silent)| leap.is_finite() || *silent > GONE);
        let nearest = usable.map(|(index, leap, _)| (index, leap)).min_by(|a, b| a.1.total_cmp(&b.1));
        let (index, leap) = nearest.unwrap_or((self.images.len(), f64::INFINITY));
        if index == self.images.len() {
            self.images.push(Background::default());
        }
        let background = &mut self.images[index];
        if leap.is_finite() {
            background.move_to(image, &mut self.before_move);
        } else {
            reset(&mut background.depth, image.pixels.len(), 0.0);
            background.rays.clear();
            background.pending.clear();
            background.frames.clear();
            (background.since, background.filled) = (None, false);
        }
        background.pending.resize(image.pixels.len(), 0.0);
        background.frames.resize(image.pixels.len(), 0);
        background.world_from_sensor = image.world_from_sensor;
        background.width = image.camera.width();
    }
}

impl Background {
    /// Reprojects the learned surfaces into the camera at its current pose; each pixel keeps the nearest surface that falls into
    /// it.
    ///
    /// A surface stays on the ray on which it was observed instead of moving to the pixel center, so that rounding errors do not
    /// accumulate.
    fn move_to(&mut self, image: &DepthImage, (old, old_rays): &mut (Vec<f32>, Vec<[f32; 2]>)) {
        let moved = image.world_from_sensor.inverse() * self.world_from_sensor;
        let turn = columns_f32(&moved);
        let camera = image.camera;
        let width = camera.width();
        let center = |index: usize| camera.pixel_ray(index % width, index / width).map(|value| value as f32);
        let view_at = |[x, y]: [f32; 2]| camera.index_of(Vec3::new(f64::from(x), f64::from(y), 1.0));
        std::mem::swap(&mut self.depth, old);
        std::mem::swap(&mut self.rays, old_rays);
        reset(&mut self.depth, old.len(), 0.0);
        reset(&mut self.rays, old.len(), NO_RAY);
        for (index, z) in old.iter().enumerate().filter(|(_, z)| **z > 0.0) {
            let [x, y] = old_rays.get(index).copied().filter(|ray| *ray != NO_RAY).unwrap_or_else(|| center(index));
            let place =
                [0, 1, 2].map(|axis| z * (turn[0][axis] * x + turn[1][axis] * y + turn[2][axis]) + turn[3][axis]);
            if !(place[2] >= NEAREST_CARRIED) {
                continue;
            }
            let ray = [place[0] / place[2], place[1] / place[2]];
            let Some(target) = view_at(ray) else { continue };
            if self.depth[target] == 0.0 || place[2] < self.depth[target] {
                (self.depth[target], self.rays[target]) = (place[2], ray);
            }
        }
        for step in [1, width] {
            self.close_cracks(step);
        }
    }

    /// Closes one-pixel cracks between neighbors `step` apart, which open where a surface comes nearer.
    fn close_cracks(&mut self, step: usize) {
        for index in step..self.depth.len().saturating_sub(step) {
            let (a, b) = (self.depth[index - step], self.depth[index + step]);
            if self.depth[index] == 0.0 && a > 0.0 && b > 0.0 && (a - b).abs() < SCENE_STEP {
                self.depth[index] = 0.5 * (a + b);
            }
        }
    }
}

/// Stands for the ray through the pixel center.
const NO_RAY: [f32; 2] = [f32::INFINITY; 2];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Lens};
    use crate::math::{Pose, Quat};
    use crate::observation::frame::DepthPixels;
    use crate::testing::learn;

    const SIZE: (usize, usize) = (64, 48);

    fn camera(lens: Lens) -> Camera {
        Camera::new(SIZE.0, SIZE.1, [60.0, 60.0, 31.5, 23.5], lens).unwrap()
    }

    fn image<'a>(pixels: &'a [f32], camera: &'a Camera, world_from_sensor: Pose) -> DepthImage<'a> {
        DepthImage {
            pixels: DepthPixels::F32(pixels),
            camera,
            meters_per_unit: 1.0,
            world_from_sensor,
            weight: 1.0,
            source: 0,
        }
    }

    /// A wall at z = 3 with a step to z = 4 at the right of x = 0.2.
    fn view_from(camera: &Camera, world_from_sensor: &Pose) -> Vec<f32> {
        (0..SIZE.0 * SIZE.1)
            .map(|index| {
                let [x, y] = camera.pixel_ray(index % SIZE.0, index / SIZE.0);
                let ray = Vec3::new(x, y, 1.0);
                let (from, along) = (world_from_sensor.translation, world_from_sensor.rotation * ray);
                let near = (3.0 - from.z) / along.z;
                let far = (4.0 - from.z) / along.z;
                if from.x + near * along.x < 0.2 { near as f32 } else { far as f32 }
            })
            .collect()
    }

    fn pose(x: f64, turn: f64) -> Pose {
        Pose { rotation: Quat::from_rotation_y(turn), translation: Vec3::new(x, 0.0, 0.0) }
    }

    #[test]
    fn what_was_learned_stays_where_it_is_while_the_camera_moves_on() {
        for lens in [Lens::Pinhole, Lens::PlumbBob([-0.3, 0.1, 0.002, -0.001, 0.0]), Lens::Fisheye([0.0; 4])] {
            moves_on(&camera(lens));
        }
    }

    fn moves_on(camera: &Camera) {
        let mut backgrounds = Backgrounds::default();
        let first = view_from(camera, &pose(0.0, 0.0));
        let images = [image(&first, camera, pose(0.0, 0.0))];
        learn(&mut backgrounds, &Frame { images: &images, ..Frame::empty(0.0) }, |_| true);
        let mut known = 0;
        for step in 1..=80 {
            // A sixth of a pixel per move: with rounding to pixels, everything would stay where it was in the image.
            let now = pose(0.002 * f64::from(step), 0.0025 * f64::from(step));
            let pixels = view_from(camera, &now);
            let frame = [image(&pixels, camera, now)];
            let frame = Frame { images: &frame, ..Frame::empty(f64::from(step)) };
            backgrounds.register(&frame);
            let depth = backgrounds.depth(&frame.images[0]);
            known = depth.iter().filter(|z| **z > 0.0).count();
            // Within one pixel: the step falls between two pixels.
            let beside = |index: usize| pixels[index.saturating_sub(1)..(index + 2).min(pixels.len())].iter();
            let view_from = || depth.iter().enumerate().filter(|(_, z)| **z > 0.0);
            let near = view_from().filter(|(index, z)| beside(*index).all(|view_from| **z < view_from - 0.1)).count();
            let deep = view_from().filter(|(index, z)| beside(*index).all(|view_from| **z > view_from + 0.1)).count();
            // Depths that are too near would hide a body. Depths that are too deep, where the far wall is visible through cracks
            // of the near one, would not.
            assert!(near == 0 && deep * 20 <= known, "step {step}: {near} too near, {deep} too deep of {known}");
        }
        // A rotation of 0.2 rad leaves most of the view; surfaces that fall into one pixel are lost.
        assert!(known * 2 > first.len(), "{known} pixels are left");
    }

    #[test]
    fn another_view_begins_with_nothing_seen() {
        let camera = camera(Lens::Pinhole);
        let pixels = view_from(&camera, &pose(0.0, 0.0));
        let mut backgrounds = Backgrounds::default();
        for (x, pending) in [(0.0, 2.0), (1.0, 0.0)] {
            let images = [image(&pixels, &camera, pose(x, 0.0))];
            backgrounds.register(&Frame { images: &images, ..Frame::empty(4.0 * x) });
            let background = &mut backgrounds.images[0];
            if x == 0.0 {
                background.pending.fill(pending);
                background.frames.fill(59);
            } else {
                assert!(background.pending.iter().all(|z| *z == pending) && background.frames.iter().all(|n| *n == 0));
            }
        }
        assert_eq!(backgrounds.images.len(), 1);
    }

    #[test]
    fn a_camera_that_wavers_stands_and_one_that_leaps_is_another() {
        let camera = camera(Lens::Pinhole);
        let pixels = view_from(&camera, &pose(0.0, 0.0));
        let mut backgrounds = Backgrounds::default();
        let mut known = |now: Pose| {
            let frame = [image(&pixels, &camera, now)];
            let frame = Frame { images: &frame, ..Frame::empty(0.0) };
            backgrounds.register(&frame);
            if now == pose(0.0, 0.0) {
                learn(&mut backgrounds, &frame, |_| true);
            }
            backgrounds.depth(&frame.images[0]).iter().filter(|z| **z > 0.0).count()
        };
        assert_eq!(known(pose(0.0, 0.0)), pixels.len());
        assert_eq!(known(pose(0.002, 0.001)), pixels.len());
        let carried = known(pose(0.1, 0.0));
        assert!(carried < pixels.len() && carried > pixels.len() / 2, "{carried}");
        assert_eq!(known(pose(1.0, 0.0)), 0);
    }
}
