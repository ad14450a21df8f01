//! Renders the depth image that a camera should observe of a posed body, and the limb that each pixel shows, by ray casting.
//!
//! The ray of every pixel is intersected with the limbs whose silhouette can cover the pixel. Along a ray `o + u (x, y, 1)`, with
//! depth `u`, the lateral surface is `(X / a)² + (Y / b)² = 1` with X, Y, a and b linear in u. With a fixed aspect `a / b`, this
//! is a quadratic. Two such solutions, each with the aspect at the end of the previous one, and two Newton steps on the exact
//! equation give the root to a micrometer. Rays near a silhouette's border or along the axis of a limb, and limbs whose aspect
//! changes much, use [`TaperedEllipticCylinder::cast_ray`], which is exact and fifty times slower.

use crate::body::Body;
use crate::camera::Camera;
use crate::error::TrackError;
use crate::math::{LANES, Pose, Vec3, refill, reset, vectorized};
use crate::observation::frame::{check_pose, check_poses};
use crate::shape::TaperedEllipticCylinder;

/// Value of a pixel that shows no limb.
///
/// [`Rendering`] has an example.
pub const NO_LIMB: u16 = u16::MAX;
/// Precision of predicted depths, for a depth of one meter. Bounds in the image are widened by the same amount, in units of `x /
/// z`, to allow for rounding. A limb that comes nearer to the camera plane than this has no bounds: every ray is tested.
const PRECISION: f64 = f32::EPSILON as f64;
/// Greatest `|ln(a0 b1 / (a1 b0))|` for which the aspect may be held fixed (method section 2).
const PLAIN_ASPECT: f64 = 0.3;
/// Relative limit for rays that need the exact intersection. A ray grazes the limb if its least squared distance from the axis
/// differs from the squared radius by less than this fraction. A ray runs along the limb if its squared slope across the axis is
/// below this fraction of the squared ratio of radius to length.
const GRAZING: f64 = 0.02;

/// Pose and calibration of a depth camera.
///
/// [`Rendering`] has an example.
#[derive(Clone, Copy, Debug)]
pub struct Viewpoint<'a> {
    /// Calibration; pixels without a ray under the lens model stay empty.
    pub camera: &'a Camera,
    /// Pose of the camera's optical frame (x right, y down, z forward).
    pub world_from_sensor: Pose,
}

impl Viewpoint<'_> {
    /// `x / z` and `y / z` of some pixels of a row, from `start`; NaN beyond the last column.
    #[inline(always)]
    fn lanes(&self, row: usize, start: usize) -> ([f64; LANES], [f64; LANES]) {
        let (mut x, mut y) = ([f64::NAN; LANES], [f64::NAN; LANES]);
        let count = LANES.min(self.camera.width() - start);
        for (lane, (x, y)) in x.iter_mut().zip(&mut y).enumerate().take(count) {
            [*x, *y] = self.camera.pixel_ray(start + lane, row);
        }
        (x, y)
    }
}

/// A predicted depth image; its buffers are reused from image to image.
///
/// ```
/// use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
/// use voodoo_core::{Body, Camera, HumanModel, NO_LIMB, Rendering, Viewpoint};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let camera = Camera::pinhole(320, 240, [290.0, 290.0, 159.5, 119.5])?;
/// // The camera is 3 m in front of the person and looks along -x of the world.
/// let rotation = Quat::from_mat3(&Mat3::from_cols(Vec3::Y, -Vec3::Z, -Vec3::X));
/// let view = Viewpoint { camera: &camera, world_from_sensor: Pose::from_parts(Vec3::X * 3.0, rotation) };
/// let mut rendering = Rendering::default();
/// rendering.render(&body, &body.rest_pose(Pose::IDENTITY), &view)?;
/// let chest = 80 * rendering.width() + 160;
/// assert_eq!(usize::from(rendering.limb()[chest]), body.limb_index("thorax")?);
/// assert!((rendering.depth()[chest] - 2.9).abs() < 0.1);
/// assert_eq!((rendering.depth()[0], rendering.limb()[0]), (0.0, NO_LIMB)); // past the person
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Rendering {
    width: usize,
    depth: Vec<f32>,
    limb: Vec<u16>,
    raycasters: Vec<LimbRaycaster>,
}

