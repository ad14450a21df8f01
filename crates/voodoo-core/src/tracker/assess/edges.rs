//! Status of arms and legs when color images are the only evidence: a limb whose position is not known to a few centimeters from
//! color edges is not reported as measured.

use super::Assessor;
use crate::association::correspondence::RegionSupport;
use crate::body::Model;
use crate::body::two_bone::TwoBone;
use crate::tracker::estimate::LimbStatus;
use crate::uncertainty::FittedPose;
use crate::visibility::EXPLAINED;

/// Factor on a limb's standard deviation when the second branch puts its end at a distance of `apart` meters. It is 1 where the
/// branches differ by as much as a point may lie from the limb that explains it.
fn sigma_factor(apart: f64) -> f64 {
    (apart / EXPLAINED).sqrt()
}

impl Assessor {
    /// Updates the uncertainty of each limb with a frame's color edges. `branch_distance` gives the distance of a limb's distal
    /// end to that in the second branch, if there is one.
    pub(in crate::tracker) fn follow_edges(
        &mut self,
        model: &Model,
        found: FittedPose,
        branch_distance: impl Fn(usize) -> Option<f64>,
    ) {
        let FittedPose { poses, correspondences, time_scale, config, .. } = found;
        let points = correspondences.limbs.iter().any(|matches| !matches.candidate.is_empty());
        let pictures = !correspondences.region_support.is_empty();
        if points || !pictures && self.edge_uncertainty.is_empty() {
            self.forget_edges();
            return;
        }
        self.edges.observe(model, poses, correspondences, time_scale, config);
        let Self { edges, edge_uncertainty, .. } = self;
        edge_uncertainty.resize(poses.len(), f64::NAN);
        for (limb, known) in edge_uncertainty.iter_mut().enumerate() {
            let support = correspondences.region_support.get(limb).copied();
            let RegionSupport { own, visible, .. } = support.unwrap_or_default();
            let sigma = edges.end_sigma(limb) * branch_distance(limb).map_or(1.0, sigma_factor);
            // A standard deviation of `EXPLAINED` suffices. Full support of a limb by color reduces its uncertainty by a factor
            // of e.
            *known = (sigma / EXPLAINED).ln() - own[0] * visible;
        }
    }

    /// Discards all evidence from color edges.
    pub(super) fn forget_edges(&mut self) {
        self.edges.forget();
        self.edge_uncertainty.clear();
    }

    /// Whether color edges are the only evidence.
    pub(super) fn is_by_edges_alone(&self) -> bool {
        !self.edge_uncertainty.is_empty()
    }

    /// Sets the status of arms and legs from color-edge uncertainty when no other evidence is available.
    pub(super) fn report_edges(&self, extremities: &[TwoBone], statuses: &mut [LimbStatus]) {
        for chain in extremities.iter().filter(|_| self.is_by_edges_alone()) {
            for limb in [chain.upper, chain.lower] {
                statuses[limb] = match statuses[limb] {
                    _ if self.edge_uncertainty[limb] < 0.0 => LimbStatus::Measured,
                    LimbStatus::Measured => LimbStatus::Inferred,
                    limb_suspect => limb_suspect,
                };
            }
            chain.ends.iter().for_each(|end| statuses[*end] = statuses[chain.lower]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::association::correspondence::{Correspondences, RegionPair};
    use crate::config::Config;
    use crate::math::Vec3;
    use crate::testing::{first_arm, standing};

    #[test]
    fn arms_and_legs_are_measured_where_edges_are_sharp() {
        let (model, poses) = standing();
        let chain = &model.extremities[0];
        let statuses = |internal: LimbStatus, sure: bool| {
            let mut assessor =
                Assessor { edge_uncertainty: vec![if sure { -1.0 } else { 1.0 }; poses.len()], ..Assessor::default() };
            let mut statuses = vec![internal; poses.len()];
            assessor.report_edges(&model.extremities, &mut statuses);
            assessor.forget_edges();
            let mut forgotten = vec![internal; poses.len()];
            assessor.report_edges(&model.extremities, &mut forgotten);
            assert_eq!(forgotten, vec![internal; poses.len()], "edges only count as the only evidence");
            (statuses[0], [chain.upper, chain.lower, chain.ends[0]].map(|limb| statuses[limb]))
        };
        let (measured, inferred, lost) = (LimbStatus::Measured, LimbStatus::Inferred, LimbStatus::Lost);
        assert_eq!(statuses(measured, false), (measured, [inferred; 3]));
        assert_eq!(statuses(lost, false), (lost, [lost; 3]));
        assert_eq!(statuses(lost, true), (lost, [measured; 3]));
    }

    #[test]
    fn a_limb_is_uncertain_where_the_second_branch_ends_elsewhere() {
        let (model, poses) = standing();
        let mut correspondences = Correspondences::default();
        for (limb, part) in model.body.limbs().iter().enumerate() {
            for (step, normal) in (0..8).flat_map(|step| Vec3::AXES.map(|normal| (step, normal))) {
                let x = poses[limb] * (f64::from(step) / 7.0 * part.shape.length() * Vec3::Z);
                correspondences.regions.push(RegionPair {
                    limb,
                    x,
                    normal,
                    distance: 0.0,
                    information: 5e3,
                    source: 0,
                });
            }
            let support = RegionSupport { own: [0.6; 2], visible: 0.6, ..RegionSupport::default() };
            correspondences.region_support.push(support);
        }
        let (body, config) = (&model.body, Config::default());
        let found = FittedPose {
            body,
            poses: &poses,
            correspondences: &correspondences,
            pairs: &[],
            sizes_found: false,
            time_scale: 1.0,
            config: &config,
        };
        let arm = &model.extremities[first_arm(&model)];
        let mut assessor = Assessor::default();
        let mut status = |apart: Option<f64>| {
            assessor.follow_edges(&model, found, |_| apart);
            let mut statuses = vec![LimbStatus::Measured; poses.len()];
            assessor.report_edges(&model.extremities, &mut statuses);
            (statuses[arm.lower] == LimbStatus::Measured, assessor.edge_uncertainty[arm.lower])
        };
        let (alone, agreed) = (status(None), status(Some(0.0)));
        assert!(alone.0 && agreed.0 && agreed.1 < alone.1, "{alone:?} {agreed:?}");
        let branch_distance = status(Some(5.0));
        assert!(!branch_distance.0 && branch_distance.1 > alone.1, "{branch_distance:?}");
    }
}
