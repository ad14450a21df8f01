//! Estimates the floor from a depth image when the ground plane is not given: the plane that contains the most points and has few
//! points below it.

use crate::view::ThinnedImage;
use voodoo_core::Ground;
use voodoo_core::math::{LANES, Points, Vec3};

/// Approximate number of sampled points.
const FLOOR_SAMPLES: usize = 1200;
/// Number of trial planes.
const TRIALS: usize = 96;
/// A point lies on the floor within this distance, meters, plus this coefficient (1/m) times its squared depth.
const NEAR: [f64; 2] = [0.025, 0.003];
/// A floor contains at least this fraction of the points.
const LEAST_FRACTION: f64 = 0.03;
/// Each point below the plane counts against it as much as this many points on it count for it. Only few points lie below a real
/// floor, caused by reflections.
const BELOW: f64 = 4.0;
/// Minimum cosine between the floor's normal and the assumed upward direction: 40 degrees.
const LEAST_UPRIGHT: f64 = 0.766;

/// Size of the neighborhood from which a point's surface normal is estimated, as a fraction of the image's width.
const NEIGHBOR: f64 = 0.05;
/// The plane is refitted to the points within these fractions of the trials' distance threshold.
const NEARER: [f64; 2] = [0.7, 0.5];

/// Distance within which a point is on the floor, meters.
fn tolerance(point: Vec3) -> f64 {
    NEAR[0] + NEAR[1] * point.z * point.z
}

/// Points with the tolerance of each point's distance from the floor.
#[derive(Debug, Default)]
struct PointLanes {
    points: Points,
    near: Vec<f32>,
}

impl PointLanes {
    fn push(&mut self, point: Vec3) {
        self.points.push(point.as_vec3().to_array());
        self.near.push(tolerance(point) as f32);
    }

    /// Sums `worth` over the heights of the points above a plane, in units of the points' tolerances.
    fn sum(&self, plane: &Ground, worth: impl Fn(f32) -> f32) -> f64 {
        let [a, b, c] = plane.normal.as_vec3().to_array();
        let offset = plane.offset as f32;
        let one = |x: f32, y: f32, z: f32, near: f32| worth((a * x + b * y + c * z - offset) / near);
        let Points { x, y, z } = &self.points;
        let [x, y, z, near] = [x, y, z, &self.near].map(|values| values.as_chunks::<LANES>());
        let mut sums = [0.0_f32; LANES];
        for (((x, y), z), near) in x.0.iter().zip(y.0).zip(z.0).zip(near.0) {
            for lane in 0..LANES {
                sums[lane] += one(x[lane], y[lane], z[lane], near[lane]);
            }
        }
        let rest = x.1.iter().zip(y.1).zip(z.1).zip(near.1).map(|(((x, y), z), near)| one(*x, *y, *z, *near));
        f64::from(sums.iter().sum::<f32>() + rest.sum::<f32>())
    }
}

/// Returns the floor of an image in the camera frame; `up` is the approximate upward direction in that frame.
pub(crate) fn find_floor(view: &ThinnedImage, up: Vec3) -> Option<Ground> {
    // A sample of the points, and those of them on surfaces that face upwards.
    let (mut points, mut level, mut level_lanes) = (PointLanes::default(), Vec::new(), PointLanes::default());
    let returns = view.depth.iter().filter(|z| **z > 0.0).count();
    let step = (returns / FLOOR_SAMPLES).max(1);
    let beside = ((NEIGHBOR * view.width as f64) as usize).max(2);
    for index in (0..view.depth.len()).filter(|index| view.depth[*index] > 0.0).step_by(step) {
        let point = view.point(index);
        points.push(point);
        let (column, row) = (index % view.width, index / view.width);
        if column < beside || row < beside {
            continue;
        }
        let [left, above] = [index - beside, index - beside * view.width];
        if view.depth[left] > 0.0 && view.depth[above] > 0.0 {
            let normal = (view.point(left) - point).cross(view.point(above) - point).normalize_or_zero();
            if normal.dot(up).abs() > LEAST_UPRIGHT {
                level.push(point);
                level_lanes.push(point);
            }
        }
    }
    if level.len() < 20 {
        return None;
    }
    // Points in a pseudo-random sequence that is the same on every run (Vigna's splitmix64).
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut draw = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut value = state;
        value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        level[((value ^ (value >> 31)) % level.len() as u64) as usize]
    };
    let below = |height: f32| if height < -2.0 { 1.0 } else { 0.0 };
    // A truncated squared distance: it prefers planes through the middle of horizontal points to planes beside them.
    let on = |height: f32| (1.0 - height * height).max(0.0);
    let mut best: Option<(f64, Ground)> = None;
    for _ in 0..TRIALS {
        let [a, b, c] = [(); 3].map(|()| draw());
        let normal = (b - a).cross(c - a);
        let Some(normal) = normal.try_normalize() else { continue };
        let normal = if normal.dot(up) < 0.0 { -normal } else { normal };
        if normal.dot(up) < LEAST_UPRIGHT {
            continue;
        }
        let plane = Ground { normal, offset: normal.dot(a) };
        let score = level_lanes.sum(&plane, on) - BELOW * points.sum(&plane, below);
        if best.is_none_or(|(most, _)| score > most) {
            best = Some((score, plane));
        }
    }
    let (score, plane) = best?;
    let fitted = |plane, fraction: &f64| refined(&level, plane, *fraction);
    (score > LEAST_FRACTION * points.near.len() as f64).then(|| NEARER.iter().fold(plane, fitted))
}

