//! Rough looks at other configurations of one arm or leg: cheap, so that many can be tried before one is refined.

use std::f64::consts::TAU;

use super::score::{ROUGH_SAMPLE, explain, rough_cost, strain};
use super::suspicion::distances_to_others;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Matched};
use crate::math::{Pose, Vec3, WeightedPoints};
use crate::regions::{Backdrop, ColorRegions, PixelGain, Posed};
use crate::visibility::evidence::{Visibility, limb_visibility};

/// The arm or leg that is looked at, and where everything else is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extremity<'a> {
    pub(super) context: Context<'a>,
    /// The current poses, and what was matched there.
    pub(super) matched: Matched<'a>,
    /// What colors tell, where nothing but pictures shows the body.
    pub(super) regions: Option<&'a ColorRegions>,
    /// Its number among the extremities.
    pub(super) index: usize,
}

impl<'a> Extremity<'a> {
    pub(super) fn chain(&self) -> &'a TwoBone {
        &self.context.model.extremities[self.index]
    }

    /// Center of its ball joint, working frame.
    pub(super) fn root(&self) -> Vec3 {
        self.chain().root(&self.context.model.body, self.matched.poses)
    }
}

/// Points about one arm or leg by which rough configurations are compared, and working memory.
#[derive(Debug, Default)]
pub(super) struct RoughScore {
    /// Those that nothing explains.
    pub(super) unexplained: WeightedPoints,
    /// Those, and the ones that the arm or leg explains now: they must stay explained. Not too many.
    sample: WeightedPoints,
    /// Distances of the sample to the nearest limb that does not belong to it: what that explains is no merit of this one.
    others: Vec<f32>,
    nearest: Vec<f32>,
    distances: Vec<f32>,
    /// What pictures show of everything else.
    pub(super) backdrop: Backdrop,
}

/// Rough looks at places where an arm or leg may end.
#[derive(Debug, Default)]
pub(super) struct RoughSearch {
    pub(super) score: RoughScore,
    trial: Vec<Pose>,
}

impl RoughScore {
    /// Room for a frame of so many candidates.
    pub(super) fn make_room(&mut self, count: usize) {
        for (points, count) in [(&mut self.unexplained, count), (&mut self.sample, 2 * count)] {
            points.clear();
            points.reserve(count);
        }
        for distances in [&mut self.others, &mut self.nearest, &mut self.distances] {
            distances.clear();
            distances.reserve(count);
        }
    }

    /// Draws everything else before what pictures show.
    fn draw_others(&mut self, at: Extremity) {
        let Some(regions) = at.regions else { return };
        let (chain, frame, poses) = (at.chain(), at.context.observation.frame(), at.matched.poses);
        let Context { model, previous, .. } = at.context;
        let posed = Posed { body: &model.body, poses, previous, origin: at.context.observation.origin() };
        regions.draw(frame, posed, |limb| chain.limbs().all(|own| own != limb), &mut self.backdrop);
    }

    /// What pictures say of some of its limbs at `poses`.
    pub(super) fn pixel_gain(&self, at: Extremity, poses: &[Pose], limbs: impl Iterator<Item = usize>) -> PixelGain {
        let mut gain = PixelGain::default();
        let Some(regions) = at.regions else { return gain };
        let Context { model, observation, previous, .. } = at.context;
        let posed = Posed { body: &model.body, poses, previous, origin: observation.origin() };
        limbs.for_each(|limb| gain += regions.pixel_gain(observation.frame(), posed, limb, &self.backdrop));
        gain
    }

    /// Takes the points that count: what is unexplained near by, and what it explains itself.
    pub(super) fn begin(&mut self, at: Extremity, own: &WeightedPoints) {
        self.draw_others(at);
        let Self { unexplained, sample, others, distances, .. } = self;
        sample.clear();
        sample.extend(unexplained);
        sample.extend(own);
        sample.subsample(ROUGH_SAMPLE);
        distances_to_others(at.context, at.matched.poses, at.chain(), &sample.points, others, distances);
    }

    /// Cost of the arm or leg at `poses`, in unexplained patches. No part of it is negative: what cannot fall below `least` any
    /// more is not looked at further.
    pub(super) fn cost(&mut self, at: Extremity, poses: &[Pose], least: f64) -> f64 {
        let Self { sample, others, nearest, distances, .. } = self;
        let (context, chain) = (at.context, at.chain());
        let body = &context.model.body;
        nearest.clone_from(others);
        chain.limbs().for_each(|limb| explain(body, limb, poses, &sample.points, nearest, distances));
        let points = rough_cost(nearest, &sample.weights);
        if at.regions.is_some() {
            // What colors explain is the only part that may be negative.
            return strain(context, at.matched, chain, poses) - self.pixel_gain(at, poses, chain.limbs()).gained;
        }
        if points >= least {
            return points;
        }
        let mut visible = Visibility::default();
        chain
            .limbs()
            .for_each(|limb| visible += limb_visibility(context.observation.views, &body.limbs()[limb], &poses[limb]));
        let evidence = points + visible.cost();
        if evidence >= least { evidence } else { evidence + strain(context, at.matched, chain, poses) }
    }
}

