//! Steps 4b-6: named sites with positions and rays, and the elastic bands (K06 IV-B.4-6, K07 4.3).

use crate::association::correspondence::{BandEnd, Correspondences, SitePair};
use crate::body::{Body, Site};
use crate::math::{Mat3, Pose, Vec3};
use crate::observation::frame::{Frame, PositionRelation, RayRelation};

/// Weight of the bands of a limb without measurements, in points; only their proportions matter there.
const UNMEASURED: f64 = 1.0;

/// Factor of a weight for a datum at this distance with a constant error of up to `bias`. With it, the force on the site is that
/// of the part of the distance beyond the bias, and becomes zero once other measurements have brought the site near. A
/// detector's definition of a hand position differs from the body model's by a nearly constant offset.
fn beyond(bias: f64, distance: f64) -> f64 {
    if bias <= 0.0 { 1.0 } else { (1.0 - bias / distance.max(bias)).max(0.0) }
}

impl Correspondences {
    /// Point-to-point pairs, and for every ray the closest point on it (K06 IV-B.4 and 5).
    pub(crate) fn add_sites(&mut self, body: &Body, poses: &[Pose], frame: &Frame, origin: Vec3) {
        self.sites.clear();
        let pair = |site: usize, target: &dyn Fn(Vec3) -> Vec3, across: Mat3, (base_weight, bias, source)| {
            let Site { limb, position: local, .. } = body.sites()[site];
            let x = poses[limb] * local;
            let p = target(x);
            let weight = base_weight * beyond(bias, (x - p).length());
            SitePair { limb, local, x, p, weight, base_weight, bias, across, source }
        };
        for PositionRelation { site, position, weight, bias, source } in frame.positions {
            let target = |_| *position - origin;
            self.sites.push(pair(*site, &target, Mat3::IDENTITY, (*weight, *bias, *source)));
        }
        for RayRelation { site, origin: start, direction, weight, bias, source } in frame.rays {
            let (start, direction) = (*start - origin, direction.normalize());
            // A site behind the sensor is pulled towards the sensor, not towards the mirror image of the ray.
            let target = |x: Vec3| start + direction * (x - start).dot(direction).max(0.0);
            let across = Mat3::IDENTITY
                - Mat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
            self.sites.push(pair(*site, &target, across, (*weight, *bias, *source)));
        }
    }

