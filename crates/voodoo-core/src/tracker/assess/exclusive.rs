//! Points that a limb explains exclusively: no other limb does, except its neighbors.

use crate::body::Body;
use crate::hypotheses::ROUGH_SAMPLE;
use crate::math::{Points, Pose, reset, vectorized};
use crate::observation::candidates::Candidates;
use crate::visibility::EXPLAINED;

/// The surface for which the exclusively explained candidates stand, and working memory.
#[derive(Debug, Default)]
pub(super) struct Exclusive {
    /// That of each limb, in patches.
    pub(super) area: Vec<f64>,
    /// The part of `area` from point clouds, that is, not from depth images.
    pub(super) clouds: Vec<f64>,
    sample: Points,
    distances: Vec<f32>,
    /// Distances of all sample points, limb after limb.
    all: Vec<f32>,
    /// For each sample point the nearest limb, the distance to it, and the number of limbs near enough to explain the point.
    nearest: Vec<u32>,
    least: Vec<f32>,
    near: Vec<u32>,
}

impl Exclusive {
    /// Recomputes them for these poses and candidates.
    pub(super) fn count(&mut self, body: &Body, poses: &[Pose], candidates: &Candidates) {
        let Self { area, clouds, sample, distances, all, nearest, least, near } = self;
        let count = poses.len();
        let pixels = candidates.cameras.last().map_or(0, |(end, _)| *end as usize);
        reset(area, count, 0.0);
        reset(clouds, count, 0.0);
        let step = (candidates.len() / ROUGH_SAMPLE).max(1);
        let points = &candidates.points;
        sample.clear();
        for index in (0..points.len()).step_by(step) {
            sample.push([points.x[index], points.y[index], points.z[index]]);
        }
        all.clear();
        reset(least, sample.len(), f32::INFINITY);
        reset(nearest, sample.len(), 0);
        reset(near, sample.len(), 0);
        for (index, (limb, pose)) in (0..).zip(body.limbs().iter().zip(poses)) {
            limb.shape.approximate_distances(pose, sample, distances);
            distances.iter_mut().for_each(|distance| *distance = distance.abs());
            let own = nearest.iter_mut().zip(&mut *least).zip(&mut *near).zip(&*distances);
            vectorized!({
                for (((nearest, least), near), distance) in own {
                    let nearer = *distance < *least;
                    *nearest = if nearer { index } else { *nearest };
                    *least = if nearer { *distance } else { *least };
                    *near += u32::from(*distance <= EXPLAINED as f32);
                }
            });
            all.extend_from_slice(distances);
        }
        for place in 0..sample.len() {
            if least[place] >= EXPLAINED as f32 {
                continue;
            }
            let closest = nearest[place] as usize;
            let distance = |limb: usize| all[limb * sample.len() + place];
            let rival = |other: &usize| {
                *other != closest && distance(*other) <= EXPLAINED as f32 && !body.adjacent(*other, closest)
            };
            if near[place] == 1 || (0..count).find(rival).is_none() {
                let candidate = f64::from(candidates.area[place * step]) * step as f64;
                area[closest] += candidate;
                clouds[closest] += if place * step < pixels { 0.0 } else { candidate };
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::testing::{before_wall, first_arm, moved, raised, standing, with_context, without_background};

    /// The surface that each limb explains exclusively, for an image of `truth` and a body at `poses`, and that of all candidates.
    fn counted(truth: &[Pose], poses: &[Pose], change: impl Fn(&Candidates, &mut Exclusive)) -> (Vec<f64>, f64) {
        let (model, config) = (standing().0, without_background());
        with_context(&before_wall(&model.body, truth), &config, &model, poses, |context| {
            let candidates = context.observation.candidates;
            let mut exclusive = Exclusive::default();
            // A second count replaces the first one.
            exclusive.count(&model.body, poses, candidates);
            exclusive.count(&model.body, poses, candidates);
            change(candidates, &mut exclusive);
            (exclusive.area, candidates.area())
        })
    }

    #[test]
    fn limbs_explain_most_of_a_body_exclusively_and_depth_images_are_not_point_clouds() {
        let (_, poses) = standing();
        let (weight, all) = counted(&poses, &poses, |_, exclusive| assert!(exclusive.clouds.iter().all(|w| *w == 0.0)));
        let sum: f64 = weight.iter().sum();
        assert!(sum > 0.6 * all && sum < 1.1 * all, "{sum} of {all}");
    }

    #[test]
    fn points_that_two_limbs_or_no_limb_explain_are_not_exclusive() {
        let (model, poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let (raised, _) = raised(&model, &poses, 0.2);
        let on = |(weight, _): &(Vec<f64>, f64)| weight[arm.lower];
        let right = counted(&poses, &poses, |_, _| ());
        // The other forearm in the same pose as this one.
        let mut twice = poses.clone();
        let other = model.extremities.iter().find(|chain| !chain.leg && chain.lower != arm.lower).unwrap().lower;
        twice[other] = poses[arm.lower];
        assert!(on(&right) > 10.0 && on(&counted(&poses, &twice, |_, _| ())) < 0.1 * on(&right));
        assert_eq!(on(&counted(&raised, &poses, |_, _| ())), 0.0);
        let (weight, all) = counted(&poses, &moved(&poses, Vec3::new(0.0, 0.0, 0.5)), |_, _| ());
        assert!(all > 1000.0 && weight.iter().sum::<f64>() == 0.0, "{weight:?}");
    }
}
