//! The published solver: weighted absolute orientation of each limb separately (K06 IV-B.7, K07 3.2).

use crate::association::correspondence::{Correspondences, LimbMatches};
use crate::math::{Moments, Pose, Vec3};

/// Lever of the damping against rotation where the pairs do not determine it, meters: the girth of a limb.
const STAY: f64 = 0.05;

/// Moves each limb to the optimum of its own pairs; information crosses one joint per step through the bands.
pub(crate) fn solve_limbwise(correspondences: &Correspondences, poses: &mut [Pose]) {
    for (limb, pose) in poses.iter_mut().enumerate() {
        // Moments about the limb's own position keep the sums well conditioned.
        let center = pose.translation;
        let mut moments = surface_moments(&correspondences.limbs[limb], center);
        for pair in correspondences.sites.iter().filter(|pair| pair.limb == limb) {
            moments.add(pair.weight, pair.x - center, pair.p - center);
        }
        for end in correspondences.bands.iter().filter(|end| end.limb == limb) {
            moments.add(end.weight, end.x - center, end.p - center);
        }
        if let Some(motion) = moments.absolute_orientation(STAY) {
            let rotation = (motion.rotation * pose.rotation).normalize();
            // x - center = 0 at the limb's own position, so its image is the translation of the motion.
            *pose = Pose::from_parts(center + motion.translation, rotation);
        }
    }
}

/// Moments of the surface matches of one limb about `center`, four lanes wide so that they vectorize.
fn surface_moments(matches: &LimbMatches, center: Vec3) -> Moments {
    /// Sums side by side: one SIMD register of double precision, in AVX2.
    const WIDE: usize = 4;
    let c = center.as_vec3().to_array();
    let (x, p) = (&matches.surface.points, &matches.measured);
    let count = matches.weight.len();
    // w, w x, w p, w p x^T
    let mut sums = [[0.0_f64; WIDE]; 16];
    for index in 0..count {
        let lane = index % WIDE;
        let w = f64::from(matches.weight[index]);
        let xs = [x.x[index] - c[0], x.y[index] - c[1], x.z[index] - c[2]].map(f64::from);
        let ps = [p.x[index] - c[0], p.y[index] - c[1], p.z[index] - c[2]].map(f64::from);
        sums[0][lane] += w;
        for axis in 0..3 {
            sums[1 + axis][lane] += w * xs[axis];
            sums[4 + axis][lane] += w * ps[axis];
            for other in 0..3 {
                sums[7 + 3 * axis + other][lane] += w * xs[axis] * ps[other];
            }
        }
    }
    let [w, x0, x1, x2, p0, p1, p2, products @ ..] = sums.map(|lanes| lanes.iter().sum::<f64>());
    let px = [0, 1, 2].map(|axis| Vec3::from_slice(&products[3 * axis..]));
    Moments { weight: w, x: Vec3::new(x0, x1, x2), p: Vec3::new(p0, p1, p2), px }
}
