//! Proposes an arm or leg that ends at a cluster of unexplained points, and one that is stretched through it.

use super::{Pool, Propose, SWIVELS};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::math::{Vec3, WeightedPoints, refill};
use crate::terms::APART;
use crate::visibility::FEW;

/// Proposal of ends at the clusters that are farthest from the root and from each other.
#[derive(Debug, Default)]
pub(in crate::hypotheses) struct UnexplainedCluster {
    pub(in crate::hypotheses) apart: Vec<f32>,
}

impl Propose for UnexplainedCluster {
    fn propose(&mut self, at: Extremity, rough: &mut RoughSearch, pool: &mut Pool) {
        let ends = end_proposals(&rough.unexplained, at.root(), &mut self.apart);
        let mut stretched = pool.least;
        for end in ends.into_iter().flatten() {
            // A hand that lies on another limb leaves only the points of its forearm, which a stretched arm passes.
            let beyond = at.root() + (end - at.root()).normalize() * at.chain.stretched_length();
            stretched = rough.end_at(at, beyond, 1, stretched, &mut pool.stretched);
            pool.least = rough.end_at(at, end, SWIVELS, pool.least, &mut pool.points);
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn cluster(points: &mut WeightedPoints, middle: Vec3, count: usize) {
        for index in 0..count {
            let around = Vec3::new((index as f64).sin(), (2.0 * index as f64).cos(), (3.0 * index as f64).sin());
            points.push((middle + 0.02 * around).to_array().map(|value| value as f32), 1.0);
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
