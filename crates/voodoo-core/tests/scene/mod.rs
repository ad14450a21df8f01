//! Synthetic measurements of a posed body, the same on every run: noisy surface points and ray-cast depth images.
#![allow(
    dead_code,
    missing_docs,
    clippy::unwrap_used,
    reason = "shared by several tests and benches, none of which uses all of it"
)]

use std::f64::consts::{PI, TAU};

use voodoo_core::Camera;
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Config, Estimate};
use voodoo_core::{Cloud, DepthImage, DepthPixels, Frame, PointSlice, Scope};
use voodoo_core::{NO_LIMB, Rendering, Viewpoint};

/// SplitMix64: small, and the same for ever.
pub(crate) struct Noise(pub u64);

impl Noise {
    /// Uniform in `[0, 1)`.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal with standard deviation 1 (Irwin-Hall).
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    /// Each coordinate uniform in `[-range, range]`.
    pub(crate) fn vector(&mut self, range: f64) -> Vec3 {
        Vec3::new(self.uniform() - 0.5, self.uniform() - 0.5, self.uniform() - 0.5) * (2.0 * range)
    }
}

/// The person stands here, turned to the camera: 2.4 m before it.
pub(crate) fn standing(body: &Body) -> Vec<Pose> {
    let turned = Quat::from_axis_angle(Vec3::Z, PI);
    body.rest_pose(Pose::from_parts(Vec3::new(2.4, 0.0, 0.86), turned))
}

/// All joints closed, each turned at random by up to `bend` radians about every axis.
pub(crate) fn bent(body: &Body, world_from_root: Pose, bend: f64, noise: &mut Noise) -> Vec<Pose> {
    let mut poses: Vec<Pose> = Vec::new();
    for limb in body.limbs() {
        poses.push(match &limb.parent {
            None => world_from_root,
            Some((parent, joint)) => {
                let turn = Pose::from_parts(Vec3::ZERO, Quat::from_scaled_axis(noise.vector(bend)));
                poses[*parent] * joint.parent_from_joint * turn * joint.limb_from_joint.inverse()
            }
        });
    }
    poses
}

/// `count` points on the sides of the limbs, by area, none inside another limb, each coordinate off by `sigma` meters.
pub(crate) fn surface_points(
    body: &Body,
    poses: &[Pose],
    count: usize,
    sigma: f64,
    noise: &mut Noise,
) -> Vec<[f64; 3]> {
    let limbs = body.limbs();
    let area: Vec<f64> = limbs.iter().map(|limb| limb.shape.length() * (limb.shape.a0() + limb.shape.b1())).collect();
    let mut points = Vec::with_capacity(count);
    while points.len() < count {
        let mut pick = noise.uniform() * area.iter().sum::<f64>();
        let index = area.iter().position(|area| {
            pick -= area;
            pick < 0.0
        });
        let index = index.unwrap_or(0);
        let shape = limbs[index].shape;
        let (t, angle) = (noise.uniform(), noise.uniform() * TAU);
        let semi = |start: f64, end: f64| start + (end - start) * t;
        let (a, b) = (semi(shape.a0(), shape.a1()), semi(shape.b0(), shape.b1()));
        let point = poses[index] * Vec3::new(a * angle.cos(), b * angle.sin(), shape.length() * t);
        let hidden = limbs.iter().zip(poses).enumerate().any(|(other, (limb, pose))| {
            other != index && limb.shape.closest_point(pose.inverse_transform_point(point)).signed_distance < 0.0
        });
        if !hidden {
            points.push((point + Vec3::new(noise.normal(), noise.normal(), noise.normal()) * sigma).to_array());
        }
    }
    points
}

/// A frame with one free cloud.
pub(crate) fn with_cloud<'a>(stamp: f64, clouds: &'a [Cloud<'a>]) -> Frame<'a> {
    Frame { clouds, ..Frame::empty(stamp) }
}

/// Free points of weight 1 in the world frame.
pub(crate) fn cloud(points: &[[f64; 3]]) -> Cloud<'_> {
    Cloud {
        points: PointSlice::F64(points),
        world_from_sensor: Pose::IDENTITY,
        weight: 1.0,
        scope: Scope::Free,
        source: 0,
    }
}

/// A camera that lives as long as the tests.
pub(crate) fn pinhole(width: usize, height: usize, intrinsics: [f64; 4]) -> &'static Camera {
    Box::leak(Box::new(Camera::pinhole(width, height, intrinsics).unwrap()))
}

