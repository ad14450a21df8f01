//! Lines across the contour of limbs: their positions in an image, and what borders the limb there.

use super::labels::{LimbLabels, NOTHING};
use super::scan::LineEdge;
use crate::body::Body;
use crate::camera::Camera;
use crate::math::{Pose, Vec3};
use crate::observation::frame::DepthImage;

/// Points on the rim of a free end.
const RIM: usize = 8;
/// Distance inside and outside of the contour at which the label is read, units: label images are coarse.
pub(super) const BESIDE: f32 = 3.0;
/// A limb that lies behind an adjacent limb by less than this is not its background, meters.
const FAR_BEHIND: f32 = 0.10;
/// A limb nearer than another by more than this occludes it, meters.
pub(super) const NEARER_BY: f32 = 0.03;

/// A line across the contour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub limb: u16,
    /// The contour's point, limb frame.
    pub foot: Vec3,
    /// Its projection, pixels, and the unit vector outward.
    pub place: [f32; 2],
    pub normal: [f32; 2],
    /// Gradient of the outward image motion with respect to the position of the foot: pixels per meter, camera frame.
    pub motion: Vec3,
    /// Depth of the limb's surface there, meters.
    pub depth: f32,
    /// Width of the limb along the line, units; infinite where the limb does not end.
    pub width: f32,
    /// The label outside of the limb on this side, and on the opposite side: a limb, or nothing.
    pub outside: u16,
    pub opposite: u16,
    /// Whether the limb is visible here and not occluded by what is outside; and whether that holds on both sides.
    pub clear: bool,
    pub both: bool,
    /// Whether something other than the body occludes it.
    pub hidden: bool,
    /// The edge that was found on it.
    pub edge: Option<LineEdge>,
}

/// A depth camera within this distance of another camera has the same view, meters.
pub(super) const SAME_VIEW: f64 = 0.15;
/// A measurement nearer than a limb by more than this occludes it, meters: the limbs may not have converged yet.
const BEFORE_BY: f64 = 0.15;

/// Data for placing the lines of a limb.
pub(super) struct Viewer<'a> {
    pub body: &'a Body,
    pub camera: &'a Camera,
    pub labels: &'a LimbLabels,
    /// Pixels per unit.
    pub unit: f32,
    pub world_from_camera: Pose,
    /// The image of a depth camera beside the camera, if the frame has one: it measures what occludes the body.
    pub depth: Option<&'a DepthImage<'a>>,
}

impl Viewer<'_> {
    /// Adds the given number of lines on each side of a limb, and the lines at its free ends.
    pub(super) fn add(&self, index: usize, camera_from_limb: &Pose, a_side: usize, lines: &mut Vec<Line>) {
        let limb = &self.body.limbs()[index];
        let camera = camera_from_limb.inverse_transform_point(Vec3::ZERO);
        for height in 0..a_side {
            let t = (height as f64 + 0.5) / a_side as f64;
            let Some(points) = limb.shape.contour(t, camera) else { continue };
            let sides = points.map(|[point, normal]| {
                let normal = camera_from_limb.rotation * normal;
                let [fx, fy] = self.camera.focal();
                self.line(index, camera_from_limb, point, [normal.x / fx, normal.y / fy])
            });
            let [Some(first), Some(second)] = sides else { continue };
            let apart = [second.place[0] - first.place[0], second.place[1] - first.place[1]];
            for (line, other) in [(first, second), (second, first)] {
                let width = (apart[0] * line.normal[0] + apart[1] * line.normal[1]).abs() / self.unit;
                lines.push(Line { width, opposite: other.outside, both: line.clear && other.clear, ..line });
            }
        }
        for (distal, _) in [false, true].into_iter().zip(limb.match_caps).filter(|(_, free)| *free) {
            self.add_rim(index, camera_from_limb, distal, lines);
        }
    }

    fn add_rim(&self, index: usize, camera_from_limb: &Pose, distal: bool, lines: &mut Vec<Line>) {
        let shape = &self.body.limbs()[index].shape;
        let camera = camera_from_limb.inverse_transform_point(Vec3::ZERO);
        let middle = *camera_from_limb * (0.5 * shape.length() * Vec3::Z);
        let Some(middle) = self.camera.project(middle) else { return };
        for corner in 0..RIM {
            let (s, c) = f64::sin_cos(std::f64::consts::TAU * corner as f64 / RIM as f64);
            let Some([point, along]) = shape.rim_contour(distal, [c, s], camera) else { continue };
            let place = *camera_from_limb * point;
            let along = camera_from_limb.rotation * along;
            // The projection of the rim's direction; the normal is perpendicular to it, away from the limb.
            let motion = [[1.0, 0.0], [0.0, 1.0]].map(|axis| self.camera.gradient(place, axis));
            let ([Some(x), Some(y)], Some(projected)) = (motion, self.camera.project(place)) else { continue };
            let [x, y] = [x.dot(along), y.dot(along)];
            let out = (projected[0] - middle[0]) * y - (projected[1] - middle[1]) * x;
            let normal = if out > 0.0 { [y, -x] } else { [-y, x] };
            lines.extend(self.line(index, camera_from_limb, point, normal));
        }
    }

    fn line(&self, limb: usize, camera_from_limb: &Pose, foot: Vec3, normal: [f64; 2]) -> Option<Line> {
        let point = *camera_from_limb * foot;
        let norm = (normal[0] * normal[0] + normal[1] * normal[1]).sqrt();
        if !(point.z > Camera::NEAREST && norm > 0.0) {
            return None;
        }
        let n = normal.map(|value| value / norm);
        let place = self.camera.project(point)?.map(|value| value as f32);
        let (normal, motion) = (n.map(|value| value as f32), self.camera.gradient(point, n)?);
        let (outside, depth, clear) = self.border(limb, place, normal)?;
        let measured = self.depth.and_then(|depth| depth.measured(self.world_from_camera * point));
        let hidden = measured.is_some_and(|[depth, expected]| depth > 0.0 && depth < expected - BEFORE_BY);
        Some(Line {
            limb: limb as u16,
            foot,
            place,
            normal,
            motion,
            depth,
            width: f32::INFINITY,
            outside,
            opposite: NOTHING,
            clear: clear && !hidden,
            both: false,
            hidden,
            edge: None,
        })
    }

    /// What borders a limb at a pixel of its contour: the limb outside, the depth inside, and whether the contour is clear.
    /// `None` outside of the image.
    fn border(&self, limb: usize, place: [f32; 2], normal: [f32; 2]) -> Option<(u16, f32, bool)> {
        let at = |outward: f32| {
            let [u, v] = [0, 1].map(|axis| place[axis] + outward * normal[axis]);
            let inside = u >= 0.0 && v >= 0.0 && u < self.camera.width() as f32 && v < self.camera.height() as f32;
            inside.then(|| self.labels.at(u as usize, v as usize))
        };
        let beside = BESIDE * self.unit;
        let ((own, depth), (outside, behind)) = (at(-beside)?, at(beside)?);
        let clear = usize::from(own) == limb
            && usize::from(outside) != limb
            && (outside == NOTHING || {
                let far = if self.body.adjacent(limb, usize::from(outside)) { FAR_BEHIND } else { -NEARER_BY };
                behind > depth + far
            });
        Some((outside, depth, clear))
    }
}
