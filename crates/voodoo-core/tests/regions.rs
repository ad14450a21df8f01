//! Pose from color regions alone: followed, told, refused and the same every time.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::{color_scene, scene};
use color_scene::{CAMERAS, HEIGHT, WIDTH, depth_of, depth_picture, picture, shoot, standing, world_from_camera};
use voodoo_core::HumanModel;
use voodoo_core::LimbStatus;
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Config, Estimate, Frame, Status, Tracker};
use voodoo_core::{Camera, Lens};
use voodoo_core::{ColorImage, ColorPixels};

const STEP: Vec3 = Vec3::new(0.02, 0.01, 0.0);
const FRAMES: usize = 8;
const RATE: f64 = 30.0;

fn human() -> Body {
    Body::human(1.75, HumanModel::Full).unwrap()
}

/// The body at a time, in frames: it walks on and lifts its left arm.
fn posed(body: &Body, time: f64) -> Vec<Pose> {
    let mut poses: Vec<Pose> =
        standing(body).iter().map(|pose| Pose::from_parts(pose.translation + time * STEP, pose.rotation)).collect();
    let upper = body.limb_index("l_upperarm").unwrap();
    let joint = &body.limbs()[upper].parent.as_ref().unwrap().1;
    let center = poses[upper] * joint.limb_from_joint.translation;
    let turn = Quat::from_axis_angle(Vec3::X, 0.3 + 0.06 * time);
    for name in ["l_upperarm", "l_forearm", "l_hand"] {
        let pose = &mut poses[body.limb_index(name).unwrap()];
        *pose = Pose::from_parts(center + turn * (pose.translation - center), turn * pose.rotation);
    }
    poses
}

/// The pictures of all cameras at a time.
fn pictures(body: &Body, time: impl Fn(usize) -> f64) -> Vec<Vec<[u8; 3]>> {
    (0..CAMERAS).map(|camera| shoot(Some((body, &posed(body, time(camera)))), camera)).collect()
}

fn started(body: &Body, config: Config) -> Tracker {
    let mut tracker = Tracker::new(body.clone(), config).unwrap();
    tracker.reset_pose(&posed(body, 0.0)).unwrap();
    tracker
}

/// Greatest distance of the sites from those of the body at a time, meters, and their mean.
fn off(body: &Body, estimate: &Estimate, time: f64) -> (f64, f64) {
    let poses = posed(body, time);
    let far: Vec<f64> =
        estimate.sites.iter().enumerate().map(|(site, at)| at.distance(body.site_position(&poses, site))).collect();
    (far.iter().copied().fold(0.0, f64::max), far.iter().sum::<f64>() / far.len() as f64)
}

/// Follows the body through the frames; `late` is how much earlier each camera looked than the frame's stamp, in frames, and `stamped`
/// whether its stamp says so.
fn followed(config: Config, late: [f64; CAMERAS], stamped: bool, gray: bool) -> Estimate {
    let body = human();
    let mut tracker = started(&body, config);
    for frame in 0..FRAMES {
        let all = pictures(&body, |camera| frame as f64 - late[camera]);
        let grays: Vec<Vec<u8>> =
            all.iter().map(|one| one.iter().map(|[r, g, b]| r / 4 + g / 2 + b / 4).collect()).collect();
        let stamp = frame as f64 / RATE;
        let colors: Vec<ColorImage> = (0..CAMERAS)
            .map(|camera| {
                let image = picture(&all[camera], camera, stamp - if stamped { late[camera] / RATE } else { 0.0 });
                if gray { ColorImage { pixels: ColorPixels::Gray(&grays[camera]), ..image } } else { image }
            })
            .collect();
        tracker.step(&Frame { colors: &colors, ..Frame::empty(stamp) }).unwrap();
    }
    tracker.estimate().clone()
}

