//! The color model of skin: two histograms of chroma, of skin and of what is around it, learned with a forgetting factor.

/// Bins of either axis of chroma, Cr and Cb.
const CHROMA_BINS: usize = 64;
const BINS: usize = CHROMA_BINS * CHROMA_BINS;
/// Pixels with less luma have no reliable chroma.
const DARKEST: i32 = 30;
/// Mean chroma (Cr, Cb) of human skin of any tone under white light, of 256.
const PRIOR_MIDDLE: [f32; 2] = [150.0, 110.0];
/// Standard deviation of that chroma.
const PRIOR_SPREAD: f32 = 8.0;
/// Least likelihood ratio of skin to its surroundings for a color to count as skin.
const RATIO: f32 = 2.0;
/// Least likelihood ratio of a color of the face to be learned, since a head seen from behind shows hair.
const NEAR_RATIO: f32 = 1.0;
/// Weight of the old histograms after each further image.
const FORGETTING: f32 = 0.86;
/// The same in the first images, in which the colors of all skin tones become those of this person.
const FORGETTING_AT_FIRST: f32 = 0.5;
const FIRST_IMAGES: u32 = 5;
/// Least number of pixels to learn from.
const FEWEST: f32 = 20.0;
/// Fraction of the surroundings that is spread evenly over all colors, so that a color never observed is not skin.
const UNSEEN: f32 = 0.05;

/// Classifies colors by the ratio of two histograms.
#[derive(Clone, Debug)]
pub struct SkinColors {
    /// Histogram of skin, by Cr and Cb.
    pub skin: Vec<f32>,
    /// Number of images that were learned from.
    pub learned: u32,
    rest: Vec<f32>,
}

/// Bin of a color (blue, green, red) by chroma as in ITU-R BT.601; `None` if it is dark.
fn bin(color: [u8; 3]) -> Option<usize> {
    let [b, g, r] = color.map(i32::from);
    // Coefficients in units of 2^-14.
    let rounded = |sum: i32| (sum + (1 << 13)) >> 14;
    let luma = rounded(1868 * b + 9617 * g + 4899 * r);
    let chroma = |difference: i32, weight: i32| rounded(difference * weight + (128 << 14)).clamp(0, 255) as usize >> 2;
    (luma >= DARKEST).then(|| chroma(r - luma, 11682) * CHROMA_BINS + chroma(b - luma, 9241))
}

impl Default for SkinColors {
    /// Returns the prior: the colors of all skin tones in surroundings of any color.
    fn default() -> Self {
        let off = |bin: usize, middle: f32| (((bin as f32 + 0.5) * 4.0 - middle) / PRIOR_SPREAD).powi(2);
        let bell = |index: usize| {
            let [cr, cb] = [index / CHROMA_BINS, index % CHROMA_BINS];
            (-0.5 * (off(cr, PRIOR_MIDDLE[0]) + off(cb, PRIOR_MIDDLE[1]))).exp()
        };
        let mut skin: Vec<f32> = (0..BINS).map(bell).collect();
        normalize(&mut skin);
        Self { skin, learned: 0, rest: vec![1.0 / BINS as f32; BINS] }
    }
}

impl SkinColors {
    /// Whether skin is so many times as likely as its surroundings to have the colors of a bin.
    fn is_above(&self, bin: usize, ratio: f32) -> bool {
        self.skin[bin] > ratio * self.rest[bin]
    }

    /// Whether a color (blue, green, red) is that of skin.
    pub(super) fn contains(&self, color: [u8; 3]) -> bool {
        bin(color).is_some_and(|bin| self.is_above(bin, RATIO))
    }

    /// Learns from the pixels of a face, of which those near the colors of skin count, and from those that show no skin.
    pub(super) fn learn(&mut self, face: impl Iterator<Item = [u8; 3]>, rest: impl Iterator<Item = [u8; 3]>) {
        let near = |bin: &usize| self.is_above(*bin, NEAR_RATIO);
        let Some(skin) = histogram(face.filter_map(bin).filter(near)) else { return };
        let Some(rest) = histogram(rest.filter_map(bin)) else { return };
        let keep = if self.learned < FIRST_IMAGES { FORGETTING_AT_FIRST } else { FORGETTING };
        let mixed = |old: &mut f32, new: f32| *old = keep * *old + (1.0 - keep) * new;
        self.skin.iter_mut().zip(skin).for_each(|(old, new)| mixed(old, new));
        let unseen = UNSEEN / BINS as f32;
        self.rest.iter_mut().zip(rest).for_each(|(old, new)| mixed(old, (1.0 - UNSEEN) * new + unseen));
        self.learned += 1;
    }
}

/// Smoothed and normalized histogram of colors; `None` for fewer than [`FEWEST`].
fn histogram(bins: impl Iterator<Item = usize>) -> Option<Vec<f32>> {
    let mut values = vec![0.0_f32; BINS];
    bins.for_each(|bin| values[bin] += 1.0);
    if values.iter().sum::<f32>() < FEWEST {
        return None;
    }
    for step in [1, 1, CHROMA_BINS, CHROMA_BINS] {
        // A binomial kernel along one axis; its ends are repeated.
        let place = |index: usize| index / step % CHROMA_BINS;
        let smoothed = |index: usize| {
            let low = if place(index) > 0 { index - step } else { index };
            let high = if place(index) + 1 < CHROMA_BINS { index + step } else { index };
            0.25 * values[low] + 0.5 * values[index] + 0.25 * values[high]
        };
        values = (0..BINS).map(smoothed).collect();
    }
    normalize(&mut values);
    Some(values)
}

fn normalize(values: &mut [f32]) {
    let total: f32 = values.iter().sum();
    values.iter_mut().for_each(|value| *value /= total.max(f32::MIN_POSITIVE));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_those_of_opencv() {
        // Pixels (blue, green, red) and Cr, Cb of cvtColor(COLOR_BGR2YCrCb) of OpenCV 5.0; the first three are dark.
        let known = [
            ([17, 9, 28], None),
            ([0, 0, 0], None),
            ([255, 0, 0], None),
            ([255, 255, 255], Some([128, 128])),
            ([0, 255, 0], Some([21, 43])),
            ([0, 0, 255], Some([255, 85])),
            ([213, 171, 45], Some([62, 170])),
            ([153, 178, 215], Some([149, 109])),
        ];
        for (color, chroma) in known {
            assert_eq!(bin(color), chroma.map(|[cr, cb]| (cr >> 2) * 64 + (cb >> 2)), "{color:?}");
        }
    }

    #[test]
    fn the_colors_of_a_face_are_learned_and_those_around_it_are_not() {
        let (face, wood, hair) = ([120, 150, 205], [60, 110, 170], [60, 60, 60]);
        let mut colors = SkinColors::default();
        assert!(colors.contains(face) && colors.contains(wood) && !colors.contains(hair));
        for _ in 0..8 {
            colors.learn([face, hair].repeat(50).into_iter(), [wood].repeat(90).into_iter());
        }
        assert!(colors.contains(face) && !colors.contains(wood) && !colors.contains(hair));
        assert!((colors.skin.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        let (before, learned) = (colors.skin.clone(), colors.learned);
        colors.learn([hair].repeat(50).into_iter(), [wood].repeat(90).into_iter());
        assert!(colors.skin == before && colors.learned == learned, "a head from behind");
    }
}