impl RoughSearch {
    /// Room for a body of so many limbs.
    pub(super) fn prepare(&mut self, limbs: usize) {
        self.trial.clear();
        self.trial.reserve(limbs);
    }

    /// The best way to end at a place that costs less than `least`, into `best`; returns its cost. `swivels` bends about the line
    /// from the root to the place are tried.
    pub(super) fn end_at(
        &mut self,
        at: Extremity,
        place: Vec3,
        swivels: usize,
        mut least: f64,
        best: &mut Vec<Pose>,
    ) -> f64 {
        let Self { score, trial } = self;
        for swivel in 0..swivels {
            trial.clear();
            trial.extend_from_slice(at.matched.poses);
            at.chain().reach(&at.context.model.body, trial, place, TAU * swivel as f64 / swivels as f64);
            let cost = score.cost(at, trial, least);
            if cost < least {
                least = cost;
                best.clone_from(trial);
            }
        }
        least
    }

    /// Takes the configuration that `change` makes of the current one, if it costs less than `least`, into `best`; returns the
    /// lower cost.
    pub(super) fn changed(
        &mut self,
        at: Extremity,
        change: impl FnOnce(&mut [Pose]),
        least: f64,
        best: &mut Vec<Pose>,
    ) -> f64 {
        let Self { score, trial } = self;
        trial.clear();
        trial.extend_from_slice(at.matched.poses);
        change(trial);
        let cost = score.cost(at, trial, least);
        if cost < least {
            best.clone_from(trial);
            return cost;
        }
        least
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::hypotheses::unexplained::Unexplained;
    use crate::testing::{before_wall, first_arm, raised, standing, with_context, without_background};

    #[test]
    fn an_arm_is_bent_the_way_it_is_visible() {
        let (model, poses) = standing();
        let (stretched, end) = raised(&model, &poses, 0.2);
        let (config, index) = (without_background(), first_arm(&model));
        let arm = &model.extremities[index];
        let root = arm.root(&model.body, &stretched);
        let place = root + 0.6 * (end - root);
        for bend in [0, 2, 5] {
            let mut raised_pose = poses.clone();
            arm.reach(&model.body, &mut raised_pose, place, TAU * f64::from(bend) / 6.0);
            with_context(&before_wall(&model.body, &raised_pose), &config, &model, &poses, |context| {
                let mut fit = Fit::new(&config).unwrap();
                fit.match_last(context, &poses);
                let at = Extremity { context, matched: fit.matched(&poses), regions: None, index };
                let (mut unexplained, mut rough) = (Unexplained::default(), RoughSearch::default());
                unexplained.collect(context, at.matched);
                unexplained.near(root, arm.stretched_length(), &mut rough.score.unexplained);
                rough.score.begin(at, &WeightedPoints::default());
                let mut best = Vec::new();
                rough.end_at(at, place, 6, f64::INFINITY, &mut best);
                let elbow = best[arm.lower].translation.distance(raised_pose[arm.lower].translation);
                assert!(elbow < 1e-6, "bend {bend}: the elbow is {elbow} m off");
            });
        }
    }

    #[test]
    fn the_raised_hand_is_where_an_arm_ends_at_least_cost() {
        let (model, poses) = standing();
        let (raised_pose, end) = raised(&model, &poses, 0.2);
        let (pixels, config) = (before_wall(&model.body, &raised_pose), without_background());
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &poses);
            let at = Extremity { context, matched: fit.matched(&poses), regions: None, index: first_arm(&model) };
            let mut unexplained = Unexplained::default();
            unexplained.collect(context, at.matched);
            let mut rough = RoughSearch::default();
            unexplained.near(at.root(), at.chain().stretched_length(), &mut rough.score.unexplained);
            rough.score.begin(at, &WeightedPoints::default());
            let hanging = rough.score.cost(at, &poses, f64::INFINITY);
            let truth = rough.score.cost(at, &raised_pose, f64::INFINITY);
            let mut best = Vec::new();
            let least = rough.end_at(at, end, 6, hanging, &mut best);
            assert!(truth < 0.3 * hanging && least < 0.5 * hanging, "{truth} and {least} of {hanging}");
            assert!(at.chain().end(&best).distance(end) < 0.02, "the best ends there");
            // Nothing is found that costs no less than asked for, and the best stays.
            let before = best.clone();
            let mirrored = at.root() - (end - at.root());
            assert_eq!(rough.end_at(at, mirrored, 6, least, &mut best), least);
            assert_eq!(best, before);
            // Another change is taken only where it costs less.
            assert_eq!(rough.changed(at, |_| (), least, &mut best), least);
            assert_eq!(best, before);
            assert_eq!(rough.changed(at, |trial| trial.copy_from_slice(&raised_pose), hanging, &mut best), truth);
            assert_eq!(best, raised_pose);
        });
    }
}
