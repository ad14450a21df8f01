//! Cost of a closest point: the SIMD batch against the exact path, on points near limb-like shapes, one core.
//!
//! Reported per point (throughput): 15 ns is the aim, 7 ns defensible, 3.2 ns the floating-point roofline on AVX2 at 3 GHz.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use voodoo_core::math::{Points, Pose, Vec3};
use voodoo_core::{SurfaceBatch, TaperedEllipticCylinder};

const POINTS: usize = 2000;

/// Splitmix64 to [0, 1).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Points from 2 cm inside to 4 cm outside of the side, world frame.
fn points_near(shape: &TaperedEllipticCylinder, world_from_limb: &Pose) -> Points {
    let mut state = 7;
    let mut points = Points::default();
    for _ in 0..POINTS {
        let (angle, t) = (std::f64::consts::TAU * uniform(&mut state), uniform(&mut state));
        let a = shape.a0() + (shape.a1() - shape.a0()) * t;
        let b = shape.b0() + (shape.b1() - shape.b0()) * t;
        let off = 0.06 * uniform(&mut state) - 0.02;
        let limb = Vec3::new((a + off) * angle.cos(), (b + off) * angle.sin(), t * shape.length());
        points.push(world_from_limb.transform_point(limb).as_vec3().to_array());
    }
    points
}

fn bench(criterion: &mut Criterion) {
    let pose = Pose::new(Vec3::new(0.4, -0.3, 2.1), Vec3::new(0.3, 1.1, -0.7));
    let mut group = criterion.benchmark_group("closest_point");
    group.throughput(Throughput::Elements(POINTS as u64));
    for (name, sizes) in [
        ("forearm", [0.25, 0.05, 0.045, 0.03, 0.027]),
        ("calf", [0.42, 0.06, 0.065, 0.04, 0.042]),
        ("torso", [0.55, 0.16, 0.11, 0.19, 0.12]),
    ] {
        let [length, a0, b0, a1, b1] = sizes;
        let Ok(shape) = TaperedEllipticCylinder::new(length, a0, b0, a1, b1) else {
            continue;
        };
        let points = points_near(&shape, &pose);
        let mut out = SurfaceBatch::default();
        group.bench_function(format!("batch/{name}"), |bencher| {
            bencher.iter(|| shape.closest_points(&pose, black_box(&points), &mut out));
        });
        group.bench_function(format!("exact/{name}"), |bencher| {
            bencher.iter(|| {
                (0..points.len())
                    .map(|i| shape.closest_point(pose.inverse_transform_point(points.get(i))).point.z)
                    .sum::<f64>()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
