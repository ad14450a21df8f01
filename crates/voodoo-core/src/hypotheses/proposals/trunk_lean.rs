//! Proposes a lean of the trunk about its shoulders, with both feet at their last good positions, for a body that sits down,
//! squats or stands up. A wrong height of the pelvis displaces both legs, and a change of one leg alone is held back by the other
//! leg and the trunk.

use std::f64::consts::TAU;

use super::{Pool, Propose, SWIVELS};
use crate::body::Model;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Matched};
use crate::hypotheses::history::{Basis, History};
use crate::hypotheses::rough::{Extremity, RoughSearch};
use crate::hypotheses::score::{ROUGH_SAMPLE, explain, rough_cost, strain};
use crate::math::{Pose, Quat, Vec3, WeightedPoints};
use crate::visibility::evidence::limb_visibility;

/// Step between the leans that are compared, radians: none, and one or two steps in each direction. Coarser and finer steps gave
/// no better results.
const LEAN: f64 = 0.2;

/// The limbs that lean and the legs that stand, and working memory.
#[derive(Debug, Default)]
pub(in crate::hypotheses) struct TrunkLean {
    /// The two legs and the two arms among the extremities; `None` if a body has another number of them. There are no proposals
    /// without two legs, and no leans without two arms.
    legs: Option<[usize; 2]>,
    arms: Option<[usize; 2]>,
    /// The ancestors of the arms.
    trunk: Vec<usize>,
    sample: WeightedPoints,
    distances: Distances,
    trial: Vec<Pose>,
    /// The body with both feet at their last good positions: with the current trunk, and with the best lean.
    upright: Vec<Pose>,
    leant: Vec<Pose>,
}

/// Distances of the sample to the nearest limb: of the limbs that stay; of these and the leaning trunk; and of all of these and
/// the legs under test.
#[derive(Debug, Default)]
struct Distances {
    staying: Vec<f32>,
    leaning: Vec<f32>,
    tried: Vec<f32>,
    scratch: Vec<f32>,
}

/// The best trunk pose with both feet at their last good positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stance {
    /// The current one.
    Upright,
    /// A lean.
    Leant,
}

/// A leg and the position of its end, working frame.
type StandingLeg<'a> = (&'a TwoBone, Vec3);

impl TrunkLean {
    /// Finds the legs, the arms and the trunk of a body, and reserves memory.
    pub(in crate::hypotheses) fn prepare(&mut self, model: &Model) {
        let Model { body, extremities, .. } = model;
        let pair = |leg: bool| {
            let mut found = (0..extremities.len()).filter(|index| extremities[*index].leg == leg);
            match (found.next(), found.next(), found.next()) {
                (Some(one), Some(two), None) => Some([one, two]),
                _ => None,
            }
        };
        (self.legs, self.arms) = (pair(true), pair(false));
        self.trunk.clear();
        for arm in self.arms.iter().flatten() {
            let mut limb = extremities[*arm].upper;
            while let Some((parent, _)) = &body.limbs()[limb].parent {
                limb = *parent;
                if !self.trunk.contains(&limb) {
                    self.trunk.push(limb);
                }
            }
        }
        for poses in [&mut self.trial, &mut self.upright, &mut self.leant] {
            poses.clear();
            poses.reserve(body.limbs().len());
        }
    }

    /// Reserves memory for a frame of `count` candidates.
    pub(in crate::hypotheses) fn make_room(&mut self, count: usize) {
        self.sample.clear();
        self.sample.reserve(count);
        let Distances { staying, leaning, tried, scratch } = &mut self.distances;
        for distances in [staying, leaning, tried, scratch] {
            distances.clear();
            distances.reserve(count.min(ROUGH_SAMPLE));
        }
    }

    /// Finds the stance of lowest cost and writes its poses to `upright` or `leant`. `None` if the last good position of a foot
    /// is not known.
    fn best_stance(&mut self, context: Context, matched: Matched, history: &[History]) -> Option<Stance> {
        let extremities = &context.model.extremities;
        let [one, two] = self.legs?;
        let (one_end, two_end) = (history[one].last_good_end?, history[two].last_good_end?);
        let origin = context.observation.origin();
        let legs = [(&extremities[one], one_end - origin), (&extremities[two], two_end - origin)];
        let (shoulders, axis) = self.shoulders(context, matched);
        let steps = [0.0, -1.0, 1.0, -2.0, 2.0];
        let leans = if axis == Vec3::ZERO { &steps[..1] } else { &steps[..] };
        self.explain_what_stays(context, matched, legs);
        let (mut least, mut stance) = (f64::INFINITY, None);
        for angle in leans.iter().map(|step| step * LEAN) {
            let mut cost = self.lean_trunk(context, matched, shoulders, Quat::from_axis_angle(axis, angle));
            for leg in legs {
                cost += self.place_leg(context, matched, leg);
            }
            cost += rough_cost(&self.distances.leaning, &self.sample.weights);
            if stance.is_none() {
                (least, stance) = (cost, Some(Stance::Upright));
                self.upright.clone_from(&self.trial);
            } else if cost < least {
                (least, stance) = (cost, Some(Stance::Leant));
                self.leant.clone_from(&self.trial);
            }
        }
        stance
    }

