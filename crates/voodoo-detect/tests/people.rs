//! Several persons: numbers that last, whoever is hidden, leaves and comes back; the same bits on any number of threads.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use voodoo_core::Frame;
use voodoo_core::HumanModel;
use voodoo_core::PeopleOptions;
use voodoo_core::math::{Aabb, Pose, Quat, Vec3};
use voodoo_core::{Body, Config, People, Status};
use voodoo_core::{ColorImage, ColorPixels};
use voodoo_detect::Detector;

const CAMERA: scene::DepthCamera = scene::DepthCamera { width: 160, height: 124, focal: 120.0 };
const RATE: f64 = 15.0;
/// Distance of the nearer one's way from the camera, and by how much the other's is farther, meters.
const WAYS: [f64; 2] = [2.2, 0.8];

fn body(height: f64) -> Body {
    Body::human(height, HumanModel::Full).unwrap()
}

/// A body that stands at a place of the floor and looks at the camera.
fn at(body: &Body, place: Vec3) -> Vec<Pose> {
    let turned = Quat::from_axis_angle(Vec3::Z, std::f64::consts::PI);
    let low = scene::standing(body)[0].translation.z;
    body.rest_pose(Pose::from_parts(place + low * Vec3::Z, turned))
}

/// Depth of everybody, the nearest first, before a wall.
fn shoot(persons: &[(&Body, Vec3)], noise: &mut scene::Noise) -> Vec<u16> {
    let mut all = vec![u16::MAX; CAMERA.width * CAMERA.height];
    for (body, place) in persons {
        let (pixels, _) = CAMERA.shoot(body, &at(body, *place), 0.004, noise);
        all.iter_mut().zip(pixels).for_each(|(all, pixel)| *all = pixel.min(*all));
    }
    all
}

/// Two who cross: the nearer from the left to the right, the farther against him. One second each way.
fn crossing() -> (Vec<Vec<u16>>, Vec<[Vec3; 2]>) {
    let (near, far) = (body(1.80), body(1.62));
    let mut noise = scene::Noise(5);
    let places = |frame: i32| {
        let aside = 0.75 - 1.5 * (f64::from(frame - 8) / 22.0).clamp(0.0, 1.0);
        [Vec3::new(WAYS[0], aside, 0.0), Vec3::new(WAYS[0] + WAYS[1], -aside, 0.0)]
    };
    let ways: Vec<[Vec3; 2]> = (0..40).map(places).collect();
    let images = ways.iter().map(|[a, b]| shoot(&[(&near, *a), (&far, *b)], &mut noise)).collect();
    (images, ways)
}

fn people(options: PeopleOptions, threads: usize) -> People {
    let people =
        People::new(body(1.75), scene::with(Config::default(), |config| config.threads = threads), options).unwrap();
    people.with_detector(Box::new(Detector::new()))
}

fn feed(people: &mut People, pixels: &[u16], frame: usize) -> Vec<(usize, Status, Vec3)> {
    let images = [CAMERA.image(pixels)];
    let input = Frame { images: &images, ..Frame::empty(frame as f64 / RATE) };
    people.step(&input, &[]).unwrap();
    let place = |tracker: &voodoo_core::BodyTracker| tracker.estimate().world_from_limb[0].translation;
    people.present().map(|(id, tracker)| (id, tracker.estimate().status, place(tracker))).collect()
}

/// Level distance of a root from a place of the floor.
fn off(root: Vec3, place: Vec3) -> f64 {
    (root - place).with_z(0.0).length()
}

#[test]
fn two_who_cross_keep_their_numbers_and_the_hidden_one_is_not_dragged_along() {
    let (images, ways) = crossing();
    let new = || people(PeopleOptions::default(), 1);
    let mut people = new();
    let mut last = Vec::new();
    for (frame, (pixels, [near, far])) in images.iter().zip(&ways).enumerate() {
        last = feed(&mut people, pixels, frame);
        for (id, status, root) in &last {
            let wrong = off(*root, *near).min(off(*root, *far));
            assert!(*status != Status::Tracking || wrong < 0.2, "frame {frame}: {id} is {wrong} m off");
        }
    }
    assert_eq!(last.len(), 2, "{last:?}");
    let [near, far] = ways[39];
    for place in [near, far] {
        assert!(last.iter().any(|(_, _, root)| off(*root, place) < 0.15), "{last:?}");
    }
    // Who was nearer at the start is so at the end.
    let mut again = new();
    let start = images[..8].iter().enumerate().map(|(frame, pixels)| feed(&mut again, pixels, frame)).last().unwrap();
    for (id, _, root) in &start {
        let was_near = off(*root, ways[7][0]) < off(*root, ways[7][1]);
        let is = last.iter().find(|(other, ..)| other == id).map(|(_, _, root)| off(*root, near) < off(*root, far));
        assert_eq!(is, Some(was_near), "number {id}");
    }
}

#[test]
fn somebody_new_who_is_where_a_person_is_tracked_is_that_person() {
    let (body, place) = (body(1.75), Vec3::new(2.6, 0.0, 0.0));
    let mut people = People::new(body.clone(), Config::default(), PeopleOptions::default()).unwrap();
    people.step(&Frame::empty(0.0), &[]).unwrap();
    for aside in [0.15, 0.0] {
        let poses = at(&body, place + aside * Vec3::Y);
        let sites: Vec<_> = (0..body.sites().len()).map(|site| (site, body.site_position(&poses, site))).collect();
        people.add(&sites, true).unwrap();
    }
    let found = feed(&mut people, &shoot(&[(&body, place)], &mut scene::Noise(5)), 1);
    let [(1, _, root)] = found[..] else { panic!("{found:?}") };
    assert!(off(root, place) < 0.04, "{root:?}");
}

