//! The one finite-difference checker that every term passes: gradient of the cost by each limb's twist.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use nalgebra::Vector6;
use proptest::prelude::*;
use voodoo_core::association::correspondence::{Correspondences, DetectedPair, EdgePair, LimbMatches, SitePair};
use voodoo_core::body::HumanModel;
use voodoo_core::body::kinematics::exp;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3, rotation_vector};
use voodoo_core::observation::frame::Ground;
use voodoo_core::terms::normal_equations::NormalEquations;
use voodoo_core::terms::{
    DetectedJoints, Edges, Floor, Limits, Penetration, Posture, Prior, Rest, Sites, Surface, Term,
};
use voodoo_core::{Body, Joint};

/// Compares the analytic gradient with differences of the cost; `add` fills the system at given poses. Where the cost has a
/// kink, as where two limbs begin to touch, the gradient lies between the differences to both sides; elsewhere these agree.
fn check(
    body: &Body,
    poses: &[Pose],
    add: &dyn Fn(&[Pose], &mut NormalEquations),
    cost: &dyn Fn(&[Pose]) -> f64,
) -> Result<(), TestCaseError> {
    let mut normal = NormalEquations::default();
    normal.clear(poses.len());
    add(poses, &mut normal);
    for limb in 0..poses.len() {
        let mut analytic = 2.0 * normal.limbs[limb].g;
        for (index, other) in body.limbs().iter().enumerate() {
            let sign = match &other.parent {
                Some(_) if index == limb => 2.0,
                Some((parent, _)) if *parent == limb => -2.0,
                _ => continue,
            };
            for axis in 0..3 {
                analytic[axis] += sign * normal.joints[index].g[axis];
            }
        }
        let (mut numeric, mut error) = (Vector6::zeros(), Vector6::zeros());
        let here = cost(poses);
        for axis in 0..6 {
            let h = 1e-5;
            let moved = |by: f64| {
                let mut poses = poses.to_vec();
                poses[limb] = exp(&(Vector6::ith(axis, 1.0) * by)) * poses[limb];
                cost(&poses)
            };
            let (right, left) = ((moved(h) - here) / h, (here - moved(-h)) / h);
            numeric[axis] = 0.5 * (left + right);
            error[axis] = analytic[axis] - analytic[axis].clamp(left.min(right), left.max(right));
        }
        let error = error.norm();
        prop_assert!(error < 2e-3 * (1.0 + numeric.norm()), "limb {limb}: analytic {analytic:?} numeric {numeric:?}");
    }
    Ok(())
}

/// Geman-McClure's kernel.
fn rho(r: f64, scale: f64) -> f64 {
    r * r / (1.0 + r * r / (scale * scale))
}

/// The components of the rotation vectors of all joints with limits, and their limits.
fn limited_angles(body: &Body, poses: &[Pose]) -> Vec<(f64, [f64; 2])> {
    let joint = |(limb, parent, joint): (usize, usize, &Joint)| {
        let world_from_joint = poses[parent].rotation * joint.parent_from_joint.rotation;
        let turn = world_from_joint.inverse() * poses[limb].rotation * joint.limb_from_joint.rotation;
        joint.limits.map(|limits| [0, 1, 2].map(|axis| (rotation_vector(turn)[axis], limits[axis])))
    };
    body.joints().filter_map(joint).flatten().collect()
}

fn random_pose(body: &Body, angles: &[f64]) -> Vec<Pose> {
    let mut values = angles.iter().cycle().copied();
    let mut next = || values.next().unwrap_or(0.3);
    let rest = body.rest_pose(Pose::new(Vec3::new(next(), next(), next()), Vec3::new(next(), next(), next())));
    rest.iter()
        .map(|pose| {
            *pose * Pose::new(0.05 * Vec3::new(next(), next(), next()), 0.6 * Vec3::new(next(), next(), next()))
        })
        .collect()
}

