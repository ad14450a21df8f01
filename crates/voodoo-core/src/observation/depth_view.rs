//! What the pixels of a depth image say about a place in space.

use crate::math::{Pose, Vec3, shifted};
use crate::observation::background::{Background, Backgrounds};
use crate::observation::frame::{DepthImage, Frame};

/// A depth image as a witness: what lies in a pixel.
#[derive(Clone, Copy, Debug)]
pub struct DepthView<'a> {
    /// The image.
    pub image: &'a DepthImage<'a>,
    /// What is known of the scene behind the body.
    pub background: Option<&'a Background>,
    /// Pose of the camera in the working frame.
    pub working_from_camera: Pose,
    /// Whoever made the image had the body segmented (cut out): a pixel without return shows that nothing is there.
    pub segmented: bool,
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pixel {
    /// Outside the image, or no return where that means nothing.
    Unknown,
    /// The scene behind the body, or nothing where the body was segmented; with its depth, infinite when nothing returned.
    Background(f64),
    /// Something that may be the body, at this depth.
    Foreground(f64),
}

/// A place nearer to the camera plane than this, metres, is in no pixel: no sensor measures there, and the projection blows up.
pub(crate) const NEAREST_SEEN: f64 = 0.05;
/// An image with more pixels without return than this share was segmented: a sensor alone loses less of a room.
const SEGMENTED_SHARE: f64 = 0.5;
/// Every so manyth pixel is asked for that; a prime, so that all columns take part.
const SEGMENTED_STEP: usize = 97;

/// The depth images of a frame as witnesses.
#[derive(Clone, Copy, Debug)]
pub struct DepthViews<'a> {
    /// The frame.
    pub frame: &'a Frame<'a>,
    /// What is known of the scene behind the body.
    pub backgrounds: &'a Backgrounds,
    /// In which images the body was segmented, as [`find_segmented`] found it.
    pub segmented: &'a [bool],
    /// The working frame's origin in the world.
    pub origin: Vec3,
}

impl<'a> DepthViews<'a> {
    /// One after the other.
    pub fn iter(self) -> impl Iterator<Item = DepthView<'a>> {
        let images = self.frame.images.iter().zip(self.segmented);
        images.map(move |(image, segmented)| DepthView {
            image,
            background: self.backgrounds.of(image),
            working_from_camera: shifted(&image.world_from_sensor, self.origin),
            segmented: *segmented,
        })
    }
}

impl DepthView<'_> {
    /// What the pixel that a point (camera frame) falls in shows. Images of distorting lenses say nothing: their rays are
    /// known by the pixel, not the pixel by the ray.
    #[inline(always)]
    pub fn at(&self, point: Vec3) -> Pixel {
        let image = self.image;
        let [fx, fy, cx, cy] = image.intrinsics;
        if point.z < NEAREST_SEEN || image.rays.is_some() {
            return Pixel::Unknown;
        }
        let near = 1.0 / point.z;
        // Half a pixel on, so that cutting off rounds.
        let (column, row) = (fx * point.x * near + (cx + 0.5), fy * point.y * near + (cy + 0.5));
        if !(column >= 0.0 && row >= 0.0 && column < image.width as f64 && row < image.height as f64) {
            return Pixel::Unknown;
        }
        // Within the image; a signed cast costs least.
        let index = row as i32 as usize * image.width + column as i32 as usize;
        let z = f64::from(image.pixels.get(index)) * image.metres_per_unit;
        if z.is_nan() || z <= 0.0 {
            return if self.segmented { Pixel::Background(f64::INFINITY) } else { Pixel::Unknown };
        }
        let scene = self.background.and_then(|background| background.depth().get(index));
        if scene.is_some_and(|depth| Background::holds(*depth, z as f32)) {
            Pixel::Background(z)
        } else {
            Pixel::Foreground(z)
        }
    }
}

/// In which images of a frame the body was segmented, into `found`.
pub fn find_segmented(frame: &Frame, found: &mut Vec<bool>) {
    found.clear();
    found.extend(frame.images.iter().map(|image| {
        let (mut none, mut all) = (0_u32, 0_u32);
        for index in (0..image.pixels.len()).step_by(SEGMENTED_STEP) {
            all += 1;
            none += u32::from(image.pixels.get(index) <= 0.0);
        }
        f64::from(none) > SEGMENTED_SHARE * f64::from(all)
    }));
}
