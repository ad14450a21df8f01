//! The energy: each term adds to the same normal equations. The list of files is the objective.

mod limits;
mod outline;
mod penetration;
mod prior;
mod sites;
mod surface;

pub use limits::Limits;
pub use outline::Outline;
pub use penetration::Penetration;
pub use prior::Prior;
pub(crate) use prior::ShortestAxis;
pub use sites::Sites;
pub use surface::Surface;

use crate::body::Body;
use crate::geometry::Pose;
use crate::normal::Normal;

/// One influence on the pose.
pub trait Term {
    /// Adds cost, gradient and information at `poses` (working frame).
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut Normal);
}
