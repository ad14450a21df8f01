//! How far a pose may be off, as it is reported: by what is proven of the limbs, and by what else they may be.

use super::Assessor;
use crate::body::Body;
use crate::math::Pose;
use crate::tracker::estimate::{Estimate, LimbStatus};
use crate::uncertainty::FittedPose;

impl Assessor {
    /// Reports how far a frame's pose may be off, after its status. `rivals` are poses of the whole body in the world that explain
    /// the frame better and wait for the next one to say so as well; `girth` is how far a limb's radius may be off.
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

    /// Reports that nothing was measured of a pose that was set.
    pub(in crate::tracker) fn forget_spread(&mut self, body: &Body, estimate: &mut Estimate) {
        self.uncertainty.forget();
        self.forget_edges();
        estimate.covariances.forget(body);
    }
}
