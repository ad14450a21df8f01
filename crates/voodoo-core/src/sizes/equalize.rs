//! Equalizes arms and legs of unequal lengths in the first frame: left and right limbs of a person are equally long.

use crate::body::two_bone::TwoBone;
use crate::body::{Body, Model};
use crate::fit::{Fit, Setting};
use crate::hypotheses::{MARGIN, Objective};
use crate::math::Pose;
use crate::solver::Gate;

/// Points farther than this from the given pose are not used for the sizes, meters.
pub(super) const START_GATE: Gate = Gate { box_margin: 0.10, distance: 0.10 };
/// Least plausible ratio of the lengths of a person's two arms or two legs; below it, one of them was set wrong.
const UNEQUAL_REACH: f64 = 0.88;

/// Where one arm or leg of the start is much longer than the other, gives one of them the lengths of the other if that explains
/// the first frame clearly better. Such a start comes, for example, from a skeleton whose foot is below the floor, or whose leg
/// ends at the shin.
pub(super) fn equalize_limb_lengths(setting: Setting, model: &mut Model, poses: &mut Vec<Pose>, fit: &mut Fit) {
    for pair in model.body.pairs() {
        let chain = |limb: &usize| model.extremities.iter().find(|chain| chain.upper == *limb).cloned();
        let [one, other] = &pair.iter().filter_map(chain).collect::<Vec<_>>()[..] else { continue };
        let [first, second] = [one, other].map(|chain| bones(&model.body, chain).iter().sum::<f64>());
        if first.min(second) > UNEQUAL_REACH * first.max(second) {
            continue;
        }
        let mut changed = |chain, like| with_lengths_of(like, setting, model, poses, fit, chain);
        let (first, second) = (changed(other, one), changed(one, other));
        let best = if second.cost < first.cost { second } else { first };
        let set = changed(one, one).cost.min(changed(other, other).cost);
        if best.cost < set - MARGIN {
            *poses = best.poses;
            model.adopt(best.body);
        }
    }
}

/// A body, its pose, and its cost in the first frame, nats.
struct Changed {
    cost: f64,
    body: Body,
    poses: Vec<Pose>,
}

/// Gives an arm or leg the lengths of the other one and fits its rotations again, since they were set with a wrong end position.
fn with_lengths_of(
    like: &TwoBone,
    setting: Setting,
    model: &Model,
    poses: &[Pose],
    fit: &mut Fit,
    chain: &TwoBone,
) -> Changed {
    let mut body = model.body.clone();
    let factors = bones(&body, like).into_iter().zip(bones(&body, chain)).map(|(expected, own)| expected / own);
    for (limb, factor) in [chain.upper, chain.lower].into_iter().zip(factors) {
        body.change_length(limb, factor);
    }
    let mut set = poses.to_vec();
    body.close_joints(&mut set);
    let mut tried = model.clone();
    tried.adopt(body);
    let mut found = set.clone();
    fit.run(setting.with_model(&tried), &set, &mut found);
    for limb in chain.limbs() {
        set[limb].rotation = found[limb].rotation;
    }
    tried.body.close_joints(&mut set);
    fit.match_points(setting.with_model(&tried), &set, &START_GATE);
    Changed {
        cost: Objective::new(setting.with_model(&tried), fit.matched(&set), 1.0, None).body(),
        body: tried.body,
        poses: set,
    }
}

/// Lengths of the two bones, meters.
fn bones(body: &Body, chain: &TwoBone) -> [f64; 2] {
    [chain.upper, chain.lower].map(|limb| body.limbs()[limb].shape.length())
}
