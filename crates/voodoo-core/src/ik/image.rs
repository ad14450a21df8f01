//! The image criterion (J10 eq. 5-8): how far the projected limbs lie outside the silhouettes.

use super::model::{Kinematics, Model};
use super::trunk::{Carrier, Trunk};
use crate::geometry::{Mat3, Pose, Vec3};

/// Samples on a projected segment, in place of the sum over its pixels in J10 eq. 5.
pub const SAMPLES: usize = 8;
/// Points nearer to the camera plane than this, or behind it, are not seen; metres.
const NEAREST: f64 = 0.05;

/// One calibrated silhouette: pinhole camera and signed Euclidean distance transform, pixels, negative inside the person.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Distances, row by row; at least 2 x 2.
    pub distance: &'a [f32],
    /// Of every pixel inside, the radius of the largest disc within the silhouette that covers it, pixels: half its local
    /// width. As many as distances, or none: then no bone is centred.
    pub thickness: &'a [f32],
    /// How far its border may be from where it should be, pixels: that much less deep is deep enough. The middle between two
    /// borders is known to half of that.
    pub border: f64,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal lengths fx, fy and centre cx, cy, pixels; integer coordinates are pixel centres.
    pub intrinsics: [f64; 4],
    /// Pose of the world in the optical frame.
    pub camera_from_world: Pose,
}

/// A bone that shall lie inside the silhouettes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Part and point in its frame of both ends.
    pub ends: [(usize, Vec3); 2],
    /// How deep inside it shall lie at both ends, and in proportion between: the limb's radius, metres; 0 is J10's criterion.
    pub radius: [f64; 2],
    /// From which share of its length on it lies outside of the trunk; 1: it need not.
    pub apart: f64,
}

/// `h`: mean over all samples of all views of `max(distance + depth, 0)`, pixels (J10 eq. 5); depth: the projected radius less
/// what the border is uncertain by or, where the silhouette is about as thin as the limb, half the silhouette's width less half
/// of that.
#[derive(Clone, Copy, Debug)]
pub struct Criterion<'a> {
    /// The silhouettes.
    pub views: &'a [View<'a>],
    /// The bones.
    pub segments: &'a [Segment],
    /// Up to how many radii the silhouette is the limb itself, in whose middle the bone shall lie; 0: nowhere.
    pub thin: f64,
    /// What the bones cannot lie in: the trunk, and limbs beside the chain.
    pub trunk: &'a [Trunk],
}

impl Criterion<'_> {
    /// What `h` changes by at most per radian, about, if one of the views sees the bones outside: their mean projected length, pixels,
    /// if they lay across the line of sight, over the number of views. So a view that is content changes no step.
    pub fn reach(&self, at: &Kinematics) -> f64 {
        let mut sum = 0.0;
        for segment in self.segments {
            let ends = segment.ends.map(|(part, point)| at.poses[part].transform_point(point));
            for view in self.views {
                let z = view.camera_from_world.transform_point(0.5 * (ends[0] + ends[1])).z;
                sum += view.intrinsics[0] * (ends[1] - ends[0]).length() / z.max(NEAREST);
            }
        }
        let views = self.views.len();
        sum / (views * views * self.segments.len()).max(1) as f64
    }

    /// The criterion, and its gradient by all unknowns into `gradient` (J10 eq. 7, 8). Samples no camera sees count zero.
    pub fn evaluate(&self, model: &Model, at: &Kinematics, gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let count = self.views.len() * self.segments.len() * SAMPLES;
        if count == 0 {
            return 0.0;
        }
        let share = 1.0 / count as f64;
        let mut h = 0.0;
        for segment in self.segments {
            let ends = segment.ends.map(|(part, point)| at.poses[part].transform_point(point));
            // Derivatives of h by the world positions of both ends.
            let mut forces = [Vec3::ZERO; 2];
            h += self.within(model, at, segment, &ends, &mut forces, gradient);
            for view in self.views {
                let (a, b) =
                    (view.camera_from_world.transform_point(ends[0]), view.camera_from_world.transform_point(ends[1]));
                let mut slopes = [Vec3::ZERO; 2];
                for t in places() {
                    let radius = segment.radius[0] + t * (segment.radius[1] - segment.radius[0]);
                    let (value, slope) = view.outside(a + t * (b - a), radius, self.thin);
                    h += value;
                    slopes[0] += (1.0 - t) * slope;
                    slopes[1] += t * slope;
                }
                let world_from_camera = Mat3::from_quat(view.camera_from_world.rotation).transpose();
                forces[0] += world_from_camera * slopes[0];
                forces[1] += world_from_camera * slopes[1];
            }
            for ((part, _), (x, force)) in segment.ends.iter().zip(ends.iter().zip(forces)) {
                if force != Vec3::ZERO {
                    pull(model, at, *part, *x, share * force, gradient);
                }
            }
        }
        share * h
    }

    /// How deep the samples of a segment lie in the trunk, in pixels of every view, and the derivative by both ends; that by
    /// the trunk's own motion goes into `gradient`.
    fn within(
        &self,
        model: &Model,
        at: &Kinematics,
        segment: &Segment,
        ends: &[Vec3; 2],
        forces: &mut [Vec3; 2],
        gradient: &mut [f64],
    ) -> f64 {
        let mut sum = 0.0;
        if segment.apart >= 1.0 || segment.radius == [0.0; 2] {
            return sum;
        }
        let share = 1.0 / (self.views.len() * self.segments.len() * SAMPLES) as f64;
        for trunk in self.trunk {
            let pose = trunk.pose(at);
            let [a, b] = ends.map(|end| pose.inverse_transform_point(end));
            for t in places().filter(|t| *t >= segment.apart) {
                let radius = segment.radius[0] + t * (segment.radius[1] - segment.radius[0]);
                let (depth, slope) = trunk.depth(a + t * (b - a), radius);
                if depth <= 0.0 {
                    continue;
                }
                let (slope, x) = (pose.rotation * slope, ends[0] + t * (ends[1] - ends[0]));
                for view in self.views {
                    let z = view.camera_from_world.transform_point(x).z;
                    if z < NEAREST {
                        continue;
                    }
                    let scale = view.intrinsics[0] / z;
                    sum += scale * depth;
                    let nearer = view.camera_from_world.rotation.inverse() * Vec3::Z;
                    let force = scale * (slope - depth / z * nearer);
                    forces[0] += (1.0 - t) * force;
                    forces[1] += t * force;
                    if let Carrier::Part(part) = trunk.carrier {
                        pull(model, at, part, x, -share * scale * slope, gradient);
                    }
                }
            }
        }
        sum
    }
}