    /// The bands of all joints at their current lengths. The bands of a limb together weigh `ratio` times its measurements,
    /// distributed over its joints by joint weight (K07 4.3: the ratio of artificial to measured weight stays constant).
    pub(crate) fn add_bands(&mut self, body: &Body, poses: &[Pose], ratio: f64, measured: &mut Vec<f64>) {
        self.bands.clear();
        measured.clear();
        for limb in 0..poses.len() {
            let weight = ratio * self.measured_weight(limb);
            let count = body.children(limb).count() + usize::from(body.parent(limb).is_some());
            measured.push(if weight > 0.0 { weight } else { UNMEASURED } / count.max(1) as f64);
        }
        for (child, parent, joint) in body.joints() {
            let fraction = joint.weight / joint.band_points().count() as f64;
            for point in joint.band_points() {
                let on_parent = poses[parent] * (joint.parent_from_joint * point);
                let on_child = poses[child] * (joint.limb_from_joint * point);
                for (limb, x, p) in [(parent, on_parent, on_child), (child, on_child, on_parent)] {
                    self.bands.push(BandEnd { limb, x, p, weight: fraction * measured[limb] });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::association::correspondence::LimbMatches;
    use crate::body::HumanModel;
    use crate::observation::frame::{PositionRelation, RayRelation};

    #[test]
    fn the_bands_of_a_limb_weigh_a_fixed_fraction_of_its_measurements() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = body.rest_pose(Pose::IDENTITY);
        let mut all = Correspondences::default();
        all.limbs.resize_with(poses.len(), LimbMatches::default);
        for (limb, matches) in all.limbs.iter_mut().enumerate() {
            matches.weight = vec![0.5; 3 * limb];
            matches.surface.signed_distance = vec![0.0; 3 * limb];
        }
        all.add_bands(&body, &poses, 0.4, &mut Vec::new());
        let joints: usize =
            body.limbs().iter().flat_map(|limb| &limb.parent).map(|(_, joint)| joint.band_points().count()).sum();
        assert_eq!(all.bands.len(), 2 * joints);
        for limb in 0..poses.len() {
            let total: f64 = all.bands.iter().filter(|end| end.limb == limb).map(|end| end.weight).sum();
            let measured = 0.5 * (3 * limb) as f64;
            let expected = if measured > 0.0 { 0.4 * measured } else { UNMEASURED };
            assert!((total - expected).abs() < 1e-9, "limb {limb}: {total} of {measured}");
        }
        for band in &all.bands {
            assert!((band.x - band.p).length() < 1e-9, "closed joints have bands of length zero");
        }
    }

    #[test]
    fn a_ray_draws_its_site_to_its_nearest_point() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = body.rest_pose(Pose::from_translation(Vec3::new(0.0, 0.0, 1.0)));
        let site = body.site_index("l_wrist").unwrap();
        let x = poses[body.sites()[site].limb] * body.sites()[site].position;
        let ray =
            |origin: Vec3, direction: Vec3, bias| RayRelation { site, origin, direction, weight: 2.0, bias, source: 1 };
        let rays = [
            ray(Vec3::new(2.0, 0.5, 1.2), Vec3::new(-1.0, 0.1, -0.2), 0.0),
            // The site lies behind the start of this ray, so the start is the nearest point.
            ray(x + Vec3::new(0.3, 0.0, 0.0), Vec3::X, 0.1),
        ];
        let origin = Vec3::new(0.1, -0.2, 0.3);
        let working: Vec<Pose> =
            poses.iter().map(|pose| Pose::from_parts(pose.translation - origin, pose.rotation)).collect();
        let mut all = Correspondences::default();
        all.add_sites(&body, &working, &Frame { rays: &rays, ..Frame::empty(0.0) }, origin);
        for (pair, ray) in all.sites.iter().zip(&rays) {
            // Brute-force search along the ray.
            let steps = (0..400_000).map(|k| ray.origin - origin + ray.direction * (1e-5 * f64::from(k)));
            let nearest = steps.map(|place| place.distance(pair.x)).fold(f64::INFINITY, f64::min);
            assert!((pair.x.distance(pair.p) - nearest).abs() < 1e-5, "{pair:?}");
            assert!((pair.across * ray.direction).length() < 1e-9, "nothing holds along the ray");
        }
        // A third of the 0.3 m may be bias.
        assert!((all.sites[1].weight - 2.0 * (1.0 - 0.1 / 0.3)).abs() < 1e-9 && all.sites[1].base_weight == 2.0);
    }

    #[test]
    fn a_position_within_its_bias_has_no_effect() {
        let body = Body::human(1.75, HumanModel::Papers).unwrap();
        let poses = body.rest_pose(Pose::IDENTITY);
        let site = body.site_index("r_hip").unwrap();
        let x = poses[body.sites()[site].limb] * body.sites()[site].position;
        let position =
            |off: f64| PositionRelation { site, position: x + off * Vec3::Y, weight: 4.0, bias: 0.05, source: 0 };
        let positions = [position(0.04), position(0.2)];
        let mut all = Correspondences::default();
        all.add_sites(&body, &poses, &Frame { positions: &positions, ..Frame::empty(0.0) }, Vec3::ZERO);
        assert_eq!(all.sites[0].weight, 0.0);
        // The force, weight times distance, is that of the part beyond the bias.
        assert!((all.sites[1].weight * 0.2 - 4.0 * 0.15).abs() < 1e-9);
    }
}