/// A depth camera 1 m above the floor that looks along the world's x axis.
pub(crate) struct DepthCamera {
    pub width: usize,
    pub height: usize,
    pub focal: f64,
}

impl DepthCamera {
    pub(crate) fn world_from_sensor() -> Pose {
        let rotation = Quat::from_mat3(&voodoo_core::math::Mat3::from_cols(-Vec3::Y, -Vec3::Z, Vec3::X));
        Pose::from_parts(Vec3::Z, rotation)
    }

    fn camera(&self) -> &'static Camera {
        let center = [self.width, self.height].map(|size| (size as f64 - 1.0) / 2.0);
        pinhole(self.width, self.height, [self.focal, self.focal, center[0], center[1]])
    }

    /// Millimeters along the optical axis to the body before a wall at 3.6 m, with noise of `sigma` meters; returns the
    /// number of pixels on the body, too.
    pub(crate) fn shoot(&self, body: &Body, poses: &[Pose], sigma: f64, noise: &mut Noise) -> (Vec<u16>, usize) {
        let view = Viewpoint { camera: self.camera(), world_from_sensor: Self::world_from_sensor() };
        let mut image = Rendering::default();
        image.render(body, poses, &view).unwrap();
        let visible = image.limb().iter().filter(|limb| **limb != NO_LIMB).count();
        let measured = |depth: &f32| {
            let depth = if *depth > 0.0 { f64::from(*depth) } else { 3.6 };
            ((depth + sigma * noise.normal()) * 1000.0).round() as u16
        };
        let pixels = image.depth().iter().map(measured).collect();
        (pixels, visible)
    }

    pub(crate) fn image<'a>(&self, pixels: &'a [u16]) -> DepthImage<'a> {
        DepthImage {
            pixels: DepthPixels::U16(pixels),
            camera: self.camera(),
            meters_per_unit: 0.001,
            world_from_sensor: Self::world_from_sensor(),
            weight: 1.0,
            source: 0,
        }
    }
}

/// All numbers of an estimate as bits: equal when the estimates are, NaN included.
pub(crate) fn bits(estimate: &Estimate) -> Vec<u64> {
    let poses = estimate.world_from_limb.iter().flat_map(|pose| {
        let (t, q) = (pose.translation, pose.rotation);
        [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
    });
    let sites = estimate.sites.iter().flat_map(|site| site.to_array());
    let sources = estimate.sources.iter().flat_map(|source| [source.weight, source.residual, source.inliers as f64]);
    let counts = estimate.limb_points.iter().map(|count| *count as f64);
    [estimate.stamp, estimate.mean_squared_distance, estimate.steps as f64, f64::from(estimate.status as u8)]
        .into_iter()
        .chain(poses)
        .chain(sites)
        .chain(sources)
        .chain(counts)
        .chain(estimate.limb_residual.iter().copied())
        .chain(estimate.joint_gaps.iter().copied())
        .map(f64::to_bits)
        .collect()
}

/// A value with changes.
pub(crate) fn with<T>(mut value: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut value);
    value
}

/// The default configuration with each solver there is.
pub(crate) fn every_solver() -> Vec<Config> {
    let words = Config::FIELDS.iter().find(|field| field.name == "solver").map_or(&[] as &[&str], |field| field.words);
    let with = |word: &&str| {
        let mut config = Config::default();
        config.set("solver", *word).unwrap();
        config
    };
    words.iter().map(with).collect()
}

/// Frames of a person who sways: noisy depth images 160x124, or noisy free points.
pub(crate) fn swaying(body: &Body, frames: usize) -> Vec<(Vec<u16>, Vec<[f64; 3]>)> {
    let mut noise = Noise(11);
    let camera = DepthCamera { width: 160, height: 124, focal: 145.0 };
    let standing = standing(body);
    let center = standing[0].translation;
    (0..frames)
        .map(|frame| {
            let turn = Quat::from_axis_angle(Vec3::Z, 0.04 * frame as f64);
            let shift = Vec3::new(0.0, 0.012 * frame as f64, 0.0);
            let move_limb = |pose: &Pose| {
                Pose::from_parts(center + turn * (pose.translation - center) + shift, turn * pose.rotation)
            };
            let poses: Vec<Pose> = standing.iter().map(move_limb).collect();
            let (pixels, _) = camera.shoot(body, &poses, 0.01, &mut noise);
            (pixels, surface_points(body, &poses, 800, 0.01, &mut noise))
        })
        .collect()
}
