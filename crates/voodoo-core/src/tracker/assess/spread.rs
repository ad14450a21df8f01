//! Reported covariances of a pose: from the evidence for each limb, and from alternative poses.

use super::Assessor;
use crate::body::Body;
use crate::math::Pose;
use crate::tracker::estimate::{Estimate, LimbStatus};
use crate::uncertainty::FittedPose;

impl Assessor {
    /// Writes the covariances of a frame's pose; its status must have been reported before. `rivals` are poses of the whole body
    /// (world frame) that explain this frame better but are adopted only if the next frame confirms them. `girth` returns the
    /// standard deviation of a limb's radius.
    pub(in crate::tracker) fn report_spread<'a>(
        &mut self,
        found: FittedPose,
        rivals: impl Iterator<Item = &'a [Pose]>,
        girth: impl Fn(usize) -> f64,
        estimate: &mut Estimate,
    ) {
        let Estimate { limb_status, covariances, sites, .. } = estimate;
        self.uncertainty.estimate(found, |limb| limb_status[limb] == LimbStatus::Measured, covariances);
        covariances.girths.iter_mut().enumerate().for_each(|(limb, sigma)| *sigma = girth(limb));
        for rival in rivals {
            for (index, site) in sites.iter().enumerate() {
                covariances.widen(index, found.body.site_position(rival, index) - *site);
            }
        }
    }

    /// Resets the covariances for a pose that was set, of which nothing was measured.
    pub(in crate::tracker) fn forget_spread(&mut self, body: &Body, estimate: &mut Estimate) {
        self.uncertainty.forget();
        self.forget_edges();
        estimate.covariances.forget(body);
    }
}
