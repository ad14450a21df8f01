//! Color and grayscale images.

use crate::camera::Camera;
use crate::error::Unexpected;
use crate::math::Pose;
use crate::observation::frame::{check_pose, check_size};

/// Maximum time between an image and its frame, seconds: beyond it, the pose at the image's time is unknown.
const LONGEST_ASIDE: f64 = 0.25;

/// The pixels of an image, row by row.
///
/// [`ColorImage`] has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColorPixels<'a> {
    /// Three channels; any order, as long as it is always the same.
    Color(&'a [[u8; 3]]),
    /// Grayscale.
    Gray(&'a [u8]),
}

impl ColorPixels<'_> {
    /// Number of pixels.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Color(pixels) => pixels.len(),
            Self::Gray(pixels) => pixels.len(),
        }
    }

    /// Whether the image is grayscale.
    #[inline(always)]
    pub(crate) fn is_gray(&self) -> bool {
        matches!(self, Self::Gray(_))
    }

    /// The color of a pixel.
    #[inline(always)]
    pub fn get(&self, index: usize) -> [u8; 3] {
        match self {
            Self::Color(pixels) => pixels[index],
            Self::Gray(pixels) => [pixels[index]; 3],
        }
    }
}

/// A color or grayscale image. Its regions locate the contours of limbs (R07 section 3), and colors of clothes distinguish
/// persons.
///
/// The contours of limbs are straight lines and ellipses only in the image of a pinhole camera. For fitting color regions,
/// undistort the image first and pass the resulting pinhole camera. Colors of clothes work with any lens.
///
/// ```
/// use voodoo_core::math::Pose;
/// use voodoo_core::{Body, Camera, ColorImage, ColorPixels, Frame, HumanModel};
///
/// let camera = Camera::pinhole(640, 480, [525.0, 525.0, 319.5, 239.5])?;
/// let bgr = vec![[90_u8, 90, 90]; camera.pixels()];
/// let image = ColorImage {
///     pixels: ColorPixels::Color(&bgr),
///     camera: &camera,
///     world_from_sensor: Pose::IDENTITY,
///     stamp: 0.004, // exposed 4 ms after the frame
///     number: 0,
///     source: 0,
/// };
/// Frame { colors: &[image], ..Frame::empty(0.0) }.check(&Body::human(1.75, HumanModel::Measured)?, None)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ColorImage<'a> {
    /// All pixels of the camera.
    pub pixels: ColorPixels<'a>,
    /// Its calibration.
    pub camera: &'a Camera,
    /// Pose of the camera's optical frame (x right, y down, z forward).
    pub world_from_sensor: Pose,
    /// Time of exposure, seconds.
    pub stamp: f64,
    /// Index of the camera, the same in every frame.
    pub number: u16,
    /// Index of the source, for the report.
    pub source: u16,
}

impl ColorImage<'_> {
    /// Returns an error for an unusable image; `index` is its index in a frame with this `stamp`, after `others`.
    pub(super) fn check(&self, index: usize, stamp: f64, others: &[Self]) -> Result<(), Unexpected> {
        let (what, near) = (format_args!("color[{index}]"), (self.stamp - stamp).abs() <= LONGEST_ASIDE);
        let expected = "a time within 0.25 s of the frame's";
        Unexpected::unless(near, format_args!("{what}.stamp"), expected, self.stamp)?;
        check_size(format_args!("{what}.image"), self.pixels.len(), self.camera)?;
        check_pose(format_args!("{what}.world_from_sensor"), &self.world_from_sensor)?;
        let first = others.iter().all(|other| other.number != self.number);
        let (what, found) = (format_args!("{what}.source"), "a second one of this");
        Unexpected::unless(first, what, "one picture of each camera", found)
    }
}
