//! What must hold for any pose, shift, weight: the step as K06 IV-B says, and the changes of the body.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene;
use proptest::prelude::*;
use voodoo_core::SolverKind;
use voodoo_core::kinematics::{hinge_axis, joint_turn, place};
use voodoo_core::math::{Pose, Quat, Vec3};
use voodoo_core::{Body, Config, Status, TaperedEllipticCylinder, Tracker};
use voodoo_core::{Cloud, Frame, PositionRelation, RayRelation, Scope};
use voodoo_core::{HumanModel, Joint, JointKind};

fn human() -> Body {
    Body::human(1.75, HumanModel::Papers).unwrap()
}

/// The published solver with steps enough to settle and no sampling.
fn settled() -> Config {
    let mut config = Config::default();
    (config.solver, config.max_steps) = (SolverKind::Limbwise, 60);
    (config.min_change, config.max_limb_points) = (0.0, 100_000);
    config
}

fn tracker(config: Config, poses: &[Pose]) -> Tracker {
    let mut tracker = Tracker::new(human(), config).unwrap();
    tracker.reset_pose(poses).unwrap();
    tracker
}

fn moved(poses: &[Pose], motion: &Pose) -> Vec<Pose> {
    poses.iter().map(|pose| *motion * *pose).collect()
}

/// A motion of the standing person about its own place: up to `turn` radians and `shift` meters.
fn small_motion(turn: f64, shift: f64) -> impl Strategy<Value = Pose> {
    (any::<u64>()).prop_map(move |seed| {
        let mut noise = scene::Noise(seed);
        let center = scene::standing(&human())[0].translation;
        let rotation = Quat::from_scaled_axis(noise.vector(turn));
        Pose::from_parts(center - rotation * center + noise.vector(shift), rotation)
    })
}

fn largest_distance(first: &[Vec3], second: &[Vec3]) -> f64 {
    assert_eq!(first.len(), second.len());
    first.iter().zip(second).map(|(first, second)| (*first - *second).length()).fold(0.0, f64::max)
}

fn sites(body: &Body, poses: &[Pose]) -> Vec<Vec3> {
    (0..body.sites().len()).map(|site| body.site_position(poses, site)).collect()
}

