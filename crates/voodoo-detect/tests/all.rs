//! The shipped detector, what needs it, and those tests of the core that ask more of a tracker that has it.

#[path = "../../voodoo-core/tests/determinism.rs"]
mod determinism;
#[path = "../../voodoo-core/tests/hostile.rs"]
mod hostile;
#[path = "../../voodoo-core/tests/relocalization.rs"]
mod relocalization;
#[path = "../../voodoo-core/tests/scene/mod.rs"]
mod scene;

mod detector_check;
mod people;
mod small;
mod tracking;

use voodoo_core::{Body, Config, TrackError, Tracker};
use voodoo_detect::Detector;

/// A tracker with the shipped detector.
fn tracker(body: Body, config: Config) -> Result<Tracker, TrackError> {
    Ok(Tracker::new(body, config)?.with_detector(Box::new(Detector::new())))
}
