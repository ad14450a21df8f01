//! The objective by which poses of a frame are compared: the cost of all terms.

use crate::association::correspondence::Correspondences;
use crate::fit::{Context, Fit};
use crate::math::Pose;
use crate::regions::ColorRegions;
use crate::solver::SITE_SCALE;
use crate::terms::{DetectedJoints, Floor, Limits, PATCH, Penetration, Sites, Term, cost_of_points, stance_cost};
use crate::visibility::evidence::limb_visibility;

/// Decrease of the cost at which another pose is better, nats: the odds are 20 to 1. An arm or leg is tested only where that much
/// is unexplained.
pub(crate) const MARGIN: f64 = 3.0;

/// Cost of a patch of a limb's surface that violates free space, in unexplained patches: it lies where a camera observes something
/// behind it. Free space moves no limb: the contour in depth images moves it to the edge of what is observed.
const VIOLATION: f64 = 0.6;

/// Negative log-likelihood of poses of a body in a frame, nats.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Objective<'a> {
    /// The frame.
    pub context: Context<'a>,
    /// The correspondences, and the poses at which they were found.
    pub correspondences: &'a Correspondences,
    pub poses: &'a [Pose],
    /// The color regions where they compare poses, with the limbs drawn that are not compared, or the whole body.
    pub regions: Option<&'a ColorRegions>,
}

impl<'a> Objective<'a> {
    /// That of matched poses, with the colors where these compare poses.
    pub(super) fn new(context: Context<'a>, fit: &'a Fit, poses: &'a [Pose]) -> Self {
        let regions = context.compares_colors().then_some(&fit.regions);
        Self { context, correspondences: &fit.correspondences, poses, regions }
    }

    /// Cost of the pose of one limb but for the points.
    pub(crate) fn limb(&self, poses: &[Pose], limb: usize) -> f64 {
        let Self { context, correspondences, regions, .. } = *self;
        let Context { model, observation, config, .. } = context;
        let information = config.point_information();
        let (body, pairs, floor) = (&model.body, &correspondences.detected, observation.floor());
        let cost = |term: &dyn Term| term.cost(body, poses, limb);
        let of_colors = |regions: &ColorRegions| -PATCH * regions.pixel_gain(context.posed(poses), limb)[0];
        VIOLATION * PATCH * limb_visibility(observation.views, &body.limbs()[limb], &poses[limb]).free_space
            + cost(&Sites { correspondences, information, scale: SITE_SCALE, biased: true })
            + cost(&DetectedJoints { pairs })
            + regions.map_or(0.0, of_colors)
            + cost(&Limits)
            + cost(&Penetration { spheres: &[] })
            + floor.map_or(0.0, |plane| cost(&Floor { plane }))
            + floor.map_or(0.0, |floor| stance_cost(floor, model, poses, limb))
    }

    /// Cost of the matched poses of the whole body. A point that no limb explains costs the surface for which it stands, where a patch
    /// costs `clutter` of those of a usual frame.
    pub(crate) fn body(&self, clutter: f64) -> f64 {
        let candidates = self.context.observation.candidates;
        let explained: f64 = self.correspondences.limbs.iter().map(|limb| cost_of_points(limb, candidates)).sum();
        let limbs = (0..self.poses.len()).map(|limb| self.limb(self.poses, limb));
        clutter * (PATCH * candidates.area() + explained) + limbs.sum::<f64>()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::Model;
    use crate::math::Vec3;
    use crate::testing::{before_wall, moved, put_board, raised, standing, turned, with_context, without_background};

    /// Costs of poses in an image of the body at `truth`.
    fn costs(model: &Model, truth: &[Pose], tried: &[Vec<Pose>]) -> Vec<f64> {
        let (pixels, config) = (before_wall(&model.body, truth), without_background());
        with_context(&pixels, &config, model, truth, |context| {
            let mut fit = Fit::new(&config).unwrap();
            let mut cost = |poses: &Vec<Pose>| {
                fit.match_last(context, poses, true);
                let (before, written) = (poses.clone(), format!("{:?}", fit.correspondences));
                let correspondences = &fit.correspondences;
                let cost = || Objective { context, correspondences, poses, regions: None }.body(1.0);
                assert_eq!(cost().to_bits(), cost().to_bits(), "the cost of the same input must not change");
                assert_eq!((&before, written), (poses, format!("{:?}", fit.correspondences)));
                cost()
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
        assert!(costs[0] < MARGIN, "{} nats", costs[0]);
        for (index, cost) in costs.iter().enumerate().skip(1) {
            assert!(*cost > costs[0] + MARGIN, "{index}: {cost}");
        }
    }

    #[test]
    fn unexplained_points_and_violated_free_space_cost_their_area_and_hidden_limbs_nothing() {
        let (model, poses) = standing();
        let config = without_background();
        let cost = |pixels: &[u16]| {
            with_context(pixels, &config, &model, &poses, |context| {
                let mut fit = Fit::new(&config).unwrap();
                fit.match_last(context, &poses, true);
                let all = context.observation.candidates.area();
                let correspondences = &fit.correspondences;
                let objective = Objective { context, correspondences, poses: &poses, regions: None };
                (objective.body(1.0), PATCH * all)
            })
        };
        let alone = before_wall(&model.body, &poses);
        let (right, body) = cost(&alone);
        // An empty room: the whole visible surface violates free space, at half the price of points.
        let (past, points) = cost(&vec![4500; alone.len()]);
        assert!(points == 0.0 && past > 0.4 * body && past < body, "{past} of {body}");
        // A nearer wall hides the whole body.
        assert!(cost(&vec![1000; alone.len()]).0 <= right);
        // A board beside the body.
        let mut pixels = alone.clone();
        put_board(&mut pixels, Vec3::new(0.75, 0.0, 2.6), [0.1; 2]);
        let (beside, all) = cost(&pixels);
        let board = all - body;
        assert!(board > 2.0 && (beside - right - board).abs() < 0.1 * board, "{beside}, {board}");
    }
}