impl Rendering {
    /// Depth along the optical axis, meters, row by row; 0 where no limb is visible.
    pub fn depth(&self) -> &[f32] {
        &self.depth
    }

    /// Index of the limb that each pixel shows, row by row; [`NO_LIMB`] where none is visible.
    pub fn limb(&self) -> &[u16] {
        &self.limb
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Predicts the image that `view` observes of `body` in the poses `world_from_limb`, one per limb.
    ///
    /// A limb that contains the camera is not visible from inside. A second image of the same size allocates nothing.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when the poses or the camera cannot be used; the last image is kept then.
    pub fn render(&mut self, body: &Body, world_from_limb: &[Pose], view: &Viewpoint) -> Result<(), TrackError> {
        check_pose("world_from_sensor", &view.world_from_sensor)?;
        check_poses(body, world_from_limb)?;
        let Self { width, depth, limb, raycasters } = self;
        *width = view.camera.width();
        reset(depth, view.camera.pixels(), 0.0);
        reset(limb, view.camera.pixels(), NO_LIMB);
        refill(raycasters, LimbRaycaster::of_body(body, world_from_limb, view.world_from_sensor));
        vectorized!({
            for (index, raycaster) in (0..).zip(&*raycasters) {
                raycaster.fill(view, index, depth, limb);
            }
        });
        Ok(())
    }
}

/// A limb as observed by one camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LimbRaycaster {
    pub(super) shape: TaperedEllipticCylinder,
    /// The camera's center and axes in the limb frame.
    origin: Vec3,
    axes: [Vec3; 3],
    /// `x / z` and `y / z` of the corners of a frustum that holds the limb; none when some lie beside or behind the camera.
    corners: Option<[[f64; 2]; 8]>,
    /// Least and greatest of the corners' coordinates.
    low: [f64; 2],
    high: [f64; 2],
    /// Whether the aspect changes little and the camera is outside.
    plain: bool,
}

impl LimbRaycaster {
    /// Those of all limbs of a body, for a sensor in the frame of the poses.
    pub(crate) fn of_body(body: &Body, poses: &[Pose], sensor: Pose) -> impl Iterator<Item = Self> {
        let limbs = body.limbs().iter().zip(poses);
        limbs.map(move |(limb, pose)| Self::new(limb.shape, pose.inv_mul(&sensor)))
    }

