//! What unit tests of the tracker's parts share: a part's view of one frame of a synthetic depth camera.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::body::{Body, HumanModel, Model};
use crate::camera::Camera;
use crate::config::Config;
use crate::fit::{Context, Setting};
use crate::math::{Pose, Quat, Vec3};
use crate::observation::background::Backgrounds;
use crate::observation::candidates::body_box;
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::{DepthImage, DepthPixels, Frame};
use crate::observation::observer::Observer;
use crate::observation::ownership::OwnershipMask;

#[path = "../tests/before_camera/mod.rs"]
mod before_camera;

use before_camera::{WALL, millimeters};
pub(crate) use before_camera::{before_wall, depth, put_board, stand};

/// A human who stands 2.6 m before the camera and faces it.
pub(crate) fn standing() -> (Model, Vec<Pose>) {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = stand(&body);
    (Model::new(body), poses)
}

/// A frame of one depth image.
pub(crate) fn with_frame<R>(pixels: &[u16], stamp: f64, check: impl FnOnce(&Frame) -> R) -> R {
    let images = [millimeters(pixels)];
    check(&Frame { images: &images, ..Frame::empty(stamp) })
}

/// A mask of a scene in which nobody else is.
pub(crate) fn everything(scene: &Backgrounds) -> OwnershipMask<'_> {
    OwnershipMask { owners: &[], own: 0, others: 0, scene }
}

/// The scene of a frame in which the wall is known.
pub(crate) fn wall(frame: &Frame) -> Backgrounds {
    let mut scene = Backgrounds::default();
    learn(&mut scene, frame, |depth| depth == 0.001 * f32::from(WALL));
    scene
}

/// Learns the depths of a frame for which `is_scene` holds.
pub(crate) fn learn(scene: &mut Backgrounds, frame: &Frame, is_scene: impl Fn(f32) -> bool) {
    scene.register(frame);
    for image in frame.images {
        for (index, depth) in scene.of_image_mut(image).unwrap().depth.iter_mut().enumerate() {
            *depth =
                Some(image.pixels.get(index) * image.meters_per_unit as f32).filter(|z| is_scene(*z)).unwrap_or(0.0);
        }
    }
}

/// What a frame of `pixels` is to a part of the tracker that expects the body at `poses`, with the wall as the scene.
pub(crate) fn with_context<R>(
    pixels: &[u16],
    config: &Config,
    model: &Model,
    poses: &[Pose],
    check: impl FnOnce(Context) -> R,
) -> R {
    with_setting(pixels, config, model, poses, |setting| check(setting.with_model(model)))
}

/// The same for a part that changes the model.
pub(crate) fn with_setting<R>(
    pixels: &[u16],
    config: &Config,
    model: &Model,
    poses: &[Pose],
    check: impl FnOnce(Setting) -> R,
) -> R {
    with_frame(pixels, 0.0, |frame| {
        let mut observer = Observer::default();
        let scene = if config.background { wall(frame) } else { Backgrounds::default() };
        let bounds = body_box(&model.body, poses, config.body_box_margin);
        observer.begin(frame, everything(&scene), None);
        let observation = observer.gather(frame, Vec3::ZERO, &bounds, everything(&scene), config);
        check(Setting { config, observation, previous: poses, time_scale: 1.0 })
    })
}

/// Poses turned about a line through `center`.
pub(crate) fn turned(poses: &[Pose], center: Vec3, axis: Vec3, angle: f64) -> Vec<Pose> {
    let turn = Quat::from_axis_angle(axis, angle);
    let place = |pose: &Pose| Pose::from_parts(center + turn * (pose.translation - center), turn * pose.rotation);
    poses.iter().map(place).collect()
}

/// Poses moved by `shift`.
pub(crate) fn moved(poses: &[Pose], shift: Vec3) -> Vec<Pose> {
    poses.iter().map(|pose| Pose::from_parts(pose.translation + shift, pose.rotation)).collect()
}

/// Number of the first arm among the extremities of a model.
pub(crate) fn first_arm(model: &Model) -> usize {
    model.extremities.iter().position(|chain| !chain.leg).unwrap()
}

/// Poses with the first arm stretched out to its side, upwards by `rise` meters, and the place where it ends.
pub(crate) fn raised(model: &Model, poses: &[Pose], rise: f64) -> (Vec<Pose>, Vec3) {
    let arm = &model.extremities[first_arm(model)];
    let root = arm.root(&model.body, poses);
    let aside = (root.x - poses[0].translation.x).signum();
    let mut raised = poses.to_vec();
    arm.reach(&model.body, &mut raised, root + Vec3::new(0.5 * aside, -rise, 0.0), 0.0);
    let end = arm.end(&raised);
    (raised, end)
}

/// Parameters with which nothing is learned of the scene, and candidates reach as far as the body does.
pub(crate) fn without_background() -> Config {
    Config { background: false, body_box_margin: 0.6, ..Config::default() }
}

/// Greatest distance between the limbs of two poses, meters.
pub(crate) fn farthest(first: &[Pose], second: &[Pose]) -> f64 {
    first.iter().zip(second).map(|(a, b)| a.translation.distance(b.translation)).fold(0.0, f64::max)
}

/// A frame without segmented images whose working frame is the world, for queries.
pub(crate) fn views<'a>(frame: &'a Frame<'a>, backgrounds: &'a Backgrounds) -> DepthViews<'a> {
    DepthViews { frame, ownership: everything(backgrounds), segmented: &[false; 8], origin: Vec3::ZERO }
}

/// A camera that lives as long as the tests.
pub(crate) fn pinhole(width: usize, height: usize, intrinsics: [f64; 4]) -> &'static Camera {
    Box::leak(Box::new(Camera::pinhole(width, height, intrinsics).unwrap()))
}

/// A depth image in meters whose center is that of its pixels, from a camera at the world's origin.
pub(crate) fn image(pixels: &[f32], width: usize, focal: f64) -> DepthImage<'_> {
    let height = pixels.len() / width;
    DepthImage {
        pixels: DepthPixels::F32(pixels),
        camera: pinhole(width, height, [focal, focal, 0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)]),
        meters_per_unit: 1.0,
        world_from_sensor: Pose::IDENTITY,
        weight: 1.0,
        source: 0,
    }
}
