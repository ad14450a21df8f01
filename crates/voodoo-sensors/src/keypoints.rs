//! Converts the 2-D keypoints of a network into measurements of body sites.

use crate::eye::Eye;
use crate::sites::SiteGate;
use voodoo_core::math::Vec3;

/// Standard deviation added for each meter of the person's own body before the site, beyond half a limb: the network guesses such
/// a site.
const GUESSED: f64 = 0.4;

/// A site and the keypoints that define it.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteKeypoints {
    /// Its name.
    pub site: String,
    /// Index and weight of each keypoint.
    pub weights: Vec<(usize, f64)>,
    /// Standard deviation between the network's and this library's definition of the site, meters.
    pub spread: f64,
    /// Distance of the site behind the visible surface, meters.
    pub behind: f64,
}

/// The camera of an image, and how its keypoints become measurements.
#[derive(Clone, Copy, Debug)]
pub struct Sensor<'a> {
    /// Calibration and pose of the camera.
    pub eye: Eye<'a>,
    /// Name of the source.
    pub source: &'a str,
    /// Standard deviation of a keypoint with confidence 1, pixels.
    pub noise: f64,
    /// Least standard deviation of a 3-D position from depth, meters: the uncertainty of the site's distance behind the surface.
    pub place_sigma: f64,
    /// Time of the frame, seconds.
    pub stamp: f64,
}

/// A detected site and its context.
#[derive(Clone, Copy, Debug)]
pub struct SiteObservation {
    /// Its column and row.
    pub pixel: [f64; 2],
    /// Its confidence, at most 1.
    pub confidence: f64,
    /// Predicted position, world frame, meters.
    pub expected: Vec3,
    /// Length of the person's own body in front of the site, meters.
    pub hidden: f64,
    /// Measured depth at the pixel along the optical axis, meters.
    pub surface: Option<f64>,
}

/// The measurement that a detected site becomes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SiteMeasurement {
    /// The unit direction of a ray in the world frame, and its standard deviation at the site, meters.
    Ray(Vec3, f64),
    /// A 3-D position in the world frame and its standard deviation, meters.
    Place(Vec3, f64),
    /// Rejected: it is too far from the prediction, or the lens model has no ray for the pixel.
    Dropped,
}

impl SiteKeypoints {
    /// Column and row of a site from keypoints (column, row, confidence), and their least confidence, at most 1; `None` if one of
    /// them is missing or has a confidence below `least`.
    pub fn pixel(&self, keypoints: &[[f64; 3]], least: f64) -> Option<([f64; 2], f64)> {
        let (mut pixel, mut total, mut confidence) = ([0.0; 2], 0.0, 1.0_f64);
        for (index, weight) in &self.weights {
            let [u, v, reliability] = *keypoints.get(*index)?;
            pixel = [pixel[0] + weight * u, pixel[1] + weight * v];
            total += reliability;
            confidence = if reliability < confidence { reliability } else { confidence };
        }
        // Missing keypoints are not finite, which makes the sums not finite.
        let known = (pixel[0] + pixel[1] + total).is_finite() && confidence >= least && confidence > 0.0;
        known.then_some((pixel, confidence))
    }

    /// Returns a 3-D position where the measured surface passes the gate, else a ray where that passes the gate.
    pub fn measurement(
        &self,
        observation: &SiteObservation,
        sensor: &Sensor,
        mut gate: Option<&mut SiteGate>,
    ) -> SiteMeasurement {
        let (eye, expected) = (&sensor.eye, observation.expected);
        let direction = eye.direction(observation.pixel);
        let depth = eye.in_sensor(expected).z;
        let away = eye.distance_from_ray(expected, direction);
        if !(depth > 0.0 && away >= 0.0) {
            return SiteMeasurement::Dropped;
        }
        let across = sensor.noise / observation.confidence.min(1.0) * depth / eye.focal();
        let sigma = across.hypot(self.spread);
        let mut accepts = |distance: f64, source: &str| {
            gate.as_deref_mut().is_none_or(|gate| gate.accepts(&self.site, distance, sensor.stamp, source))
        };
        if let Some(surface) = observation.surface {
            let place = eye.origin() + direction * (surface / direction.dot(eye.axis()) + self.behind);
            if accepts(place.distance(expected), "points") {
                return SiteMeasurement::Place(place, sigma.max(sensor.place_sigma));
            }
        }
        if !accepts(away, sensor.source) {
            return SiteMeasurement::Dropped;
        }
        let hidden = observation.hidden - self.behind;
        let sigma = if hidden > 0.0 { sigma.hypot(GUESSED * hidden) } else { sigma };
        SiteMeasurement::Ray(direction, sigma)
    }
}

