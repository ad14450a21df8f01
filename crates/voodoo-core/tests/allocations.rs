//! No heap allocation in a step after warm-up, counted.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod color_scene;
mod counting;
mod people_allocations;
mod scene;

use counting::allocations_so_far;
use people_allocations::TwoPersons;

use voodoo_core::HumanModel;
use voodoo_core::math::{Pose, Vec3};

use voodoo_core::{Body, Config, Tracker};
use voodoo_core::{Frame, PositionRelation, RayRelation};
use voodoo_core::{Rendering, Viewpoint};

const WARM_UP: usize = 48;
const COUNTED: usize = 60;

/// Allocations inside `step` in the frames after the warm-up. In every other frame the camera is aside by `sway` meters.
fn allocations(config: Config, frames: &[(Vec<u16>, Vec<[f64; 3]>)], sway: f64) -> usize {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let camera = scene::DepthCamera { width: 160, height: 124, focal: 145.0 };
    let wrist = body.site_index("l_wrist").unwrap();
    let knee = body.site_index("r_knee").unwrap();
    let mut tracker = Tracker::new(body.clone(), config).unwrap();
    let estimate = tracker.reset_pose(&scene::standing(&body)).unwrap();
    let positions =
        [PositionRelation { site: wrist, position: estimate.sites[wrist], weight: 20.0, bias: 0.0, source: 1 }];
    let rays = [RayRelation {
        site: knee,
        origin: Vec3::Z,
        direction: estimate.sites[knee] - Vec3::Z,
        weight: 20.0,
        bias: 0.0,
        source: 2,
    }];
    let mut count = 0;
    for index in 0..WARM_UP + COUNTED {
        let (pixels, points) = &frames[index % frames.len()];
        let (mut images, clouds) = ([camera.image(pixels)], [scene::cloud(points)]);
        images[0].world_from_sensor.translation.y += sway * (index % 2) as f64;
        let frame = Frame {
            clouds: &clouds,
            images: &images,
            positions: &positions,
            rays: &rays,
            ..Frame::empty(index as f64)
        };
        let before = allocations_so_far();
        tracker.step(&frame).unwrap();
        if index >= WARM_UP {
            count += allocations_so_far() - before;
        }
    }
    count
}

/// Allocations of a rendering after one of the same size.
fn allocations_of_a_rendering() -> usize {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let view = Viewpoint {
        camera: scene::pinhole(160, 124, [145.0, 145.0, 79.5, 61.5]),
        world_from_sensor: scene::DepthCamera::world_from_sensor(),
    };
    let poses = scene::standing(&body);
    let mut image = Rendering::default();
    image.render(&body, &poses, &view).unwrap();
    let before = allocations_so_far();
    image.render(&body, &poses, &view).unwrap();
    allocations_so_far() - before
}

/// Allocations of warm steps by color pictures of so many cameras alone, of a body that stands and one that steps aside.
fn region_allocations(cameras: usize) -> usize {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let standing = color_scene::standing(&body);
    let aside: Vec<Pose> =
        standing.iter().map(|pose| Pose::from_parts(pose.translation + 0.03 * Vec3::X, pose.rotation)).collect();
    let shoot = |poses: &[Pose], camera| color_scene::shoot(Some((&body, poses)), camera);
    let pictures = [&standing, &aside].map(|poses| [0, 1, 2, 3].map(|camera| shoot(poses, camera)));
    let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap();
    tracker.reset_pose(&standing).unwrap();
    let mut count = 0;
    for index in 0..WARM_UP {
        let stamp = index as f64;
        let colors = [0, 1, 2, 3].map(|camera| color_scene::picture(&pictures[index % 2][camera], camera, stamp));
        let before = allocations_so_far();
        tracker.step(&Frame { colors: &colors[..cameras], ..Frame::empty(stamp) }).unwrap();
        if index >= WARM_UP / 2 {
            count += allocations_so_far() - before;
        }
    }
    count
}

/// Without the test harness, whose thread allocates beside the counted one.
fn main() {
    let before = allocations_so_far();
    drop(std::hint::black_box(Vec::<u8>::with_capacity(100)));
    assert!(allocations_so_far() > before, "the counter counts nothing");

    assert_eq!(allocations_of_a_rendering(), 0);
    for cameras in [4, 2] {
        assert_eq!(region_allocations(cameras), 0, "color regions of {cameras} cameras");
    }
    let two = TwoPersons::new();
    let mut people = two.people();
    for poses in &two.poses {
        let sites = (0..two.body.sites().len()).map(|site| (site, two.body.site_position(poses, site)));
        people.add(&sites.collect::<Vec<_>>(), false).unwrap();
    }
    let [allocating, all] = two.allocations(people);
    assert!(allocating == 0, "{allocating} of {all} frames of two persons");

    let mut frames = scene::swaying(&Body::human(1.75, HumanModel::Papers).unwrap(), 4);
    // To and fro, so that the frames after the warm-up need no more memory than those before.
    frames.extend(frames.clone().into_iter().rev());
    // Lost for a while, and found again.
    let nothing = vec![0; frames[0].0.len()];
    frames.extend(std::iter::repeat_n((nothing, Vec::new()), 4));
    assert_eq!(allocations(Config::default(), &frames, 0.02), 0, "a camera that moves");
    for config in scene::every_solver().into_iter().flat_map(|config| {
        [false, true].map(|hypotheses| scene::with(config.clone(), |config| config.hypotheses = hypotheses))
    }) {
        assert_eq!(allocations(config.clone(), &frames, 0.0), 0, "{config:?}");
        // The step itself allocates nothing here either; the queue through which rayon hands work to its threads takes a
        // new block for every 63 jobs, and a frame hands over at most one job an ICP step and one more, or a hundred when a
        // lost body is searched.
        let searched = if config.relocalization { COUNTED / 4 * 100 } else { 0 };
        let jobs = COUNTED * (config.max_steps + 1) + searched;
        let many = allocations(scene::with(config.clone(), |config| config.threads = 2), &frames, 0.0);
        assert!(many <= jobs / 63 + 1, "{many} allocations in {COUNTED} frames, {config:?}");
    }
}
