//! What the pixels of a depth image show at a position in space.

use crate::camera::Camera;
use crate::math::{Pose, Vec3, refill, shifted};
use crate::observation::background::{Background, OTHERS};
use crate::observation::frame::{DepthImage, Frame};
use crate::observation::ownership::OwnershipMask;

/// A depth image that can be queried by position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthView<'a> {
    /// The image.
    pub image: &'a DepthImage<'a>,
    /// The learned depth of the scene behind the body, row by row; empty where it is not known.
    pub background: &'a [f32],
    /// Pose of the camera in the working frame.
    pub working_from_camera: Pose,
    /// Whether the body was segmented (cut out) before the image was passed in: then a pixel without return is free space.
    pub segmented: bool,
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pixel {
    /// Outside the image, or no return in an image where that carries no information.
    Unknown,
    /// The scene behind the body, with its depth; or free space in a segmented image, with infinite depth.
    Background(f64),
    /// A return that may be the body, at this depth.
    Foreground(f64),
    /// Another person, at this depth.
    Other(f64),
}

/// An image with a larger fraction of pixels without return was segmented: a sensor alone loses less of a room.
const SEGMENTED_FRACTION: f64 = 0.5;
/// Stride of the pixels that are tested for that; a prime, so that all columns take part.
const SEGMENTED_STEP: usize = 97;

/// The depth images of a frame, for queries by position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthViews<'a> {
    /// The frame.
    pub frame: &'a Frame<'a>,
    /// The scene as the body's person sees it, and which pixels and points others explain.
    pub ownership: OwnershipMask<'a>,
    /// Whether the body was segmented in each image, as [`find_segmented`] found.
    pub segmented: &'a [bool],
    /// The working frame's origin in the world.
    pub origin: Vec3,
}

impl<'a> DepthViews<'a> {
    /// Iterates over the images.
    pub(crate) fn iter(self) -> impl Iterator<Item = DepthView<'a>> {
        let images = self.frame.images.iter().zip(self.segmented);
        images.map(move |(image, segmented)| DepthView {
            image,
            background: self.ownership.scene.depth(image),
            working_from_camera: shifted(&image.world_from_sensor, self.origin),
            segmented: *segmented,
        })
    }
}

impl DepthView<'_> {
    /// What the pixel shows that a point (camera frame) projects to.
    #[inline(always)]
    pub(crate) fn at(&self, point: Vec3) -> Pixel {
        let image = self.image;
        if point.z < Camera::NEAREST {
            return Pixel::Unknown;
        }
        image.camera.index_of(point).map_or(Pixel::Unknown, |index| self.pixel(index))
    }

    /// What a pixel shows, by its row-major index.
    #[inline(always)]
    fn pixel(&self, index: usize) -> Pixel {
        let image = self.image;
        let z = f64::from(image.pixels.get(index)) * image.meters_per_unit;
        if !(z > 0.0 && z.is_finite()) {
            return if self.segmented { Pixel::Background(f64::INFINITY) } else { Pixel::Unknown };
        }
        match self.background.get(index) {
            Some(&OTHERS) => Pixel::Other(z),
            Some(depth) if Background::contains(*depth, z as f32) => Pixel::Background(z),
            _ => Pixel::Foreground(z),
        }
    }

    /// What the four pixels about a point (camera frame) show, bilinearly interpolated: a body whose surface is within `deep`
    /// meters of the point's depth, or what is behind it.
    #[inline(always)]
    pub(crate) fn shares(&self, point: Vec3, deep: f64) -> Shares {
        let mut found = Shares::default();
        let camera = &self.image.camera;
        let Some([u, v]) = camera.project(point).filter(|_| point.z >= Camera::NEAREST) else { return found };
        let (width, height) = (camera.width() as f64, camera.height() as f64);
        if !(u > -1.0 && v > -1.0 && u < width && v < height) {
            return found;
        }
        let (left, top) = (u.floor(), v.floor());
        let (across, down) = (u - left, v - top);
        let mut sum = 0.0;
        for (row, by_row) in [(top, 1.0 - down), (top + 1.0, down)] {
            for (column, by_column) in [(left, 1.0 - across), (left + 1.0, across)] {
                let weight = by_row * by_column;
                if row < 0.0 || column < 0.0 || row >= height || column >= width {
                    continue;
                }
                let beyond = |z: f64| ((z - point.z - deep) / DEPTH_FADE + 0.5).clamp(0.0, 1.0);
                match self.pixel(row as i32 as usize * camera.width() + column as i32 as usize) {
                    Pixel::Unknown => {}
                    Pixel::Background(_) => found.past += weight,
                    Pixel::Other(z) => found.past += weight * beyond(z),
                    Pixel::Foreground(z) => {
                        let past = beyond(z);
                        let here = weight * (1.0 - past) * ((z - point.z + deep) / DEPTH_FADE + 0.5).clamp(0.0, 1.0);
                        found.past += weight * past;
                        found.body += here;
                        sum += here * z;
                    }
                }
            }
        }
        found.depth = (found.body > 0.0).then(|| sum / found.body);
        found
    }
}

/// Interval of depth over which a pixel passes from the body to what is before or behind it, meters.
const DEPTH_FADE: f64 = 0.03;

/// What the pixels about a point show, as fractions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shares {
    /// The body.
    pub body: f64,
    /// What is behind the body.
    pub past: f64,
    /// Mean depth of the body, meters; `None` where no pixel shows it.
    pub depth: Option<f64>,
}

