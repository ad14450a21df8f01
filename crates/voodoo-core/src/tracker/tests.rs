//! Steps of the tracker as a whole.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use super::*;
use crate::Detection;
use crate::observation::background::Backgrounds;
use crate::testing::{before_wall, everything, farthest, moved, put_board, standing, with_frame};
use crate::{Ground, Tracker};

/// Returns a tracker that has tracked the standing body for three frames, and the image.
fn tracking() -> (Tracker, Vec<u16>) {
    let (model, poses) = standing();
    let pixels = before_wall(&model.body, &poses);
    let mut tracker = Tracker::new(model.body, Config::default()).unwrap();
    tracker.reset_pose(&poses).unwrap();
    for frame in 0..3 {
        feed(&mut tracker, &pixels, frame);
    }
    (tracker, pixels)
}

/// Steps the tracker with a depth image and returns the status.
fn feed(tracker: &mut Tracker, pixels: &[u16], frame: usize) -> Status {
    with_frame(pixels, frame as f64 / 30.0, |frame| tracker.step(frame).unwrap().status)
}

#[test]
fn a_refused_frame_leaves_every_part_as_it_was() {
    let (mut tracker, pixels) = tracking();
    let before = format!("{tracker:?}");
    assert!(with_frame(&pixels, 0.0, |frame| tracker.step(frame).is_err()), "time ran backwards");
    assert_eq!(format!("{tracker:?}"), before);
    feed(&mut tracker, &pixels, 3);
    assert_ne!(format!("{tracker:?}"), before);
}

#[test]
fn a_body_that_sites_miss_by_far_is_not_tracked_whatever_depth_says() {
    let sites = ["l_wrist", "r_wrist", "l_elbow", "r_elbow", "l_knee", "r_knee"];
    let status = |off: f64| {
        let (mut tracker, pixels) = tracking();
        let places: Vec<_> = sites
            .iter()
            .map(|name| {
                let site = tracker.body().site_index(name).unwrap();
                let position = tracker.estimate().sites[site] + off * Vec3::X;
                crate::PositionRelation { site, position, weight: 0.1, bias: 0.0, source: 1 }
            })
            .collect();
        with_frame(&pixels, 0.1, |frame| tracker.step(&Frame { positions: &places, ..*frame }).unwrap().status)
    };
    assert_eq!([0.0, 0.08, 0.3].map(status), [Status::Tracking, Status::Tracking, Status::Degraded]);
}

#[test]
fn the_precision_of_an_image_does_not_change_how_much_of_the_body_it_shows() {
    let (model, poses) = standing();
    let (truth, _) = crate::testing::raised(&model, &poses, 0.2);
    for weight in [1.0, 0.05, 3.0] {
        let mut tracker = Tracker::new(model.body.clone(), Config::default()).unwrap();
        tracker.reset_pose(&poses).unwrap();
        for (frame, shown) in [&poses, &poses, &truth, &truth].into_iter().enumerate() {
            with_frame(&before_wall(&model.body, shown), frame as f64 / 30.0, |frame| {
                let images: Vec<_> = frame.images.iter().map(|image| crate::DepthImage { weight, ..*image }).collect();
                assert_eq!(tracker.step(&Frame { images: &images, ..*frame }).unwrap().status, Status::Tracking);
            });
        }
        let off = farthest(&tracker.estimate().world_from_limb, &truth);
        // The joints hold against points of little weight, but the arm was found 1 m from where it was.
        assert!(off < 0.1, "weight {weight}: {off} m");
    }
}

#[test]
fn edits_keep_the_track() {
    type Edit = fn(&mut Tracker);
    let edits: [Edit; 4] = [
        |tracker| tracker.scale(1.02).unwrap(),
        |tracker| tracker.remove_limb("l_hand").unwrap(),
        |tracker| {
            let shape = tracker.body().limbs()[tracker.body().limb_index("r_calf").unwrap()].shape;
            let (a, b) = (1.1 * shape.a0(), 1.1 * shape.b0());
            let thicker = crate::TaperedEllipticCylinder::new(shape.length(), a, b, a, b).unwrap();
            tracker.set_shape("r_calf", thicker).unwrap();
        },
        |tracker| {
            let hand = &tracker.body().limbs()[tracker.body().limb_index("r_hand").unwrap()];
            let (shape, mut joint) = (hand.shape, hand.parent.as_ref().unwrap().1.clone());
            joint.parent_from_joint.translation = Vec3::Z * shape.length();
            tracker.add_limb("held", "r_hand", shape, joint, Vec::new()).unwrap();
        },
    ];
    for (number, edit) in edits.into_iter().enumerate() {
        let (mut tracker, _) = tracking();
        let before = tracker.estimate().clone();
        edit(&mut tracker);
        let after = tracker.estimate().clone();
        assert_eq!((after.status, after.stamp, after.steps), (before.status, before.stamp, 0), "edit {number}");
        assert!(tracker.limb_motion().is_none(), "edit {number}");
        let limbs = tracker.body().limbs().len();
        assert!(after.world_from_limb.len() == limbs && after.limb_status.len() == limbs, "edit {number}");
        let (then, now) = (&before.world_from_limb[0], &after.world_from_limb[0]);
        assert!(then.translation.distance(now.translation) < 0.01);
        assert!(after.joint_gaps.iter().all(|gap| *gap < 1e-9), "edit {number}: {:?}", after.joint_gaps);
        let pixels = before_wall(tracker.body(), &after.world_from_limb);
        let status = feed(&mut tracker, &pixels, 3);
        assert_eq!(status, Status::Tracking, "edit {number}");
        let off = farthest(&tracker.estimate().world_from_limb, &after.world_from_limb);
        assert!(off < 0.02, "edit {number}: {off} m");
    }
}

