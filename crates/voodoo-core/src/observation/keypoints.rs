//! What the 2-D keypoints of a network say about the sites of a body.

use crate::math::Vec3;
use crate::observation::eye::Eye;

/// A site, and the keypoints that it is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Number and share of each.
    pub shares: Vec<(usize, f64)>,
    /// How far the network's idea of the site lies from ours, metres.
    pub spread: f64,
}

/// A site seen in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SitePixel {
    /// Column and row.
    pub pixel: [f64; 2],
    /// The least of its keypoints' confidences, at most 1.
    pub confidence: f64,
}

impl Part {
    /// Where a site is by keypoints (column, row, confidence); none where one of them is missing, or believed less than `least`.
    pub fn pixel(&self, keypoints: &[[f64; 3]], least: f64) -> Option<SitePixel> {
        let (mut pixel, mut total, mut confidence) = ([0.0; 2], 0.0, 1.0_f64);
        for (index, share) in &self.shares {
            let [u, v, believed] = *keypoints.get(*index)?;
            pixel = [pixel[0] + share * u, pixel[1] + share * v];
            total += believed;
            confidence = if believed < confidence { believed } else { confidence };
        }
        // What is not finite anywhere is not in the sums.
        let known = (pixel[0] + pixel[1] + total).is_finite() && confidence >= least && confidence > 0.0;
        known.then_some(SitePixel { pixel, confidence })
    }
}

/// A site on the ray on which it was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SiteSight {
    /// Unit vector in the world; NaN where the lens cannot be inverted.
    pub direction: Vec3,
    /// Of the place where the site is expected, along the optical axis, metres.
    pub depth: f64,
    /// From that place to the ray, metres.
    pub away: f64,
    /// Standard deviation across the ray, metres.
    pub sigma: f64,
}

impl SitePixel {
    /// The ray behind `flat`, the pixel without the lens (`x/z`, `y/z`), for a site that is expected at a place of the world.
    pub fn sight(&self, eye: &Eye, flat: [f64; 2], place: Vec3, spread: f64, noise: f64) -> SiteSight {
        let direction = eye.direction(flat);
        let depth = eye.in_sensor(place).z;
        let offset = place - eye.origin();
        let away = (offset - offset.dot(direction).max(0.0) * direction).length();
        let across = noise / self.confidence.min(1.0) * depth / eye.focal();
        SiteSight { direction, depth, away, sigma: across.hypot(spread) }
    }
}

/// Number of the person whose sites lie nearest to where they are expected in the picture (column, row; NaN: nowhere), by the median
/// distance; none without any site that both have.
pub fn nearest_person<'a>(
    people: impl Iterator<Item = &'a [[f64; 3]]>,
    parts: &[Part],
    expected: &[[f64; 2]],
    least: f64,
) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for (number, keypoints) in people.enumerate() {
        let apart = |(part, place): (&Part, &[f64; 2])| {
            let [u, v] = part.pixel(keypoints, least)?.pixel;
            Some((u - place[0]).hypot(v - place[1])).filter(|distance| distance.is_finite())
        };
        let mut distances: Vec<f64> = parts.iter().zip(expected).filter_map(apart).collect();
        distances.sort_unstable_by(f64::total_cmp);
        let Some(upper) = distances.get(distances.len() / 2) else { continue };
        let lower = distances.get((distances.len() - 1) / 2).unwrap_or(upper);
        let middle = 0.5 * (lower + upper);
        if best.is_none_or(|(_, least)| middle < least) {
            best = Some((number, middle));
        }
    }
    best.map(|(number, _)| number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(shares: &[(usize, f64)]) -> Part {
        Part { shares: shares.to_vec(), spread: 0.02 }
    }

    #[test]
    fn a_site_is_where_its_keypoints_are_and_unseen_without_one_of_them() {
        let rows = [[100.0, 50.0, 0.9], [120.0, 54.0, 0.4], [0.0, 0.0, 0.0], [1.0, f64::NAN, 0.9]];
        let ears = part(&[(0, 0.5), (1, 0.5)]);
        assert_eq!(ears.pixel(&rows, 0.1), Some(SitePixel { pixel: [110.0, 52.0], confidence: 0.4 }));
        assert_eq!(ears.pixel(&rows, 0.5), None);
        for missing in [2, 3, 4] {
            assert_eq!(part(&[(0, 0.5), (missing, 0.5)]).pixel(&rows, 0.0), None, "{missing}");
        }
    }

    #[test]
    fn the_nearest_of_several_people_is_the_one() {
        let parts = [part(&[(0, 1.0)]), part(&[(1, 1.0)]), part(&[(2, 1.0)])];
        let far = [[90.0, 10.0, 1.0], [90.0, 20.0, 1.0], [90.0, 30.0, 1.0]];
        let near = [[12.0, 10.0, 1.0], [12.0, 20.0, 1.0], [99.0, 30.0, 1.0]];
        let expected = [[10.0, 10.0], [10.0, 20.0], [10.0, 30.0]];
        let choose = |people: &[&[[f64; 3]]], expected: &[[f64; 2]]| {
            nearest_person(people.iter().copied(), &parts, expected, 0.1)
        };
        assert_eq!(choose(&[&far, &near], &expected), Some(1));
        assert_eq!(choose(&[], &expected), None);
        assert_eq!(choose(&[&near], &[[f64::NAN; 2]; 3]), None);
    }
}
