//! The empty scene of a camera: a background color per pixel, and the likelihood of another color there.

use super::histogram::{Kind, SIDE};
use crate::error::Unexpected;
use crate::observation::picture::{ColorImage, ColorPixels};

/// Minimum standard deviation of a channel, of 255: sensor noise and compression.
const LEAST_SIGMA: f32 = 6.0;
/// Probability that a pixel without the body has its background color, and probability that it has any color of the surroundings
/// instead: shadows and lamps change many pixels.
const CHANGED: f32 = 0.5;

/// The background colors of one camera.
#[derive(Clone, Debug)]
pub(super) struct EmptyScene {
    size: [usize; 2],
    kind: Kind,
    mean: Vec<[u8; 3]>,
    /// Logarithm of the greatest probability of a bin, and one over twice the variance of a channel.
    most: f32,
    narrow: f32,
}

impl EmptyScene {
    /// The mean and variance of images of one size (height, width) and kind; `None` without images.
    pub(super) fn from_pictures(pictures: &[(ColorPixels, [usize; 2])]) -> Result<Option<Self>, Unexpected> {
        let Some((first, size)) = pictures.first() else { return Ok(None) };
        let kind = Kind::new(first);
        for (index, (pixels, found)) in pictures.iter().enumerate() {
            let count = found[0].saturating_mul(found[1]);
            let valid = found == size && Kind::new(pixels) == kind && pixels.len() == count && count > 0;
            let (what, expected) =
                (format!("images[{index}]"), "pictures of the empty scene, all of one size and kind");
            let found = format!("{:?} of {}x{} beside {}x{}", Kind::new(pixels), found[1], found[0], size[1], size[0]);
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
        let variance = (squares / (3.0 * mean.len() as f64 * f64::from((count - 1.0).max(1.0)))) as f32;
        let sigma = variance.sqrt().max(LEAST_SIGMA);
        let width = (std::f32::consts::TAU.sqrt() * sigma).ln();
        let most = match kind {
            Kind::Color => (SIDE as f32).ln() * 3.0 - 3.0 * width,
            Kind::Gray => -width,
        };
        Ok(Some(Self { size: *size, kind, mean, most: most.min(0.0), narrow: 0.5 / (sigma * sigma) }))
    }

    /// Returns an error for an image that cannot be compared with the empty scene.
    pub(super) fn check(&self, picture: &ColorImage, index: usize) -> Result<(), Unexpected> {
        let [height, width] = [picture.camera.height(), picture.camera.width()];
        let valid = self.size == [height, width] && self.kind == Kind::new(&picture.pixels);
        let (what, expected) = (format_args!("color[{index}].image"), "a picture like those of the empty scene");
        let found = format_args!("{width}x{height} beside {}x{}", self.size[1], self.size[0]);
        Unexpected::unless(valid, what, expected, found)
    }

    /// Log-likelihood of this color at a pixel that does not show the body; `around` is the log-likelihood under the colors of
    /// the surroundings.
    #[inline]
    pub(super) fn log(&self, index: usize, pixel: [u8; 3], around: f32) -> f32 {
        let (here, value) = (self.mean[index].map(f32::from), pixel.map(f32::from));
        let square: f32 = match self.kind {
            Kind::Color => (0..3).map(|channel| (value[channel] - here[channel]).powi(2)).sum(),
            Kind::Gray => (value[0] - here[0]).powi(2),
        };
        (self.most - self.narrow * square).max(around) + CHANGED.ln()
    }
}
