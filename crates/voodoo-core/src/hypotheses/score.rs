//! Cost of the poses of a frame, by which hypotheses are compared, in unexplained patches.

use super::landmark_cost::extremity_landmark_cost;
use crate::body::Body;
use crate::body::kinematics::joint_turn;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Matched};
use crate::math::{Points, Pose, ShortestAxis, Vec3};
use crate::observation::candidates::REFERENCE_PATCH;
use crate::observation::frame::Ground;
use crate::shape::TaperedEllipticCylinder;
use crate::visibility::evidence::{EXPLAINED, Visibility, limb_visibility, unexplained};
use crate::visibility::{ALONG_LIMB, OVERLAP};

/// Violation of a joint limit, and rotation of a joint since the last frame, that cost one unexplained patch each; radians.
/// Limits are soft; a joint may rotate by a third of a right angle between two frames.
const LIMIT_STRAIN: f64 = 0.1;
const MOTION_STRAIN: f64 = 0.6;
/// Minimum decrease of the cost by a hypothesis, patches: an area of six by six centimeters. The evidence must decrease as much,
/// because less occlusion or overlap alone does not justify a change. An arm or leg is tested only with as many unexplained
/// patches nearby.
pub(crate) const GAIN: f64 = 25.0;
/// Minimum decrease of the cost for a change to the opposite direction, patches.
pub(crate) const SURE_GAIN: f64 = 100.0;
/// Maximum number of points for the rough cost; the time is proportional to it.
pub(crate) const ROUGH_SAMPLE: usize = 400;

/// Cost of a pose in unexplained patches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost {
    /// Evidence against the pose: points that no limb explains, and surface that violates free space, at one price.
    pub evidence: f64,
    /// Evidence, occluded surface, and the strain of all arms and legs.
    pub total: f64,
}

impl Cost {
    /// Whether a hypothesis of this cost may replace the current pose.
    pub(crate) fn is_better_than(&self, current: &Self) -> bool {
        self.total < current.total - GAIN && self.evidence < current.evidence - GAIN
    }
}

/// Cost of matched poses. An unexplained patch costs `patch_cost`.
pub(crate) fn overall_cost(context: Context, matched: Matched, patch_cost: f64) -> Cost {
    let Context { model, observation, .. } = context;
    let mut visible = Visibility::default();
    for (limb, pose) in model.body.limbs().iter().zip(matched.poses) {
        visible += limb_visibility(observation.views, limb, pose);
    }
    let strain: f64 = model.extremities.iter().map(|chain| strain(context, matched, chain, matched.poses)).sum();
    let total: f64 = observation.candidates.weight.iter().map(|weight| f64::from(*weight)).sum();
    let (points, free_space) = (unexplained(matched.correspondences, total), visible.image.free_space);
    Cost { evidence: patch_cost * (points + free_space), total: patch_cost * points + visible.cost() + strain }
}

/// Cost of one arm or leg at `poses` due to joint limits, overlap with other limbs, distances from measured sites, and motion
/// since the last frame, in unexplained patches.
pub(super) fn strain(context: Context, matched: Matched, chain: &TwoBone, poses: &[Pose]) -> f64 {
    let (body, previous) = (&context.model.body, context.previous);
    let mut cost = 0.0;
    for limb in [chain.upper, chain.lower] {
        let Some((parent, joint)) = &body.limbs()[limb].parent else { continue };
        let turn = joint_turn(joint, &poses[*parent], &poses[limb]);
        cost += limit_strain(body, poses, limb);
        if previous.len() == poses.len() {
            let before = joint_turn(joint, &previous[*parent], &previous[limb]);
            let moved = (turn * before.inverse()).to_scaled_axis_shortest().length() / MOTION_STRAIN;
            cost += moved * moved;
        }
    }
    cost + overlap_cost(body, context.observation.floor(), chain, poses)
        + extremity_landmark_cost(matched, chain, poses)
}

