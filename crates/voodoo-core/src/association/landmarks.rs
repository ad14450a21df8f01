//! Steps 4b-6: named sites with positions and rays, and the elastic bands (K06 IV-B.4-6, K07 4.3).

use crate::association::correspondence::{Band, Correspondences, SitePair};
use crate::body::Body;
use crate::math::{Mat3, Pose, Vec3};
use crate::observation::frame::Frame;

/// Weight of the bands of a limb that nothing measures, in points; only their proportions matter there.
const UNMEASURED: f64 = 1.0;

/// Share of a weight that is left when a datum at this distance may always be `bias` off: the force on the site is then
/// that of the part of the distance which is no bias, and nothing pulls once the rest of the frame has brought the site
/// near. What a detector calls a hand is not where the body has its hand, in frame after frame to the same side.
fn beyond(bias: f64, distance: f64) -> f64 {
    if bias <= 0.0 { 1.0 } else { (1.0 - bias / distance.max(bias)).max(0.0) }
}

impl Correspondences {
    /// Point-to-point relations, and for every ray the closest point on it (K06 IV-B.4 and 5).
    pub fn add_sites(&mut self, body: &Body, poses: &[Pose], frame: &Frame, origin: Vec3) {
        self.sites.clear();
        let place = |site: usize| {
            let site = &body.sites()[site];
            (site.limb, poses[site.limb] * site.position)
        };
        for relation in frame.positions {
            let (limb, x) = place(relation.site);
            let p = relation.position - origin;
            let weight = relation.weight * beyond(relation.bias, (x - p).length());
            self.sites.push(SitePair {
                limb,
                x,
                p,
                weight,
                base_weight: relation.weight,
                bias: relation.bias,
                across: Mat3::IDENTITY,
                information: Mat3::IDENTITY * weight,
                source: relation.source,
            });
        }
        for relation in frame.rays {
            let (limb, x) = place(relation.site);
            let start = relation.origin - origin;
            let direction = relation.direction.normalize();
            // A site behind the sensor is drawn to the sensor, not to the ray's mirror image.
            let p = start + direction * (x - start).dot(direction).max(0.0);
            let across = Mat3::IDENTITY
                - Mat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
            let weight = relation.weight * beyond(relation.bias, (x - p).length());
            self.sites.push(SitePair {
                limb,
                x,
                p,
                weight,
                base_weight: relation.weight,
                bias: relation.bias,
                across,
                information: across * weight,
                source: relation.source,
            });
        }
    }

    /// The bands of all joints at their current lengths. A limb's bands together weigh `ratio` times its measurements, each
    /// joint by its own weight (K07 4.3: the ratio of artificial to measured stays constant).
    pub fn add_bands(&mut self, body: &Body, poses: &[Pose], ratio: f64, measured: &mut Vec<f64>) {
        self.bands.clear();
        measured.clear();
        for limb in 0..poses.len() {
            let weight = ratio * self.measured_weight(limb);
            let joints = body.limbs().iter().enumerate();
            let count = joints
                .filter(|(index, other)| {
                    other.parent.as_ref().is_some_and(|(parent, _)| *index == limb || *parent == limb)
                })
                .count();
            measured.push(if weight > 0.0 { weight } else { UNMEASURED } / count.max(1) as f64);
        }
        for (child, limb) in body.limbs().iter().enumerate() {
            let Some((parent, joint)) = &limb.parent else { continue };
            let share = joint.weight / joint.band_count() as f64;
            for point in joint.band_points() {
                self.bands.push(Band {
                    parent: *parent,
                    child,
                    on_parent: poses[*parent] * (joint.parent_from_joint * point),
                    on_child: poses[child] * (joint.limb_from_joint * point),
                    parent_weight: share * measured[*parent],
                    child_weight: share * measured[child],
                });
            }
        }
    }
}