    /// The midpoint of the shoulders and the axis through them; zero without two arms.
    fn shoulders(&self, context: Context, matched: Matched) -> (Vec3, Vec3) {
        let model = context.model;
        let roots = self.arms.map(|arms| arms.map(|arm| model.extremities[arm].root(&model.body, matched.poses)));
        roots.map_or((Vec3::ZERO, Vec3::ZERO), |[first, second]| {
            (0.5 * (first + second), (second - first).normalize_or_zero())
        })
    }

    /// Draws the sample of points and computes its distances to the limbs outside the trunk and the legs.
    fn explain_what_stays(&mut self, context: Context, matched: Matched, legs: [StandingLeg; 2]) {
        let candidates = context.observation.candidates;
        self.make_room(candidates.len());
        self.sample.assign(&candidates.points, &candidates.weight);
        self.sample.subsample(ROUGH_SAMPLE);
        let Self { sample, distances: Distances { staying, scratch, .. }, trunk, .. } = self;
        staying.resize(sample.len(), f32::INFINITY);
        let stands = |limb: usize| legs.iter().any(|(leg, _)| leg.limbs().any(|own| own == limb));
        for limb in (0..matched.poses.len()).filter(|limb| !trunk.contains(limb) && !stands(*limb)) {
            explain(&context.model.body, limb, matched.poses, &sample.points, staying, scratch);
        }
    }

    /// Writes the trunk, rotated about the shoulders, to `trial`. Returns the visibility cost of the trunk there.
    fn lean_trunk(&mut self, context: Context, matched: Matched, shoulders: Vec3, turn: Quat) -> f64 {
        let body = &context.model.body;
        let Self { trunk, sample, distances: Distances { staying, leaning, scratch, .. }, trial, .. } = self;
        trial.clear();
        trial.extend_from_slice(matched.poses);
        leaning.clone_from(staying);
        let mut cost = 0.0;
        for limb in trunk.iter().copied() {
            let pose = &matched.poses[limb];
            trial[limb] =
                Pose::from_parts(shoulders + turn * (pose.translation - shoulders), (turn * pose.rotation).normalize());
            explain(body, limb, trial, &sample.points, leaning, scratch);
            cost += limb_visibility(context.observation.views, &body.limbs()[limb], &trial[limb]).cost();
        }
        cost
    }

    /// Poses a leg between the trunk in `trial` and the position of its foot, with the bend of lowest cost. Returns its cost
    /// except that of unexplained points: visibility and strain.
    fn place_leg(&mut self, context: Context, matched: Matched, (leg, end): StandingLeg) -> f64 {
        let body = &context.model.body;
        let Self { sample, distances: Distances { leaning, tried, scratch, .. }, trial, .. } = self;
        let visible_cost = |limb: usize, poses: &[Pose]| {
            limb_visibility(context.observation.views, &body.limbs()[limb], &poses[limb]).cost()
        };
        let (mut bend, mut least, mut own) = (0.0, f64::INFINITY, 0.0);
        for swivel in 0..SWIVELS {
            let swivel = TAU * swivel as f64 / SWIVELS as f64;
            leg.reach(body, trial, end, swivel);
            tried.clone_from(leaning);
            leg.limbs().for_each(|limb| explain(body, limb, trial, &sample.points, tried, scratch));
            let against =
                leg.limbs().map(|limb| visible_cost(limb, trial)).sum::<f64>() + strain(context, matched, leg, trial);
            let cost = rough_cost(tried, &sample.weights) + against;
            if cost < least {
                (bend, least, own) = (swivel, cost, against);
            }
        }
        leg.reach(body, trial, end, bend);
        leg.limbs().for_each(|limb| explain(body, limb, trial, &sample.points, leaning, scratch));
        own
    }
}

