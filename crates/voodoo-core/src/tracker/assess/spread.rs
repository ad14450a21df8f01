//! Reported covariances of a pose, from the evidence for each limb.

use super::Assessor;
use crate::body::Body;
use crate::tracker::estimate::{Estimate, LimbStatus};
use crate::uncertainty::FittedPose;

impl Assessor {
    /// Writes the covariances of a frame's pose; its status must have been reported before. `girth` returns the standard
    /// deviation of a limb's radius.
    pub(in crate::tracker) fn report_spread(
        &mut self,
        found: FittedPose,
        girth: impl Fn(usize) -> f64,
        estimate: &mut Estimate,
    ) {
        let Estimate { limb_status, covariances, .. } = estimate;
        self.uncertainty.estimate(found, |limb| limb_status[limb] == LimbStatus::Measured, covariances);
        covariances.girths.iter_mut().enumerate().for_each(|(limb, sigma)| *sigma = girth(limb));
    }

    /// Resets the covariances for a pose that was set, of which nothing was measured.
    pub(in crate::tracker) fn forget_spread(&mut self, body: &Body, estimate: &mut Estimate) {
        self.uncertainty.forget();
        self.forget_edges();
        estimate.covariances.forget(body);
    }
}
