//! Proposals of alternative configurations of an arm or leg, one function for each kind. Each writes the poses of the body with its
//! best configuration, if that is worth refining.

use std::f64::consts::{PI, TAU};

use super::rough::{Extremity, RoughSearch};
use crate::detect::Detected;
use crate::math::{Pose, Vec3, WeightedPoints, refill};
use crate::terms::APART;
use crate::visibility::FEW;

/// Number of bends of an arm or leg about the line from its root to its end that are compared; twice as many where the position
/// of the end is given. Also the maximum number of clusters of unexplained points, and of directions of the upper limb, for one
/// arm or leg. The time is proportional to all of them.
pub(crate) const SWIVELS: usize = 6;

/// Proposes an arm or leg that ends at a cluster of unexplained points, and one that is stretched through it: at the clusters that
/// are farthest from the root and from each other. Both have to cost less than `least`. Returns the cost of the first, or `least`.
pub(super) fn propose_clusters(
    at: Extremity,
    rough: &mut RoughSearch,
    mut least: f64,
    [ending, stretched]: [&mut Vec<Pose>; 2],
) -> f64 {
    let ends = end_proposals(&rough.unexplained, at.root(), &mut rough.distances);
    let mut least_stretched = least;
    for end in ends.into_iter().flatten() {
        // A hand that lies on another limb leaves only the points of its forearm, which a stretched arm passes.
        let beyond = at.root() + (end - at.root()).normalize() * at.chain.stretched_length();
        least_stretched = rough.end_at(at, beyond, 1, least_stretched, stretched);
        least = rough.end_at(at, end, SWIVELS, least, ending);
    }
    least
}

/// Positions for the end: centroids of clusters, selected by farthest-point sampling from the root. `apart` is working memory.
fn end_proposals(cluster: &WeightedPoints, root: Vec3, apart: &mut Vec<f32>) -> [Option<Vec3>; SWIVELS] {
    let WeightedPoints { points, weights } = cluster;
    refill(apart, (0..points.len()).map(|index| (points.get(index) - root).length() as f32));
    let (mut ends, mut found) = ([None; SWIVELS], 0);
    while found < SWIVELS {
        let Some(next) = (0..points.len()).max_by(|a, b| apart[*a].total_cmp(&apart[*b])) else { break };
        let place = points.get(next);
        if f64::from(apart[next]) < APART {
            break;
        }
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for (index, apart) in apart.iter_mut().enumerate() {
            let point = points.get(index);
            let distance = (point - place).length();
            *apart = apart.min(distance as f32);
            if distance < APART {
                sum += weights[index] * point;
                total += weights[index];
            }
        }
        // Clusters of few points are noise.
        if total > FEW {
            ends[found] = Some(sum / total);
            found += 1;
        }
    }
    ends
}

/// Proposes the directions that explain the colors best: of the upper limb among directions on a sphere, then of the lower limb
/// at the best of these. It has to cost less than `least`.
pub(super) fn propose_color_directions(at: Extremity, rough: &mut RoughSearch, mut least: f64, best: &mut Vec<Pose>) {
    if at.objective.regions.is_none() {
        return;
    }
    let body = &at.objective.context.model.body;
    for (_, upper) in best_directions(at, &mut rough.trial) {
        let bend = at.root() + at.chain.lengths[0] * upper;
        for lower in directions() {
            let change = |poses: &mut [Pose]| at.chain.place_between(body, poses, bend, bend + lower);
            least = rough.changed(at, change, least, best);
        }
    }
}

/// The directions of the upper limb of lowest cost, working frame, each with its cost, in ascending order. The current direction is
/// one of the candidates. `trial` is working memory.
fn best_directions(at: Extremity, trial: &mut Vec<Pose>) -> [(f64, Vec3); SWIVELS] {
    let (chain, body, poses) = (at.chain, &at.objective.context.model.body, at.objective.poses);
    let mut kept = [(f64::INFINITY, Vec3::ZERO); SWIVELS];
    for upper in directions().chain([poses[chain.upper].rotation * Vec3::Z]) {
        refill(trial, poses.iter().copied());
        chain.place_between(body, trial, at.root() + upper, at.root() + 2.0 * upper);
        let cost = at.objective.limb(trial, chain.upper);
        let place = kept.partition_point(|(other, _)| *other <= cost);
        if place < SWIVELS {
            kept[place..].rotate_right(1);
            kept[place] = (cost, upper);
        }
    }
    kept
}

/// Directions on the unit sphere on a grid of `SWIVELS` polar angles and twice as many azimuths.
fn directions() -> impl Iterator<Item = Vec3> {
    let step = PI / SWIVELS as f64;
    (0..SWIVELS).flat_map(move |row| {
        let (height, around) = ((row as f64 + 0.5) * step).sin_cos();
        (0..2 * SWIVELS).map(move |column| {
            let (s, c) = (TAU * column as f64 / (2 * SWIVELS) as f64).sin_cos();
            Vec3::new(height * c, height * s, around)
        })
    })
}

/// Proposes an arm or leg that ends at the detected hand, wrist or ankle.
pub(super) fn propose_detected_end(at: Extremity, detected: Detected, rough: &mut RoughSearch, best: &mut Vec<Pose>) {
    let Some(end) = detected_end(at, detected) else { return };
    let place = end - at.objective.context.observation.origin();
    // The bend is searched for, because a detected elbow or knee is no more accurate than the wrist or ankle.
    rough.end_at(at, place, 2 * SWIVELS, f64::INFINITY, best);
}

/// Detected position of the chain's end, world frame: a joint detected on its last limb, or the detected wrist or ankle plus the
/// current offset of the end from it.
fn detected_end(at: Extremity, detected: Detected) -> Option<Vec3> {
    let (chain, body, poses) = (at.chain, &at.objective.context.model.body, at.objective.poses);
    let last = *chain.ends.first()?;
    let (_, joint) = body.limbs()[last].parent.as_ref()?;
    if let Some(detected) = detected.on_limb(last) {
        return Some(detected.position);
    }
    let beyond = chain.end(poses) - poses[last] * joint.limb_from_joint.translation;
    Some(detected.hangs_by(last)?.position + beyond)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cluster(points: &mut WeightedPoints, middle: Vec3, count: usize) {
        for index in 0..count {
            let around = Vec3::new((index as f64).sin(), (2.0 * index as f64).cos(), (3.0 * index as f64).sin());
            points.push((middle + 0.02 * around).as_vec3().to_array(), 1.0);
        }
    }

    #[test]
    fn ends_are_cluster_centroids_farthest_first() {
        let mut points = WeightedPoints::default();
        let (far, near) = (Vec3::new(0.5, 0.1, 0.2), Vec3::new(-0.1, 0.3, -0.1));
        cluster(&mut points, near, 40);
        cluster(&mut points, far, 20);
        let found: Vec<Vec3> = end_proposals(&points, Vec3::ZERO, &mut Vec::new()).into_iter().flatten().collect();
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].distance(far) < 0.03 && found[1].distance(near) < 0.03, "{found:?}");
    }

    #[test]
    fn nothing_is_proposed_without_points_or_close_to_the_root() {
        let mut points = WeightedPoints::default();
        assert_eq!(end_proposals(&points, Vec3::ZERO, &mut Vec::new()), [None; SWIVELS]);
        cluster(&mut points, Vec3::new(0.02, 0.0, 0.0), 30);
        assert_eq!(end_proposals(&points, Vec3::ZERO, &mut Vec::new()), [None; SWIVELS]);
    }
}
