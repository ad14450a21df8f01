//! Candidates that no limb explains.

use crate::association::correspondence::Correspondences;
use crate::math::{Vec3, WeightedPoints, reset};
use crate::observation::candidates::Candidates;
use crate::visibility::EXPLAINED;

/// Fraction of the points in a frame that a correct pose usually leaves unexplained, and the cost of a patch there, nats: the
/// logarithm of its probability on the body over that of an unexplained one. It falls where more is unexplained: a frame of
/// noise, or of another person in front of the body, is no evidence against a pose.
const USUAL_CLUTTER: f64 = 0.05;
const USUAL_COST: f64 = 2.0;

/// Candidates that the current correspondences leave unexplained.
#[derive(Debug, Default)]
pub(super) struct Unexplained {
    points: WeightedPoints,
    /// Cost of an unexplained patch in this frame, in those of a usual frame.
    pub(super) clutter: f64,
    /// Distance of every candidate to the nearest limb that it is matched to.
    nearest: Vec<f32>,
}

impl Unexplained {
    /// Collects the unexplained candidates of a frame.
    pub(super) fn collect(&mut self, candidates: &Candidates, correspondences: &Correspondences) {
        let Self { points, clutter, nearest } = self;
        // Reserved now, so that later steps do not allocate.
        points.make_room(candidates.len());
        reset(nearest, candidates.len(), f32::INFINITY);
        for matches in &correspondences.limbs {
            let distances = &matches.surface.signed_distance;
            let mut explain = |candidate: u32, distance: f32| {
                let nearest = &mut nearest[candidate as usize];
                // A rejected match (to a cap inside the body) still explains its point.
                *nearest = nearest.min(distance.abs());
            };
            matches.candidate.iter().zip(distances).for_each(|(candidate, distance)| explain(*candidate, *distance));
            matches.left_out.iter().for_each(|[candidate, of]| explain(*candidate, distances[*of as usize]));
        }
        for (index, distance) in nearest.iter().enumerate() {
            if f64::from(*distance) > EXPLAINED {
                let all = &candidates.points;
                points.push([all.x[index], all.y[index], all.z[index]], f64::from(candidates.area[index]));
            }
        }
        let all = candidates.area();
        let excess = points.total() / (USUAL_CLUTTER * all).max(f64::MIN_POSITIVE);
        *clutter = (1.0 - excess.max(1.0).ln() / USUAL_COST).max(0.0);
    }

    /// Writes the unexplained points within `reach` meters of a position to `near`.
    pub(super) fn near(&self, place: Vec3, reach: f64, near: &mut WeightedPoints) {
        near.clear();
        for index in 0..self.points.weights.len() {
            let (point, weight) = self.points.get(index);
            if (point - place).length() < reach {
                near.push(point.as_vec3().to_array(), weight);
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::math::Pose;
    use crate::testing::{before_wall, first_arm, raised, standing, with_context, without_background};

    /// Checks the points that hanging arms leave unexplained in an image of the body at `truth`.
    fn collected(truth: &[Pose], check: impl FnOnce(&Unexplained)) {
        let (model, poses) = standing();
        let (pixels, config) = (before_wall(&model.body, truth), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &poses, true);
            let mut unexplained = Unexplained::default();
            unexplained.collect(context.observation.candidates, &fit.correspondences);
            check(&unexplained);
        });
    }

    #[test]
    fn a_correct_pose_leaves_few_points_unexplained() {
        let (_, poses) = standing();
        collected(&poses, |unexplained| {
            assert!(unexplained.points.total() < 5.0 && unexplained.clutter == 1.0);
        });
    }

    #[test]
    fn points_of_a_raised_arm_are_unexplained_by_a_hanging_one_and_lie_near_its_shoulder() {
        let (model, poses) = standing();
        let (truth, end) = raised(&model, &poses, 0.2);
        let chain = &model.extremities[first_arm(&model)];
        let root = chain.root(&model.body, &poses);
        collected(&truth, |unexplained| {
            let all = unexplained.points.total();
            let mut near = WeightedPoints::default();
            unexplained.near(end, 0.15, &mut near);
            let hand = near.total();
            unexplained.near(root, 1.2 * chain.stretched_length(), &mut near);
            let arm = near.total();
            assert!(hand > 20.0 && arm > 0.95 * all && arm > 1.5 * hand, "hand: {hand}, arm: {arm}, all: {all}");
            unexplained.near(root - 2.0 * (end - root), 0.15, &mut near);
            assert!(near.weights.is_empty());
        });
    }
}
