//! No heap allocation in a solve after warm-up, counted.
#![allow(missing_docs, clippy::unwrap_used, reason = "a test stops at the first surprise")]

#[path = "../../voodoo-core/tests/counting/mod.rs"]
mod counting;

use counting::allocations_so_far;
use voodoo_core::HumanModel;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
use voodoo_core::{Body, Camera};
use voodoo_ik::{Aim, ChainModel, Criterion, Goal, IkProblem, IkSolver, SilhouetteView, SolverOptions, bones, trunk};

const WARM_UP: usize = 26;
const COUNTED: usize = 60;

/// Allocations of a warm solver with two levels, limits, an image and a rest posture, for targets and starts it has not seen.
fn allocations() -> usize {
    let body = Body::human(1.75, HumanModel::Papers).unwrap();
    let model = ChainModel::new(&body, &[], true).unwrap();
    let pixels: Vec<[f32; 2]> = (0..160 * 120)
        .map(|i| ((i % 160) as f32 - 70.0).hypot((i / 160) as f32 - 60.0) - 9.0)
        .map(|distance| [distance, if distance < 0.0 { 9.0 } else { 0.0 }])
        .collect();
    let rotation = Quat::from_mat3(&Mat3::from_cols(-Vec3::Z, Vec3::X, -Vec3::Y));
    let camera_from_world = Pose::from_parts(Vec3::new(0.0, 0.0, 3.0), rotation);
    let camera = Camera::pinhole(160, 120, [140.0, 140.0, 79.5, 59.5]).unwrap();
    let view = SilhouetteView { pixels, depth: Vec::new(), border: 1.0, camera, camera_from_world };
    let segments = bones(&body, &model, 1.0);
    let trunk = trunk(&body, &model, &Pose::IDENTITY);
    let criterion = Criterion { views: &[&view], segments: &segments, thin: 1.7, trunk: &trunk };
    let rest: Vec<(usize, f64)> = (6..model.freedoms()).map(|unknown| (unknown, 0.1)).collect();
    let mut solver = IkSolver::default();
    let mut count = 0;
    for index in 0..WARM_UP + COUNTED {
        let by = 0.02 * index as f64;
        let goals = [("l_hand", 0), ("r_ankle", 0), ("head_center", 1)].map(|(name, level)| {
            let site = &body.sites()[body.site_index(name).unwrap()];
            // Some in reach, some not.
            let aim = Aim::Position(Vec3::new(by, 0.3 - by, 0.2 + 0.5 * by));
            Goal { link: model.link_of(site.limb).unwrap(), point: site.position, aim, weight: 1.0, level }
        });
        let mut angles = vec![0.1; model.freedoms()];
        let before = allocations_so_far();
        let (model, base, options) = (&model, Pose::IDENTITY, SolverOptions::default());
        let problem = IkProblem { model, base, goals: &goals, criterion: Some(&criterion), rest: &rest, options };
        solver.solve(&problem, &mut angles);
        if index >= WARM_UP {
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
    assert_eq!(allocations(), 0);
}
