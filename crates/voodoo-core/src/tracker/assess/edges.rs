//! Status of arms and legs when color images are the only evidence: a limb whose position is not known to a few centimeters from
//! color edges is not reported as measured.

use super::Assessor;
use crate::association::correspondence::RegionSupport;
use crate::uncertainty::FittedPose;
use crate::visibility::EXPLAINED;

impl Assessor {
    /// Updates the uncertainty of each limb with a frame's color edges. `branch_distance` gives the distance of a limb's distal
    /// end to that in the second branch, if there is one.
    pub(in crate::tracker) fn follow_edges(
        &mut self,
        found: FittedPose,
        branch_distance: impl Fn(usize) -> Option<f64>,
    ) {
        let FittedPose { model, correspondences, .. } = found;
        let points = correspondences.limbs.iter().any(|matches| !matches.candidate.is_empty());
        let pictures = !correspondences.region_support.is_empty();
        if points || !pictures && !self.edges.is_known() {
            self.edges.forget();
            return;
        }
        self.edges.observe(found);
        let Self { edges, log_odds, .. } = self;
        for chain in &model.extremities {
            for limb in [chain.upper, chain.lower] {
                let support = correspondences.region_support.get(limb).copied();
                let RegionSupport { own, visible, .. } = support.unwrap_or_default();
                // The second branch counts against the limb where their ends differ by more than the distance from which a limb
                // explains a point, and for it where they differ by less.
                let factor = branch_distance(limb).map_or(1.0, |apart| (apart / EXPLAINED).sqrt());
                let sigma = edges.end_sigma(limb) * factor;
                // A standard deviation of `EXPLAINED` suffices. Full support of a limb by color reduces its uncertainty by a factor
                // of e.
                log_odds[limb] = own * visible - (sigma / EXPLAINED).ln();
            }
            chain.ends.iter().for_each(|end| log_odds[*end] = log_odds[chain.lower]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::association::correspondence::{Correspondences, EdgePair, LimbMatches};
    use crate::body::Model;
    use crate::config::Config;
    use crate::math::{Pose, Vec3};
    use crate::testing::{first_arm, standing};

    /// Edges of this information on every limb, 1/m^2.
    fn edges_of(model: &Model, poses: &[Pose], information: f64) -> Correspondences {
        let mut correspondences = Correspondences::default();
        for (limb, part) in model.body.limbs().iter().enumerate() {
            for (step, normal) in (0..8).flat_map(|step| Vec3::AXES.map(|normal| (step, normal))) {
                let x = poses[limb] * (f64::from(step) / 7.0 * part.shape.length() * Vec3::Z);
                let (distance, source) = (0.0, 0);
                correspondences.regions.push(EdgePair { limb, x, normal, distance, information, source });
            }
            let support = RegionSupport { own: 0.6, visible: 0.6, ..RegionSupport::default() };
            correspondences.region_support.push(support);
        }
        correspondences
    }

    /// Follows a frame with these correspondences; `apart` is the distance of the second branch.
    fn follow(
        assessor: &mut Assessor,
        model: &Model,
        poses: &[Pose],
        correspondences: &Correspondences,
        apart: Option<f64>,
    ) {
        let (config, pairs) = (&Config::default(), &[]);
        let found = FittedPose { model, poses, correspondences, pairs, sizes_found: false, time_scale: 1.0, config };
        assessor.follow_edges(found, |_| apart);
    }

    /// Log odds of an arm, and of its hand, after a frame with these edges.
    fn log_odds(information: f64, apart: Option<f64>) -> [f64; 3] {
        let (model, poses) = standing();
        let mut assessor = Assessor { log_odds: vec![f64::NAN; poses.len()], ..Assessor::default() };
        follow(&mut assessor, &model, &poses, &edges_of(&model, &poses, information), apart);
        let arm = &model.extremities[first_arm(&model)];
        assert!(assessor.edges.is_known() && assessor.log_odds[0].is_nan(), "the trunk's odds are kept");
        [arm.upper, arm.lower, arm.ends[0]].map(|limb| assessor.log_odds[limb])
    }

    #[test]
    fn arms_are_supported_where_edges_are_sharp() {
        let (sharp, blurred) = (log_odds(5e3, None), log_odds(1.0, None));
        assert!(sharp.iter().all(|sharp| *sharp > 0.0) && blurred.iter().all(|blurred| *blurred < 0.0));
        assert_eq!(sharp[1].to_bits(), sharp[2].to_bits(), "the hand's odds are the forearm's");
    }

    #[test]
    fn a_limb_is_uncertain_where_the_second_branch_ends_elsewhere() {
        let [alone, agreed, elsewhere] = [None, Some(0.0), Some(5.0)].map(|apart| log_odds(5e3, apart)[1]);
        assert!(agreed > alone && alone > 0.0 && elsewhere < 0.0, "{agreed} {alone} {elsewhere}");
    }

    #[test]
    fn points_replace_edges() {
        let (model, poses) = standing();
        let mut correspondences = edges_of(&model, &poses, 5e3);
        correspondences.limbs.push(LimbMatches { candidate: vec![0], ..LimbMatches::default() });
        let mut assessor = Assessor { log_odds: vec![2.0; poses.len()], ..Assessor::default() };
        follow(&mut assessor, &model, &poses, &edges_of(&model, &poses, 5e3), None);
        let before = assessor.log_odds.clone();
        follow(&mut assessor, &model, &poses, &correspondences, None);
        assert_eq!((assessor.edges.is_known(), assessor.log_odds), (false, before));
    }
}
