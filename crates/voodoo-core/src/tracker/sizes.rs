//! Sizes of the body: girths from the first frame, lengths from those that follow.

use super::Tracker;
use crate::calibrate::{Girth, GirthFit, girth_step};
use crate::frame::Frame;
use crate::geometry::Vec3;
use crate::outline::edges;
use crate::solver::{Gate, Problem};
use crate::view::Views;

/// Gauss-Newton steps of the girth fit.
const GIRTH_STEPS: usize = 6;
/// Points farther than this from the set pose say nothing about girths, metres.
const GIRTH_GATE: f64 = 0.10;
/// A limb becomes longer or shorter by at most this share in one frame.
const LENGTH_STEP: f64 = 0.02;

impl Tracker {
    /// Fits the girths to the first frame after a reset, whose pose is known.
    pub(super) fn fit_girths(&mut self, frame: &Frame) {
        self.girths = vec![Girth::default(); self.poses.len()];
        let mut totals = vec![GirthFit::default(); self.poses.len()];
        let gate = Gate { box_margin: GIRTH_GATE, distance: GIRTH_GATE };
        let mut seen = Vec::new();
        for _ in 0..GIRTH_STEPS {
            // The pose is known: what is closest is what was seen.
            self.assign(&gate);
            self.match_points(&gate, true, false);
            for (limb, total) in totals.iter_mut().enumerate() {
                let shape = self.body.limbs()[limb].shape;
                let matches = &self.correspondences.limbs[limb];
                seen.clear();
                let views =
                    Views { frame, backgrounds: &self.backgrounds, cut_out: &self.cut_out, origin: self.origin };
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
    pub(super) fn refine_girths(&mut self) {
        for (limb, girth) in self.girths.iter_mut().enumerate() {
            if !self.judgement.relied_on(limb) {
                continue;
            }
            let shape = self.body.limbs()[limb].shape;
            if let Some(axes) = girth.follow(&shape, self.outline.sides(limb)) {
                self.body.change_girth(limb, Vec3::ZERO, axes);
            }
        }
    }

    /// Starts to refine the limbs' lengths from those they have.
    pub(super) fn follow_lengths(&mut self) {
        self.pairs = self.body.pairs();
        self.stretched = vec![1.0; self.pairs.len()];
    }

    /// Draws the limbs' lengths to what the frame asks for: those of a seated start are rough.
    pub(super) fn refine_lengths(&mut self, pace: f64) {
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
