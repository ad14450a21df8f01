//! What unit tests of the tracker's parts share: a synthetic depth camera, and a part's view of one frame.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::sync::LazyLock;

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
use crate::visibility::render::{Rendering, Viewpoint};

/// The camera, which stands in the world's origin and looks along z.
static CAMERA: LazyLock<Camera> = LazyLock::new(|| Camera::pinhole(160, 124, [145.0, 145.0, 79.5, 61.5]).unwrap());

/// Depth of the wall behind the body, millimeters.
const WALL: u16 = 4500;

/// A human who stands 2.6 m before the camera and faces it.
pub(crate) fn standing() -> (Model, Vec<Pose>) {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let poses = stand(&body);
    (Model::new(body), poses)
}

/// Any body as it stands there.
pub(crate) fn stand(body: &Body) -> Vec<Pose> {
    // The body's x looks forward and z up; the camera's y points down.
    let upright = Quat::from_axis_angle(Vec3::X, std::f64::consts::FRAC_PI_2);
    let faces = Quat::from_axis_angle(Vec3::Z, -std::f64::consts::FRAC_PI_2);
    body.rest_pose(Pose::from_parts(Vec3::new(0.0, 0.1, 2.6), upright * faces))
}

/// Depth in millimeters, as the camera sees a posed body before nothing.
pub(crate) fn depth(body: &Body, poses: &[Pose]) -> Vec<u16> {
    let mut rendering = Rendering::default();
    let view = Viewpoint { camera: &CAMERA, world_from_sensor: Pose::IDENTITY };
    rendering.render(body, poses, &view).unwrap();
    rendering.depth().iter().map(|depth| (depth * 1000.0) as u16).collect()
}

/// The same before a wall.
pub(crate) fn before_wall(body: &Body, poses: &[Pose]) -> Vec<u16> {
    depth(body, poses).into_iter().map(|depth| if depth == 0 { WALL } else { depth }).collect()
}

/// Puts a board that faces the camera before what an image shows; half its width and height, meters.
pub(crate) fn put_board(pixels: &mut [u16], center: Vec3, [width, height]: [f64; 2]) {
    for (index, pixel) in pixels.iter_mut().enumerate() {
        let [x, y] = CAMERA.pixel_ray(index % CAMERA.width(), index / CAMERA.width()).map(|ray| center.z * ray);
        let depth = (1000.0 * center.z) as u16;
        if (x - center.x).abs() < width && (y - center.y).abs() < height && (*pixel == 0 || depth < *pixel) {
            *pixel = depth;
        }
    }
}

/// A frame of one depth image.
pub(crate) fn with_frame<R>(pixels: &[u16], stamp: f64, check: impl FnOnce(&Frame) -> R) -> R {
    let images = [DepthImage {
        pixels: DepthPixels::U16(pixels),
        camera: &CAMERA,
        meters_per_unit: 0.001,
        world_from_sensor: Pose::IDENTITY,
        weight: 1.0,
        source: 0,
    }];
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