/// The same body with hinges about the y axes of their joints' frames.
fn about_y(body: &Body) -> Body {
    let mut limbs = body.limbs().to_vec();
    for joint in limbs.iter_mut().filter_map(|limb| limb.parent.as_mut()).map(|(_, joint)| joint) {
        if joint.kind() == JointKind::Hinge {
            let turn = Quat::from_axis_angle(Vec3::Z, -std::f64::consts::FRAC_PI_2);
            joint.parent_from_joint.rotation *= turn;
            joint.limb_from_joint.rotation *= turn;
            joint.semi_axes.swap(0, 1);
            joint.limits.iter_mut().for_each(|limits| limits.swap(0, 1));
        }
    }
    Body::new(body.name(), limbs, body.sites().to_vec()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_fit_reproduces_positions_and_sizes(seed: u64, stature in 1.2..2.1_f64) {
        let mut noise = scene::Noise(seed);
        let truth = Body::human(stature, HumanModel::Papers).unwrap();
        let root = Pose::from_parts(noise.vector(3.0), Quat::from_scaled_axis(noise.vector(3.0)));
        let poses = scene::bent(&truth, root, 0.5, &mut noise);
        let expected = sites(&truth, &poses);
        let named: Vec<(usize, Vec3)> = expected.iter().copied().enumerate().collect();
        let (body, found) = human().fit(&named, true).unwrap();
        prop_assert!(largest_distance(&sites(&body, &found), &expected) < 1e-6);
        for (limb, original) in body.limbs().iter().zip(truth.limbs()) {
            let off = (limb.shape.length() - original.shape.length()).abs();
            prop_assert!(off < 1e-4, "length of {} is {off} m off", limb.name);
        }
    }

    #[test]
    fn a_fit_is_the_same_anywhere_on_a_map(seed: u64, east in 1e5..9e5_f64, north in 0.0..1e7_f64) {
        let mut noise = scene::Noise(seed);
        let truth = Body::human(1.6, HumanModel::Full).unwrap();
        let root = Pose::from_parts(noise.vector(3.0), Quat::from_scaled_axis(noise.vector(3.0)));
        let expected = sites(&truth, &scene::bent(&truth, root, 0.5, &mut noise));
        let away = Vec3::new(east, north, 100.0);
        let named = |shift: Vec3| expected.iter().map(|place| *place + shift).enumerate().collect::<Vec<_>>();
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let (here, poses) = body.fit(&named(Vec3::ZERO), true).unwrap();
        let (there, mut moved) = body.fit(&named(away), true).unwrap();
        for pose in &mut moved {
            pose.translation -= away;
        }
        prop_assert!(largest_distance(&sites(&there, &moved), &sites(&here, &poses)) < 1e-5);
    }

    #[test]
    fn a_fit_puts_shoulders_on_clavicles(seed: u64, stature in 1.2..2.1_f64, rise in 0.0..0.5_f64) {
        let mut noise = scene::Noise(seed);
        let truth = Body::human(stature, HumanModel::Full).unwrap();
        let root = Pose::from_parts(noise.vector(3.0), Quat::from_scaled_axis(noise.vector(3.0)));
        let mut expected = sites(&truth, &truth.rest_pose(root));
        // Shrugged: both shoulders higher than at rest; the arms hang where they hung.
        for name in ["l_shoulder", "r_shoulder"] {
            expected[truth.site_index(name).unwrap()] += root.rotation * Vec3::Z * (0.1 * rise * stature);
        }
        let named: Vec<(usize, Vec3)> = expected.iter().copied().enumerate().collect();
        let (body, found) = Body::human(1.75, HumanModel::Full).unwrap().fit(&named, true).unwrap();
        prop_assert!(largest_distance(&sites(&body, &found), &expected) < 1e-6);
    }

    #[test]
    fn a_bent_arm_shows_the_axis_of_its_elbow(seed: u64, flexion in 0.5..2.2_f64, model in 0..3) {
        let mut noise = scene::Noise(seed);
        let human = |stature: f64| match model {
            0 => Body::human(stature, HumanModel::Papers).unwrap(),
            1 => Body::human(stature, HumanModel::Full).unwrap(),
            _ => about_y(&Body::human(stature, HumanModel::Full).unwrap()),
        };
        let truth = human(1.7);
        let root = Pose::from_parts(noise.vector(3.0), Quat::from_scaled_axis(noise.vector(3.0)));
        let mut poses = truth.rest_pose(root);
        let index = |name: &str| truth.limb_index(name).unwrap();
        let (upper, fore) = (index("r_upperarm"), index("r_forearm"));
        let joint = |limb: usize| &truth.limbs()[limb].parent.as_ref().unwrap().1;
        // The arm is lifted and turned about itself, then bent.
        let turn = Quat::from_scaled_axis(noise.vector(1.0));
        let parent = truth.limbs()[upper].parent.as_ref().unwrap().0;
        poses[upper] = place(joint(upper), &poses[parent], turn);
        let bend = Quat::from_axis_angle(hinge_axis(joint(fore)), flexion);
        poses[fore] = place(joint(fore), &poses[upper], bend);
        for limb in fore + 1..poses.len() {
            if let Some((parent, joint)) = &truth.limbs()[limb].parent && *parent == fore {
                poses[limb] = place(joint, &poses[fore], Quat::IDENTITY);
            }
        }
        let named: Vec<(usize, Vec3)> = sites(&truth, &poses).into_iter().enumerate().collect();
        let (body, found) = human(1.75).fit(&named, true).unwrap();
        let Some((_, elbow)) = &body.limbs()[fore].parent else { unreachable!() };
        let found = joint_turn(elbow, &found[upper], &found[fore]);
        let off = found.angle_between(bend);
        prop_assert!(off < 0.1, "bent by {found:?}, {off} rad off {flexion}");
    }

    #[test]
    fn a_foreshortened_calf_is_as_long_as_its_pair(fraction in 0.5..0.74_f64, other in 0.77..1.0_f64) {
        let truth = Body::human(1.7, HumanModel::Full).unwrap();
        let measured = sites(&truth, &truth.rest_pose(Pose::IDENTITY));
        let fitted = |name: &str, fraction: f64| {
            let (knee, ankle) = (truth.site_index("l_knee").unwrap(), truth.site_index(name).unwrap());
            let mut named: Vec<(usize, Vec3)> = measured.iter().copied().enumerate().collect();
            named[ankle].1 = named[knee].1.lerp(named[ankle].1, fraction);
            named.retain(|(site, _)| !truth.sites()[*site].name.ends_with("toe"));
            let (body, _) = truth.fit(&named, true).unwrap();
            let length = |name: &str| body.limbs()[body.limb_index(name).unwrap()].shape.length();
            length("l_calf") / length("r_calf")
        };
        prop_assert!((fitted("l_ankle", fraction) - 1.0).abs() < 1e-6);
        // What persons may differ by is believed.
        prop_assert!((fitted("l_ankle", other) - other).abs() < 1e-2);
    }

    #[test]
    fn a_knee_set_too_low_on_a_straight_leg_is_moved_along_it(low in 0.27..0.5_f64, bend in 0.6..1.5_f64) {
        let truth = Body::human(1.7, HumanModel::Full).unwrap();
        let measured = sites(&truth, &truth.rest_pose(Pose::IDENTITY));
        let site = |name: &str| truth.site_index(name).unwrap();
        let (hip, knee, ankle) = (site("l_hip"), site("l_knee"), site("l_ankle"));
        let fitted = |low: f64, bend: f64| {
            let mut named: Vec<(usize, Vec3)> = measured.iter().copied().enumerate().collect();
            named[knee].1 = named[knee].1.lerp(named[ankle].1, low);
            named[ankle].1 = named[knee].1 + Quat::from_axis_angle(Vec3::Y, bend) * (named[ankle].1 - named[knee].1);
            named.retain(|(site, _)| !truth.sites()[*site].name.ends_with("toe"));
            let total: f64 = [[hip, knee], [knee, ankle]]
                .map(|ends| ends.map(|end| named.iter().find(|(site, _)| *site == end).unwrap().1))
                .map(|[from, to]| (to - from).length())
                .iter()
                .sum();
            let (body, _) = truth.fit(&named, true).unwrap();
            let length = |name: &str| body.limbs()[body.limb_index(name).unwrap()].shape.length();
            let right = length("r_thigh") + length("r_calf");
            (length("l_thigh") / length("r_thigh"), length("l_calf") / length("r_calf"), total / right)
        };
        // Straight: both are as long together as they were set, in the right leg's proportion.
        let (thigh, calf, total) = fitted(low, 0.0);
        prop_assert!((thigh - calf).abs() < 1e-6 && (thigh - total).abs() < 0.02, "{thigh} {calf} {total}");
        // Bent, the knee shows where it is, and the calf was foreshortened.
        let (thigh, calf, _) = fitted(low.min(0.3), bend);
        prop_assert!(thigh > 1.1 && (calf - 1.0).abs() < 1e-6, "{thigh} {calf}");
    }

    #[test]
    fn a_single_ray_pulls_its_site_onto_it(offset in [-0.06..0.06_f64, -0.06..0.06, -0.06..0.06], from: u64) {
        let poses = scene::standing(&human());
        let site = human().site_index("l_wrist").unwrap();
        let target = human().site_position(&poses, site) + Vec3::from_array(offset);
        let origin = target + 2.0 * Vec3::new(-1.0, scene::Noise(from).uniform() - 0.5, 0.3);
        let direction = 3.0 * (target - origin);
        let ray = [RayRelation { site, origin, direction, weight: 1.0, bias: 0.0, source: 0 }];
        let mut tracker = tracker(settled(), &poses);
        for stamp in 0..10 {
            tracker.step(&Frame { rays: &ray, ..Frame::empty(f64::from(stamp)) }).unwrap();
        }
        let found = tracker.estimate().sites[site] - origin;
        prop_assert!(found.reject_from(direction).length() < 1e-3, "{} m off", found.reject_from(direction).length());
        prop_assert!(found.dot(direction) > 0.0);
    }

    #[test]
    fn a_single_position_pulls_its_site_to_it(offset in [-0.08..0.08_f64, -0.08..0.08, -0.08..0.08]) {
        let poses = scene::standing(&human());
        let site = human().site_index("r_ankle").unwrap();
        let position = human().site_position(&poses, site) + Vec3::from_array(offset);
        let relation = [PositionRelation { site, position, weight: 1.0, bias: 0.0, source: 0 }];
        let mut tracker = tracker(settled(), &poses);
        for stamp in 0..10 {
            tracker.step(&Frame { positions: &relation, ..Frame::empty(f64::from(stamp)) }).unwrap();
        }
        prop_assert!((tracker.estimate().sites[site] - position).length() < 1e-3);
        prop_assert!(tracker.estimate().joint_gaps.iter().all(|gap| *gap < 2e-3));
    }

    #[test]
    fn a_ray_gives_no_pull_along_its_direction(along in -1.5..1.5_f64) {
        let poses = scene::standing(&human());
        let site = human().site_index("l_wrist").unwrap();
        let target = human().site_position(&poses, site);
        let direction = Vec3::new(1.0, 0.2, -0.1);
        // Where on the line the ray starts does not matter, as long as the site is before it.
        let ray = [RayRelation { site, origin: target - direction * (2.0 + along), direction, weight: 5.0, bias: 0.0, source: 0 }];
        let mut tracker = tracker(settled(), &poses);
        tracker.step(&Frame { rays: &ray, ..Frame::empty(0.0) }).unwrap();
        prop_assert!(largest_distance(&tracker.estimate().sites, &sites(&human(), &poses)) < 1e-6);
    }

    #[test]
    fn limbs_without_data_are_carried_by_their_bands(seed: u64, motion in small_motion(0.08, 0.03)) {
        let body = human();
        let before = scene::standing(&body);
        let after = moved(&before, &motion);
        let mut noise = scene::Noise(seed);
        let (forearm, calf) = (body.limb_index("l_forearm").unwrap(), body.limb_index("r_calf").unwrap());
        // Every point is known to be on its limb; two limbs have none.
        let points = scene::surface_points(&body, &after, 900, 0.005, &mut noise);
        let mut by_limb = vec![Vec::new(); 10];
        for point in points {
            let distance = |limb: &usize| {
                let local = after[*limb].inverse_transform_point(Vec3::from_array(point));
                body.limbs()[*limb].shape.closest_point(local).signed_distance.abs()
            };
            let nearest = (0..10).min_by(|first, second| distance(first).total_cmp(&distance(second))).unwrap();
            by_limb[nearest].push(point);
        }
        by_limb[forearm].clear();
        by_limb[calf].clear();
        let on_limb = |limb: usize| Cloud { scope: Scope::Limb(limb), ..scene::cloud(&by_limb[limb]) };
        let mut clouds: Vec<Cloud> = (0..10).map(on_limb).collect();
        let lonely = [(after[forearm] * Vec3::new(0.03, 0.0, 0.1)).to_array()];
        for count in [0, 1] {
            clouds[forearm] = Cloud { scope: Scope::Limb(forearm), ..scene::cloud(&lonely[..count]) };
            let mut tracker = tracker(settled(), &before);
            for stamp in 0..3 {
                tracker.step(&scene::with_cloud(f64::from(stamp), &clouds)).unwrap();
            }
            let estimate = tracker.estimate();
            prop_assert_eq!([estimate.limb_points[forearm], estimate.limb_points[calf]], [count, 0]);
            for limb in [forearm, calf] {
                prop_assert!(estimate.joint_gaps[limb] < 0.01, "gap {} m", estimate.joint_gaps[limb]);
                let turned = estimate.world_from_limb[limb].rotation.angle_between(after[limb].rotation);
                prop_assert!(turned < [0.7, 1.2][count], "{} turned by {turned} rad with {count} points", body.limbs()[limb].name);
            }
            let off = largest_distance(&estimate.sites, &sites(&body, &after));
            prop_assert!(off < 0.35, "a site is {off} m off");
        }
    }

    #[test]
    fn only_the_proportions_of_weights_matter(seed: u64, factor in 0.01..1000.0_f64, motion in small_motion(0.05, 0.03)) {
        let before = scene::standing(&human());
        let points = scene::surface_points(&human(), &moved(&before, &motion), 600, 0.005, &mut scene::Noise(seed));
        let site = human().site_index("l_wrist").unwrap();
        let run = |factor: f64| {
            let cloud = [Cloud { weight: factor, ..scene::cloud(&points) }];
            let position = sites(&human(), &before)[site] + Vec3::Y * 0.02;
            let positions = [PositionRelation { site, position, weight: 20.0 * factor, bias: 0.0, source: 1 }];
            let mut tracker = tracker(scene::with(settled(), |config| config.max_steps = 6), &before);
            tracker.step(&Frame { clouds: &cloud, positions: &positions, ..Frame::empty(0.0) }).unwrap().sites.clone()
        };
        prop_assert!(largest_distance(&run(1.0), &run(factor)) < 1e-5);
    }

    #[test]
    fn a_weight_is_a_multiplicity(seed: u64, times in 2..6_usize, motion in small_motion(0.05, 0.03)) {
        let before = scene::standing(&human());
        let points = scene::surface_points(&human(), &moved(&before, &motion), 300, 0.005, &mut scene::Noise(seed));
        let (heavy, light) = points.split_at(100);
        let run = |clouds: &[Cloud]| {
            let mut tracker = tracker(scene::with(settled(), |config| config.max_steps = 6), &before);
            tracker.step(&scene::with_cloud(0.0, clouds)).unwrap().sites.clone()
        };
        let repeated = heavy.repeat(times);
        let weighted = Cloud { weight: times as f64, ..scene::cloud(heavy) };
        let difference = largest_distance(
            &run(&[scene::cloud(&repeated), scene::cloud(light)]),
            &run(&[weighted, scene::cloud(light)]),
        );
        prop_assert!(difference < 1e-5, "{difference} m");
    }

    #[test]
    fn the_place_in_the_world_does_not_matter(seed: u64, motion in small_motion(0.05, 0.02)) {
        let mut noise = scene::Noise(seed);
        let before = scene::standing(&human());
        let points = scene::surface_points(&human(), &moved(&before, &motion), 600, 0.005, &mut noise);
        let other_from_world = Pose::from_parts(noise.vector(4.0), Quat::from_scaled_axis(noise.vector(2.5)));
        let run = |other: Pose| {
            // Known to be on the body: the box of the whole body lies along the axes of the world.
            let clouds = [Cloud { scope: Scope::Body, world_from_sensor: other, ..scene::cloud(&points) }];
            let mut tracker = tracker(scene::with(settled(), |config| config.max_steps = 6), &moved(&before, &other));
            let estimate = tracker.step(&scene::with_cloud(0.0, &clouds)).unwrap();
            estimate.sites.iter().map(|site| other.inverse_transform_point(*site)).collect::<Vec<_>>()
        };
        let difference = largest_distance(&run(Pose::IDENTITY), &run(other_from_world));
        prop_assert!(difference < 1e-3, "{difference} m");
    }

    #[test]
    fn changes_of_the_body_keep_the_track(seed: u64, factor in 0.93..1.07_f64) {
        let mut noise = scene::Noise(seed);
        let before = scene::standing(&human());
        let points = scene::surface_points(&human(), &before, 1000, 0.005, &mut noise);
        let clouds = [scene::cloud(&points)];
        let mut tracker = tracker(scene::with(Config::default(), |config| config.solver = SolverKind::Limbwise), &before);
        let mut stamp = 0.0;
        let mut last = Status::Tracking;
        // A limb of which nothing is seen, and two of the others by which few of the points lie, are a quarter of them.
        let mut follow = |tracker: &mut Tracker, unseen: bool| {
            let gaps = &tracker.estimate().joint_gaps;
            assert!(gaps.iter().all(|gap| *gap < 1e-9), "a change opened a joint: {gaps:?}");
            assert_eq!(tracker.estimate().status, last, "a change of the body tells nothing of the pose");
            stamp += 1.0;
            let estimate = tracker.step(&scene::with_cloud(stamp, &clouds)).unwrap();
            last = estimate.status;
            assert!(last == Status::Tracking || (unseen && last == Status::Degraded), "{last:?}");
            assert_eq!(estimate.stamp, stamp);
            largest_distance(&estimate.sites[..5], &sites(&human(), &before)[..5])
        };
        tracker.scale(factor).unwrap();
        prop_assert!(follow(&mut tracker, false) < 0.1);
        tracker.scale(1.0 / factor).unwrap();
        let forearm = human().limbs()[3].shape;
        let [length, a0, b0, a1, b1] =
            [forearm.length(), forearm.a0(), forearm.b0(), forearm.a1(), forearm.b1()].map(|size| factor * size);
        let scaled = TaperedEllipticCylinder::new(length, a0, b0, a1, b1).unwrap();
        tracker.set_shape("l_forearm", scaled).unwrap();
        prop_assert!(follow(&mut tracker, false) < 0.05);
        let held = TaperedEllipticCylinder::new(0.2, 0.1, 0.1, 0.1, 0.1).unwrap();
        let joint = Joint {
            name: "grip".into(),
            parent_from_joint: Pose::from_parts(Vec3::Z * forearm.length(), Quat::IDENTITY),
            limb_from_joint: Pose::IDENTITY,
            semi_axes: [0.05, 0.05],
            weight: 1.0,
            limits: None,
            motion: 0.3,
        };
        tracker.add_limb("box", "l_forearm", held, joint, vec![("box_end".into(), Vec3::Z * 0.2)]).unwrap();
        let end = tracker.body().site_index("box_end").unwrap();
        let (hand, top) = (tracker.estimate().world_from_limb[3], tracker.estimate().sites[end]);
        prop_assert!((top - hand * Vec3::new(0.0, 0.0, forearm.length() + 0.2)).length() < 1e-9);
        prop_assert!(follow(&mut tracker, true) < 0.05);
        tracker.remove_limb("box").unwrap();
        prop_assert!(tracker.body().site_index("box_end").is_err());
        prop_assert!(follow(&mut tracker, false) < 0.05);
        tracker.remove_limb("r_thigh").unwrap();
        prop_assert_eq!(tracker.body().limbs().len(), 8);
        prop_assert!(follow(&mut tracker, false) < 0.05);
    }
}
