//! Searches for a lost body without a detection, because the detector does not know its kind or there is no depth image. The body
//! is tried at every connected foreground segment of its size, in its last tracked pose and in rotations of that about the
//! vertical.

use super::Relocalizer;
use super::trials::{STRAY, try_at};
use crate::fit::{Context, Fit, UNKNOWN_MOTION};
use crate::hypotheses::SWIVELS;
use crate::math::{Pose, Quat, Vec3, refill};
use crate::observation::candidates::body_box;
use crate::observation::observer::Observation;
use crate::observation::segments::Segment;

impl Relocalizer {
    /// Searches for a lost body that the detector cannot find. Returns whether it explains the frame better there than at
    /// `present`. The matches of `fit` are restored before it returns.
    pub(crate) fn search(&mut self, context: Context, fit: &mut Fit, present: &[Pose]) -> bool {
        let views = context.observation.views;
        if self.detector.knows && !views.frame.images.is_empty() {
            return false;
        }
        self.segments.find(views, context.config);
        fit.swap_matches(&mut self.matched);
        let count = self.segments.found.len();
        let found = (0..count).any(|index| self.is_at(self.segments.found[index], context, fit, present));
        fit.swap_matches(&mut self.matched);
        found
    }

    /// Whether the body is at this segment rather than at `present`.
    fn is_at(&mut self, segment: Segment, context: Context, fit: &mut Fit, present: &[Pose]) -> bool {
        let Self { tracked, turned, candidates, trials, found, .. } = self;
        let body = body_box(&context.model.body, tracked, 0.0);
        let [length, extent] = [body, segment.bounds].map(|bounds| bounds.extents().max_element());
        if !(extent > 0.5 * length && extent < 2.0 * length) {
            return false;
        }
        let bounds = segment.bounds.enlarged(context.config.body_box_margin);
        candidates.gather(context.observation.views, &bounds, context.config);
        let observation = Observation { candidates, ..context.observation };
        let at = Context { observation, previous: &[], time_scale: UNKNOWN_MOTION, ..context };
        let stood = tracked.first().map_or(Vec3::Z, |root| root.rotation * Vec3::Z);
        let up = observation.frame().ground.map_or(stood, |ground| ground.normal);
        let mut turn = |turn: usize| {
            let turn = Quat::from_axis_angle(up, std::f64::consts::TAU * turn as f64 / SWIVELS as f64);
            let moved = Pose::from_parts(segment.bounds.center() - turn * body.center(), turn);
            refill(turned, tracked.iter().map(|pose| moved * *pose));
            trials.stray_fraction(at, turned)
        };
        let strays: [f64; SWIVELS] = std::array::from_fn(&mut turn);
        // Of two rotations that explain equally many points, the smaller one is kept.
        turn((0..SWIVELS).min_by(|a, b| strays[*a].total_cmp(&strays[*b])).unwrap_or_default());
        try_at(at, fit, present, turned, found) && trials.stray_fraction(at, found) < STRAY
    }
}
