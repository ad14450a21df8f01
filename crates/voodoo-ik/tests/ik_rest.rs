//! The rest posture: below all goals and the images, and as near as these allow.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

use proptest::prelude::*;
use voodoo_core::HumanModel;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
use voodoo_core::{Body, Camera};
use voodoo_ik::{
    Aim, ChainModel, Criterion, Goal, IkProblem, IkSolver, Kinematics, SilhouetteView, SolverOptions, bones,
    level_cost, level_rows, trunk,
};

fn long() -> SolverOptions {
    SolverOptions { steps: 400, tolerance: 1e-12, still: 1e-9, ..SolverOptions::default() }
}

struct Arm {
    body: Body,
    model: ChainModel,
}

impl Arm {
    fn new(human: HumanModel, limbs: &[&str]) -> Self {
        let body = Body::human(1.75, human).unwrap();
        let limbs: Vec<usize> = limbs.iter().map(|name| body.limb_index(name).unwrap()).collect();
        let model = ChainModel::new(&body, &limbs, false).unwrap();
        Self { body, model }
    }

    /// One freedom is left when the hand is known.
    fn stiff() -> Self {
        Self::new(HumanModel::Papers, &["l_upperarm", "l_forearm"])
    }

    /// Several are.
    fn loose() -> Self {
        Self::new(HumanModel::Full, &["l_upperarm", "l_forearm", "l_hand"])
    }

    fn place(&self, angles: &[f64]) -> Kinematics {
        let mut at = Kinematics::default();
        self.model.place(&Pose::IDENTITY, angles, &mut at);
        at
    }

    fn within(&self, values: &[f64]) -> Vec<f64> {
        values.iter().zip(self.model.limits()).map(|(value, [low, high])| value.clamp(*low, *high)).collect()
    }

    /// A goal for a site where it is at some angles, and farther by `beyond`.
    fn goal(&self, site: &str, angles: &[f64], beyond: Vec3, level: usize) -> Goal {
        let site = &self.body.sites()[self.body.site_index(site).unwrap()];
        let link = self.model.link_of(site.limb).unwrap();
        let aim = Aim::Position(self.place(angles).poses[link].transform_point(site.position) + beyond);
        Goal { link, point: site.position, aim, weight: 1.0, level }
    }

    fn solve(&self, goals: &[Goal], criterion: Option<&Criterion>, start: &[f64], rest: Vec<(usize, f64)>) -> Vec<f64> {
        let mut angles = start.to_vec();
        let problem =
            IkProblem { model: &self.model, base: Pose::IDENTITY, goals, criterion, rest: &rest, options: long() };
        let report = IkSolver::default().solve(&problem, &mut angles);
        let h = criterion.map_or(0.0, |criterion| self.h(criterion, &angles));
        assert!((report.h - h).abs() < 1e-9, "{} {h}", report.h);
        for (angle, [low, high]) in angles.iter().zip(self.model.limits()) {
            assert!(low <= angle && angle <= high);
        }
        angles
    }

    fn h(&self, criterion: &Criterion, angles: &[f64]) -> f64 {
        criterion.evaluate(&self.model, &self.place(angles), &mut vec![0.0; angles.len()])
    }
}

fn rest_at(values: &[f64]) -> Vec<(usize, f64)> {
    values.iter().copied().enumerate().collect()
}

fn off(angles: &[f64], rest: &[(usize, f64)]) -> f64 {
    rest.iter().map(|(unknown, rest)| (angles[*unknown] - rest).powi(2)).sum()
}

fn values(count: usize, size: f64) -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-size..size, count)
}

/// A silhouette: what is left of a line across the picture, `slope` steep, as a signed distance.
fn half(at: f64, slope: f64) -> Vec<[f32; 2]> {
    let length = 1.0_f64.hypot(slope);
    (0..160 * 120)
        .map(|i| [((((i % 160) as f64 - at) + slope * ((i / 160) as f64 - 60.0)) / length) as f32, 0.0])
        .collect()
}

