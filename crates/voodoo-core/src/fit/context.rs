//! What everything that looks for a pose in a frame may read.

use crate::association::correspondence::Correspondences;
use crate::body::Model;
use crate::body::two_bone::TwoBone;
use crate::config::Config;
use crate::math::Pose;
use crate::observation::observer::Observation;

/// A frame that comes later than so many after the last one says nothing of how the body moves now.
const LATE: f64 = 2.5;

/// One frame of one body. Cheap to copy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Context<'a> {
    /// Parameters.
    pub config: &'a Config,
    /// What is tracked.
    pub model: &'a Model,
    /// What the frame shows of it.
    pub observation: Observation<'a>,
    /// Poses of the frame before, working frame; empty where nothing is known of the motion.
    pub previous: &'a [Pose],
    /// Seconds since the last frame, as multiples of 1/30 s.
    pub time_scale: f64,
}

impl Context<'_> {
    /// The same with fewer points, where there are many.
    pub(crate) fn subsampled(self) -> Self {
        Self { observation: self.observation.with(self.observation.candidates.subsampled()), ..self }
    }

    /// Whether edges of colors tell more of a limb than what else there is: depth blurs arms, and knows legs better.
    pub(crate) fn uses_edges(&self, limb: usize) -> bool {
        self.pictures_alone() || {
            let arms = self.model.extremities.iter().filter(|chain| !chain.leg);
            arms.flat_map(TwoBone::limbs).any(|own| own == limb)
        }
    }

    /// Whether the body may have moved as nobody expects: two frames show how it moves, and a long time may change that.
    pub(crate) fn moves_unknown(&self) -> bool {
        self.time_scale > LATE
    }

    /// Whether colors are all that shows the body.
    pub(crate) fn pictures_alone(&self) -> bool {
        let frame = self.observation.frame();
        self.config.regions && !frame.colors.is_empty() && frame.images.is_empty() && frame.clouds.is_empty()
    }
}

/// A frame before it is said what is tracked: for those who change the model meanwhile.
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
    /// The frame of this model.
    pub(crate) fn with_model<'b>(self, model: &'b Model) -> Context<'b>
    where
        'a: 'b,
    {
        let Self { config, observation, previous, time_scale } = self;
        Context { config, model, observation, previous, time_scale }
    }
}

/// Correspondences and the poses at which they were found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matched<'a> {
    /// The correspondences.
    pub correspondences: &'a Correspondences,
    /// The poses, working frame.
    pub poses: &'a [Pose],
}