/// Patches of an arm or leg where its axis lies inside another limb or below the floor.
fn overlap_cost(body: &Body, floor: Option<Ground>, chain: &TwoBone, poses: &[Pose]) -> f64 {
    let mut cost = 0.0;
    for limb in chain.limbs() {
        let shape = &body.limbs()[limb].shape;
        let patches = 2.0 * shape.length() * shape.b0().max(shape.b1()) / REFERENCE_PATCH;
        // The proximal end of the upper limb always lies inside its parent.
        let first = if limb == chain.upper { 2 } else { 0 };
        for place in &ALONG_LIMB[first..] {
            let point = poses[limb] * Vec3::new(0.0, 0.0, place * shape.length());
            let below = floor.is_some_and(|floor| floor.height(point) < -OVERLAP);
            let within = below
                || (0..poses.len()).filter(|other| !chain.limbs().any(|own| own == *other)).any(|other| {
                    let shape = &body.limbs()[other].shape;
                    // Most limbs are too far away to contain the point.
                    let reach = shape.length() + shape.a0().max(shape.b0()).max(shape.a1()).max(shape.b1());
                    (point - poses[other].translation).length_squared() < reach * reach
                        && shape.approximate_distance(poses[other].inverse_transform_point(point)) < -OVERLAP
                });
            cost += if within { patches / ALONG_LIMB.len() as f64 } else { 0.0 };
        }
    }
    cost
}

/// Cost of violated limits of the joint between a limb and its parent, in unexplained patches.
pub(crate) fn limit_strain(body: &Body, poses: &[Pose], limb: usize) -> f64 {
    let Some((parent, joint)) = &body.limbs()[limb].parent else { return 0.0 };
    let Some(limits) = &joint.limits else { return 0.0 };
    let turn = joint_turn(joint, &poses[*parent], &poses[limb]).to_scaled_axis_shortest();
    let excess = |(axis, [low, high]): (usize, &[f64; 2])| {
        ((low - turn[axis]).max(turn[axis] - high).max(0.0) / LIMIT_STRAIN).powi(2)
    };
    limits.iter().enumerate().map(excess).sum()
}

/// Updates the distances `least` of points to the nearest of several limbs with one more limb. `distances` is working memory.
pub(crate) fn explain(
    body: &Body,
    limb: usize,
    poses: &[Pose],
    points: &Points,
    least: &mut [f32],
    distances: &mut Vec<f32>,
) {
    body.limbs()[limb].shape.approximate_distances(&poses[limb], points, distances);
    for (least, distance) in least.iter_mut().zip(distances.iter()) {
        *least = least.min(distance.abs());
    }
}

/// Bounding box of points: its lowest and highest corner.
pub(super) fn bounds(points: &Points) -> [Vec3; 2] {
    let least =
        |values: &[f32]| values.iter().fold(f32::INFINITY, |least, value| if *value < least { *value } else { least });
    let most =
        |values: &[f32]| values.iter().fold(f32::NEG_INFINITY, |most, value| if *value > most { *value } else { most });
    let Points { x, y, z } = points;
    [[least(x), least(y), least(z)], [most(x), most(y), most(z)]].map(|corner| Vec3::from_array(corner.map(f64::from)))
}

/// Whether a limb may explain a point within a bounding box, with the tolerance of the rough cost.
pub(super) fn may_explain(shape: &TaperedEllipticCylinder, pose: &Pose, [low, high]: [Vec3; 2]) -> bool {
    let (middle, radius) = shape.sphere(pose);
    let gap = (middle - middle.max(low).min(high)).length() - radius;
    // The approximate distance is smaller than the true one where a cross-section is flat.
    let flatness = |a: f64, b: f64| a.min(b) / a.max(b).max(f64::MIN_POSITIVE);
    gap * flatness(shape.a0(), shape.b0()).min(flatness(shape.a1(), shape.b1())) <= 2.0 * EXPLAINED
}