#[test]
fn a_body_is_followed_by_colors_or_gray_alone_and_its_limbs_are_measured() {
    let body = human();
    for (gray, most, mean) in [(false, 0.045, 0.015), (true, 0.06, 0.02)] {
        let estimate = followed(Config::default(), [0.0; CAMERAS], true, gray);
        let (farthest, middle) = off(&body, &estimate, (FRAMES - 1) as f64);
        assert!(farthest < most && middle < mean, "gray {gray}: {farthest} m, mean {middle} m");
        assert_eq!(estimate.status, Status::Tracking, "gray {gray}");
        for name in ["head", "l_forearm", "r_forearm", "l_thigh", "r_thigh", "l_calf", "r_calf"] {
            let status = estimate.limb_status[body.limb_index(name).unwrap()];
            assert_eq!(status, LimbStatus::Measured, "gray {gray}: {name}");
        }
    }
    // Without regions the pictures say nothing: the body stays where it was.
    let still = followed(scene::with(Config::default(), |config| config.regions = false), [0.0; CAMERAS], true, false);
    assert!(off(&body, &still, (FRAMES - 1) as f64).1 > 0.1);
}

#[test]
fn an_earlier_image_is_matched_with_the_body_at_its_stamp() {
    let (body, late) = (human(), [0.0, 0.5, 0.8, 0.3]);
    let [stamped, unstamped] = [true, false].map(|stamped| {
        let estimate = followed(Config::default(), late, stamped, false);
        off(&body, &estimate, (FRAMES - 1) as f64).1
    });
    assert!(stamped < 0.015 && unstamped > stamped + 0.003, "with stamps {stamped} m, without {unstamped} m");
}

#[test]
fn a_body_that_is_not_in_the_pictures_is_not_tracked() {
    let body = human();
    let mut tracker = started(&body, Config::default());
    let (observed, empty) =
        (pictures(&body, |_| 0.0), (0..CAMERAS).map(|camera| shoot(None, camera)).collect::<Vec<_>>());
    for frame in 0..12 {
        let stamp = frame as f64 / RATE;
        let pictures_now = if frame < 4 { &observed } else { &empty };
        let colors: Vec<ColorImage> =
            (0..CAMERAS).map(|camera| picture(&pictures_now[camera], camera, stamp)).collect();
        let status = tracker.step(&Frame { colors: &colors, ..Frame::empty(stamp) }).unwrap().status;
        assert!(frame >= 4 || status == Status::Tracking, "{status:?} in frame {frame}");
    }
    assert_eq!(tracker.estimate().status, Status::Lost);
}

/// The standing body with a limb and what hangs on it turned about its joint.
fn swung(body: &Body, limbs: [&str; 3], turn: Quat) -> Vec<Pose> {
    let mut poses = standing(body);
    let upper = body.limb_index(limbs[0]).unwrap();
    let center = poses[upper] * body.limbs()[upper].parent.as_ref().unwrap().1.limb_from_joint.translation;
    for name in limbs {
        let pose = &mut poses[body.limb_index(name).unwrap()];
        *pose = Pose::from_parts(center + turn * (pose.translation - center), turn * pose.rotation);
    }
    poses
}

/// How far the end of a limb is off, meters, after it was swung away between two frames.
fn after_a_swing(config: Config, limbs: [&str; 3], turn: Quat, frames: usize) -> f64 {
    let body = human();
    let mut tracker = Tracker::new(body.clone(), config).unwrap();
    tracker.reset_pose(&standing(&body)).unwrap();
    let (still, away) = (standing(&body), swung(&body, limbs, turn));
    let shots = [&still, &away].map(|poses| (0..CAMERAS).map(|n| shoot(Some((&body, poses)), n)).collect::<Vec<_>>());
    for frame in 0..4 + frames {
        let stamp = frame as f64 / RATE;
        let shot = &shots[usize::from(frame >= 4)];
        let colors: Vec<ColorImage> = (0..CAMERAS).map(|camera| picture(&shot[camera], camera, stamp)).collect();
        tracker.step(&Frame { colors: &colors, ..Frame::empty(stamp) }).unwrap();
    }
    let end = body.limb_index(limbs[1]).unwrap();
    let place = Vec3::Z * body.limbs()[end].shape.length();
    (tracker.estimate().world_from_limb[end] * place).distance(away[end] * place)
}