fn view(pixels: Vec<[f32; 2]>) -> SilhouetteView {
    // Optical frame: z towards -x of the world, 3 m away.
    let rotation = Quat::from_mat3(&Mat3::from_cols(-Vec3::Z, Vec3::X, -Vec3::Y));
    let camera_from_world = Pose::from_parts(Vec3::new(0.0, 0.0, 3.0), rotation);
    let camera = Camera::pinhole(160, 120, [140.0, 140.0, 79.5, 59.5]).unwrap();
    SilhouetteView { pixels, depth: Vec::new(), border: 1.0, camera, camera_from_world }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

    #[test]
    fn rest_disturbs_neither_goals_nor_images(
        start in values(7, 0.6), hand in values(7, 1.0), elbow in values(7, 1.0), rest in values(7, 1.0),
        beyond in prop_oneof![Just(0.0), 0.0..0.5_f64], at in 40.0..120.0_f64, slope in -1.0..1.0_f64, drawn in 1..8_usize,
    ) {
        let arm = Arm::loose();
        let start = arm.within(&start[..arm.model.freedoms()]);
        let goals = [
            arm.goal("l_hand", &arm.within(&hand), beyond * Vec3::X, 0),
            arm.goal("l_elbow", &arm.within(&elbow), Vec3::ZERO, 1),
        ];
        let (pixels, bones, trunk) = (half(at, slope), bones(&arm.body, &arm.model, 1.1), trunk(&arm.body, &arm.model, &Pose::IDENTITY));
        let criterion = Criterion { views: &[&view(pixels)], segments: &bones, thin: 1.7, trunk: &trunk };
        let mut rest = rest_at(&rest[..arm.model.freedoms()]);
        rest.truncate(drawn);
        for levels in 0..=2 {
            for criterion in [None, Some(&criterion)] {
                let goals = &goals[..levels];
                let alone = arm.solve(goals, criterion, &start, vec![]);
                let drawn = arm.solve(goals, criterion, &start, rest.clone());
                for goal in goals {
                    let cost = |angles: &[f64]| level_cost(&[*goal], &arm.place(angles)).sqrt();
                    prop_assert!(cost(&drawn) <= cost(&alone) + 1e-9, "{} {}", cost(&drawn), cost(&alone));
                }
                if let Some(criterion) = criterion {
                    let (before, after) = (arm.h(criterion, &alone), arm.h(criterion, &drawn));
                    prop_assert!(after <= before + 1e-8, "{after} {before}");
                }
                prop_assert!(off(&drawn, &rest) <= off(&alone, &rest) + 1e-12);
            }
        }
    }

    #[test]
    fn rest_is_as_near_as_the_goal_allows(start in values(4, 0.5), hand in values(4, 0.7), rest in values(4, 0.7)) {
        let arm = Arm::stiff();
        // Off the limits, and the elbow bent.
        let bent = |values: &[f64]| arm.within(&[values[0], -0.8 + 0.5 * values[1], values[2], 1.2 + 0.5 * values[3]]);
        let goals = [arm.goal("l_wrist", &bent(&hand), Vec3::ZERO, 0)];
        let rest = rest_at(&rest);
        let found = arm.solve(&goals, None, &bent(&start), rest.clone());
        let (mut rows, mut residual) = (Vec::new(), Vec::new());
        let at = arm.place(&found);
        prop_assert!(level_cost(&goals, &at).sqrt() < 1e-9);
        level_rows(&arm.model, &goals, &at, &mut rows, &mut residual);
        // The one direction that is free: minors of the 3 x 4 Jacobian.
        let minor = |skip: usize| {
            let column = |i: usize| Vec3::new(rows[i], rows[4 + i], rows[8 + i]);
            let c: Vec<Vec3> = (0..4).filter(|i| *i != skip).map(column).collect();
            let sign = if skip.is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * c[0].dot(c[1].cross(c[2]))
        };
        let free: Vec<f64> = (0..4).map(minor).collect();
        let length = free.iter().map(|value| value * value).sum::<f64>().sqrt();
        prop_assume!(length > 1e-4);
        for way in [-1e-3, 1e-3] {
            let moved: Vec<f64> = found.iter().zip(&free).map(|(angle, free)| angle + way * free / length).collect();
            let beside = arm.solve(&goals, None, &moved, vec![]);
            prop_assert!(off(&found, &rest) <= off(&beside, &rest) + 1e-8, "{found:?} {beside:?}");
        }
    }

    #[test]
    fn without_goals_rest_is_reached(start in values(7, 2.0), rest in values(7, 4.0), drawn in 0..8_usize) {
        let arm = Arm::loose();
        let start = arm.within(&start[..arm.model.freedoms()]);
        let mut rest = rest_at(&rest[..arm.model.freedoms()]);
        rest.truncate(drawn);
        let mut expected = start.clone();
        rest.iter().for_each(|(unknown, rest)| expected[*unknown] = *rest);
        let found = arm.solve(&[], None, &start, rest);
        for (found, expected) in found.iter().zip(arm.within(&expected)) {
            prop_assert!((found - expected).abs() < 1e-12);
        }
    }
}

#[test]
fn rest_goes_along_the_border_of_the_silhouette() {
    let arm = Arm::loose();
    let n = arm.model.freedoms();
    let (bones, trunk) = (bones(&arm.body, &arm.model, 1.1), trunk(&arm.body, &arm.model, &Pose::IDENTITY));
    // The arm hangs within the silhouette; at rest it would be stretched out to the side, beyond its border, and forwards.
    let side = arm.place(&vec![0.0; n]).poses[0].translation.y;
    let start = vec![0.0; n];
    let mut out = start.clone();
    out[1] = -1.2;
    out[0] = 0.9;
    let rest = rest_at(&out);
    let pixels = half(79.5 + 140.0 * (side + 0.2) / 3.0, 0.0);
    let criterion = Criterion { views: &[&view(pixels)], segments: &bones, thin: 0.0, trunk: &trunk };
    let (from, to) = (arm.h(&criterion, &start), arm.h(&criterion, &out));
    assert!(from < 1e-9 && to > 1.0, "{from} {to}");
    let found = arm.solve(&[], Some(&criterion), &start, rest.clone());
    assert!(arm.h(&criterion, &found) < 1e-8);
    // Sideways as far as the border, forwards all the way.
    assert!(off(&found, &rest) < 0.5 * off(&start, &rest), "{found:?}");
    assert!(found[1] < -0.1 && (found[0] - out[0]).abs() < 0.3, "{found:?}");
    assert_eq!(arm.solve(&[], Some(&criterion), &start, vec![]), start);
}

#[test]
fn what_is_no_unknown_is_drawn_nowhere() {
    let arm = Arm::stiff();
    let start = arm.within(&[0.1, -0.2, 0.1, 0.4]);
    let rest = [(99, 1.0), (0, f64::NAN)];
    for rest in rest {
        assert_eq!(arm.solve(&[], None, &start, vec![rest]), start);
    }
}