#[test]
fn a_lost_body_is_found_beside_its_place_and_no_board_of_its_size_is() {
    let (mut tracker, empty) = tracking();
    let (model, poses) = standing();
    let nothing = vec![4500; empty.len()];
    let aside = moved(&poses, 0.7 * Vec3::X);
    let person = before_wall(&model.body, &aside);
    for frame in 3..8 {
        assert_eq!(feed(&mut tracker, &nothing, frame), Status::Lost);
    }
    for (frame, width) in [0.15, 0.2, 0.25].into_iter().flat_map(|width| [width; 3]).enumerate() {
        let mut board = nothing.clone();
        put_board(&mut board, Vec3::new(-0.7, 0.1, 2.6), [width, 0.85]);
        assert_eq!(feed(&mut tracker, &board, 8 + frame), Status::Lost, "{width} m wide");
        let moved = poses[0].translation.distance(tracker.estimate().world_from_limb[0].translation);
        assert!(moved < 0.1, "{width} m wide: moved by {moved} m");
    }
    let mut jumps = 0;
    for frame in 20..30 {
        let before = tracker.estimate().world_from_limb.clone();
        feed(&mut tracker, &person, frame);
        if farthest(&tracker.estimate().world_from_limb, &before) > 0.3 {
            assert!(tracker.limb_motion().is_none(), "a jump is no motion");
            jumps += 1;
        }
    }
    assert_eq!(jumps, 1);
    let off = farthest(&tracker.estimate().world_from_limb, &aside);
    assert!(tracker.estimate().status == Status::Tracking && off < 0.05, "{off} m");
}

#[test]
fn a_leg_that_a_board_hides_comes_to_stand_where_the_floor_is_known() {
    let (model, poses) = standing();
    let leg = model.extremities.iter().find(|chain| chain.leg).unwrap();
    let mut pixels = before_wall(&model.body, &poses);
    put_board(&mut pixels, Vec3::new(0.0, 0.65, 1.8), [1.2, 0.9]);
    let mut bent = poses.clone();
    leg.reach(&model.body, &mut bent, leg.root(&model.body, &poses) + Vec3::new(0.0, 0.4, 0.5), 0.0);
    let ground = Ground { normal: -Vec3::Y, offset: -leg.end(&poses).y - 0.07 };
    let tilt = |ground| {
        let mut tracker = Tracker::new(model.body.clone(), Config::default()).unwrap();
        tracker.reset_pose(&bent).unwrap();
        for frame in 0..60 {
            with_frame(&pixels, f64::from(frame) / 30.0, |frame| {
                tracker.step(&Frame { ground, ..*frame }).unwrap();
            });
        }
        (tracker.estimate().world_from_limb[leg.lower].rotation * Vec3::Z).angle_between(Vec3::Y)
    };
    let [known, unknown] = [Some(ground), None].map(tilt);
    assert!(known < 0.3 && unknown > 0.8, "{known}, {unknown}");
}

/// Positions of all sites of the standing body.
fn positions() -> Vec<(usize, Vec3)> {
    let (model, poses) = standing();
    (0..model.body.sites().len()).map(|site| (site, model.body.site_position(&poses, site))).collect()
}

#[test]
fn a_limb_that_is_added_before_the_sizes_are_fitted_is_fitted_too() {
    let (model, poses) = standing();
    let mut tracker = Tracker::new(model.body.clone(), Config::default()).unwrap();
    tracker.reset(&positions(), true).unwrap();
    let hand = &model.body.limbs()[model.body.limb_index("r_hand").unwrap()];
    let (shape, mut joint) = (hand.shape, hand.parent.as_ref().unwrap().1.clone());
    joint.parent_from_joint.translation = Vec3::Z * shape.length();
    tracker.add_limb("held", "r_hand", shape, joint, Vec::new()).unwrap();
    assert_eq!(feed(&mut tracker, &before_wall(&model.body, &poses), 0), Status::Tracking);
    assert_eq!(tracker.estimate().covariances.girths.len(), model.body.limbs().len() + 1);
}

#[test]
fn the_limbwise_solver_reports_no_lengths_and_keeps_no_detection() {
    let (model, poses) = standing();
    let config = Config { solver: crate::SolverKind::Limbwise, ..Config::default() };
    let mut tracker = BodyTracker::new(model.body.clone(), config).unwrap();
    tracker.reset(&positions(), true).unwrap();
    tracker.relocalizer.detection =
        Some(PlacedDetection { index: 0, root: Vec3::ZERO, detection: Detection::default() });
    let scene = Backgrounds::default();
    with_frame(&before_wall(&model.body, &poses), 0.0, |frame| tracker.step(frame, everything(&scene)));
    assert!(tracker.relocalizer.detected().is_none());
    let lengths = &tracker.estimate.covariances.lengths;
    assert!(!lengths.is_empty() && lengths.iter().all(|sigma| sigma.is_nan()), "{lengths:?}");
}

#[test]
fn an_edit_keeps_the_floor_and_what_confirmed_the_track() {
    let (model, poses) = standing();
    let mut tracker = BodyTracker::new(model.body.clone(), Config::default()).unwrap();
    tracker.reset_pose(&poses).unwrap();
    tracker.relocalizer.floor = Some(Ground { normal: Vec3::Z, offset: 0.0 });
    tracker.relocalizer.check.confirmed = true;
    tracker.scale(1.02).unwrap();
    assert!(tracker.relocalizer.floor.is_some() && tracker.is_confirmed(0.0));
}
