//! Colour and grey pictures.

use crate::error::TrackError;
use crate::math::{Pose, is_rigid};

/// A picture is taken at most so long before or after its frame, seconds: beyond, nobody knows where the body was.
const LONGEST_ASIDE: f64 = 0.25;

/// The pixels of a picture, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColorPixels<'a> {
    /// Three channels in any order that is always the same.
    Color(&'a [[u8; 3]]),
    /// Brightness alone.
    Grey(&'a [u8]),
}

impl ColorPixels<'_> {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        match self {
            Self::Color(pixels) => pixels.len(),
            Self::Grey(pixels) => pixels.len(),
        }
    }

    /// True when there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The colour of a pixel.
    #[inline(always)]
    pub fn get(&self, index: usize) -> [u8; 3] {
        match self {
            Self::Color(pixels) => pixels[index],
            Self::Grey(pixels) => [pixels[index]; 3],
        }
    }
}

/// A colour or grey picture: its regions tell where limbs end (R07 section 3), and clothes tell persons apart. Straight lines
/// have to be straight in it.
#[derive(Clone, Copy, Debug)]
pub struct ColorImage<'a> {
    /// `width * height` pixels.
    pub pixels: ColorPixels<'a>,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// As of a [`DepthImage`].
    pub intrinsics: [f64; 4],
    /// Pose of the camera's optical frame (x right, y down, z forward).
    pub world_from_sensor: Pose,
    /// When it was taken, seconds.
    pub stamp: f64,
    /// Number of the camera, the same in every frame.
    pub camera: u16,
    /// Number of the source, for the report.
    pub source: u16,
}

impl ColorImage<'_> {
    /// Refuses what cannot be used: `index` is its number in a frame of this `stamp`, after `others`.
    pub(super) fn check(&self, index: usize, stamp: f64, others: &[Self]) -> Result<(), TrackError> {
        let wrong = |part: &str, expected, found: String| {
            Err(TrackError::measurement(format!("color[{index}].{part}"), expected, found))
        };
        let aside = (self.stamp - stamp).abs();
        if !(aside <= LONGEST_ASIDE) {
            return wrong("stamp", "a time within 0.25 s of the frame's", self.stamp.to_string());
        }
        if self.pixels.len() != self.width.saturating_mul(self.height) || self.pixels.is_empty() {
            let found = format!("{} for {}x{}", self.pixels.len(), self.width, self.height);
            return wrong("image", "width x height pixels", found);
        }
        let [fx, fy, cx, cy] = self.intrinsics;
        if !(fx > 0.0 && fy > 0.0 && [fx, fy, cx, cy].iter().all(|value| value.is_finite())) {
            return wrong("camera", "positive focal lengths and a finite centre", format!("{:?}", self.intrinsics));
        }
        if !is_rigid(&self.world_from_sensor) {
            return wrong("world_from_sensor", "a rigid transform", format!("{:?}", self.world_from_sensor));
        }
        if others.iter().any(|other| other.camera == self.camera) {
            return wrong("source", "one picture of each camera", "a second one of this".into());
        }
        Ok(())
    }
}