#[test]
fn bits_are_the_same_on_any_number_of_threads() {
    let (images, _) = crossing();
    let run = |threads| {
        let mut people = people(PeopleOptions::default(), threads);
        let mut all = Vec::new();
        for (frame, pixels) in images.iter().take(16).enumerate() {
            feed(&mut people, pixels, frame);
            all.extend(people.present().map(|(id, tracker)| (id, scene::bits(tracker.estimate()))));
        }
        all
    };
    let alone = run(1);
    assert!(alone.iter().any(|(id, _)| *id == 2), "two are there");
    assert_eq!(alone, run(2));
}

#[test]
fn a_refused_frame_changes_nothing() {
    let (images, _) = crossing();
    let mut people = people(PeopleOptions::default(), 1);
    for (frame, pixels) in images.iter().take(6).enumerate() {
        feed(&mut people, pixels, frame);
    }
    let before = format!("{people:?}");
    let (pictures, none) = ([CAMERA.image(&images[6])], [CAMERA.image(&[])]);
    let good = Frame { images: &pictures, ..Frame::empty(1.0) };
    assert!(people.step(&Frame { images: &pictures, ..Frame::empty(0.1) }, &[]).is_err(), "time ran backwards");
    assert!(people.step(&Frame { images: &none, ..Frame::empty(1.0) }, &[]).is_err(), "no pixels");
    assert!(people.step(&good, &[(1, Frame { images: &none, ..Frame::empty(1.0) })]).is_err(), "one person's");
    let short = [[0_u8; 3]; 5];
    let picture = ColorImage {
        pixels: ColorPixels::Color(&short),
        camera: scene::pinhole(3, 2, [1.0; 4]),
        world_from_sensor: Pose::IDENTITY,
        stamp: 1.0,
        number: 0,
        source: 0,
    };
    assert!(people.step(&Frame { colors: &[picture], ..good }, &[]).is_err(), "a pixel is missing");
    assert_eq!(format!("{people:?}"), before);
    assert!(people.step(&good, &[]).is_ok());
}

/// Numbers of those who are there while somebody comes, is away for `away` seconds, and somebody of `heights[1]` comes.
fn numbers(heights: [f64; 2], away: f64, options: PeopleOptions) -> [Vec<usize>; 3] {
    let mut noise = scene::Noise(9);
    let mut people = people(options, 1);
    let place = Vec3::new(2.4, 0.2, 0.0);
    let empty = shoot(&[(&body(1.75), Vec3::new(0.0, 9.0, 0.0))], &mut noise);
    let mut frame = 0;
    let mut run = |pixels: &mut dyn FnMut() -> Vec<u16>, frames: usize| {
        for _ in 0..frames {
            feed(&mut people, &pixels(), frame);
            frame += 1;
        }
        people.present().map(|(id, _)| id).collect::<Vec<_>>()
    };
    run(&mut || empty.clone(), 3);
    let [first, second] = heights.map(body);
    let came = run(&mut || shoot(&[(&first, place)], &mut noise), 22);
    let left = run(&mut || empty.clone(), (away * RATE) as usize);
    let back = run(&mut || shoot(&[(&second, place)], &mut noise), 8);
    [came, left, back]
}

#[test]
fn who_comes_back_has_the_number_again_and_who_is_taller_or_forgotten_has_a_new_one() {
    let any = PeopleOptions::default;
    assert_eq!(numbers([1.72, 1.72], 3.0, any()), [vec![1], vec![], vec![1]]);
    assert_eq!(numbers([1.60, 1.88], 3.0, any()), [vec![1], vec![], vec![2]]);
    assert_eq!(
        numbers([1.72, 1.72], 3.0, scene::with(any(), |options| options.forget_after = 1.0)),
        [vec![1], vec![], vec![2]]
    );
}

#[test]
fn only_some_are_followed() {
    let (images, _) = crossing();
    let there = |options: PeopleOptions| {
        let mut people = people(options, 1);
        images.iter().take(8).enumerate().map(|(frame, pixels)| feed(&mut people, pixels, frame)).last().unwrap()
    };
    let any = PeopleOptions::default;
    let nearest = there(scene::with(any(), |options| {
        options.limit = Some(1);
        options.nearest = true;
    }));
    assert!(nearest.len() == 1 && (nearest[0].2.x - WAYS[0]).abs() < 0.2, "{nearest:?}");
    let behind = Aabb::new(Vec3::new(2.6, -2.0, 0.0), Vec3::new(4.0, 2.0, 2.0));
    let far = there(scene::with(any(), |options| options.region = Some(behind)));
    assert!(far.len() == 1 && (far[0].2.x - WAYS[0] - WAYS[1]).abs() < 0.2, "{far:?}");
    let two = there(any());
    assert_eq!(two.len(), 2);
    assert_eq!(
        there(scene::with(any(), |options| options.only = Some(vec![1]))).iter().map(|one| one.0).collect::<Vec<_>>(),
        [1]
    );
}
