//! Inverse kinematics: derivatives against differences, twists, lines against rays, priorities, limits, singular cases.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};
use proptest::prelude::*;
use voodoo_core::HumanModel;
use voodoo_core::kinematics::exp;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
use voodoo_core::{Body, Camera};
use voodoo_ik::{
    Aim, Bone, ChainModel, Criterion, Goal, IkProblem, IkSolver, Kinematics, SilhouetteView, SolverOptions, Trunk,
    bones, level_rows, project, trunk,
};

fn human() -> Body {
    Body::human(1.75, HumanModel::Full).unwrap()
}

fn arm() -> (Body, ChainModel) {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let limbs = ["l_upperarm", "l_forearm"].map(|name| body.limb_index(name).unwrap());
    let model = ChainModel::new(&body, &limbs, false).unwrap();
    (body, model)
}

/// The line through `origin` along `direction`.
fn line(origin: Vec3, direction: Vec3) -> Aim {
    let n = direction.normalize();
    Aim::Line { n, m: origin.cross(n) }
}

fn goal(body: &Body, model: &ChainModel, site: &str, aim: Aim, level: usize) -> Goal {
    let site = &body.sites()[body.site_index(site).unwrap()];
    Goal { link: model.link_of(site.limb).unwrap(), point: site.position, aim, weight: 1.0, level }
}

fn position(model: &ChainModel, goal: &Goal, angles: &[f64]) -> Vec3 {
    let mut at = Kinematics::default();
    model.place(&Pose::IDENTITY, angles, &mut at);
    at.poses[goal.link].transform_point(goal.point)
}

fn close(a: Vec3, b: Vec3, within: f64) -> bool {
    (a - b).length() < within
}

fn values(count: usize, size: f64) -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-size..size, count)
}

