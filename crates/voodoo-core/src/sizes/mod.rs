//! Sizes of the body: what the first frame corrects and fits, and what those that follow refine.

use crate::hypotheses::GAIN;
use crate::tracker::Tracker;
pub mod girth;

use crate::association::contour::edges;
use crate::body::two_bone::TwoBone;
use crate::math::Vec3;
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::Frame;
use crate::solver::{Gate, Problem};
use girth::{Girth, GirthFit, girth_step};

/// Gauss-Newton steps of the girth fit.
const GIRTH_STEPS: usize = 6;
/// Points farther than this from the set pose say nothing about sizes, metres.
const START_GATE: Gate = Gate { box_margin: 0.10, distance: 0.10 };
/// A limb becomes longer or shorter by at most this share in one frame.
const LENGTH_STEP: f64 = 0.02;
/// Nobody's arm is shorter than this share of the other one, nor a leg: one of them was set wrong.
const UNLIKE_REACH: f64 = 0.88;

impl Tracker {
    /// Fits the sizes to the first frame after a reset, whose pose is known.
    pub(crate) fn fit_sizes(&mut self, frame: &Frame) {
        if self.config.fit_lengths {
            self.equalise_limb_lengths(frame);
        }
        if self.config.fit_girths {
            self.fit_girths(frame);
        }
    }

    /// Where one arm or leg of the start is much longer than the other, gives one the lengths of the other if that explains the
    /// first frame clearly better: a skeleton whose foot is under the floor, or ends at the shin.
    fn equalise_limb_lengths(&mut self, frame: &Frame) {
        for pair in self.body.pairs() {
            let bones = |limb: &usize| self.chains.iter().find(|c| c.upper == *limb).map(|c| [c.upper, c.lower]);
            let [one, other] = pair.iter().filter_map(bones).collect::<Vec<_>>()[..] else { continue };
            let lengths = [one, other].map(|bones| bones.map(|limb| self.body.limbs()[limb].shape.length()));
            let [first, second] = lengths.map(|lengths| lengths.iter().sum::<f64>());
            if first.min(second) > UNLIKE_REACH * first.max(second) {
                continue;
            }
            let given = (self.body.clone(), self.poses.clone());
            let (mut least, mut best) = (self.cost_of_start(frame) - GAIN, given.clone());
            for (bones, own, wanted) in [(other, lengths[1], lengths[0]), (one, lengths[0], lengths[1])] {
                (self.body, self.poses) = given.clone();
                for (limb, (own, wanted)) in bones.into_iter().zip(own.into_iter().zip(wanted)) {
                    self.body.change_length(limb, wanted / own);
                }
                self.body.close_joints(&mut self.poses);
                let cost = self.cost_of_start(frame);
                if cost < least {
                    (least, best) = (cost, (self.body.clone(), self.poses.clone()));
                }
            }
            (self.body, self.poses) = best;
            self.chains = TwoBone::of(&self.body);
        }
    }

    /// What the first frame has against the pose that was set, in unexplained patches.
    fn cost_of_start(&mut self, frame: &Frame) -> f64 {
        self.assign(&START_GATE);
        self.match_points(&START_GATE, true, false);
        self.overall_cost(frame).evidence
    }

    fn fit_girths(&mut self, frame: &Frame) {
        self.girths = vec![Girth::default(); self.poses.len()];
        let mut totals = vec![GirthFit::default(); self.poses.len()];
        let mut seen = Vec::new();
        for _ in 0..GIRTH_STEPS {
            // The pose is known: what is closest is what was seen.
            self.assign(&START_GATE);
            self.match_points(&START_GATE, true, false);
            for (limb, total) in totals.iter_mut().enumerate() {
                let shape = self.body.limbs()[limb].shape;
                let matches = &self.correspondences.limbs[limb];
                seen.clear();
                let views = DepthViews {
                    frame,
                    backgrounds: &self.backgrounds,
                    segmented: &self.segmented,
                    origin: self.origin,
                };
                for view in views.iter() {
                    edges(&view, &self.body.limbs()[limb], &self.poses[limb], |edge| {
                        // Beyond the rim, the edge may be another limb's.
                        if edge.seen <= edge.rim || self.body.closest_limb(&self.poses, edge.place) == limb {
                            seen.push(edge);
                        }
                    });
                }
                if let Some(tip) = seen.iter().find(|edge| edge.side == Vec3::Z) {
                    let longer = 1.0 + (tip.seen - tip.rim) / shape.length();
                    self.body.change_tip(limb, longer.clamp(0.8, 1.25));
                }
                let Some(step) = girth_step(&shape, matches, &self.poses[limb], &seen, total) else { continue };
                let (sum, step) = total.then(&step);
                if self.body.change_girth(limb, step.shift, step.axes()) {
                    let pose = &mut self.poses[limb];
                    pose.translation += pose.rotation * step.shift;
                    *total = sum;
                }
            }
        }
    }

    /// Draws the girths to what the outline of this frame shows of the sides of each limb.
    pub(crate) fn refine_girths(&mut self) {
        for (limb, girth) in self.girths.iter_mut().enumerate() {
            if !self.judgement.relied_on(limb) {
                continue;
            }
            let shape = self.body.limbs()[limb].shape;
            if let Some(axes) = girth.follow(&shape, self.contour.sides(limb)) {
                self.body.change_girth(limb, Vec3::ZERO, axes);
            }
        }
    }

    /// Starts to refine the limbs' lengths from those they have.
    pub(crate) fn follow_lengths(&mut self) {
        self.pairs = self.body.pairs();
        self.stretched = vec![1.0; self.pairs.len()];
    }

    /// Draws the limbs' lengths to what the frame asks for: those of a seated start are rough.
    pub(crate) fn refine_lengths(&mut self, pace: f64) {
        let Self { body, correspondences, predicted, config, solver, poses, pairs, stretched, change, .. } = self;
        change.clear();
        change.extend(stretched.iter().map(|factor: &f64| 1.0 - factor));
        let step = config.max_steps;
        if !solver.lengths(&Problem { body, correspondences, predicted, step, pace, config }, poses, pairs, change) {
            return;
        }
        for ((pair, total), change) in pairs.iter().zip(stretched).zip(change.iter()) {
            let factor =
                ((*total + change.clamp(-LENGTH_STEP, LENGTH_STEP)) / *total).clamp(0.5 / *total, 2.0 / *total);
            *total *= factor;
            pair.iter().for_each(|limb| {
                body.change_length(*limb, factor);
            });
        }
        body.close_joints(poses);
    }
}
