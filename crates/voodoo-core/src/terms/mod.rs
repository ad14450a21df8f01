//! The cost function: each term adds to the same normal equations. The list of files is the list of terms.

mod detected;
mod edges;
mod floor;
mod limits;
pub(crate) mod normal_equations;
mod penetration;
mod posture;
mod prior;
mod sites;
mod stance;
mod surface;

pub(crate) use detected::DetectedJoints;
pub(crate) use edges::Edges;
pub(crate) use floor::Floor;
pub(crate) use limits::Limits;
pub(crate) use penetration::Penetration;
pub(crate) use posture::Posture;
pub(crate) use prior::{Prior, Rest};
pub(crate) use sites::{APART, Sites};
pub(crate) use stance::stance_cost;
pub(crate) use surface::{Surface, cost_of_points, unexplained};

use crate::association::correspondence::Correspondences;
use crate::body::Body;
use crate::config::Config;
use crate::math::Pose;
use crate::terms::normal_equations::NormalEquations;

/// Cost of an unexplained patch, nats. Measurements err alike over about a square decimeter, so a patch of 1.44 square centimeters
/// tells less than one of its own would.
pub(crate) const PATCH: f64 = 0.12;
/// Greatest cost of one limb in the terms that are not measurements, nats: such a term may be wrong, too.
const LARGEST_COST: f64 = 10.0;
/// Standard deviation of the depth of an axis inside another limb or below the ground, meters.
const OVERLAP_SIGMA: f64 = 0.03;

/// One term of the cost function.
///
/// The solver linearizes a term at poses that differ by millimeters. Poses that differ by centimeters are compared by its cost,
/// which is limited, because no model of an error holds far away, and lower than the sum of squares, because nearby measurements
/// err alike. What only tells such poses apart, and moves none, is a function of its cost.
pub(crate) trait Term {
    /// Adds gradient and information at `poses` (working frame).
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations);

    /// Negative log-likelihood of the pose of one limb, nats. Terms that do not tell such poses apart have none.
    fn cost(&self, _body: &Body, _poses: &[Pose], _limb: usize) -> f64 {
        0.0
    }
}

/// The terms of all measurements: those that the solver fits and from which covariances follow.
#[derive(Debug)]
pub(crate) struct Measurements<'a> {
    /// The measurements.
    pub correspondences: &'a Correspondences,
    /// Parameters.
    pub config: &'a Config,
    /// Scales of the kernels of points and of sites, meters.
    pub scales: [f64; 2],
    /// As in [`Sites`].
    pub biased: bool,
}

impl Term for Measurements<'_> {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut NormalEquations) {
        let Self { correspondences, config, scales: [scale, site_scale], biased } = *self;
        let information = config.point_information();
        let terms: [&dyn Term; 4] = [
            &Surface { correspondences, information, tangential_weight: config.tangential_weight, scale },
            &Sites { correspondences, information, scale: site_scale, biased },
            &Edges { pairs: &correspondences.contour, scale },
            &Edges { pairs: &correspondences.regions, scale: f64::INFINITY },
        ];
        for term in terms {
            term.add(body, poses, normal);
        }
    }
}
