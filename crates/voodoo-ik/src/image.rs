//! The image criterion (J10 eq. 5-8): how far the projected limbs lie outside the silhouettes.

use super::model::{ChainModel, Kinematics};
use super::trunk::Trunk;
use super::view::SilhouetteView;
use voodoo_core::Camera;
use voodoo_core::math::{Mat3, Vec3};

/// Samples on a projected segment, in place of the sum over its pixels in J10 eq. 5.
const SAMPLES: usize = 8;

/// A bone that is to lie inside the silhouettes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bone {
    /// Both ends: a link and a point in its frame.
    pub ends: [(usize, Vec3); 2],
    /// How deep inside the silhouette it must lie at both ends, interpolated between: the limb's radius, meters; 0 is J10's
    /// criterion.
    pub radius: [f64; 2],
    /// The fraction of its length beyond which it must lie outside the trunk; 1: it need not.
    pub apart: f64,
}

/// `h`: mean over all samples of all views of `max(distance + depth, 0)`, pixels (J10 eq. 5). `depth` is the projected radius
/// minus the uncertainty of the border. Where the silhouette is approximately as thin as the limb, it is half the silhouette's
/// width minus half of that uncertainty. Views with depths add how far the bone's flesh lies in front of the measured depth, see
/// [`SilhouetteView::depth`].
#[derive(Clone, Copy, Debug)]
pub struct Criterion<'a> {
    /// The silhouettes.
    pub views: &'a [&'a SilhouetteView],
    /// The bones.
    pub segments: &'a [Bone],
    /// The silhouette counts as the limb itself where its half width is at most this many radii; the bone is then centered in it.
    /// 0: nowhere.
    pub thin: f64,
    /// What the bones may not enter: the trunk, and limbs outside the chain.
    pub trunk: &'a [Trunk],
}

impl Bone {
    /// Positions of the samples as fractions of its length, and its radius there.
    fn samples(&self) -> impl Iterator<Item = (f64, f64)> {
        let [first, last] = self.radius;
        let places = (0..SAMPLES).map(|sample| (sample as f64 + 0.5) / SAMPLES as f64);
        places.map(move |t| (t, first + t * (last - first)))
    }
}

impl Criterion<'_> {
    /// Approximate upper bound of the change of `h` per radian if one view sees the bones outside: their mean projected length,
    /// pixels, as if perpendicular to the line of sight, divided by the number of views. Thus a view without violations does not
    /// change the step.
    pub fn reach(&self, at: &Kinematics) -> f64 {
        let mut sum = 0.0;
        for segment in self.segments {
            let ends = segment.ends.map(|(link, point)| at.poses[link].transform_point(point));
            for view in self.views {
                let z = view.camera_from_world.transform_point(0.5 * (ends[0] + ends[1])).z;
                sum += view.camera.focal()[0] * (ends[1] - ends[0]).length() / z.max(Camera::NEAREST);
            }
        }
        let views = self.views.len();
        sum / (views * views * self.segments.len()).max(1) as f64
    }

    /// Computes the criterion, and its gradient by all unknowns into `gradient` (J10 eq. 7, 8). Samples that no camera sees count
    /// as zero.
    pub fn evaluate(&self, model: &ChainModel, at: &Kinematics, gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let count = self.views.len() * self.segments.len() * SAMPLES;
        if count == 0 {
            return 0.0;
        }
        let fraction = 1.0 / count as f64;
        let mut h = 0.0;
        for segment in self.segments {
            let ends = segment.ends.map(|(link, point)| at.poses[link].transform_point(point));
            // Derivatives of `h` with respect to the world positions of both ends.
            let mut forces = [Vec3::ZERO; 2];
            h += self.within(model, at, segment, &ends, &mut forces, gradient);
            for view in self.views {
                let (a, b) =
                    (view.camera_from_world.transform_point(ends[0]), view.camera_from_world.transform_point(ends[1]));
                let mut slopes = [Vec3::ZERO; 2];
                for (t, radius) in segment.samples() {
                    let (value, slope) = view.outside(a + t * (b - a), radius, self.thin);
                    if value > 0.0 {
                        h += value;
                        slopes[0] += (1.0 - t) * slope;
                        slopes[1] += t * slope;
                    }
                }
                if slopes != [Vec3::ZERO; 2] {
                    let world_from_camera = Mat3::from_quat(view.camera_from_world.rotation).transpose();
                    forces[0] += world_from_camera * slopes[0];
                    forces[1] += world_from_camera * slopes[1];
                }
            }
            for ((link, _), (x, force)) in segment.ends.iter().zip(ends.iter().zip(forces)) {
                if force != Vec3::ZERO {
                    add_force(model, at, *link, *x, fraction * force, gradient);
                }
            }
        }
        fraction * h
    }

    /// How deep the samples of a segment lie in the trunk, in pixels of every view, and the derivative with respect to both ends.
    /// The derivative due to the trunk's own motion is added to `gradient`.
    fn within(
        &self,
        model: &ChainModel,
        at: &Kinematics,
        segment: &Bone,
        ends: &[Vec3; 2],
        forces: &mut [Vec3; 2],
        gradient: &mut [f64],
    ) -> f64 {
        let mut sum = 0.0;
        if segment.apart >= 1.0 || segment.radius == [0.0; 2] {
            return sum;
        }
        let fraction = 1.0 / (self.views.len() * self.segments.len() * SAMPLES) as f64;
        for trunk in self.trunk {
            let pose = trunk.pose(at);
            let [a, b] = ends.map(|end| pose.inverse_transform_point(end));
            for (t, radius) in segment.samples().filter(|(t, _)| *t >= segment.apart) {
                let (depth, slope) = trunk.depth(a + t * (b - a), radius);
                if depth <= 0.0 {
                    continue;
                }
                let (slope, x) = (pose.rotation * slope, ends[0] + t * (ends[1] - ends[0]));
                for view in self.views {
                    let z = view.camera_from_world.transform_point(x).z;
                    if z < Camera::NEAREST {
                        continue;
                    }
                    let scale = view.camera.focal()[0] / z;
                    sum += scale * depth;
                    let nearer = view.camera_from_world.rotation.inverse() * Vec3::Z;
                    let force = scale * (slope - depth / z * nearer);
                    forces[0] += (1.0 - t) * force;
                    forces[1] += t * force;
                    if let Some(link) = trunk.link {
                        add_force(model, at, link, x, -fraction * scale * slope, gradient);
                    }
                }
            }
        }
        sum
    }
}

/// Adds the derivative by all unknowns that move a link, given a force on it at a world position.
fn add_force(model: &ChainModel, at: &Kinematics, link: usize, x: Vec3, force: Vec3, gradient: &mut [f64]) {
    let moment = x.cross(force);
    for &mover in &model.links()[link].movers {
        let column = &at.columns[mover];
        gradient[mover] += column.omega.dot(moment) + column.v.dot(force);
    }
}
