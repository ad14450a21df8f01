//! Read-only inputs of everything that estimates a pose in a frame.

use crate::body::Model;
use crate::config::Config;
use crate::math::Pose;
use crate::observation::observer::Observation;
use crate::regions::Posed;

/// One frame of one body. Cheap to copy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Context<'a> {
    /// Parameters.
    pub config: &'a Config,
    /// The tracked model.
    pub model: &'a Model,
    /// Observation of the frame.
    pub observation: Observation<'a>,
    /// Poses of the previous frame, working frame; empty where the motion is unknown.
    pub previous: &'a [Pose],
    /// Seconds since the last frame, as multiples of 1/30 s.
    pub time_scale: f64,
}

impl<'a> Context<'a> {
    /// Returns the frame and the body at these poses, working frame.
    pub(crate) fn posed(self, poses: &'a [Pose]) -> Posed<'a> {
        let (frame, origin) = (self.observation.frame(), self.observation.origin());
        Posed { frame, body: &self.model.body, poses, previous: self.previous, origin }
    }

    /// Returns the context with fewer points, where there are many.
    pub(crate) fn subsampled(self) -> Self {
        let candidates = self.observation.candidates.subsampled();
        Self { observation: Observation { candidates, ..self.observation }, ..self }
    }

    /// Whether color edges are used for a limb: for all limbs without points, and for arms with points, which are blurred there
    /// but reliable for legs.
    pub(crate) fn uses_edges(&self, limb: usize) -> bool {
        self.compares_colors() || { self.model.extremities.iter().any(|chain| !chain.leg && chain.has(limb)) }
    }

    /// Whether the colors of pixels compare poses: where no point was measured near the body. Points and pixels of the same
    /// surface are not independent, and points say more.
    pub(crate) fn compares_colors(&self) -> bool {
        !self.observation.frame().colors.is_empty() && self.observation.candidates.points.is_empty()
    }
}

/// A context without its model, for code that changes the model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting<'a> {
    /// As in [`Context`].
    pub config: &'a Config,
    /// As in [`Context`].
    pub observation: Observation<'a>,
    /// As in [`Context`].
    pub previous: &'a [Pose],
    /// As in [`Context`].
    pub time_scale: f64,
}

impl<'a> Setting<'a> {
    /// Returns the context with this model.
    pub(crate) fn with_model(self, model: &'a Model) -> Context<'a> {
        let Self { config, observation, previous, time_scale } = self;
        Context { config, model, observation, previous, time_scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::observation::depth_view::DepthViews;
    use crate::observation::frame::Frame;
    use crate::observation::picture::{ColorImage, ColorPixels};
    use crate::testing::{before_wall, pinhole, standing, with_context, without_background};

    #[test]
    fn colors_compare_poses_where_depth_has_no_return() {
        let (model, poses) = standing();
        let (config, camera) = (without_background(), pinhole(4, 3, [4.0, 4.0, 1.5, 1.0]));
        let (pixels, world_from_sensor) = (ColorPixels::Gray(&[90; 12]), Pose::IDENTITY);
        let colors = [ColorImage { pixels, camera, world_from_sensor, stamp: 0.0, number: 0, source: 0 }];
        let seen = before_wall(&model.body, &poses);
        for (depth, expected) in [(vec![0; seen.len()], true), (seen, false)] {
            with_context(&depth, &config, &model, &poses, |context| {
                let frame = Frame { colors: &colors, ..*context.observation.frame() };
                let views = DepthViews { frame: &frame, ..context.observation.views };
                let with_colors = Context { observation: Observation { views, ..context.observation }, ..context };
                assert_eq!([context.compares_colors(), with_colors.compares_colors()], [false, expected]);
            });
        }
    }
}