/// Finds in which images of a frame the body was segmented, and writes the result to `found`.
pub(crate) fn find_segmented(frame: &Frame, found: &mut Vec<bool>) {
    let is_segmented = |image: &DepthImage| {
        let tested = (0..image.pixels.len()).step_by(SEGMENTED_STEP);
        let none = tested.clone().filter(|index| image.depth(*index).is_none()).count();
        none as f64 > SEGMENTED_FRACTION * tested.len() as f64
    };
    refill(found, frame.images.iter().map(is_segmented));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Lens};
    use crate::observation::background::Backgrounds;
    use crate::testing::{everything, image, views};

    /// Every pixel of this image has a different depth, meters.
    fn distinct(count: usize) -> Vec<f32> {
        (0..count).map(|index| 1.0 + 0.01 * index as f32).collect()
    }

    #[test]
    fn values_that_are_no_depths_are_no_returns() {
        for none in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let mut pixels = vec![none; 24 * 16];
            pixels[0] = 2.0;
            let image = image(&pixels, 24, 20.0);
            let mut segmented = Vec::new();
            find_segmented(&Frame { images: &[image], ..Frame::empty(0.0) }, &mut segmented);
            assert_eq!(segmented, [true], "{none}");
            let working_from_camera = Pose::IDENTITY;
            let view = DepthView { image: &image, background: &[], working_from_camera, segmented: false };
            assert_eq!([view.pixel(0), view.pixel(1)], [Pixel::Foreground(2.0), Pixel::Unknown], "{none}");
        }
    }

    #[test]
    fn a_place_is_visible_in_the_pixel_of_its_ray_through_every_lens() {
        let pixels = distinct(24 * 16);
        for lens in [
            Lens::PlumbBob([-0.3, 0.1, 0.002, -0.001, 0.0]),
            Lens::Fisheye([0.02, -0.01, 0.0, 0.0]),
            Lens::InversePlumbBob([0.2, 0.05, 0.0, 0.001, 0.0]),
        ] {
            let camera = Camera::new(24, 16, [20.0, 20.0, 11.5, 7.5], lens).unwrap();
            let image = DepthImage { camera: &camera, ..image(&pixels, 24, 20.0) };
            let view =
                DepthView { image: &image, background: &[], working_from_camera: Pose::IDENTITY, segmented: false };
            for (index, depth) in pixels.iter().enumerate() {
                let [column, row] = [index % 24, index / 24].map(|at| at as f64);
                for (z, u, v) in [(0.3, 0.0, 0.0), (2.0, 0.45, -0.45), (9.0, -0.45, 0.45)] {
                    let [x, y] = camera.ray([column + u, row + v]).unwrap();
                    let found = view.at(Vec3::new(x, y, 1.0) * z);
                    assert_eq!(found, Pixel::Foreground(f64::from(*depth)), "pixel {index} through {lens:?}");
                }
            }
            assert_eq!(view.at(Vec3::new(2.0, 0.0, 1.0)), Pixel::Unknown, "outside of {lens:?}");
        }
    }

    #[test]
    fn a_place_is_visible_in_the_pixel_whose_ray_passes_nearest() {
        let pixels = distinct(24 * 16);
        let image = image(&pixels, 24, 20.0);
        let view = DepthView { image: &image, background: &[], working_from_camera: Pose::IDENTITY, segmented: false };
        for (index, depth) in pixels.iter().enumerate() {
            // Anywhere within the pixel, and at any depth: its borders are half a pixel from its center.
            for (z, u, v) in [(0.3, 0.0, 0.0), (2.0, 0.45, -0.45), (9.0, -0.45, 0.45)] {
                let aside = Vec3::new(u, v, 0.0) * (f64::from(z) / 20.0);
                let found = view.at(image.back_project(index, z) + aside);
                assert_eq!(found, Pixel::Foreground(f64::from(*depth)), "pixel {index}");
            }
        }
        for outside in [Vec3::new(0.7, 0.0, 1.0), Vec3::new(0.0, -0.5, 1.0), Vec3::new(0.0, 0.0, -1.0)] {
            assert_eq!(view.at(outside), Pixel::Unknown, "{outside}");
        }
    }

    #[test]
    fn no_return_means_nothing_unless_the_body_was_segmented() {
        let mut pixels = vec![0.0_f32; 40 * 30];
        pixels[..400].fill(2.0);
        let image = image(&pixels, 40, 30.0);
        let images = [image];
        let frame = Frame { images: &images, ..Frame::empty(0.0) };
        let mut segmented = Vec::new();
        find_segmented(&frame, &mut segmented);
        assert_eq!(segmented, [true], "two thirds returned nothing");
        let backgrounds = Backgrounds::default();
        let empty = image.back_project(1000, 2.0);
        for (segmented, expected) in [([true], Pixel::Background(f64::INFINITY)), ([false], Pixel::Unknown)] {
            let views = DepthViews {
                frame: &frame,
                ownership: everything(&backgrounds),
                segmented: &segmented,
                origin: Vec3::ZERO,
            };
            assert!(views.iter().all(|view| view.at(empty) == expected));
        }
    }

    #[test]
    fn what_was_learned_as_scene_is_background() {
        let scene = vec![3.0_f32; 12 * 10];
        let mut backgrounds = Backgrounds::default();
        let learned = image(&scene, 12, 10.0);
        crate::testing::learn(&mut backgrounds, &Frame { images: &[learned], ..Frame::empty(0.0) }, |_| true);
        let mut pixels = scene.clone();
        pixels[55] = 2.0;
        let images = [image(&pixels, 12, 10.0)];
        let frame = Frame { images: &images, ..Frame::empty(0.1) };
        let views = views(&frame, &backgrounds);
        let view = views.iter().next().unwrap();
        assert_eq!(view.at(images[0].back_project(54, 1.0)), Pixel::Background(3.0));
        assert_eq!(view.at(images[0].back_project(55, 1.0)), Pixel::Foreground(2.0));
    }
}