/// Refits the plane to all nearby ones of these points on horizontal surfaces, by least squares along its normal.
fn refined(level: &[Vec3], plane: Ground, fraction: f64) -> Ground {
    let on = |point: &&Vec3| plane.height(**point).abs() < fraction * tolerance(**point);
    let points: Vec<&Vec3> = level.iter().filter(on).collect();
    let mean = points.iter().copied().sum::<Vec3>() / (points.len() as f64).max(1.0);
    let first = plane.normal.any_orthonormal_vector();
    let second = plane.normal.cross(first);
    let (mut uu, mut uv, mut vv, mut uh, mut vh) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for point in points {
        let from = *point - mean;
        let (u, v, h) = (from.dot(first), from.dot(second), from.dot(plane.normal));
        uu += u * u;
        uv += u * v;
        vv += v * v;
        uh += u * h;
        vh += v * h;
    }
    let determinant = uu * vv - uv * uv;
    if determinant < 1e-9 {
        return plane;
    }
    let (along_u, along_v) = ((uh * vv - vh * uv) / determinant, (vh * uu - uh * uv) / determinant);
    let normal = (plane.normal - along_u * first - along_v * second).normalize();
    Ground { normal, offset: normal.dot(mean) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::segmentation::Segmentation;
    use voodoo_core::Camera;
    use voodoo_core::Surroundings;
    use voodoo_core::math::Pose;
    use voodoo_core::{DepthImage, DepthPixels};

    /// Edge of the image, and its focal length, pixels.
    const EDGE: usize = 120;
    const FOCAL: f64 = 100.0;

    /// The floor that is found for a camera tilted down by `tilt` radians, 1.2 m above the floor of a room that ends at 4.5 m.
    fn found(tilt: f64, is_visible: impl Fn(Vec3) -> bool) -> Option<Ground> {
        found_before(tilt, is_visible, false)
    }

    /// The same where all of it is the known scene, if `known`.
    fn found_before(tilt: f64, is_visible: impl Fn(Vec3) -> bool, known: bool) -> Option<Ground> {
        let (sin, cos) = tilt.sin_cos();
        let up = Vec3::new(0.0, -cos, -sin);
        let pixels: Vec<f32> = (0..EDGE * EDGE)
            .map(|index| {
                let half = 0.5 * (EDGE as f64 - 1.0);
                let ray =
                    Vec3::new(((index % EDGE) as f64 - half) / FOCAL, ((index / EDGE) as f64 - half) / FOCAL, 1.0);
                let wall = 4.5;
                let floor = -1.2 / up.dot(ray);
                let z = if floor > 0.0 && floor < wall { floor } else { wall };
                if is_visible(z * ray) { (z + 0.01 * (index as f64 * 12.9898).sin()) as f32 } else { 0.0 }
            })
            .collect();
        let half = 0.5 * (EDGE as f64 - 1.0);
        let camera = Camera::pinhole(EDGE, EDGE, [FOCAL, FOCAL, half, half]).unwrap();
        let image = DepthImage {
            pixels: DepthPixels::F32(&pixels),
            camera: &camera,
            meters_per_unit: 1.0,
            world_from_sensor: Pose::IDENTITY,
            weight: 1.0,
            source: 0,
        };
        let mut segmentation = Segmentation::default();
        let background: &[f32] = if known { &pixels } else { &[] };
        segmentation.find(&image, &Surroundings { background, ..Surroundings::default() });
        assert!(!known || segmentation.candidates.is_empty(), "the known scene is nobody");
        segmentation.floor
    }

    #[test]
    fn the_floor_of_a_known_scene_is_found() {
        assert_eq!(found_before(0.25, |_| true, true), found(0.25, |_| true));
    }

    #[test]
    fn a_floor_is_found_under_tilted_cameras() {
        for tilt in [0.0_f64, 0.25, 0.5] {
            let floor = found(tilt, |_| true).unwrap();
            let up = Vec3::new(0.0, -tilt.cos(), -tilt.sin());
            assert!(floor.normal.dot(up) > 0.9998, "tilt {tilt}: {:?}", floor.normal);
            assert!((floor.offset + 1.2).abs() < 0.03, "tilt {tilt}: {}", floor.offset);
        }
    }

    #[test]
    fn a_wall_alone_is_no_floor_and_neither_is_nothing() {
        assert_eq!(found(0.0, |point| point.z > 4.4), None);
        assert_eq!(found(0.0, |_| false), None);
    }
}
