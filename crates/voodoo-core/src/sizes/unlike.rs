//! Arms and legs of unlike lengths in the start: a person has two alike.

use crate::body::Model;
use crate::fit::{Fit, Setting};
use crate::hypotheses::{GAIN, overall_cost};
use crate::math::Pose;
use crate::solver::Gate;

/// Points farther than this from the set pose say nothing about sizes, metres.
pub(super) const START_GATE: Gate = Gate { box_margin: 0.10, distance: 0.10 };
/// Nobody's arm is shorter than this share of the other one, nor a leg: one of them was set wrong.
const UNLIKE_REACH: f64 = 0.88;

/// Where one arm or leg of the start is much longer than the other, gives one the lengths of the other if that explains the first
/// frame clearly better: a skeleton whose foot is under the floor, or ends at the shin.
pub(super) fn equalise_limb_lengths(setting: Setting, model: &mut Model, poses: &mut Vec<Pose>, fit: &mut Fit) {
    for pair in model.body.pairs() {
        let bones = |limb: &usize| model.extremities.iter().find(|c| c.upper == *limb).map(|c| [c.upper, c.lower]);
        let [one, other] = pair.iter().filter_map(bones).collect::<Vec<_>>()[..] else { continue };
        let lengths = [one, other].map(|bones| bones.map(|limb| model.body.limbs()[limb].shape.length()));
        let [first, second] = lengths.map(|lengths| lengths.iter().sum::<f64>());
        if first.min(second) > UNLIKE_REACH * first.max(second) {
            continue;
        }
        let start = (model.body.clone(), poses.clone());
        let (mut least, mut best) = (start_cost(setting, model, poses, fit) - GAIN, start.clone());
        for (bones, own, wanted) in [(other, lengths[1], lengths[0]), (one, lengths[0], lengths[1])] {
            (model.body, *poses) = start.clone();
            for (limb, (own, wanted)) in bones.into_iter().zip(own.into_iter().zip(wanted)) {
                model.body.change_length(limb, wanted / own);
            }
            model.body.close_joints(poses);
            let cost = start_cost(setting, model, poses, fit);
            if cost < least {
                (least, best) = (cost, (model.body.clone(), poses.clone()));
            }
        }
        *poses = best.1;
        model.adopt(best.0);
    }
}

/// What the first frame has against the pose that was set, in unexplained patches.
fn start_cost(setting: Setting, model: &Model, poses: &[Pose], fit: &mut Fit) -> f64 {
    fit.match_points(setting.of(model), poses, &START_GATE);
    overall_cost(setting.of(model), fit.matched(poses)).evidence
}