/// Adds the derivative by all unknowns that move a part: a force on it at a world position.
fn pull(model: &Model, at: &Kinematics, part: usize, x: Vec3, force: Vec3, gradient: &mut [f64]) {
    let moment = x.cross(force);
    for &mover in model.movers(part) {
        let column = &at.columns[mover];
        gradient[mover] += column.omega.dot(moment) + column.v.dot(force);
    }
}

/// Where on a segment the samples are, as shares of its length.
fn places() -> impl Iterator<Item = f64> {
    (0..SAMPLES).map(|sample| (sample as f64 + 0.5) / SAMPLES as f64)
}

impl View<'_> {
    /// `max(distance + depth, 0)` of a point in the optical frame and its derivative by that point.
    fn outside(&self, x: Vec3, radius: f64, thin: f64) -> (f64, Vec3) {
        if x.z < NEAREST {
            return (0.0, Vec3::ZERO);
        }
        let [fx, fy, cx, cy] = self.intrinsics;
        let inverse = 1.0 / x.z;
        let (px, py) = (x.x * inverse, x.y * inverse);
        let Some(at) = self.locate(fx * px + cx, fy * py + cy) else { return (0.0, Vec3::ZERO) };
        let [distance, mut du, mut dv] = at.sample(self.distance, self.width);
        let projected = fx * radius * inverse;
        let mut depth = (projected - self.border).max(0.0);
        // The derivative of the depth by the distance from the camera plane.
        let mut closer = if depth > 0.0 { projected } else { 0.0 };
        let middle = 0.5 * self.border;
        // No place is deeper than half the width: what is too deep to be thin need not be looked up.
        if distance < 0.0 && -distance <= thin * projected && distance + thin * projected - middle > 0.0 {
            let [half, su, sv] = at.sample(self.thickness, self.width);
            if half <= thin * projected && half - middle > depth {
                depth = half - middle;
                (du, dv, closer) = (du + su, dv + sv, 0.0);
            }
        }
        let value = distance + depth;
        if value <= 0.0 {
            return (0.0, Vec3::ZERO);
        }
        let (gx, gy) = (du * fx, dv * fy);
        (value, Vec3::new(gx, gy, -(gx * px + gy * py) - closer) * inverse)
    }

    /// The four pixels around a place; outside of the picture those of its border.
    fn locate(&self, u: f64, v: f64) -> Option<Place> {
        let (right, bottom) = ((self.width - 1) as f64, (self.height - 1) as f64);
        let (x, y) = (u.clamp(0.0, right), v.clamp(0.0, bottom));
        let column = (x as usize).min(self.width - 2);
        let row = (y as usize).min(self.height - 2);
        let place =
            Place { start: row * self.width + column, s: x - column as f64, t: y - row as f64, beyond: [u - x, v - y] };
        (place.start + self.width + 2 <= self.distance.len()).then_some(place)
    }
}

/// A place between four pixels, and how far beyond the picture it lies.
struct Place {
    start: usize,
    s: f64,
    t: f64,
    beyond: [f64; 2],
}

impl Place {
    /// Bilinear interpolation and its gradient; outside of the picture the distance to its border is added: what is not in the
    /// picture is background. Zero for an image of another size.
    fn sample(&self, image: &[f32], width: usize) -> [f64; 3] {
        let (s, t) = (self.s, self.t);
        let (Some(upper), Some(lower)) =
            (image.get(self.start..self.start + 2), image.get(self.start + width..self.start + width + 2))
        else {
            return [0.0; 3];
        };
        let [d00, d01, d10, d11] = [upper[0], upper[1], lower[0], lower[1]].map(f64::from);
        let (first, second) = (d00 + s * (d01 - d00), d10 + s * (d11 - d10));
        let value = first + t * (second - first);
        let (mut du, mut dv) = ((1.0 - t) * (d01 - d00) + t * (d11 - d10), second - first);
        let [ox, oy] = self.beyond;
        if ox == 0.0 && oy == 0.0 {
            return [value, du, dv];
        }
        let beyond = ox.hypot(oy);
        if ox != 0.0 {
            du = ox / beyond;
        }
        if oy != 0.0 {
            dv = oy / beyond;
        }
        [value + beyond, du, dv]
    }
}
