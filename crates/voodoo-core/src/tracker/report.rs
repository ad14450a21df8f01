//! Fills the estimate from the tracker's state, without allocation once its buffers have grown.

use super::estimate::{Estimate, SourceReport};
use crate::association::correspondence::Correspondences;
use crate::body::Body;
use crate::fit::Motion;
use crate::math::refill;
use crate::observation::candidates::Candidates;

impl Estimate {
    /// Fills in everything but stamp, steps and status.
    pub(super) fn fill(
        &mut self,
        body: &Body,
        motion: &Motion,
        correspondences: &Correspondences,
        candidates: &Candidates,
    ) {
        let (estimate, poses) = (self, &motion.poses);
        let measured = correspondences.mean_squared_distance().or_else(|| correspondences.mean_squared_edge());
        estimate.mean_squared_distance = measured.unwrap_or(f64::NAN);
        refill(&mut estimate.world_from_limb, motion.world_from_limb());
        refill(
            &mut estimate.sites,
            (0..body.sites().len()).map(|site| body.site_position(&estimate.world_from_limb, site)),
        );
        estimate.limb_points.clear();
        estimate.limb_residual.clear();
        estimate.joint_gaps.clear();
        for (index, limb) in body.limbs().iter().enumerate() {
            let matches = correspondences.limbs.get(index);
            let count = matches.map_or(0, |matches| matches.accepted());
            let (weight, sum) = matches.map_or((0.0, 0.0), |matches| matches.weighed());
            estimate.limb_points.push(count);
            estimate.limb_residual.push((sum / weight).sqrt());
            estimate.joint_gaps.push(limb.parent.as_ref().map_or(0.0, |(parent, joint)| {
                let on_parent = poses[*parent] * joint.parent_from_joint.translation;
                (on_parent - poses[index] * joint.limb_from_joint.translation).length()
            }));
        }
        let sources = &mut estimate.sources;
        sources.clear();
        for run in candidates.source.chunk_by(|source, next| source == next) {
            entry(sources, run[0]).count += run.len();
        }
        for matches in &correspondences.limbs {
            for ((candidate, weight), distance) in
                matches.candidate.iter().zip(&matches.weight).zip(&matches.surface.signed_distance)
            {
                if *weight > 0.0 {
                    entry(sources, candidates.source[*candidate as usize])
                        .add(f64::from(*weight), f64::from(distance * distance));
                }
            }
        }
        for pair in &correspondences.sites {
            let report = entry(sources, pair.source);
            report.count += 1;
            report.add(pair.base_weight, (pair.x - pair.p).length_squared());
        }
        for pair in &correspondences.regions {
            let report = entry(sources, pair.source);
            report.count += 1;
            report.add(pair.information, pair.distance * pair.distance);
        }
        for source in sources {
            source.residual = (source.residual / source.weight).sqrt();
        }
    }
}

fn entry(sources: &mut Vec<SourceReport>, source: u16) -> &mut SourceReport {
    let index = usize::from(source);
    if sources.len() <= index {
        sources.resize(index + 1, SourceReport::default());
    }
    &mut sources[index]
}

impl SourceReport {
    /// Counts one matched measurement; `residual` holds the weighted sum until all are counted.
    fn add(&mut self, weight: f64, square: f64) {
        self.inliers += 1;
        self.weight += weight;
        self.residual += weight * square;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::math::Vec3;
    use crate::testing::{before_wall, moved, standing, with_context, without_background};

    /// Estimate of the standing body and number of candidates, when the depth image shows it `off` meters behind its pose.
    fn filled(off: f64) -> (Estimate, usize) {
        let (model, poses) = standing();
        let config = without_background();
        let pixels = before_wall(&model.body, &moved(&poses, off * Vec3::Z));
        with_context(&pixels, &config, &model, &poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &poses);
            let mut motion = Motion::default();
            (motion.poses, motion.origin) = (poses.clone(), Vec3::new(1.0, 2.0, 3.0));
            let mut estimate = Estimate::default();
            // A second call replaces the results of the first.
            for _ in 0..2 {
                estimate.fill(&model.body, &motion, &fit.correspondences, context.observation.candidates);
            }
            (estimate, context.observation.candidates.len())
        })
    }

    #[test]
    fn poses_and_sites_are_in_the_world_and_joints_are_closed() {
        let (model, poses) = standing();
        let (estimate, _) = filled(0.0);
        let origin = Vec3::new(1.0, 2.0, 3.0);
        for (found, pose) in estimate.world_from_limb.iter().zip(&poses) {
            assert!(found.translation.distance(pose.translation + origin) < 1e-12);
        }
        for (index, site) in estimate.sites.iter().enumerate() {
            assert!(site.distance(model.body.site_position(&poses, index) + origin) < 1e-9);
        }
        assert!(estimate.joint_gaps.len() == poses.len() && estimate.joint_gaps.iter().all(|gap| *gap < 1e-9));
    }

    #[test]
    fn a_source_is_reported_once_with_all_it_gave_and_what_of_it_fits() {
        let [near, far] = [0.0, 0.04].map(|off| {
            let (estimate, candidates) = filled(off);
            assert_eq!(estimate.sources.len(), 1);
            let source = estimate.sources[0];
            assert_eq!((source.count, source.inliers), (candidates, estimate.limb_points.iter().sum()));
            assert!(source.inliers > 0 && source.inliers <= source.count);
            assert!((source.residual.powi(2) - estimate.mean_squared_distance).abs() < 1e-6);
            source.residual
        });
        assert!(near < 0.005 && (0.02..0.06).contains(&far), "{near} and {far} m");
    }
}