    /// Prepares the intersection of a camera's rays with a limb of this shape.
    pub(crate) fn new(shape: TaperedEllipticCylinder, limb_from_sensor: Pose) -> Self {
        let sensor_from_limb = limb_from_sensor.inverse();
        let (mut low, mut high) = ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
        let places: [Vec3; 8] = std::array::from_fn(|index| {
            let end = shape.ends()[index / 4];
            let sign = |bit: usize| if index & bit == 0 { 1.0 } else { -1.0 };
            sensor_from_limb * Vec3::new(sign(1) * end.a, sign(2) * end.b, end.z)
        });
        let in_front = places.iter().all(|place| place.z > PRECISION);
        let corners = in_front.then(|| places.map(|place| [place.x / place.z, place.y / place.z]));
        if let Some(corners) = &corners {
            for axis in 0..2 {
                let values = || corners.iter().map(|corner| corner[axis]);
                low[axis] = values().fold(f64::INFINITY, f64::min) - PRECISION;
                high[axis] = values().fold(f64::NEG_INFINITY, f64::max) + PRECISION;
            }
        }
        // A cone's tip or a wedge has no aspect: the logarithm is not finite, and the comparison false.
        let twist = ((shape.a0() * shape.b1()) / (shape.a1() * shape.b0())).ln().abs();
        Self {
            shape,
            origin: limb_from_sensor.translation,
            axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| limb_from_sensor.rotation * axis),
            plain: twist < PLAIN_ASPECT && corners.is_some(),
            corners,
            low,
            high,
        }
    }

    /// Returns the depth at which the ray to a point, camera frame, meets the limb, meters; NaN if it misses.
    #[inline(always)]
    pub(crate) fn depth_before(&self, point: Vec3) -> f64 {
        let (x, y) = (point.x / point.z, point.y / point.z);
        // Most rays do not come near most limbs.
        if self.is_near(x, y) { self.depth_within(x, y) } else { f64::NAN }
    }

    /// Whether the ray through `(x / z, y / z)` may meet the limb.
    #[inline(always)]
    fn is_near(&self, x: f64, y: f64) -> bool {
        (x >= self.low[0]) & (x <= self.high[0]) & (y >= self.low[1]) & (y <= self.high[1])
    }

    #[inline(never)]
    fn depth_within(&self, x: f64, y: f64) -> f64 {
        let (depth, inexact) = if self.plain { self.intersect_plain(x, y) } else { (f64::NAN, true) };
        if inexact { self.intersect_exactly(x, y) } else { depth }
    }

    fn intersect_exactly(&self, x: f64, y: f64) -> f64 {
        let direction = self.axes[0] * x + self.axes[1] * y + self.axes[2];
        self.shape.cast_ray(self.origin, direction).map_or(f64::NAN, |distance| distance / direction.length())
    }

    /// Returns the columns of a row that the limb can cover; all of them where the lens may bend straight lines.
    fn span(&self, camera: &Camera, row: usize) -> (usize, usize) {
        let Some(corners) = self.corners.as_ref().filter(|_| !camera.distorts()) else { return (0, camera.width()) };
        let [_, y] = camera.pixel_ray(0, row);
        if y < self.low[1] || y > self.high[1] {
            return (0, 0);
        }
        // The limb lies in the convex hull of the corners; a row cuts the hull between its outermost crossings of the lines
        // from corner to corner.
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        for (index, from) in corners.iter().enumerate() {
            for to in &corners[index + 1..] {
                let (low, high) = if from[1] <= to[1] { (from, to) } else { (to, from) };
                if low[1] > y + PRECISION || high[1] < y - PRECISION {
                    continue;
                }
                let rise = high[1] - low[1];
                if rise < PRECISION {
                    first = first.min(low[0]).min(high[0]);
                    last = last.max(low[0]).max(high[0]);
                } else {
                    let x = low[0] + (high[0] - low[0]) * ((y - low[1]) / rise).clamp(0.0, 1.0);
                    first = first.min(x);
                    last = last.max(x);
                }
            }
        }
        let column = |x: f64| camera.pixel([x, y]).map_or(0.0, |pixel| pixel[0]).clamp(-1.0, camera.width() as f64);
        let start = column(first - 2.0 * PRECISION).ceil().max(0.0) as usize;
        let end = (column(last + 2.0 * PRECISION).floor() + 1.0).clamp(0.0, camera.width() as f64) as usize;
        (start, end.max(start))
    }

    /// Renders the limb where it is nearest.
    #[inline(always)]
    fn fill(&self, view: &Viewpoint, index: u16, depth: &mut [f32], limb: &mut [u16]) {
        let width = view.camera.width();
        for (row, (depth, limb)) in depth.chunks_mut(width).zip(limb.chunks_mut(width)).enumerate() {
            let (first, end) = self.span(view.camera, row);
            for start in (first..end).step_by(LANES) {
                let (x, y) = view.lanes(row, start);
                if !(0..LANES).fold(false, |near, lane| near | self.is_near(x[lane], y[lane])) {
                    continue;
                }
                let found = self.intersect(&x, &y);
                let count = LANES.min(end - start);
                let pixels_here = depth[start..start + count].iter_mut().zip(&mut limb[start..start + count]);
                for ((depth, limb), found) in pixels_here.zip(found) {
                    // NaN: no intersection.
                    if found > 0.0 && (*limb == NO_LIMB || (found as f32) < *depth) {
                        (*depth, *limb) = (found as f32, index);
                    }
                }
            }
        }
    }

    /// Returns the depths at which rays meet the limb; NaN for rays that miss.
    #[inline(always)]
    fn intersect(&self, x: &[f64; LANES], y: &[f64; LANES]) -> [f64; LANES] {
        let exact = |lane: usize| self.intersect_exactly(x[lane], y[lane]);
        if !self.plain {
            return std::array::from_fn(exact);
        }
        let (mut found, mut inexact) = ([f64::NAN; LANES], [false; LANES]);
        for lane in 0..LANES {
            (found[lane], inexact[lane]) = self.intersect_plain(x[lane], y[lane]);
        }
        for lane in 0..LANES {
            if inexact[lane] {
                found[lane] = exact(lane);
            }
        }
        found
    }

    /// Returns the depth at which a ray meets a limb of nearly fixed aspect from outside, NaN if it misses, and whether that
    /// result is uncertain. The code has no branches, so that it is vectorized over several rays.
    #[inline(always)]
    fn intersect_plain(&self, x: f64, y: f64) -> (f64, bool) {
        let select = |condition: bool, yes: f64, no: f64| if condition { yes } else { no };
        let o = self.origin;
        let d = self.axes[0] * x + self.axes[1] * y + self.axes[2];
        let length = self.shape.length();
        let (a0, b0) = (self.shape.a0(), self.shape.b0());
        let [da, db] = self.shape.growth();
        let inside = |z: f64| select(z < 0.0, 0.0, select(z > length, length, z));
        // Intersections with the planes of the caps.
        let (one, other) = (-o.z / d.z, (length - o.z) / d.z);
        let (enter, leave) = (select(one < other, one, other), select(one < other, other, one));
        let z = inside(o.z + enter * d.z);
        let (u, v) = ((o.x + enter * d.x) / (a0 + da * z), (o.y + enter * d.y) / (b0 + db * z));
        let through_cap = (enter > 0.0) & (u * u + v * v < 1.0);
        // a(z) = a + slope u along the ray.
        let (a, slope) = (a0 + da * o.z, da * d.z);
        let mut z = 0.5 * length;
        let mut root = 0.0;
        let mut grazing = false;
        for _ in 0..2 {
            let aspect = (a0 + da * z) / (b0 + db * z);
            let square = aspect * aspect;
            let p = d.x * d.x + square * d.y * d.y - slope * slope;
            let q = o.x * d.x + square * o.y * d.y - a * slope;
            let r = o.x * o.x + square * o.y * o.y - a * a;
            let discriminant = q * q - p * r;
            let radius = a0 + da * z;
            grazing = discriminant.abs() < GRAZING * p * radius * radius;
            // For rays along the axis, the section of a cone is no ellipse, and a ray hardly crosses a cylinder within its
            // length.
            grazing |= p < GRAZING * (slope * slope + (radius / length) * (radius / length));
            // A ray that misses the limb comes nearest to it at the real part of the root.
            root = (-q - select(discriminant > 0.0, discriminant, 0.0).sqrt()) / p;
            root = select(discriminant >= 0.0, root, f64::NAN);
            let nearest = -q / p;
            z = inside(o.z + d.z * select(discriminant >= 0.0, root, nearest));
        }
        let mut step = 0.0;
        for _ in 0..2 {
            let (px, py, pz) = (o.x + root * d.x, o.y + root * d.y, o.z + root * d.z);
            let (a, b) = (a0 + da * pz, b0 + db * pz);
            let (xb, ya, ab) = (px * b, py * a, a * b);
            let value = xb * xb + ya * ya - ab * ab;
            let (a_rate, b_rate) = (da * d.z, db * d.z);
            let rate = xb * (d.x * b + px * b_rate) + ya * (d.y * a + py * a_rate) - ab * (a_rate * b + a * b_rate);
            step = 0.5 * value / rate;
            root -= step;
        }
        let on_side = (root >= enter) & (root <= leave) & (root > 0.0);
        let depth = select(on_side, root, f64::NAN);
        let inexact = !through_cap & (grazing | (on_side & !(step.abs() < PRECISION * root)) | (d.z.abs() < 1e-9));
        (select(through_cap, enter, depth), inexact)
    }
}
