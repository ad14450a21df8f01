//! The network's input for a candidate: 96 x 96 pixels around its center, rotated so that up in the world is up in the image.

use crate::components::PersonCandidate;
use crate::segmentation::Segmentation;
use voodoo_core::math::Vec3;

/// Pixels along an edge.
pub const SIZE: usize = 96;
/// Its width at the depth of the candidate's center, meters, where it is not enlarged.
pub(crate) const WIDTH: f64 = 2.6;
/// Range of depth in front of and behind the center that is resolved there, meters.
const DEPTH: f64 = 1.2;
/// Below this sine of the angle between up and the optical axis, up is not defined in the image.
const LEAST_UP: f64 = 0.3;

/// An input image, and the transform from it back to the camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Crop {
    /// For every pixel, row by row: its depth behind the center divided by `DEPTH`, from -1 to 1; and 1 on the candidate, else 0.
    pub pixels: Vec<[f32; 2]>,
    /// Its center: `(x/z, y/z)` in the rotated camera, and the depth in meters.
    pub middle: [f64; 3],
    /// Angle by which the camera is rotated about its optical axis so that up is up, radians.
    pub roll: f64,
    /// Factor by which it is enlarged: a person of 1 m looks like one of `enlarged` meters.
    pub enlarged: f64,
}

impl Segmentation {
    /// The network's input for a candidate of the last image, `enlarged` by this factor. `None` if the candidate has no pixels.
    pub fn crop(&self, candidate: &PersonCandidate, enlarged: f64) -> Option<Crop> {
        let Self { view, parts, up, .. } = self;
        // Up in the world is up in the image, unless the camera looks along the vertical.
        let roll = if up.x.hypot(up.y) < LEAST_UP { 0.0 } else { (-up.x).atan2(-up.y) };
        let (sin, cos) = roll.sin_cos();
        let (sin, cos) = (sin as f32, cos as f32);
        let member = |index: usize| candidate.has(&parts.labels[index]);
        let (mut xs, mut ys, mut zs) = (Vec::new(), Vec::new(), Vec::new());
        for index in (0..view.depth.len()).filter(|index| member(*index)) {
            let [x, y] = view.slopes[index];
            xs.push(cos * x - sin * y);
            ys.push(sin * x + cos * y);
            zs.push(view.depth[index]);
        }
        let middle = [median(&mut xs)?, median(&mut ys)?, median(&mut zs)?];
        let z0 = middle[2];
        let (size, half) = ((WIDTH / enlarged / SIZE as f64) as f32, 0.5 * (SIZE as f32 - 1.0));
        let range = (DEPTH / enlarged) as f32;
        let pixel = |number: usize| {
            let x = middle[0] + ((number % SIZE) as f32 - half) * size / z0;
            let y = middle[1] + ((number / SIZE) as f32 - half) * size / z0;
            let index = view.pixel_at([cos * x + sin * y, cos * y - sin * x]).filter(|index| member(*index));
            index.map_or([1.0, 0.0], |index| [((view.depth[index] - z0) / range).clamp(-1.0, 1.0), 1.0])
        };
        let pixels = (0..SIZE * SIZE).map(pixel).collect();
        Some(Crop { pixels, middle: middle.map(f64::from), roll, enlarged })
    }
}

impl Crop {
    /// Converts a position relative to the center (meters right, down and behind, enlarged) to a point in the camera frame.
    pub fn to_camera(&self, place: Vec3) -> Vec3 {
        let place = place / self.enlarged;
        let [x0, y0, z0] = self.middle;
        let z = z0 + place.z;
        let turned = Vec3::new(z * (x0 + place.x / z0), z * (y0 + place.y / z0), z);
        let (sin, cos) = self.roll.sin_cos();
        Vec3::new(cos * turned.x + sin * turned.y, cos * turned.y - sin * turned.x, turned.z)
    }
}

fn median(values: &mut [f32]) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::{before_wall, image, standing};
    use voodoo_core::DepthImage;
    use voodoo_core::Surroundings;
    use voodoo_core::math::{Pose, Quat};

    #[test]
    fn places_of_the_picture_are_where_the_camera_saw_them() {
        let (body, poses) = standing();
        let pixels = before_wall(&body, &poses);
        for (roll, enlarged) in [(0.0, 1.0), (0.6, 1.0), (0.6, 1.4)] {
            let world_from_sensor = Pose::from_parts(Vec3::ZERO, Quat::from_axis_angle(Vec3::Z, roll));
            let image = DepthImage { world_from_sensor, ..image(&pixels) };
            let mut segmentation = Segmentation::default();
            let around = Surroundings { up: Some(-Vec3::Y), ..Surroundings::default() };
            segmentation.find(&image, &around);
            let candidate = segmentation.candidates[0].clone();
            let crop = segmentation.crop(&candidate, enlarged).unwrap();
            assert!((crop.roll - roll).abs() < 1e-9, "{}", crop.roll);
            // Every pixel on the person, transformed back to the camera frame, coincides with a measured point.
            let mask = segmentation.mask(&candidate);
            let point = |pixel: &usize| image.back_project(*pixel, 0.001 * image.pixels.get(*pixel));
            let points: Vec<Vec3> = mask.iter().map(point).collect();
            let half = 0.5 * (SIZE as f64 - 1.0);
            let mut inside = 0;
            for (index, [depth, mask]) in crop.pixels.iter().enumerate().filter(|(_, pixel)| pixel[1] > 0.0) {
                let [column, row] = [index % SIZE, index / SIZE].map(|at| (at as f64 - half) * WIDTH / SIZE as f64);
                let place = crop.to_camera(Vec3::new(column, row, DEPTH * f64::from(*depth)));
                let nearest = points.iter().map(|point| point.distance(place)).fold(f64::INFINITY, f64::min);
                assert!(nearest < 0.02 && *mask == 1.0, "{nearest}");
                inside += 1;
            }
            assert!(inside as f64 > 300.0 * enlarged * enlarged, "{inside}");
        }
    }
}