#[test]
fn an_arm_or_leg_that_is_lost_in_colors_is_searched_for_and_found() {
    let arm = (["l_upperarm", "l_forearm", "l_hand"], Quat::from_rotation_x(1.6));
    let leg = (["r_thigh", "r_calf", "r_foot"], Quat::from_rotation_y(-0.9));
    for (limbs, turn) in [arm, leg] {
        let [with, without] = [true, false].map(|hypotheses| {
            after_a_swing(scene::with(Config::default(), |config| config.hypotheses = hypotheses), limbs, turn, 8)
        });
        assert!(with < 0.05 && without > 0.15, "{limbs:?}: {with} m, and {without} m where nothing is looked for");
    }
}

/// How many edges the first camera finds on the left arm, with a depth camera beside it; before the half of the picture with that
/// arm, or before the other one, stands a board in the clothes' color.
fn edges_beside_depth(body: &Body, before_arm: bool) -> usize {
    let poses = standing(body);
    let (mut pixels, mut depth) = (shoot(Some((body, &poses)), 0), depth_of(body, &poses, 0));
    let arm = ["l_upperarm", "l_forearm"].map(|name| body.limb_index(name).unwrap());
    let left_half = (world_from_camera(0).inverse() * poses[arm[0]].translation).x < 0.0;
    for (index, (pixel, depth)) in pixels.iter_mut().zip(&mut depth).enumerate() {
        if ((index % WIDTH < WIDTH / 2) == left_half) == before_arm {
            (*pixel, *depth) = ([180, 40, 50], 1.5);
        }
    }
    let mut tracker = Tracker::new(body.clone(), Config::default()).unwrap();
    tracker.reset_pose(&poses).unwrap();
    let (colors, images) = ([picture(&pixels, 0, 0.0)], [depth_picture(&depth, 0)]);
    tracker.step(&Frame { colors: &colors, images: &images, ..Frame::empty(0.0) }).unwrap();
    tracker.region_lines(0).filter(|line| arm.contains(&line.limb) && line.sigma.is_finite()).count()
}

#[test]
fn what_a_depth_camera_sees_before_the_body_hides_its_edges() {
    let body = human();
    let [beside, before] = [false, true].map(|before| edges_beside_depth(&body, before));
    assert!(beside > 10 && before == 0, "{beside} edges, {before} behind a board");
}

#[test]
fn the_same_pictures_give_the_same_bits() {
    let first = followed(Config::default(), [0.0; CAMERAS], true, false);
    let again = followed(scene::with(Config::default(), |config| config.threads = 2), [0.0; CAMERAS], true, false);
    assert_eq!(first.world_from_limb, again.world_from_limb);
}

#[test]
fn what_cannot_be_used_is_refused_and_changes_nothing() {
    let body = human();
    let mut tracker = started(&body, Config::default());
    let observed = pictures(&body, |_| 0.0);
    let good: Vec<ColorImage> = (0..CAMERAS).map(|camera| picture(&observed[camera], camera, 0.0)).collect();
    tracker.step(&Frame { colors: &good, ..Frame::empty(0.0) }).unwrap();
    let small = [[0_u8; 3]; 6];
    tracker.set_background(0, &[(ColorPixels::Color(&small), [2, 3])]).unwrap();
    let before = format!("{tracker:?}");
    let refused = |tracker: &mut Tracker, pictures: &[ColorImage]| {
        tracker.step(&Frame { colors: pictures, ..Frame::empty(0.1) }).unwrap_err().to_string()
    };
    let at = |camera: usize, stamp: f64| picture(&observed[camera], camera, stamp);
    assert!(refused(&mut tracker, &[at(0, 0.1)]).contains("color[0].image: expected a picture like those"));
    assert!(refused(&mut tracker, &[at(1, 0.1), at(1, 0.1)]).contains("color[1].source"));
    assert!(refused(&mut tracker, &[at(1, 0.4)]).contains("color[0].stamp"));
    let bent = Camera::new(WIDTH, HEIGHT, [200.0, 200.0, 119.5, 99.5], Lens::Fisheye([0.0; 4])).unwrap();
    assert!(refused(&mut tracker, &[ColorImage { camera: &bent, ..at(1, 0.1) }]).contains("color[0].camera"));
    let unequal = [(ColorPixels::Color(&small[..]), [2, 3]), (ColorPixels::Color(&small[..4]), [2, 2])];
    assert!(tracker.set_background(0, &unequal).unwrap_err().to_string().contains("images[1]"));
    assert_eq!(format!("{tracker:?}"), before);
    tracker.set_background(0, &[]).unwrap();
    let next: Vec<ColorImage> = (0..CAMERAS).map(|camera| at(camera, 0.1)).collect();
    assert!(tracker.step(&Frame { colors: &next, ..Frame::empty(0.1) }).is_ok());
}

