//! The block-tree elimination is the dense solution, and the tree solver holds joints together.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use proptest::prelude::*;
use voodoo_core::Body;
use voodoo_core::body::HumanModel;
use voodoo_core::math::{Mat3, Pose, Vec3};
use voodoo_core::solver::TreeSolver;
use voodoo_core::terms::normal_equations::{LimbBlock, NormalEquations};

/// A system with the human's tree: `A^T A` of random rows that each touch one limb or a limb and its parent.
fn random_system(body: &Body, values: &[f64]) -> TreeSolver {
    let mut values = values.iter().cycle().copied();
    let mut next = || values.next().unwrap_or(0.3);
    let mut tree = TreeSolver::default();
    for (limb, part) in body.limbs().iter().enumerate() {
        let parent = part.parent.as_ref().map_or(0, |(parent, _)| *parent);
        tree.own.push(LimbBlock { h: Matrix6::identity() * 0.1, g: Vector6::from_fn(|_, _| next()) });
        tree.mixed.push(Matrix6::zeros());
        if limb == 0 {
            continue;
        }
        for _ in 0..5 {
            let (moves, follows) = (Vector6::from_fn(|_, _| next()), Vector6::from_fn(|_, _| next()));
            tree.own[limb].h += moves * moves.transpose();
            tree.own[parent].h += follows * follows.transpose();
            tree.mixed[limb] += moves * follows.transpose();
        }
    }
    tree
}

/// The solution by a dense Cholesky of the whole matrix.
fn dense(tree: &TreeSolver, body: &Body) -> DVector<f64> {
    let n = tree.own.len();
    let mut h = DMatrix::zeros(6 * n, 6 * n);
    let mut g = DVector::zeros(6 * n);
    for limb in 0..n {
        h.view_mut((6 * limb, 6 * limb), (6, 6)).copy_from(&tree.own[limb].h);
        g.rows_mut(6 * limb, 6).copy_from(&tree.own[limb].g);
        if let Some(parent) = body.parent(limb) {
            h.view_mut((6 * limb, 6 * parent), (6, 6)).copy_from(&tree.mixed[limb]);
            h.view_mut((6 * parent, 6 * limb), (6, 6)).copy_from(&tree.mixed[limb].transpose());
        }
    }
    -h.cholesky().unwrap().solve(&g)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn elimination_is_the_dense_solution(values in proptest::collection::vec(-1.0..1.0_f64, 499)) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut tree = random_system(&body, &values);
        let expected = dense(&tree, &body);
        prop_assert!(tree.solve(&body));
        for (limb, twist) in tree.twist.iter().enumerate() {
            let error = (twist - expected.fixed_rows::<6>(6 * limb)).norm();
            prop_assert!(error < 1e-7 * (1.0 + expected.norm()), "limb {limb}: {error}");
        }
    }
}

#[test]
fn a_matrix_that_is_not_positive_definite_is_refused() {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let mut tree = random_system(&body, &[0.3, -0.7, 0.2]);
    tree.own[4].h[(2, 2)] = -50.0;
    assert!(!tree.solve(&body));
}

/// Pulling one hand 10 cm away takes the arm along, and the joints stay closed within millimeters.
#[test]
fn bands_carry_a_pull_through_the_body() {
    let body = Body::human(1.75, HumanModel::Full).unwrap();
    let start = body.rest_pose(Pose::IDENTITY);
    let hand = body.limb_index("l_hand").unwrap();
    let upper = body.limb_index("l_upperarm").unwrap();
    let target = start[hand].translation + Vec3::new(0.10, 0.0, 0.05);
    let mut poses = start.clone();
    let mut tree = TreeSolver::default();
    for _ in 0..30 {
        let mut normal = NormalEquations::default();
        normal.clear(poses.len());
        // Everything holds its place a little, the hand is drawn to its target.
        for (limb, (pose, rest)) in poses.iter().zip(&start).enumerate() {
            let (place, weight) = if limb == hand { (target, 1e4) } else { (rest.translation, 10.0) };
            normal.limbs[limb].add_point(&(Mat3::IDENTITY * weight), pose.translation, pose.translation - place);
            normal.joints[limb].h += nalgebra::Matrix3::identity();
        }
        normal.joints[0] = Default::default();
        tree.step(&body, &normal, 1.0, 0.001, &mut poses);
    }
    assert!((poses[hand].translation - target).length() < 0.02);
    assert!((poses[upper].rotation.inverse() * start[upper].rotation).w.abs() < 0.9999, "the upper arm has not turned");
    for (limb, part) in body.limbs().iter().enumerate() {
        let Some((parent, joint)) = &part.parent else { continue };
        let gap =
            poses[limb] * joint.limb_from_joint.translation - poses[*parent] * joint.parent_from_joint.translation;
        assert!(gap.length() < 0.005, "{}: {gap:?}", joint.name);
    }
}
