//! A calibrated camera: projects points to pixels through its lens, and returns the rays of pixels.

mod lens;

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use crate::error::Unexpected;
use crate::math::Vec3;

pub use lens::Lens;

/// Maximum number of pixels of an image, those of an 8K image. A larger size is probably a typing error and would need gigabytes
/// of memory.
pub(crate) const MOST_PIXELS: usize = 1 << 25;
/// Number of parts into which each side of a rectangle is divided to follow its image through a lens.
const SIDE_PARTS: usize = 16;

/// A calibrated camera in its optical frame: x right, y down, z forward, meters. Integer pixel coordinates are pixel centers.
///
/// Images carry a reference to their camera. A point `(x, y, z)` is observed in the pixel `(fx X + cx, fy Y + cy)`, where
/// `(X, Y)` is the position to which the [`Lens`] distorts `(x/z, y/z)`.
///
/// ```
/// use voodoo_core::{Camera, Lens};
/// use voodoo_core::math::Vec3;
///
/// # fn main() -> Result<(), voodoo_core::Unexpected> {
/// let lens = Lens::PlumbBob([-0.25, 0.08, 0.001, -0.002, 0.0]);
/// let camera = Camera::new(320, 240, [250.0, 252.0, 161.0, 118.0], lens)?;
/// let pixel = camera.project(Vec3::new(0.4, -0.3, 2.0)).unwrap();
/// let [x, y] = camera.ray(pixel).unwrap();
/// assert!((x - 0.2).abs() < 1e-12 && (y + 0.15).abs() < 1e-12);
/// assert_eq!(camera.project(Vec3::new(0.0, 0.0, -1.0)), None);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Camera {
    width: usize,
    height: usize,
    focal: [f64; 2],
    center: [f64; 2],
    lens: Lens,
    /// Domain of the lens, see [`Lens::domain`].
    domain: f64,
    table: OnceLock<Arc<RayTable>>,
}

/// The rays of all pixels.
#[derive(Debug)]
struct RayTable {
    rays: Box<[[f32; 2]]>,
    /// Minimum and maximum of the rays.
    low: [f64; 2],
    high: [f64; 2],
}

impl PartialEq for Camera {
    fn eq(&self, other: &Self) -> bool {
        let plain = |camera: &Self| (camera.width, camera.height, camera.focal, camera.center, camera.lens);
        plain(self) == plain(other)
    }
}

impl Camera {
    /// Minimum distance of a point from the camera plane, meters. Nearer points are in no pixel: no sensor measures there, and the
    /// projection diverges.
    pub const NEAREST: f64 = 0.05;

    /// A camera of `width` x `height` pixels with the `intrinsics` `(fx, fy, cx, cy)`, pixels.
    ///
    /// # Errors
    /// [`Unexpected`] unless there are 1 to 33,554,432 pixels, the focal lengths are above zero, and all numbers are finite.
    pub fn new(width: usize, height: usize, intrinsics: [f64; 4], lens: Lens) -> Result<Self, Unexpected> {
        let valid = width.checked_mul(height).is_some_and(|count| (1..=MOST_PIXELS).contains(&count));
        Unexpected::unless(valid, "camera size", "1 to 33554432 pixels", format_args!("{width}x{height}"))?;
        let [fx, fy, cx, cy] = intrinsics;
        let valid = fx > 0.0 && fy > 0.0 && fx.is_finite() && fy.is_finite();
        Unexpected::unless(valid, "camera fx, fy", "finite focal lengths above zero", format_args!("{fx}, {fy}"))?;
        let valid = cx.is_finite() && cy.is_finite();
        Unexpected::unless(valid, "camera cx, cy", "a finite principal point", format_args!("{cx}, {cy}"))?;
        let coefficients = lens.coefficients();
        let valid = coefficients.iter().all(|value| value.is_finite());
        Unexpected::unless(valid, "camera distortion", "finite coefficients", format_args!("{coefficients:?}"))?;
        let table = OnceLock::new();
        Ok(Self { width, height, focal: [fx, fy], center: [cx, cy], lens, domain: lens.domain(), table })
    }

    /// A camera without distortion.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn pinhole(width: usize, height: usize, intrinsics: [f64; 4]) -> Result<Self, Unexpected> {
        Self::new(width, height, intrinsics, Lens::Pinhole)
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Pixels of the image.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Focal lengths `fx` and `fy`, pixels.
    pub fn focal(&self) -> [f64; 2] {
        self.focal
    }