#[test]
fn pictures_of_the_empty_scene_help_where_clothes_are_as_the_room() {
    let body = human();
    let observed = |time: f64| pictures(&body, |_| time);
    // A room of the shirt's color, but for its noise.
    let dye = |pixels: &mut Vec<[u8; 3]>, empty: &[[u8; 3]]| {
        for (pixel, empty) in pixels.iter_mut().zip(empty) {
            if *pixel == *empty {
                *pixel = [pixel[0].saturating_add(40), 60, 60];
            }
        }
    };
    let rooms: Vec<Vec<[u8; 3]>> = (0..CAMERAS).map(|camera| shoot(None, camera)).collect();
    let ends = [false, true].map(|with_depth| {
        let mut tracker = started(&body, Config::default());
        for camera in (0..CAMERAS).filter(|_| with_depth) {
            let mut room = rooms[camera].clone();
            dye(&mut room, &rooms[camera]);
            tracker.set_background(camera as u16, &[(ColorPixels::Color(&room), [200, 240])]).unwrap();
        }
        for frame in 0..FRAMES {
            let mut all = observed(frame as f64);
            all.iter_mut().zip(&rooms).for_each(|(pixels, room)| dye(pixels, room));
            let stamp = frame as f64 / RATE;
            let colors: Vec<ColorImage> = (0..CAMERAS).map(|camera| picture(&all[camera], camera, stamp)).collect();
            tracker.step(&Frame { colors: &colors, ..Frame::empty(stamp) }).unwrap();
        }
        off(&body, tracker.estimate(), (FRAMES - 1) as f64).1
    });
    assert!(ends[1] < 0.02 && ends[1] < ends[0] + 0.002, "without {} m, with {} m", ends[0], ends[1]);
}

#[test]
fn colors_that_the_user_learns_are_learned_each_time_and_leave_the_next_step_as_it_is() {
    let body = human();
    let mut tracker = started(&body, Config::default());
    let all = pictures(&body, |_| 0.0);
    let colors: Vec<ColorImage> = (0..CAMERAS).map(|camera| picture(&all[camera], camera, 0.0)).collect();
    fn of<'a>(colors: &'a [ColorImage<'a>]) -> Frame<'a> {
        Frame { colors, ..Frame::empty(0.0) }
    }
    let mut seen = vec![tracker.segment(&of(&colors[..1]), None).unwrap()];
    for darker in [10, 20] {
        let dark: Vec<[u8; 3]> = all[0].iter().map(|pixel| pixel.map(|value| value.saturating_sub(darker))).collect();
        tracker.learn_colors(&of(&[picture(&dark, 0, 0.0)]), None).unwrap();
        seen.push(tracker.segment(&of(&colors[..1]), None).unwrap());
    }
    assert!(seen[0] != seen[1] && seen[1] != seen[2]);
    let estimate = tracker.step(&Frame { colors: &colors, ..Frame::empty(0.0) }).unwrap();
    assert_eq!(estimate.status, Status::Tracking);
}