fn angles() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-1.0..1.0_f64, 97)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn prior(angles in angles(), other in angles(), hold in prop::sample::select(vec![0.0, 30.0])) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let predicted = random_pose(&body, &other);
        let [sigmas, still] = [0.02, 1.0].map(|value| vec![value; predicted.len()]);
        let rests: Vec<Rest> = body.limbs().iter().map(|limb| {
            let joint = limb.parent.as_ref().map(|(_, joint)| joint.parent_from_limb_at_rest());
            Rest { rotation: joint.map_or(Quat::IDENTITY, |joint| joint.rotation), fraction: 0.01 }
        }).collect();
        // Rotation errors beyond a small one make the linearized geodesic (R07 eq. 25) an approximation: stay near.
        let near: Vec<Pose> = predicted.iter().zip(random_pose(&body, &angles)).map(|(pose, push)| {
            *pose * Pose::new(0.02 * push.translation, 0.01 * push.translation)
        }).collect();
        let relative = |poses: &[Pose], parent: usize, limb: usize| poses[parent].rotation.inverse() * poses[limb].rotation;
        let cost = |poses: &[Pose]| {
            let turn = rotation_vector(poses[0].rotation * predicted[0].rotation.inverse()) / 0.02;
            let shift = (poses[0].translation - predicted[0].translation) / 0.04;
            let joints: f64 = body.joints().map(|(limb, parent, _)| {
                let expected = relative(&predicted, parent, limb).slerp(rests[limb].rotation, rests[limb].fraction);
                (rotation_vector(relative(poses, parent, limb) * expected.inverse()) / 0.02).length_squared()
            }).sum();
            // A fifth of what holds the joints holds the root.
            (1.0 + 0.2 * hold) * (turn.length_squared() + shift.length_squared()) + (1.0 + hold) * joints
        };
        let prior = |poses: &[Pose], normal: &mut NormalEquations| {
            Prior { predicted: &predicted, root: [0.02, 0.04], joints: &sigmas, gain: hold, stillness: &still, rests: &rests }.add(&body, poses, normal);
        };
        check(&body, &near, &prior, &cost)?;
    }

    #[test]
    fn limits(angles in angles()) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = random_pose(&body, &angles);
        let beyond = |poses: &[Pose]| {
            limited_angles(&body, poses).into_iter().map(|(angle, [low, high])| ((angle - angle.clamp(low, high)) / 0.05).powi(2)).sum()
        };
        check(&body, &poses, &|poses, normal| Limits.add(&body, poses, normal), &beyond)?;
        let off_rest = |poses: &[Pose]| {
            let narrow = limited_angles(&body, poses).into_iter().filter(|(_, [low, high])| (1e-9..1.7).contains(&(high - low)));
            narrow.map(|(angle, [low, high])| ((angle - 0.0_f64.clamp(low, high)) / (0.125 * (high - low))).powi(2)).sum()
        };
        check(&body, &poses, &|poses, normal| Posture { fraction: 0.25 }.add(&body, poses, normal), &off_rest)?;
    }

    #[test]
    fn sites(angles in angles(), targets in angles()) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = random_pose(&body, &angles);
        let pairs_at = |poses: &[Pose]| -> Vec<SitePair> {
            body.sites().iter().enumerate().map(|(index, site)| {
                let x = poses[site.limb] * site.position;
                let p = Vec3::new(targets[index], targets[index + 20], targets[index + 40]);
                let d = Vec3::new(targets[index + 5], 0.3, 0.8).normalize();
                let across = if index % 2 == 0 { Mat3::IDENTITY } else { Mat3::IDENTITY - Mat3::from_cols(d * d.x, d * d.y, d * d.z) };
                // A ray's target is the closest point on it.
                let p = if index % 2 == 0 { p } else { p + d * (x - p).dot(d) };
                SitePair { limb: site.limb, local: site.position, x, p, weight: 1.0, base_weight: 1.0, bias: 0.0, across, source: 0 }
            }).collect()
        };
        let add = |poses: &[Pose], normal: &mut NormalEquations| {
            let correspondences = Correspondences { sites: pairs_at(poses), ..Default::default() };
            Sites { correspondences: &correspondences, information: 1.0, scale: 0.5, biased: true }.add(&body, poses, normal);
        };
        check(&body, &poses, &add, &|poses| pairs_at(poses).iter().map(|pair| rho(pair.x.distance(pair.p), 0.5)).sum())?;
    }

    #[test]
    fn contour(angles in angles(), offsets in proptest::collection::vec(-0.1..0.1_f64, 18)) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = random_pose(&body, &angles);
        // A point of each limb and the edge it is drawn to, fixed in the world.
        let feet: Vec<Vec3> = offsets.iter().map(|offset| Vec3::new(*offset, 0.05, 0.1)).collect();
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let targets: Vec<Vec3> = poses.iter().zip(&feet).zip(&offsets).map(|((pose, foot), offset)| *pose * *foot + normal * *offset).collect();
        let edges_at = |poses: &[Pose]| -> Vec<EdgePair> {
            (0..poses.len()).map(|limb| {
                let x = poses[limb] * feet[limb];
                EdgePair { limb, x, normal, distance: normal.dot(targets[limb] - x), information: 0.7, source: 0 }
            }).collect()
        };
        let add = |poses: &[Pose], system: &mut NormalEquations| {
            Edges { pairs: &edges_at(poses), scale: 0.05 }.add(&body, poses, system);
        };
        check(&body, &poses, &add, &|poses| edges_at(poses).iter().map(|edge| 0.7 * rho(edge.distance, 0.05)).sum())?;
    }

    #[test]
    fn detected_joints(angles in angles(), offsets in proptest::collection::vec(-0.4..0.4_f64, 18)) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = random_pose(&body, &angles);
        let targets: Vec<Vec3> = body.sites().iter().zip(&offsets).map(|(site, off)| poses[site.limb].translation + Vec3::new(*off, 0.1, -off)).collect();
        let add = |poses: &[Pose], system: &mut NormalEquations| {
            let pairs: Vec<DetectedPair> = targets.iter().enumerate().map(|(site, p)| {
                DetectedPair { site, p: *p, sigma: 0.05, information: 1.0 + site as f64 }
            }).collect();
            DetectedJoints { pairs: &pairs }.add(&body, poses, system);
        };
        let cost = |poses: &[Pose]| {
            let sites = body.sites().iter().zip(&targets).enumerate();
            // The scale of the kernel is five standard deviations in space.
            sites.map(|(index, (site, p))| (1.0 + index as f64) * rho((poses[site.limb] * site.position).distance(*p), 8.66 * 0.05)).sum()
        };
        check(&body, &poses, &add, &cost)?;
    }

    #[test]
    fn regions(angles in angles(), offsets in proptest::collection::vec(-0.1..0.1_f64, 18)) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = random_pose(&body, &angles);
        // A point of each limb's contour, and where the edge of its colors is seen along a direction fixed in the world.
        let feet: Vec<Vec3> = offsets.iter().map(|offset| Vec3::new(0.06, *offset, 0.1)).collect();
        let normal = Vec3::new(0.48, -0.6, 0.64);
        let edges: Vec<f64> = poses.iter().zip(&feet).zip(&offsets).map(|((pose, foot), off)| normal.dot(*pose * *foot) + off).collect();
        let pairs_at = |poses: &[Pose]| -> Vec<EdgePair> {
            (0..poses.len()).map(|limb| {
                let x = poses[limb] * feet[limb];
                let information = 1.0 + limb as f64;
                EdgePair { limb, x, normal, distance: edges[limb] - normal.dot(x), information, source: 0 }
            }).collect()
        };
        let add = |poses: &[Pose], system: &mut NormalEquations| {
            Edges { pairs: &pairs_at(poses), scale: f64::INFINITY }.add(&body, poses, system);
        };
        check(&body, &poses, &add, &|poses| pairs_at(poses).iter().map(|pair| pair.information * pair.distance.powi(2)).sum())?;
    }

    #[test]
    fn penetration(angles in angles(), folded in 1.5..2.6_f64) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut poses = random_pose(&body, &angles);
        // The left forearm lies in the trunk in every case.
        let forearm = body.limb_index("l_forearm").unwrap();
        let thorax = body.limb_index("thorax").unwrap();
        poses[forearm] = poses[thorax] * Pose::new(Vec3::new(0.05, 0.12, 0.1), Vec3::new(folded, 0.4, 0.0));
        let add = |poses: &[Pose], normal: &mut NormalEquations| {
            let spheres: Vec<_> = body.limbs().iter().zip(poses).map(|(limb, pose)| limb.shape.sphere(pose)).collect();
            Penetration { spheres: &spheres }.add(&body, poses, normal);
        };
        let cost = |poses: &[Pose]| {
            let pairs = (0..poses.len()).flat_map(|limb| (0..poses.len()).map(move |other| [limb, other]));
            let overlap = |[limb, other]: [usize; 2]| [0.0, 0.35, 0.7, 1.0].map(|fraction| {
                let place = poses[limb] * (fraction * body.limbs()[limb].shape.length() * Vec3::Z);
                let found = body.limbs()[other].shape.closest_point(poses[other].inverse_transform_point(place));
                (found.signed_distance.min(0.0) / 0.03).powi(2)
            }).iter().sum::<f64>();
            pairs.filter(|[limb, other]| body.are_apart(*limb, *other)).map(overlap).sum()
        };
        check(&body, &poses, &add, &cost)?;
        let mut normal = NormalEquations::default();
        normal.clear(poses.len());
        add(&poses, &mut normal);
        prop_assert!(normal.limbs[forearm].g.norm() > 1e-3, "the overlap is not felt");
    }

    #[test]
    fn floor(angles in angles(), tilt in -0.3..0.3_f64) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = random_pose(&body, &angles);
        // The middle of the body is in the floor: some limbs end above it, some below.
        let normal = Vec3::new(tilt.sin(), 0.0, tilt.cos());
        let term = Floor { plane: Ground { normal, offset: normal.dot(poses[0].translation) } };
        let depth = |pose: &Pose, length: f64| (term.plane.height(*pose * (Vec3::Z * length)).min(0.0) / 0.03).powi(2);
        let cost = |poses: &[Pose]| body.limbs().iter().zip(poses).map(|(limb, pose)| depth(pose, limb.shape.length())).sum();
        check(&body, &poses, &|poses, normal| term.add(&body, poses, normal), &cost)?;
        let mut system = NormalEquations::default();
        system.clear(poses.len());
        term.add(&body, &poses, &mut system);
        for (limb, part) in body.limbs().iter().enumerate() {
            let height = term.plane.height(poses[limb] * (Vec3::Z * part.shape.length()));
            let push = system.limbs[limb].g;
            // What is above feels nothing.
            prop_assert_eq!(height < 0.0, push.norm() > 0.0);
            let expected = (0.5 * depth(&poses[limb], part.shape.length())).min(10.0);
            prop_assert!((term.cost(&body, &poses, limb) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn surface(angles in angles(), offsets in proptest::collection::vec(-0.05..0.1_f64, 60)) {
        let body = Body::human(1.75, HumanModel::Papers).unwrap();
        let poses = random_pose(&body, &angles);
        // Measured points near each limb, fixed in the world.
        let measured: Vec<Vec<Vec3>> = body.limbs().iter().zip(&poses).enumerate().map(|(limb, (part, pose))| (0..6).map(|k| {
            let turn = f64::from(k) * 1.1 + offsets[limb];
            let z = part.shape.length() * (0.15 + 0.12 * f64::from(k));
            let start = part.shape.closest_point(Vec3::new(turn.cos(), turn.sin(), z));
            *pose * (start.point + start.normal * (offsets[6 * limb + k as usize].abs() + 0.004))
        }).collect()).collect();
        // With an uncertain radius, the weights of the kernel are taken as constant: it is wide there.
        for (radius_variance, scale) in [(0.0, 0.05), (0.5, 1e3)] {
            let add = |poses: &[Pose], normal: &mut NormalEquations| {
                let limbs = body.limbs().iter().zip(poses).zip(&measured).map(|((part, pose), points)| {
                    let mut matches = LimbMatches { radius_variance, ..LimbMatches::default() };
                    for point in points {
                        let found = part.shape.closest_point(pose.inverse_transform_point(*point));
                        let f32s = |v: Vec3| v.to_array().map(|value| value as f32);
                        matches.candidate.push(0);
                        matches.measured.push(f32s(*point));
                        matches.weight.push(1.0);
                        matches.own.push(1.0);
                        matches.surface.points.push(f32s(*pose * found.point));
                        matches.surface.normals.push(f32s(pose.rotation * found.normal));
                        matches.surface.signed_distance.push(found.signed_distance as f32);
                        matches.surface.region.push(found.region);
                    }
                    matches
                }).collect();
                let correspondences = Correspondences { limbs, ..Default::default() };
                Surface { correspondences: &correspondences, information: 1.0, tangential_weight: 0.07, scale }
                    .add(&body, poses, normal);
            };
            let cost = |poses: &[Pose]| body.limbs().iter().zip(poses).zip(&measured).map(|((part, pose), points)| {
                let (mut sum, mut weight, mut pull) = (0.0, 0.0, 0.0);
                for point in points {
                    let distance = part.shape.closest_point(pose.inverse_transform_point(*point)).signed_distance;
                    let kernel = 1.0 / (1.0 + (distance / scale).powi(2)).powi(2);
                    (sum, weight, pull) = (sum + rho(distance, scale), weight + kernel, pull + kernel * distance);
                }
                sum - radius_variance / (1.0 + radius_variance * weight) * pull * pull
            }).sum();
            check(&body, &poses, &add, &cost)?;
        }
    }
}