/// Signed distance to a disc, as a picture.
fn disc(width: usize, height: usize, center: [f64; 2], radius: f64) -> Vec<f32> {
    (0..width * height)
        .map(|i| ((i % width) as f64 - center[0]).hypot((i / width) as f64 - center[1]) as f32 - radius as f32)
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn exp_is_the_limit_of_small_motions(omega in values(3, 2.0), v in values(3, 2.0)) {
        // A screw motion by a whole twist is that by half of it, twice.
        let twist = |fraction: f64| {
            exp(&Vector6::from_iterator(omega.iter().chain(&v).map(|value| fraction * value)))
        };
        let (whole, half) = (twist(1.0), twist(0.5));
        let twice = half * half;
        prop_assert!(close(whole.translation, twice.translation, 1e-12), "{whole:?} {twice:?}");
        prop_assert!(whole.rotation.dot(twice.rotation).abs() > 1.0 - 1e-14);
        // And a small one moves a point with the velocity of the twist.
        let (omega, v) = (Vec3::new(omega[0], omega[1], omega[2]), Vec3::new(v[0], v[1], v[2]));
        let moved = (twist(1e-6).transform_point(Vec3::X) - Vec3::X) / 1e-6;
        prop_assert!(close(moved, omega.cross(Vec3::X) + v, 1e-5), "{moved:?}");
    }

    #[test]
    fn jacobian_is_the_derivative(angles in values(64, 1.2), site in 0..20_usize, kind in any::<bool>()) {
        let body = human();
        let model = ChainModel::new(&body, &[], true).unwrap();
        let angles = &angles[..model.freedoms()];
        let site = &body.sites()[site % body.sites().len()];
        let aim = if kind {
            line(Vec3::new(0.3, -0.2, 0.9), Vec3::new(0.2, 1.0, -0.4))
        } else {
            Aim::Position(Vec3::new(0.1, 0.2, 0.3))
        };
        let goal = Goal { link: model.link_of(site.limb).unwrap(), point: site.position, aim, weight: 2.0, level: 0 };
        let evaluate = |angles: &[f64]| {
            let (mut at, mut rows, mut residual) = (Kinematics::default(), Vec::new(), Vec::new());
            model.place(&Pose::IDENTITY, angles, &mut at);
            level_rows(&model, &[goal], &at, &mut rows, &mut residual);
            (rows, residual)
        };
        let (rows, _) = evaluate(angles);
        for i in 0..angles.len() {
            let moved = |by: f64| {
                let mut angles = angles.to_vec();
                angles[i] += by;
                evaluate(&angles).1
            };
            let (plus, minus) = (moved(1e-6), moved(-1e-6));
            for axis in 0..3 {
                let numeric = (plus[axis] - minus[axis]) / 2e-6;
                prop_assert!((rows[axis * angles.len() + i] - numeric).abs() < 1e-7, "unknown {i} axis {axis}");
            }
        }
    }

    #[test]
    fn criterion_gradient_is_the_derivative(angles in values(64, 0.6), radius in 0.0..0.06_f64, thin in 0.0..4.0_f64) {
        let body = human();
        let model = ChainModel::new(&body, &[], true).unwrap();
        let mut angles = angles[..model.freedoms()].to_vec();
        angles[2] += 0.2;
        let image = disc(160, 120, [60.0, 50.0], 12.0);
        // A disc is nowhere thinner than itself; a little slope, so that its derivative is seen.
        let pixels: Vec<[f32; 2]> = image.iter().enumerate().map(|(i, d)| [*d, if *d < 0.0 { 6.0 + 0.02 * (i % 160) as f32 } else { 0.0 }]).collect();
        // A surface through the body, oblique.
        let depth: Vec<f32> = (0..160 * 120).map(|i| 3.0 + 0.001 * (i % 160) as f32 - 0.002 * (i / 160) as f32).collect();
        // Optical frame: z towards -x of the world, 3 m away.
        let rotation = Quat::from_mat3(&Mat3::from_cols(-Vec3::Z, Vec3::X, -Vec3::Y));
        let camera_from_world = Pose::from_parts(Vec3::new(0.0, 0.0, 3.0), rotation);
        let camera = Camera::pinhole(160, 120, [140.0, 150.0, 79.5, 59.5]).unwrap();
        let view = SilhouetteView { pixels, depth: Vec::new(), border: 1.0, camera, camera_from_world };
        let deep = SilhouetteView { depth, ..view.clone() };
        let mut segments = bones(&body, &model, 0.0);
        segments.iter_mut().for_each(|segment: &mut Bone| segment.radius = [radius, 0.5 * radius]);
        let mut trunk = trunk(&body, &model, &Pose::IDENTITY);
        prop_assert_eq!(trunk.len(), 2);
        // A limb beside the chain, through the body's middle.
        let beside = Pose::from_parts(Vec3::new(0.1, 0.0, -0.3), Quat::from_axis_angle(Vec3::Y, 0.3));
        trunk.push(Trunk { link: None, pose: beside, shape: body.limbs()[0].shape });
        let criterion = Criterion { views: &[&view, &deep], segments: &segments, thin, trunk: &trunk };
        let evaluate = |angles: &[f64]| {
            let (mut at, mut gradient) = (Kinematics::default(), vec![0.0; angles.len()]);
            model.place(&Pose::IDENTITY, angles, &mut at);
            (criterion.evaluate(&model, &at, &mut gradient), gradient)
        };
        let (h, gradient) = evaluate(&angles);
        prop_assert!(h > 0.0);
        for i in 0..angles.len() {
            let slope = |by: f64| {
                let mut angles = angles.clone();
                angles[i] += by;
                (evaluate(&angles).0 - h) / by
            };
            // Between pixels the criterion has kinks; where one is, the gradient is the derivative to the other side.
            let error = [1e-7, -1e-7].map(|by| (gradient[i] - slope(by)).abs());
            prop_assert!(error[0].min(error[1]) < 1e-3 * (1.0 + gradient[i].abs()), "{i}: {} {error:?}", gradient[i]);
        }
    }

    #[test]
    fn no_bone_in_the_trunk(x in -0.2..0.2_f64, y in -0.2..0.2_f64) {
        let (body, model) = arm();
        let trunk = trunk(&body, &model, &Pose::IDENTITY);
        // The base of an arm is the trunk.
        prop_assert_eq!(trunk.len(), 1);
        let image = vec![[-100.0_f32, 0.0]; 160 * 120];
        let rotation = Quat::from_mat3(&Mat3::from_cols(-Vec3::Z, Vec3::X, -Vec3::Y));
        let camera_from_world = Pose::from_parts(Vec3::new(0.0, 0.0, 3.0), rotation);
        let camera = Camera::pinhole(160, 120, [140.0, 140.0, 79.5, 59.5]).unwrap();
        let view = SilhouetteView { pixels: image, depth: Vec::new(), border: 1.0, camera, camera_from_world };
        // One short bone beside the shoulder, moved into the trunk by its base.
        let segment = Bone { ends: [(0, Vec3::ZERO), (0, 1e-3 * Vec3::Z)], radius: [1e-6; 2], apart: 0.0 };
        let criterion = Criterion { views: &[&view], segments: &[segment], thin: 0.0, trunk: &trunk };
        let mut at = Kinematics::default();
        model.place(&Pose::IDENTITY, &vec![0.0; model.freedoms()], &mut at);
        at.poses[0] = Pose::from_parts(Vec3::new(x, y, 0.3), at.poses[0].rotation);
        let h = criterion.evaluate(&model, &at, &mut vec![0.0; model.freedoms()]);
        let shape = &body.limbs()[0].shape;
        let t = 0.3 / shape.length();
        let (a, b) = (shape.a0() + t * (shape.a1() - shape.a0()), shape.b0() + t * (shape.b1() - shape.b0()));
        let level = (x / a).hypot(y / b);
        prop_assert!((h > 0.0) == (level < 1.0) || (level - 1.0).abs() < 0.02, "{h} {level}");
    }

    #[test]
    fn lines_equal_rays(x in values(3, 2.0), p in values(3, 2.0), d in values(3, 1.0)) {
        let (x, p) = (Vec3::new(x[0], x[1], x[2]), Vec3::new(p[0], p[1], p[2]));
        let d = Vec3::new(d[0], d[1], d[2]).try_normalize().unwrap_or(Vec3::Z);
        // R07 eq. 13: three rows of the twist.
        let aim = line(p, d);
        let residual = aim.residual(x);
        let jacobian = Matrix3x6::from_fn(|axis, i| {
            let e = Vec3::AXES[i % 3];
            aim.derivative(if i < 3 { e.cross(x) } else { e })[axis]
        });
        let residual_rows = Vector3::from(residual.to_array());
        // A ray correspondence of the tracker: W = I - d d^T to any point of the ray, by the twist's motion of x.
        let direction = Vector3::from(d.to_array());
        let information = Matrix3::identity() - direction * direction.transpose();
        let motion = Matrix3x6::from_fn(|axis, i| {
            let e = Vec3::AXES[i % 3];
            (if i < 3 { e.cross(x) } else { e })[axis]
        });
        let h: Matrix6<f64> = motion.transpose() * information * motion;
        let g = motion.transpose() * information * Vector3::from((x - p).to_array());
        let difference: Matrix6<f64> = jacobian.transpose() * jacobian - h;
        prop_assert!(difference.abs().max() < 1e-12 * (1.0 + h.abs().max()));
        prop_assert!((jacobian.transpose() * residual_rows - g).abs().max() < 1e-12 * (1.0 + g.abs().max()));
        // The distance itself.
        let offset = x - p;
        let distance = (offset - offset.dot(d) * d).length();
        prop_assert!((residual.length() - distance).abs() < 1e-12);
    }

    #[test]
    fn lower_levels_never_disturb_higher_ones(start in values(6, 0.4), hand in values(3, 0.9), elbow in values(3, 0.9)) {
        let (body, model) = arm();
        let shoulder = model.links()[0].parent_from_joint.translation;
        let options = SolverOptions { steps: 400, tolerance: 1e-12, still: 1e-12, ..SolverOptions::default() };
        let top = goal(&body, &model, "l_hand", Aim::Position(shoulder + Vec3::new(hand[0], hand[1], hand[2])), 0);
        let low = goal(&body, &model, "l_elbow", Aim::Position(shoulder + Vec3::new(elbow[0], elbow[1], elbow[2])), 1);
        let third = goal(&body, &model, "l_wrist", Aim::Position(Vec3::ZERO), 2);
        let residual = |goals: &[Goal]| {
            let mut angles = start[..model.freedoms()].to_vec();
            let problem = IkProblem { model: &model, base: Pose::IDENTITY, goals, criterion: None, rest: &[], options };
            IkSolver::default().solve(&problem, &mut angles);
            for (angle, [least, greatest]) in angles.iter().zip(model.limits()) {
                prop_assert!(*least <= *angle && *angle <= *greatest);
            }
            Ok(top.aim.residual(position(&model, &top, &angles)).length())
        };
        let (alone, two, three) = (residual(&[top])?, residual(&[top, low])?, residual(&[top, low, third])?);
        prop_assert!(two <= alone + 1e-9, "{alone} {two}");
        prop_assert!(three <= alone + 1e-9, "{alone} {three}");
    }

    #[test]
    fn projection_finds_the_angles_again(angles in values(64, 0.5)) {
        let body = human();
        let model = ChainModel::new(&body, &[], true).unwrap();
        let expected: Vec<f64> = angles[..model.freedoms()].iter().zip(model.limits()).map(|(a, [l, h])| a.clamp(*l, *h)).collect();
        let mut at = Kinematics::default();
        model.place(&Pose::IDENTITY, &expected, &mut at);
        let mut found = Vec::new();
        project(&body, &model, &Pose::IDENTITY, &at.poses, &mut found);
        for (found, expected) in found.iter().zip(&expected) {
            prop_assert!((found - expected).abs() < 1e-9);
        }
    }
}
