//! The empty scene of a camera: a background color per pixel, and the likelihood of another color there.

use super::histogram::SIDE;
use crate::error::Unexpected;
use crate::observation::picture::{ColorImage, ColorPixels};

/// Minimum standard deviation of a channel or of brightness, of 255: sensor noise and compression.
pub(super) const LEAST_SIGMA: f32 = 6.0;
/// Probability that a pixel without the body has its background color, and probability that it has any color of the surroundings
/// instead: shadows and lamps change many pixels.
const CHANGED: f32 = 0.5;
/// Channels of a color.
const CHANNELS: f32 = 3.0;

/// The background colors of one camera.
#[derive(Clone, Debug)]
pub(super) struct EmptyScene {
    size: [usize; 2],
    /// Whether the images are grayscale.
    gray: bool,
    mean: Vec<[u8; 3]>,
    /// Logarithm of the greatest probability of a bin, and one over twice the variance of a channel.
    most: f32,
    narrow: f32,
}

impl EmptyScene {
    /// The mean and variance of images of one size (height, width) and kind; `None` without images.
    pub(super) fn from_pictures(pictures: &[(ColorPixels, [usize; 2])]) -> Result<Option<Self>, Unexpected> {
        let Some((first, size)) = pictures.first() else { return Ok(None) };
        let gray = first.is_gray();
        for (index, (pixels, found)) in pictures.iter().enumerate() {
            let count = found[0].saturating_mul(found[1]);
            let valid = found == size && pixels.is_gray() == gray && pixels.len() == count && count > 0;
            let (what, expected) =
                (format!("images[{index}]"), "pictures of the empty scene, all of one size and kind");
            let kind = if pixels.is_gray() { "grayscale" } else { "color" };
            let found = format!("{kind} of {}x{} beside {}x{}", found[1], found[0], size[1], size[0]);
            Unexpected::unless(valid, what, expected, found)?;
        }
        let count = pictures.len() as f32;
        let mut squares = 0.0_f64;
        let mean = (0..first.len()).map(|index| {
            let mut sums = [[0.0_f32; 3]; 2];
            for (pixels, _) in pictures {
                for (channel, value) in pixels.get(index).into_iter().enumerate() {
                    sums[0][channel] += f32::from(value);
                    sums[1][channel] += f32::from(value).powi(2);
                }
            }
            let [sum, square] = sums;
            squares += (0..3).map(|channel| f64::from(square[channel] - sum[channel].powi(2) / count)).sum::<f64>();
            sum.map(|sum| (sum / count).round() as u8)
        });
        let mean: Vec<[u8; 3]> = mean.collect();
        let variance = (squares / (f64::from(CHANNELS) * mean.len() as f64 * f64::from((count - 1.0).max(1.0)))) as f32;
        let sigma = variance.sqrt().max(LEAST_SIGMA);
        let width = (std::f32::consts::TAU.sqrt() * sigma).ln();
        let most = if gray { -width } else { (SIDE as f32).ln() * CHANNELS - CHANNELS * width };
        Ok(Some(Self { size: *size, gray, mean, most: most.min(0.0), narrow: 0.5 / (sigma * sigma) }))
    }

    /// Returns an error for an image that cannot be compared with the empty scene.
    pub(super) fn check(&self, picture: &ColorImage, index: usize) -> Result<(), Unexpected> {
        let [height, width] = [picture.camera.height(), picture.camera.width()];
        let valid = self.size == [height, width] && self.gray == picture.pixels.is_gray();
        let (what, expected) = (format_args!("color[{index}].image"), "a picture like those of the empty scene");
        let found = format_args!("{width}x{height} beside {}x{}", self.size[1], self.size[0]);
        Unexpected::unless(valid, what, expected, found)
    }

    /// Log-likelihood of this color at a pixel that does not show the body; `around` is the log-likelihood under the colors of
    /// the surroundings.
    #[inline]
    pub(super) fn log(&self, index: usize, pixel: [u8; 3], around: f32) -> f32 {
        let (here, value) = (self.mean[index].map(f32::from), pixel.map(f32::from));
        let square = |channel: usize| (value[channel] - here[channel]).powi(2);
        let square: f32 = if self.gray { square(0) } else { (0..3).map(square).sum() };
        (self.most - self.narrow * square).max(around) + CHANGED.ln()
    }
}
