//! The energy: each term adds to the same normal equations. The list of files is the objective.

mod contour;
mod floor;
mod limits;
pub mod normal_equations;
mod penetration;
mod posture;
mod prior;
mod regions;
mod sites;
mod surface;

pub use contour::Contour;
pub use floor::Floor;
pub use limits::Limits;
pub use penetration::Penetration;
pub use posture::Posture;
pub use prior::Prior;
pub use regions::Regions;
pub use sites::Sites;
pub use surface::Surface;

use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::NormalEquations;

/// One influence on the pose.
pub trait Term {
    /// Adds cost, gradient and information at `poses` (working frame).
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations);
}