impl Propose for TrunkLean {
    fn propose(&mut self, at: Extremity, history: &[History], _rough: &mut RoughSearch, pool: &mut Pool) {
        // With color images alone, there are no points to evaluate the trunk.
        if !at.chain().leg || at.regions.is_some() {
            return;
        }
        match self.best_stance(at.context, at.matched, history) {
            Some(Stance::Leant) => {
                pool.lean.poses.clone_from(&self.leant);
                pool.lean.set(Basis::Lean);
            }
            Some(Stance::Upright) => {
                // Both feet are moved together only when all legs are suspect.
                let extremities = at.context.model.extremities.iter().zip(history);
                if extremities.into_iter().all(|(chain, own)| !chain.leg || !own.persistence.is_clear()) {
                    pool.both_feet.poses.clone_from(&self.upright);
                    pool.both_feet.set(Basis::End);
                }
            }
            None => {}
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::association::correspondence::Correspondences;
    use crate::body::{Body, HumanModel, LimbRole};
    use crate::config::Config;
    use crate::testing::{depth, turned, with_context};

    /// A person in front of a camera whose trunk and head are bent forward by `bow`, with thighs and calves at the given angles
    /// from the vertical. The midpoint of the feet does not depend on the angles.
    fn bent(body: &Body, bow: f64, thigh: f64, calf: f64) -> Vec<Pose> {
        let upright = Quat::from_axis_angle(Vec3::X, std::f64::consts::FRAC_PI_2);
        let rest = body.rest_pose(Pose::from_parts(Vec3::ZERO, upright * Quat::from_axis_angle(Vec3::Z, -1.571)));
        let mut poses: Vec<Pose> = Vec::new();
        for (index, (limb, rest)) in body.limbs().iter().zip(&rest).enumerate() {
            let angle = match body.roles().limb(index) {
                Some(LimbRole::Thigh(_)) => -thigh,
                Some(LimbRole::Calf(_)) => calf,
                Some(LimbRole::Foot(_)) => 0.0,
                _ => bow,
            };
            let rotation = Quat::from_axis_angle(Vec3::X, angle) * rest.rotation;
            let at = limb.parent.as_ref().map_or(Vec3::ZERO, |(parent, joint)| {
                poses[*parent] * joint.parent_from_joint.translation - rotation * joint.limb_from_joint.translation
            });
            poses.push(Pose::from_parts(at, rotation));
        }
        let feet: Vec<Vec3> =
            TwoBone::from_body(body).iter().filter(|leg| leg.leg).map(|leg| leg.end(&poses)).collect();
        let shift = Vec3::new(0.0, 0.9, 2.6) - 0.5 * (feet[0] + feet[1]);
        poses.iter().map(|pose| Pose::from_parts(pose.translation + shift, pose.rotation)).collect()
    }

    /// Maximum error of a hip or knee position.
    fn off(legs: &[&TwoBone], body: &Body, poses: &[Pose], truth: &[Pose]) -> f64 {
        let places = |leg: &TwoBone, poses: &[Pose]| [leg.root(body, poses), poses[leg.lower].translation];
        let distances = legs.iter().flat_map(|leg| {
            let (is, was) = (places(leg, poses), places(leg, truth));
            [is[0].distance(was[0]), is[1].distance(was[1])]
        });
        distances.fold(0.0, f64::max)
    }

    #[test]
    fn the_trunk_of_a_sitting_body_leans_until_its_feet_are_in_place() {
        let model = Model::new(Body::human(1.75, HumanModel::Full).unwrap());
        let (body, config) = (&model.body, Config::default());
        let truth = bent(body, 0.5, 1.1, 0.15);
        let pixels = depth(body, &truth);
        // The whole body is rotated about the shoulders, so that hips and feet are wrong.
        let arms: Vec<Vec3> =
            model.extremities.iter().filter(|arm| !arm.leg).map(|arm| arm.root(body, &truth)).collect();
        let wrong = turned(&truth, 0.5 * (arms[0] + arms[1]), (arms[1] - arms[0]).normalize(), 0.35);
        let ends = |poses: &[Pose]| -> Vec<History> {
            let end = |chain: &TwoBone| History { last_good_end: Some(chain.end(poses)), ..History::default() };
            model.extremities.iter().map(end).collect()
        };
        let mut lean = TrunkLean::default();
        lean.prepare(&model);
        let mut stance = |poses: &[Pose], history: &[History]| {
            with_context(&pixels, &config, &model, poses, |context| {
                let correspondences = Correspondences::default();
                let matched = Matched { correspondences: &correspondences, poses };
                (lean.best_stance(context, matched, history), lean.leant.clone())
            })
        };
        let (found, leant) = stance(&wrong, &ends(&truth));
        assert_eq!(found, Some(Stance::Leant));
        let legs: Vec<&TwoBone> = model.extremities.iter().filter(|chain| chain.leg).collect();
        let (before, after) = (off(&legs, body, &wrong, &truth), off(&legs, body, &leant, &truth));
        assert!(before > 0.12 && after < 0.07, "{before} {after}");
        for leg in legs {
            assert!(leg.end(&leant).distance(leg.end(&truth)) < 0.02);
        }
        // A correct pose does not lean, and there is no stance without positions of the feet.
        assert_eq!(stance(&truth, &ends(&truth)).0, Some(Stance::Upright));
        assert_eq!(stance(&truth, &vec![History::default(); model.extremities.len()]).0, None);
    }
}
