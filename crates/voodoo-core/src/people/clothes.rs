//! Color histograms of a person's clothes, above and below the waist.

use crate::body::{Body, LimbRole};
use crate::math::{Pose, Vec3};
use crate::observation::frame::{DepthImage, Frame};
use crate::observation::picture::ColorImage;
use crate::visibility::surface::surface_rows;
use crate::visibility::{EXPLAINED, across_limb};

/// Positions across a limb at which colors are sampled, as fractions of its radius from the axis. The rim is left out because its
/// pixels may show the background.
const ACROSS: [f64; 5] = across_limb(0.5);
/// Number of bins of brightness and of the two color differences.
const BINS: [usize; 3] = [5, 9, 9];
/// Range of the color differences that the bins cover; clothes rarely exceed it.
const COLORFUL: f32 = 80.0;
/// An observation with fewer samples than this is ignored.
const FEWEST_PLACES: usize = 15;
/// Least weight of a new observation in the running mean.
const NEW_WEIGHT: f32 = 0.1;

/// Relative frequency of each color; the sum is one.
#[derive(Clone, Debug, Default)]
struct ClothesHistogram {
    frequencies: Vec<f32>,
    updates: f32,
}

/// Color histograms of a person's clothes, as far as observed.
#[derive(Clone, Debug, Default)]
pub(super) struct Clothes {
    worn: [ClothesHistogram; 2],
}

impl Clothes {
    /// Updates with the colors of a posed body (world frame). `own` returns for the number of a depth image and a pixel whether
    /// the pixel may show this body.
    pub(super) fn observe(&mut self, frame: &Frame, body: &Body, poses: &[Pose], own: impl Fn(usize, usize) -> bool) {
        for (half, histogram) in self.worn.iter_mut().enumerate() {
            let mut counts = vec![0.0; BINS.iter().product()];
            let mut places = 0;
            for (index, (limb, pose)) in body.limbs().iter().zip(poses).enumerate() {
                if body.roles().limb(index).and_then(half_of) != Some(half) {
                    continue;
                }
                for (number, image) in frame.images.iter().enumerate() {
                    let camera_from_limb = image.world_from_sensor.inverse() * *pose;
                    for (.., points) in surface_rows(&limb.shape, &camera_from_limb, ACROSS) {
                        for place in points {
                            let Some(point) = surface(image, place, |pixel| own(number, pixel)) else { continue };
                            let world = image.world_from_sensor * point;
                            if let Some(color) = frame.colors.iter().find_map(|picture| color_at(picture, world)) {
                                add(&mut counts, color);
                                places += 1;
                            }
                        }
                    }
                }
            }
            if places >= FEWEST_PLACES {
                histogram.update(&counts, places as f32);
            }
        }
    }

    /// Returns the distance between two persons' clothes, from 0 to 1, by the colors of all halves of the body that were observed:
    /// at a wrong pose, what is seen above the waist may be worn below it. `None` if one of them was not observed.
    pub(super) fn distance(&self, other: &Self) -> Option<f64> {
        let alike: f32 = self.colors()?.iter().zip(other.colors()?).map(|(a, b)| (a * b).sqrt()).sum();
        Some(1.0 - f64::from(alike))
    }

    /// The mean frequency of each color over the observed halves of the body; `None` if neither was observed.
    fn colors(&self) -> Option<Vec<f32>> {
        let halves: Vec<&Vec<f32>> =
            self.worn.iter().filter(|half| half.updates > 0.0).map(|half| &half.frequencies).collect();
        let mean = |bin| halves.iter().map(|half| half[bin]).sum::<f32>() / halves.len() as f32;
        Some((0..halves.first()?.len()).map(mean).collect())
    }
}

/// Returns whether a limb shows clothes above the waist (0) or below it (1).
fn half_of(limb: LimbRole) -> Option<usize> {
    match limb {
        LimbRole::Thorax | LimbRole::UpperArm(_) => Some(0),
        LimbRole::Thigh(_) | LimbRole::Calf(_) => Some(1),
        _ => None,
    }
}

impl ClothesHistogram {
    fn update(&mut self, counts: &[f32], total: f32) {
        self.frequencies.resize(counts.len(), 0.0);
        self.updates += 1.0;
        let new = NEW_WEIGHT.max(1.0 / self.updates);
        for (weight, count) in self.frequencies.iter_mut().zip(counts) {
            *weight += new * (count / total - *weight);
        }
    }
}

/// Returns the measured point of a limb's surface whose expected position is `place`, camera frame.
fn surface(image: &DepthImage, place: Vec3, own: impl Fn(usize) -> bool) -> Option<Vec3> {
    let pixel = image.camera.index_of(place)?;
    let z = f64::from(image.pixels.get(pixel)) * image.meters_per_unit;
    ((z - place.z).abs() < 2.0 * EXPLAINED && own(pixel)).then(|| place * (z / place.z))
}

/// Returns a picture's color at a world position.
fn color_at(picture: &ColorImage, world: Vec3) -> Option<[u8; 3]> {
    let place = picture.world_from_sensor.inverse_transform_point(world);
    Some(picture.pixels.get(picture.camera.index_of(place)?))
}

/// Adds a color to the nearest bins, with trilinear weights.
fn add(counts: &mut [f32], [first, green, last]: [u8; 3]) {
    let [x, y, z] = [first, green, last].map(f32::from);
    // Brightness and color differences. The order of red and blue does not matter as long as it is always the same.
    let brightness = 0.2 * x + 0.6 * y + 0.2 * z;
    let place = |value: f32, bins: usize| (value * (bins - 1) as f32).clamp(0.0, (bins - 1) as f32);
    let difference = |value: f32| (value - brightness) / (2.0 * COLORFUL) + 0.5;
    let at =
        [place(brightness / f32::from(u8::MAX), BINS[0]), place(difference(x), BINS[1]), place(difference(z), BINS[2])];
    for corner in 0..8_usize {
        let (mut index, mut weight) = (0, 1.0);
        for axis in 0..3 {
            let low = at[axis].floor().min((BINS[axis] - 2) as f32);
            let fraction = at[axis] - low;
            let high = (corner >> axis) & 1;
            weight *= if high == 1 { fraction } else { 1.0 - fraction };
            index = index * BINS[axis] + low as usize + high;
        }
        counts[index] += weight;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clothes of one color above the waist and one below it, as far as observed.
    fn clothes(halves: [Option<usize>; 2]) -> Clothes {
        let mut clothes = Clothes::default();
        for (histogram, color) in clothes.worn.iter_mut().zip(halves) {
            if let Some(color) = color {
                let mut counts = vec![0.0; BINS.iter().product()];
                counts[color] = 20.0;
                histogram.update(&counts, 20.0);
            }
        }
        clothes
    }

    #[test]
    fn trousers_that_count_as_a_shirt_are_as_near_as_trousers_alone_and_other_clothes_are_far() {
        let person = clothes([Some(1), Some(2)]);
        let distance = |halves| person.distance(&clothes(halves));
        assert!(distance([Some(1), Some(2)]).is_some_and(|same| same < 1e-6));
        let part = distance([None, Some(2)]);
        assert!(part.is_some_and(|part| part < 0.3) && part == distance([Some(2), None]));
        assert_eq!(distance([Some(3), Some(4)]), Some(1.0));
        assert_eq!(distance([None, None]), None);
    }
}
