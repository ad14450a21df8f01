//! The cost function: each term adds to the same normal equations. The list of files is the list of terms.

mod contour;
mod floor;
mod limits;
pub(crate) mod normal_equations;
mod penetration;
mod posture;
mod prior;
mod regions;
mod sites;
mod surface;

pub(crate) use contour::Contour;
pub(crate) use floor::Floor;
pub(crate) use limits::Limits;
pub(crate) use penetration::Penetration;
pub(crate) use posture::Posture;
pub(crate) use prior::Prior;
pub(crate) use regions::Regions;
pub(crate) use sites::Sites;
pub(crate) use surface::Surface;

use crate::body::Body;
use crate::math::Pose;
use crate::terms::normal_equations::NormalEquations;

/// One term of the cost function.
pub(crate) trait Term {
    /// Adds cost, gradient and information at `poses` (working frame).
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations);
}
