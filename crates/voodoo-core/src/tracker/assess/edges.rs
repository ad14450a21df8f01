//! Whether arms and legs are where they are thought to be, where pictures are all that shows them: what is not known to a few
//! centimetres by what edges told is not called measured.

use super::Assessor;
use crate::association::correspondence::RegionSupport;
use crate::body::Model;
use crate::body::two_bone::TwoBone;
use crate::tracker::estimate::LimbStatus;
use crate::uncertainty::Found;

/// A limb is in doubt whose end is known less well, metres. Edges err alike: errors are about twice as large.
const UNSURE: f64 = 0.048;
/// What speaks for all of a limb makes it surer by so many e-folds.
const SPOKEN_FOR: f64 = 0.9;

impl Assessor {
    /// Takes what a frame's edges told.
    pub(in crate::tracker) fn follow_edges(&mut self, model: &Model, found: Found) {
        let Found { poses, correspondences, time_scale, config, .. } = found;
        let points = correspondences.limbs.iter().any(|matches| !matches.candidate.is_empty());
        let pictures = !correspondences.region_support.is_empty();
        if points || !pictures && self.sure.is_empty() {
            self.forget_edges();
            return;
        }
        self.edges.observe(model, poses, correspondences, time_scale, config);
        let Self { edges, sure, .. } = self;
        sure.clear();
        sure.extend((0..poses.len()).map(|limb| {
            let support = correspondences.region_support.get(limb).copied();
            let RegionSupport { own, shown, .. } = support.unwrap_or_default();
            edges.end_sigma(limb) * (-SPOKEN_FOR * own[0] * shown).exp() < UNSURE
        }));
    }

    /// Nothing that edges told before counts.
    pub(super) fn forget_edges(&mut self) {
        self.edges.forget();
        self.sure.clear();
    }

    /// Edges of pictures are all there is.
    pub(super) fn told_by_edges(&self) -> bool {
        !self.sure.is_empty()
    }

    /// Statuses of arms and legs by what edges told, if that is all there is.
    pub(super) fn doubt_by_edges(&self, extremities: &[TwoBone], statuses: &mut [LimbStatus]) {
        for chain in extremities.iter().filter(|_| self.told_by_edges()) {
            for limb in [chain.upper, chain.lower] {
                statuses[limb] = match statuses[limb] {
                    _ if self.sure[limb] => LimbStatus::Measured,
                    LimbStatus::Measured => LimbStatus::Inferred,
                    doubtful => doubtful,
                };
            }
            chain.ends.iter().for_each(|end| statuses[*end] = statuses[chain.lower]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::standing;

    #[test]
    fn arms_and_legs_are_measured_where_edges_told_where_they_are() {
        let (model, poses) = standing();
        let chain = &model.extremities[0];
        let statuses = |internal: LimbStatus, sure: bool| {
            let mut assessor = Assessor { sure: vec![sure; poses.len()], ..Assessor::default() };
            let mut statuses = vec![internal; poses.len()];
            assessor.doubt_by_edges(&model.extremities, &mut statuses);
            assessor.forget_edges();
            let mut forgotten = vec![internal; poses.len()];
            assessor.doubt_by_edges(&model.extremities, &mut forgotten);
            assert_eq!(forgotten, vec![internal; poses.len()], "edges are not all there is");
            (statuses[0], [chain.upper, chain.lower, chain.ends[0]].map(|limb| statuses[limb]))
        };
        let (measured, inferred, lost) = (LimbStatus::Measured, LimbStatus::Inferred, LimbStatus::Lost);
        assert_eq!(statuses(measured, false), (measured, [inferred; 3]));
        assert_eq!(statuses(lost, false), (lost, [lost; 3]));
        assert_eq!(statuses(lost, true), (lost, [measured; 3]));
    }
}
