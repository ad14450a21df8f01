//! One image of the image criterion: how far a point lies outside the silhouette, or in front of the measured depth.

use voodoo_core::Camera;
use voodoo_core::math::{Pose, Vec3};

/// Four neighboring depths that differ by more than this fraction do not belong to one surface.
const EDGE: f64 = 0.03;
/// Minimum distance of a bone behind the measured surface of its limb, in radii. It is one for a limb perpendicular to the line
/// of sight, and less where the person is slimmer than the body model.
const LEAST_RADII: f64 = 0.5;
/// The maximum: more than one where the limb is observed along its axis.
const MOST_RADII: f64 = 2.0;

/// A calibrated silhouette: pinhole camera and signed Euclidean distance transform, pixels, negative inside the person.
#[derive(Clone, Debug)]
pub struct SilhouetteView {
    /// For every pixel, row by row, at least 2 x 2: the signed distance and, inside, the radius of the largest disc within the
    /// silhouette that covers the pixel, in pixels. That radius is half the local width. If all radii are zero, no bone is
    /// centered. The two values are stored together because they are read together.
    pub pixels: Vec<[f32; 2]>,
    /// For every pixel, the measured depth along the optical axis, meters, zero where there is none; empty without depth. A bone
    /// lies at least its radius behind the measured surface; where the silhouette is the limb itself, no farther.
    pub depth: Vec<f32>,
    /// Uncertainty of the silhouette's border, pixels. The required depth inside the silhouette is reduced by it. The midline
    /// between two borders is known to half of it.
    pub border: f64,
    /// The camera, without distortion: masks and depths must be undistorted before.
    pub camera: Camera,
    /// Pose of the world in the optical frame.
    pub camera_from_world: Pose,
}

impl SilhouetteView {
    /// Returns `max(distance + depth, 0)` of a point in the optical frame plus how far it lies in front of the measured depth,
    /// both in pixels, and the derivative with respect to the point.
    pub(super) fn outside(&self, x: Vec3, radius: f64, thin: f64) -> (f64, Vec3) {
        if x.z < Camera::NEAREST {
            return (0.0, Vec3::ZERO);
        }
        let [fx, fy] = self.camera.focal();
        let inverse = 1.0 / x.z;
        let (px, py) = (x.x * inverse, x.y * inverse);
        let Some(at) = self.camera.pixel([px, py]).map(|place| self.locate(place)) else { return (0.0, Vec3::ZERO) };
        let Some(corners) = at.corners(&self.pixels) else { return (0.0, Vec3::ZERO) };
        let of = |channel: usize| at.interpolated(corners.map(|pixel| f64::from(pixel[channel])));
        let [distance, mut du, mut dv] = of(0);
        let projected = fx * radius * inverse;
        let mut depth = (projected - self.border).max(0.0);
        // The derivative of the depth with respect to the distance from the camera plane.
        let mut closer = if depth > 0.0 { projected } else { 0.0 };
        let middle = 0.5 * self.border;
        let mut own_surface = false;
        // No pixel is deeper inside than half the width, so a pixel deeper than this cannot be in a thin part.
        if distance < 0.0 && -distance <= thin * projected {
            let [half, su, sv] = of(1);
            own_surface = half > 0.0 && half <= thin * projected;
            if own_surface && half - middle > depth {
                depth = half - middle;
                (du, dv, closer) = (du + su, dv + sv, 0.0);
            }
        }
        let (mut value, mut slope) = (distance + depth, Vec3::ZERO);
        if value > 0.0 {
            let (gx, gy) = (du * fx, dv * fy);
            slope = Vec3::new(gx, gy, -(gx * px + gy * py) - closer) * inverse;
        } else {
            value = 0.0;
        }
        if !self.depth.is_empty() && radius > 0.0 {
            let (before, by) = self.depth_violation(&at, x, radius, own_surface);
            value += before;
            slope += by;
        }
        (value, slope)
    }

    /// How far the flesh around a point lies in front of the measured surface, or behind it if that surface is the limb itself,
    /// in pixels (meters as projected perpendicular to the line of sight), and the derivative with respect to the point.
    fn depth_violation(&self, at: &PixelPlace, x: Vec3, radius: f64, own_surface: bool) -> (f64, Vec3) {
        let nothing = (0.0, Vec3::ZERO);
        let Some(corners) = at.corners(&self.depth) else { return nothing };
        let corners = corners.map(f64::from);
        let (least, most) = corners.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), d| (a.min(*d), b.max(*d)));
        if at.beyond != [0.0; 2] || !(least > Camera::NEAREST && most < (1.0 + EDGE) * least) {
            return nothing;
        }
        let [observed, du, dv] = at.interpolated(corners);
        let (before, behind) = (observed + LEAST_RADII * radius - x.z, x.z - observed - MOST_RADII * radius);
        let (gap, sign) = if before > 0.0 { (before, 1.0) } else { (behind, -1.0) };
        if sign < 0.0 && !own_surface {
            return nothing;
        }
        let [fx, fy] = self.camera.focal();
        let inverse = 1.0 / x.z;
        let value = fx * gap * inverse - self.border;
        if value <= 0.0 {
            return nothing;
        }
        let (gx, gy) = (du * fx * inverse, dv * fy * inverse);
        let slope = Vec3::new(gx, gy, -(gx * x.x + gy * x.y) * inverse - 1.0);
        (value, fx * inverse * (sign * slope - gap * inverse * Vec3::Z))
    }

    /// The four pixels around a position; outside of the image the nearest ones on its border.
    fn locate(&self, [u, v]: [f64; 2]) -> PixelPlace {
        let (width, height) = (self.camera.width(), self.camera.height());
        let (right, bottom) = ((width - 1) as f64, (height - 1) as f64);
        let (x, y) = (u.clamp(0.0, right), v.clamp(0.0, bottom));
        let column = (x as usize).min(width - 2);
        let row = (y as usize).min(height - 2);
        let (start, s, t) = (row * width + column, x - column as f64, y - row as f64);
        PixelPlace { start, width, s, t, beyond: [u - x, v - y] }
    }
}

/// A position between four pixels, and its distance outside the image.
struct PixelPlace {
    start: usize,
    width: usize,
    s: f64,
    t: f64,
    beyond: [f64; 2],
}

impl PixelPlace {
    /// The values of the four pixels: upper row, lower row; `None` for an image of another size.
    fn corners<T: Copy>(&self, image: &[T]) -> Option<[T; 4]> {
        let rows = image.get(self.start..self.start + self.width + 2)?;
        Some([rows[0], rows[1], rows[self.width], rows[self.width + 1]])
    }

    /// Bilinear interpolation and its gradient. Outside of the image the distance to its border is added, because everything
    /// outside counts as background.
    fn interpolated(&self, [d00, d01, d10, d11]: [f64; 4]) -> [f64; 3] {
        let (s, t) = (self.s, self.t);
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
