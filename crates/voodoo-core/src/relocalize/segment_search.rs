//! Searches for a lost body without a detection, because the detector does not know its kind or there is no depth image. The body
//! is tried at every connected foreground segment of its size, in its last tracked pose and in rotations of that about the
//! vertical.

use super::trials::Trials;
use crate::body::Body;
use crate::fit::{Context, Fit};
use crate::hypotheses::SWIVELS;
use crate::math::{Pose, Quat, Vec3, refill};
use crate::observation::candidates::body_box;
use crate::observation::segments::{Segment, Segments};

/// The state of the search, and its working memory.
#[derive(Debug, Default)]
pub(super) struct SegmentSearch {
    pub(super) segments: Segments,
    /// The last tracked poses, or those that were set.
    tracked: Vec<Pose>,
    turned: Vec<Pose>,
    best: Vec<Pose>,
}

impl SegmentSearch {
    /// Stores the poses of a tracked body.
    pub(super) fn remember(&mut self, poses: &[Pose]) {
        refill(&mut self.tracked, poses.iter().copied());
    }

    /// Whether the longest side of a segment is between half and twice that of the body.
    pub(super) fn is_body_sized(&self, body: &Body, segment: Segment) -> bool {
        let length = body_box(body, &self.tracked, 0.0).extents().max_element();
        let extent = segment.bounds.extents().max_element();
        extent > 0.5 * length && extent < 2.0 * length
    }

    /// Tries the body at a segment, whose points are the candidates of `context`. Returns whether it is there rather than at
    /// `present`; `trials` then has its poses.
    pub(super) fn try_segment(
        &mut self,
        segment: Segment,
        context: Context,
        fit: &mut Fit,
        trials: &mut Trials,
        present: &[Pose],
    ) -> bool {
        let Self { tracked, turned, best, .. } = self;
        let stood = tracked.first().map_or(Vec3::Z, |root| root.rotation * Vec3::Z);
        let up = context.observation.frame().ground.map_or(stood, |ground| ground.normal);
        let middle = body_box(&context.model.body, tracked, 0.0).center();
        best.clear();
        let mut least = f64::INFINITY;
        for turn in 0..SWIVELS {
            let turn = Quat::from_axis_angle(up, std::f64::consts::TAU * turn as f64 / SWIVELS as f64);
            let moved = Pose::from_parts(segment.bounds.center() - turn * middle, turn);
            refill(turned, tracked.iter().map(|pose| moved * *pose));
            let stray = trials.stray_fraction(context, turned);
            // Of two rotations that explain equally many points, the smaller one is kept.
            if stray < least {
                least = stray;
                std::mem::swap(best, turned);
            }
        }
        !best.is_empty() && trials.try_at(context, fit, present, best) && trials.explains_most(context)
    }
}