/// Cost of points at these distances from the nearest limb of a rough pose. The tolerance is twice that of a refined pose,
/// because refinement pulls nearby points and limbs together.
pub(super) fn rough_cost(distances: &[f32], weights: &[f64]) -> f64 {
    distances.iter().zip(weights).map(|(d, w)| w * (f64::from(*d) / (2.0 * EXPLAINED)).powi(2).min(1.0)).sum()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::association::correspondence::Correspondences;
    use crate::body::Model;
    use crate::body::kinematics::{hinge_axis, place};
    use crate::fit::Fit;
    use crate::math::Quat;
    use crate::testing::{
        before_wall, first_arm, moved, put_board, raised, standing, turned, with_context, without_background,
    };

    /// Costs of poses in an image of the body at `truth`.
    fn costs(model: &Model, truth: &[Pose], tried: &[Vec<Pose>]) -> Vec<Cost> {
        let (pixels, config) = (before_wall(&model.body, truth), without_background());
        with_context(&pixels, &config, model, truth, |context| {
            let mut fit = Fit::new(&config).unwrap();
            let mut cost = |poses: &Vec<Pose>| {
                fit.match_last(context, poses);
                let (before, written) = (poses.clone(), format!("{:?}", fit.correspondences()));
                let cost = overall_cost(context, fit.matched(poses), 1.0);
                let again = overall_cost(context, fit.matched(poses), 1.0);
                let bits = |cost: Cost| [cost.evidence, cost.total].map(f64::to_bits);
                assert_eq!(bits(cost), bits(again), "the cost of the same input must not change");
                assert_eq!((&before, written), (poses, format!("{:?}", fit.correspondences())));
                cost
            };
            tried.iter().map(&mut cost).collect()
        })
    }

    #[test]
    fn a_correct_pose_costs_less_than_disturbed_ones_and_the_cost_has_no_side_effects() {
        let (model, poses) = standing();
        let root = poses[0].translation;
        let mut tried = vec![poses.clone()];
        for shift in [0.1 * Vec3::X, -0.1 * Vec3::X, 0.1 * Vec3::Y, 0.15 * Vec3::Z, -0.15 * Vec3::Z] {
            tried.push(moved(&poses, shift));
        }
        for (axis, angle) in [(Vec3::Z, 0.15), (Vec3::Z, -0.15), (Vec3::X, 0.2), (Vec3::Y, 0.8)] {
            tried.push(turned(&poses, root, axis, angle));
        }
        tried.push(raised(&model, &poses, 0.2).0);
        let costs = costs(&model, &poses, &tried);
        assert!(costs[0].total < GAIN, "{:?}", costs[0]);
        for (index, cost) in costs.iter().enumerate().skip(1) {
            assert!(cost.total > costs[0].total + GAIN && cost.evidence > costs[0].evidence, "{index}: {cost:?}");
        }
    }

    #[test]
    fn free_space_violations_and_unexplained_points_cost_their_area() {
        let (model, poses) = standing();
        let config = without_background();
        let cost = |pixels: &[u16]| {
            with_context(pixels, &config, &model, &poses, |context| {
                let mut fit = Fit::new(&config).unwrap();
                fit.match_last(context, &poses);
                let all: f32 = context.observation.candidates.weight.iter().sum();
                (overall_cost(context, fit.matched(&poses), 1.0), f64::from(all))
            })
        };
        let alone = before_wall(&model.body, &poses);
        let (right, body) = cost(&alone);
        // An empty room: the whole visible surface violates free space.
        let (past, points) = cost(&vec![4500; alone.len()]);
        assert!(points == 0.0 && past.evidence > 0.8 * body && past.total >= past.evidence, "{past:?} of {body}");
        // A nearer wall occludes the whole body, which has a cost but is no evidence against the pose.
        let (hidden, _) = cost(&vec![1000; alone.len()]);
        assert!(hidden.evidence == 0.0 && hidden.total > 0.0 && hidden.total < past.total, "{hidden:?}");
        // A board beside the body.
        let mut pixels = alone.clone();
        put_board(&mut pixels, Vec3::new(0.75, 0.0, 2.6), [0.1; 2]);
        let (beside, all) = cost(&pixels);
        let board = all - body;
        assert!(board > 20.0 && (beside.evidence - right.evidence - board).abs() < 0.1 * board, "{beside:?}, {board}");
    }

    #[test]
    fn a_hyperextended_elbow_costs_the_squared_violation_of_its_limit() {
        let (model, poses) = standing();
        let chain = &model.extremities[first_arm(&model)];
        let (_, joint) = model.body.limbs()[chain.lower].parent.as_ref().unwrap();
        let [[least, _], ..] = joint.limits.unwrap();
        let matched = Matched { correspondences: &Correspondences::default(), poses: &poses };
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let own = |poses: &[Pose]| strain(Context { previous: &[], ..context }, matched, chain, poses);
            assert!(limit_strain(&model.body, &poses, chain.lower) < 1e-9);
            for beyond in [0.2, 0.4] {
                let mut bent = poses.clone();
                let turn = Quat::from_axis_angle(hinge_axis(joint), least - beyond);
                bent[chain.lower] = place(joint, &poses[chain.upper], turn);
                let expected = (beyond / LIMIT_STRAIN).powi(2);
                let (limit, all) = (limit_strain(&model.body, &bent, chain.lower), own(&bent) - own(&poses));
                assert!(
                    (limit - expected).abs() < 1e-6 && (all - expected).abs() < 1e-6,
                    "{limit} and {all} for {beyond}"
                );
            }
        });
    }

    #[test]
    fn an_arm_inside_the_trunk_costs_its_patches_and_one_outside_costs_nothing() {
        let (model, poses) = standing();
        let (body, chain) = (&model.body, &model.extremities[first_arm(&model)]);
        assert_eq!(overlap_cost(body, None, chain, &poses), 0.0);
        assert_eq!(overlap_cost(body, None, chain, &raised(&model, &poses, 0.2).0), 0.0);
        let mut inside = poses.clone();
        let middle = 0.5 * (poses[0].translation + chain.root(body, &poses));
        chain.reach(body, &mut inside, middle, 0.0);
        let cost = overlap_cost(body, None, chain, &inside);
        assert!(cost > 10.0, "{cost} patches");
        // A floor above the whole arm has a cost, and one below it has none.
        let below = |offset| overlap_cost(body, Some(Ground { normal: Vec3::Y, offset }), chain, &poses);
        let ends = chain.limbs().map(|limb| poses[limb].translation.y);
        let [low, high] = ends.fold([f64::MAX, f64::MIN], |[low, high], y| [low.min(y), high.max(y)]);
        assert!(below(high + 1.0) > 10.0 && below(low - 1.0) == 0.0, "{}", below(high + 1.0));
    }

    #[test]
    fn motion_costs_nothing_without_previous_poses() {
        let (model, poses) = standing();
        let (raised, _) = raised(&model, &poses, 0.2);
        let (pixels, config) = (before_wall(&model.body, &poses), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &poses);
            let chain = &model.extremities[first_arm(&model)];
            let cost = |previous| strain(Context { previous, ..context }, fit.matched(&poses), chain, &raised);
            let (unknown, hung, stayed) = (cost(&[]), cost(&poses), cost(&raised));
            assert_eq!(unknown, stayed);
            assert!(hung > unknown + 1.0, "{hung} after {unknown}");
            // The strain of all arms and legs is part of the total, but not of the evidence.
            let overall = |previous| overall_cost(Context { previous, ..context }, fit.matched(&poses), 1.0);
            let (still, moved) = (overall(&poses), overall(&raised));
            assert!(moved.total > still.total + 1.0 && moved.evidence == still.evidence, "{moved:?} and {still:?}");
        });
    }
}