/// Index of the person whose sites have the least median distance from their predicted pixels (column, row; NaN if unknown);
/// `None` if no person shares a site with the prediction.
pub fn nearest_person<'a>(
    people: impl Iterator<Item = &'a [[f64; 3]]>,
    layout: &[SiteKeypoints],
    expected: &[[f64; 2]],
    least: f64,
) -> Option<usize> {
    let middle = |(number, keypoints): (usize, &[[f64; 3]])| {
        let apart = |(part, place): (&SiteKeypoints, &[f64; 2])| {
            let ([u, v], _) = part.pixel(keypoints, least)?;
            Some((u - place[0]).hypot(v - place[1])).filter(|distance| distance.is_finite())
        };
        let mut distances: Vec<f64> = layout.iter().zip(expected).filter_map(apart).collect();
        distances.sort_unstable_by(f64::total_cmp);
        let upper = distances.get(distances.len() / 2)?;
        let lower = distances.get((distances.len() - 1) / 2)?;
        Some((number, 0.5 * (lower + upper)))
    };
    let nearest = people.enumerate().filter_map(middle).min_by(|a, b| a.1.total_cmp(&b.1));
    nearest.map(|(number, _)| number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(weights: &[(usize, f64)]) -> SiteKeypoints {
        SiteKeypoints { site: "l_wrist".to_owned(), weights: weights.to_vec(), spread: 0.02, behind: 0.03 }
    }

    #[test]
    fn a_site_is_where_its_keypoints_are_and_unseen_without_one_of_them() {
        let rows = [[100.0, 50.0, 0.9], [120.0, 54.0, 0.4], [0.0, 0.0, 0.0], [1.0, f64::NAN, 0.9]];
        let ears = part(&[(0, 0.5), (1, 0.5)]);
        assert_eq!(ears.pixel(&rows, 0.1), Some(([110.0, 52.0], 0.4)));
        assert_eq!(ears.pixel(&rows, 0.5), None);
        for missing in [2, 3, 4] {
            assert_eq!(part(&[(0, 0.5), (missing, 0.5)]).pixel(&rows, 0.0), None, "{missing}");
        }
    }

    #[test]
    fn the_nearest_of_several_people_is_the_one() {
        let layout = [part(&[(0, 1.0)]), part(&[(1, 1.0)]), part(&[(2, 1.0)])];
        let far = [[90.0, 10.0, 1.0], [90.0, 20.0, 1.0], [90.0, 30.0, 1.0]];
        let near = [[12.0, 10.0, 1.0], [12.0, 20.0, 1.0], [99.0, 30.0, 1.0]];
        let expected = [[10.0, 10.0], [10.0, 20.0], [10.0, 30.0]];
        let choose = |people: &[&[[f64; 3]]], expected: &[[f64; 2]]| {
            nearest_person(people.iter().copied(), &layout, expected, 0.1)
        };
        assert_eq!(choose(&[&far, &near], &expected), Some(1));
        assert_eq!(choose(&[], &expected), None);
        assert_eq!(choose(&[&near], &[[f64::NAN; 2]; 3]), None);
    }
    #[test]
    fn what_was_visible_becomes_a_ray_or_a_place_or_is_dropped() {
        let camera = voodoo_core::Camera::pinhole(320, 240, [300.0, 300.0, 160.0, 120.0]).unwrap();
        let eye = Eye { world_from_sensor: voodoo_core::math::Affine3::IDENTITY, camera: &camera };
        let sensor = Sensor { eye, source: "camera", noise: 3.0, place_sigma: 0.03, stamp: 0.0 };
        let (pixel, expected) = ([160.0, 120.0], Vec3::new(0.05, 0.0, 2.0));
        let observation = SiteObservation { pixel, confidence: 1.0, expected, hidden: 0.0, surface: None };
        let wrist = part(&[(0, 1.0)]);
        let mut gate = SiteGate::new(0.1, 0.0, 0.1);
        let sigma = |measured: SiteMeasurement| match measured {
            SiteMeasurement::Ray(_, sigma) => sigma,
            _ => f64::NAN,
        };
        let clear = sigma(wrist.measurement(&observation, &sensor, Some(&mut gate)));
        assert!((clear - 0.02_f64.hypot(0.02)).abs() < 1e-12);
        let behind = SiteObservation { hidden: 0.13, ..observation };
        assert!((sigma(wrist.measurement(&behind, &sensor, None)) - clear.hypot(0.04)).abs() < 1e-12);
        let deep = SiteObservation { surface: Some(1.95), ..observation };
        let SiteMeasurement::Place(place, least) = wrist.measurement(&deep, &sensor, Some(&mut gate)) else {
            panic!("a place")
        };
        assert!(place.distance(Vec3::new(0.0, 0.0, 1.98)) < 1e-12 && least == 0.03);
        let before = SiteObservation { surface: Some(1.0), ..observation };
        assert!(
            matches!(wrist.measurement(&before, &sensor, Some(&mut gate)), SiteMeasurement::Ray(..)),
            "what hides it is refused"
        );
        let far = SiteObservation { expected: Vec3::new(0.2, 0.0, 2.0), ..observation };
        assert_eq!(wrist.measurement(&far, &sensor, Some(&mut gate)), SiteMeasurement::Dropped);
        for wrong in [
            SiteObservation { pixel: [f64::NAN; 2], ..observation },
            SiteObservation { expected: -Vec3::Z, ..observation },
        ] {
            assert_eq!(wrist.measurement(&wrong, &sensor, None), SiteMeasurement::Dropped);
        }
    }
}