    /// Principal point `cx` and `cy`, pixels.
    pub fn center(&self) -> [f64; 2] {
        self.center
    }

    /// The lens.
    pub fn lens(&self) -> Lens {
        self.lens
    }

    /// Whether the lens distorts, so that straight lines may appear curved.
    #[inline(always)]
    pub fn distorts(&self) -> bool {
        !matches!(self.lens, Lens::Pinhole)
    }

    /// Column and row of a point in the camera frame, inside of the image or not. `None` at or behind the camera plane, and
    /// outside the lens's domain: beyond the radius at which its distortion stops growing.
    #[inline]
    pub fn project(&self, point: Vec3) -> Option<[f64; 2]> {
        if !(point.z > 0.0) {
            return None;
        }
        if self.distorts() {
            return self.pixel([point.x / point.z, point.y / point.z]);
        }
        let ([fx, fy], [cx, cy]) = (self.focal, self.center);
        Some([fx * point.x / point.z + cx, fy * point.y / point.z + cy])
    }

    /// Column and row of all points on the ray through `(x/z, y/z)`; `None` as for [`Camera::project`].
    #[inline(always)]
    pub fn pixel(&self, ray: [f64; 2]) -> Option<[f64; 2]> {
        let [x, y] = if self.distorts() { self.lens.distorted(ray, self.domain)? } else { ray };
        Some([x * self.focal[0] + self.center[0], y * self.focal[1] + self.center[1]])
    }

    /// Row-major index of the pixel of a point in the camera frame; `None` outside of the image.
    #[inline(always)]
    pub fn index_of(&self, point: Vec3) -> Option<usize> {
        let near = 1.0 / point.z;
        let [u, v] = self.pixel([point.x * near, point.y * near])?;
        // Adds half a pixel, so that truncation rounds.
        let (column, row) = (u + 0.5, v + 0.5);
        let inside = column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.height as f64;
        // The position is inside the image; a signed cast is the cheapest.
        (inside && point.z > 0.0).then(|| row as i32 as usize * self.width + column as i32 as usize)
    }

    /// `(x/z, y/z)` of the points at a column and row, which may be fractional; `None` outside the image of the lens's domain.
    ///
    /// Polynomial lenses are inverted by Newton's method in double precision, to an error of at most 1e-12 in `x/z`.
    #[inline]
    pub fn ray(&self, [u, v]: [f64; 2]) -> Option<[f64; 2]> {
        let at = [(u - self.center[0]) / self.focal[0], (v - self.center[1]) / self.focal[1]];
        if self.distorts() { self.lens.undistorted(at, self.domain) } else { Some(at) }
    }

    /// `(x/z, y/z)` of a pixel's center; for a distorting lens as in [`Camera::rays`].
    #[inline(always)]
    pub fn pixel_ray(&self, column: usize, row: usize) -> [f64; 2] {
        if self.distorts() {
            return self.rays()[row * self.width + column].map(f64::from);
        }
        [(column as f64 - self.center[0]) / self.focal[0], (row as f64 - self.center[1]) / self.focal[1]]
    }

    /// `(x/z, y/z)` of all pixels' centers, row by row; NaN outside the image of the lens's domain. Computed once.
    #[inline]
    pub fn rays(&self) -> &[[f32; 2]] {
        &self.table().rays
    }

    #[inline]
    fn table(&self) -> &RayTable {
        self.table.get_or_init(|| Arc::new(self.find_rays()))
    }

    #[cold]
    fn find_rays(&self) -> RayTable {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut rays = Vec::with_capacity(self.pixels());
        for row in 0..self.height {
            for column in 0..self.width {
                let ray = self.ray([column as f64, row as f64]).unwrap_or([f64::NAN; 2]);
                for axis in 0..2 {
                    (low[axis], high[axis]) = (low[axis].min(ray[axis]), high[axis].max(ray[axis]));
                }
                rays.push(ray.map(|value| value as f32));
            }
        }
        RayTable { rays: rays.into_boxed_slice(), low, high }
    }

