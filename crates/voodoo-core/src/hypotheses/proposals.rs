//! Where an arm or leg may be: carried along with its parent, or ending at a heap of open points.

use crate::body::Body;
use crate::body::two_bone::TwoBone;
use crate::math::{Points, Pose, Vec3};

/// Places where the end of a chain is tried, size of what stands for one (metres), and patches of it that may be stray.
const TARGETS: usize = 5;
const HEAP: f64 = 0.08;
const STRAY: f64 = 3.0;

/// The chain's relative pose of another time on the parent of now.
pub(crate) fn carry(chain: &TwoBone, body: &Body, then: &[Pose], now: &mut [Pose]) {
    for limb in chain.limbs() {
        if let Some((parent, _)) = &body.limbs()[limb].parent {
            now[limb] = now[*parent] * then[*parent].inverse() * then[limb];
        }
    }
}

/// Where the end of the chain may be: middles of heaps of open points, each as far as can be from the root and the others.
pub(crate) fn targets(points: &Points, weights: &[f64], root: Vec3, apart: &mut Vec<f32>) -> [Option<Vec3>; TARGETS] {
    apart.clear();
    apart.extend((0..points.len()).map(|index| (points.get(index) - root).length() as f32));
    let (mut targets, mut found) = ([None; TARGETS], 0);
    while found < TARGETS {
        let Some(next) = (0..points.len()).max_by(|a, b| apart[*a].total_cmp(&apart[*b])) else { break };
        let place = points.get(next);
        if f64::from(apart[next]) < HEAP {
            break;
        }
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for (index, apart) in apart.iter_mut().enumerate() {
            let point = points.get(index);
            let distance = (point - place).length();
            *apart = apart.min(distance as f32);
            if distance < HEAP {
                sum += weights[index] * point;
                total += weights[index];
            }
        }
        // A few stray points are no hand.
        if total > STRAY {
            targets[found] = Some(sum / total);
            found += 1;
        }
    }
    targets
}

/// Keeps about `most` of the points, evenly, and their total weight.
pub(crate) fn thin(points: &mut Points, weights: &mut Vec<f64>, most: usize) {
    let count = points.len();
    if count <= most {
        return;
    }
    let scale = count as f64 / most as f64;
    for kept in 0..most {
        let from = (kept as f64 * scale) as usize;
        let point = points.get(from).to_array().map(|value| value as f32);
        points.set(kept, point);
        weights[kept] = weights[from] * scale;
    }
    points.x.truncate(most);
    points.y.truncate(most);
    points.z.truncate(most);
    weights.truncate(most);
}