    /// `x/z` and `y/z` of every `stride`-th pixel of a row from `start` on, `count` pixels, in single precision, written as whole
    /// SIMD registers. Values after the last pixel are meaningless.
    #[inline(always)]
    pub(crate) fn row_rays<const N: usize>(
        &self,
        row: usize,
        start: usize,
        stride: usize,
        count: usize,
    ) -> [[f32; N]; 2] {
        let ([fx, fy], [cx, cy]) = (self.focal.map(|value| value as f32), self.center.map(|value| value as f32));
        let mut x = [0.0; N];
        let mut y = [(row as f32 - cy) * (1.0 / fy); N];
        if self.distorts() {
            let rays = self.rays()[row * self.width + start..].iter().step_by(stride);
            for ((x, y), ray) in x.iter_mut().zip(&mut y).zip(rays).take(count) {
                (*x, *y) = (ray[0], ray[1]);
            }
        } else {
            let inverse = 1.0 / fx;
            for (x, offset) in x.iter_mut().zip(0_i32..) {
                *x = ((start as i32 + offset * stride as i32) as f32 - cx) * inverse;
            }
        }
        [x, y]
    }

    /// Velocity of a point's image along the image direction `along` per velocity of the point: pixels per meter, camera frame.
    /// For the image axes these are the rows of the projection's Jacobian. `None` where [`Camera::project`] returns `None`.
    #[inline]
    pub fn gradient(&self, point: Vec3, along: [f64; 2]) -> Option<Vec3> {
        if !(point.z > 0.0) {
            return None;
        }
        let mut by = [along[0] * self.focal[0], along[1] * self.focal[1]];
        if self.distorts() {
            let [[a, b], [c, d]] = self.lens.derivative([point.x / point.z, point.y / point.z], self.domain)?;
            by = [by[0] * a + by[1] * c, by[0] * b + by[1] * d];
        }
        let (x, y) = (by[0] / point.z, by[1] / point.z);
        Some(Vec3::new(x, y, -(x * point.x + y * point.y) / point.z))
    }

    /// Columns and rows that can show a part of the convex hull of `corners`, camera frame; the whole image when a corner is
    /// nearer than 5 cm.
    pub fn window(&self, corners: impl IntoIterator<Item = Vec3>) -> [Range<usize>; 2] {
        let whole = [0..self.width, 0..self.height];
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for corner in corners {
            if !(corner.z >= Self::NEAREST) {
                return whole;
            }
            let ray = [corner.x / corner.z, corner.y / corner.z];
            let place = if self.distorts() { ray } else { self.project(corner).unwrap_or(ray) };
            for axis in 0..2 {
                (low[axis], high[axis]) = (low[axis].min(place[axis]), high[axis].max(place[axis]));
            }
        }
        if self.distorts() {
            match self.bounds(low, high) {
                Some(bounds) => (low, high) = bounds,
                None => return whole,
            }
        }
        let range = |axis: usize, size: usize| {
            let start = low[axis].floor().clamp(0.0, size as f64) as usize;
            let end = (high[axis].ceil() + 1.0).clamp(0.0, size as f64) as usize;
            start..end.max(start)
        };
        [range(0, self.width), range(1, self.height)]
    }

    /// Minimum and maximum column and row of the image of a rectangle of rays through a distorting lens; `None` when a part of
    /// its border is not in the image. A lens maps the rectangle into the image of its border.
    fn bounds(&self, low: [f64; 2], high: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
        // Rays outside all pixels are irrelevant.
        let table = self.table();
        let within = |corner: [f64; 2]| [0, 1].map(|axis| corner[axis].max(table.low[axis]).min(table.high[axis]));
        let [low, high] = [within(low), within(high)];
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
        let (mut least, mut most) = ([f64::MAX; 2], [f64::MIN; 2]);
        // Between two points on a side, the side's image deviates from a line by less than their second differences.
        let mut bulge = [0.0_f64; 2];
        for side in 0..4 {
            let (from, to) = (corners[side], corners[(side + 1) % 4]);
            let mut before: [Option<[f64; 2]>; 2] = [None; 2];
            for part in 0..=SIDE_PARTS {
                let fraction = part as f64 / SIDE_PARTS as f64;
                let place = self.pixel([0, 1].map(|axis| from[axis] + fraction * (to[axis] - from[axis])))?;
                for axis in 0..2 {
                    (least[axis], most[axis]) = (least[axis].min(place[axis]), most[axis].max(place[axis]));
                    if let [Some(first), Some(second)] = before {
                        bulge[axis] = bulge[axis].max((first[axis] - 2.0 * second[axis] + place[axis]).abs());
                    }
                }
                before = [before[1], Some(place)];
            }
        }
        Some(([0, 1].map(|axis| least[axis] - bulge[axis]), [0, 1].map(|axis| most[axis] + bulge[axis])))
    }
}
