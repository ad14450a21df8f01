//! Assesses every limb, and from the limbs the body: measured, inferred or lost.
//!
//! Each limb has a filter of the odds that its pose is right. Its probability is a fitted function of them, and its status a cut of
//! that.
//!
//! A limb that overlaps another one explains points that the other explains as well, and it is visible to the cameras in its
//! pose; neither is evidence that its pose is right. Evidence for a limb is what it alone explains, compared with the visible
//! part of its surface. A free-space violation is evidence against it. For arms and legs, `limb_support` evaluates the depth
//! images in more detail.
//!
//! A lower limb is right only if the whole arm or leg is: without evidence for the upper arm, a forearm may have been fitted to
//! any object. The distal end of an upper limb is supported where its outer part is visible or where its lower limb begins.
//!
//! A body with more than a quarter of its limbs not measured is not tracked.

mod edges;
mod exclusive;
mod limb_filter;

use super::estimate::{Estimate, LimbStatus, Status};
use crate::association::correspondence::{Correspondences, SitePair};
use crate::body::two_bone::TwoBone;
use crate::body::{Body, Model};
use crate::detect::Detected;
use crate::fit::Context;
use crate::math::{Pose, Vec3, probability, refill, reset};
use crate::terms::APART;
use crate::uncertainty::EdgeFilter;
use crate::visibility::limb_support::{LimbSupport, measure_support};
use crate::visibility::render::LimbRaycaster;
use crate::visibility::{EXPLAINED, FEW, LITTLE};
use exclusive::Exclusive;
use limb_filter::{EVEN, LimbFilter, all_log_odds, any_log_odds, is_uncertain, support_log_odds};

/// Weight of past frames in the sums of the roundness: a single blurred frame must not make the body flat.
const ROUNDNESS_MEMORY: f64 = 0.9;
/// Sums with which a round body begins, m^2: those of ten frames of a whole body for a pose that the user set, and those of one
/// section of a trunk for any other, because a body of whom hardly anything shows is not flat.
const ROUND: [f64; 2] = [0.15, 0.0003];
/// Limits for the fraction of limbs. A tracked body has at most this fraction not measured. A body is lost if less than this
/// fraction is measured, or, where the root is not measured, less than twice this fraction.
const SOME: f64 = 0.25;
/// Weight of the fraction of its surface that a limb explains exclusively by points, relative to the one that patches support.
const OF_EXCLUSIVE: f64 = 0.5;
/// Log odds that the distal end of a limb is within 10 cm of its position: this constant, and this multiple of the log odds that
/// measurements support the limb. Fitted to depth images by `lab/experiments/limb_probability.py`; the first is the logarithm of 4,
/// so that a limb that is measured has a probability of 0.8 or more.
const WITHIN_10_CM: [f64; 2] = [2.0 * std::f64::consts::LN_2, 0.43];
/// A body is not tracked if it misses the measurements of a source by more than this, root mean square, meters.
const MISSED: f64 = 0.15;

/// Assesses every frame and keeps the odds of every limb.
#[derive(Debug, Default)]
pub(super) struct Assessor {
    limbs: Vec<LimbFilter>,
    /// Sums of the roundness of the surface observed at the tracked pose.
    round: [f64; 2],
    /// Internal status of the body and of its limbs, which the tracker itself uses; `internal` is empty before the first frame.
    pub(super) status: Status,
    internal: Vec<LimbStatus>,
    /// Log odds that each limb is right, of which its reported status and probability are functions.
    log_odds: Vec<f64>,
    /// All of these while another pose is assessed.
    aside: (Vec<LimbFilter>, [f64; 2], Status, Vec<LimbStatus>, Vec<f64>),
    exclusive: Exclusive,
    raycasters: Vec<LimbRaycaster>,
    supports: Vec<LimbSupport>,
    /// Evidence of color edges, where these are the only evidence.
    pub(super) edges: EdgeFilter,
}

impl Assessor {
    /// Trusts a pose that the user set: it counts as right until many frames contradict it.
    pub(super) fn trust_pose(&mut self) {
        self.restart(Status::Tracking);
        self.round = [ROUND[0]; 2];
    }

    /// Restarts the assessment of the limbs, of a body with this status.
    pub(super) fn restart(&mut self, status: Status) {
        self.limbs.clear();
        self.internal.clear();
        self.status = status;
    }

    /// Restarts the evidence after the body was moved, or where the user did not set its pose: only the current frame counts.
    pub(super) fn moved(&mut self) {
        self.limbs.clear();
        self.round = [ROUND[1]; 2];
    }

    /// Sets the assessment aside for that of another pose, for which only the current frame is evidence.
    pub(super) fn set_aside(&mut self) {
        self.take_back();
        self.moved();
    }

    /// Takes back the assessment that was set aside.
    pub(super) fn take_back(&mut self) {
        let Self { limbs, round, status, internal, log_odds, aside, .. } = self;
        std::mem::swap(limbs, &mut aside.0);
        std::mem::swap(round, &mut aside.1);
        std::mem::swap(status, &mut aside.2);
        std::mem::swap(internal, &mut aside.3);
        std::mem::swap(log_odds, &mut aside.4);
    }

    /// Sets the body and all its limbs to lost.
    fn give_up(&mut self) {
        self.status = Status::Lost;
        self.internal.fill(LimbStatus::Lost);
        self.log_odds.fill(f64::NEG_INFINITY);
    }

    /// Whether the last assessment found the body not tracked or one of its limbs lost, or whether the status of an arm or leg has
    /// low confidence.
    pub(super) fn is_uncertain(&self, extremities: &[TwoBone]) -> bool {
        let mut limbs = extremities.iter().flat_map(|chain| [chain.upper, chain.lower]);
        self.status != Status::Tracking
            || self.internal.contains(&LimbStatus::Lost)
            || limbs.any(|limb| self.limbs.get(limb).is_some_and(|limb| is_uncertain(limb.log_odds[0])))
    }

    /// Whether the tracker relies on a limb: its internal status is measured.
    pub(super) fn is_reliable(&self, limb: usize) -> bool {
        self.internal.get(limb) == Some(&LimbStatus::Measured)
    }

    /// Updates the internal status of the body and its limbs. `detected` is the detection of this frame, if there is one.
    pub(super) fn assess(
        &mut self,
        context: Context,
        correspondences: &Correspondences,
        poses: &[Pose],
        detected: Option<Detected>,
    ) {
        if context.observation.candidates.points.is_empty() && correspondences.sites.is_empty() {
            // Nothing was measured, and earlier evidence does not count for this frame.
            self.limbs.clear();
        }
        let [product, square] = self.update_limbs(context, correspondences, poses);
        self.weigh_evidence(context, poses, detected);
        let Self { limbs, internal, log_odds, .. } = self;
        refill(log_odds, limbs.iter().map(|limb| limb.log_odds[0]));
        refill(internal, limbs.iter().map(|limb| limb.status(limb.log_odds[0])));
        for chain in &context.model.extremities {
            // Hands and feet have too few patches for odds of their own.
            for end in &chain.ends {
                internal[*end] = internal[chain.lower];
                log_odds[*end] = limbs[chain.lower].log_odds[1];
            }
        }
        self.status = overall(internal, |limb| limbs[limb].visible >= LITTLE);
        if square > 0.0 {
            let [products, squares] = self.round.map(|sum| ROUNDNESS_MEMORY * sum);
            self.round = [products + product, squares + square];
        }
        if self.round[0] < LITTLE * self.round[1] {
            self.give_up();
        }
    }

    /// Writes the status of the body and its limbs into an estimate, whose sources must have been filled in; no other function
    /// does. A body with too many limbs not measured, far from a source's measurements, or without any that match, is not
    /// reported as tracked.
    pub(super) fn report_status(&self, model: &Model, estimate: &mut Estimate) {
        let Estimate { limb_status: statuses, limb_probability: probabilities, .. } = estimate;
        if self.internal.is_empty() {
            // A pose that was set, before its first frame.
            reset(statuses, model.body.limbs().len(), LimbStatus::Inferred);
            reset(probabilities, model.body.limbs().len(), f64::NAN);
            estimate.status = self.status;
            return;
        }
        refill(statuses, self.limbs.iter().zip(&self.log_odds).map(|(limb, log_odds)| limb.status(*log_odds)));
        let [even, factor] = WITHIN_10_CM;
        refill(probabilities, self.log_odds.iter().map(|log_odds| probability(even + factor * log_odds)));
        let status = if self.edges.is_known() { overall(statuses, |_| true) } else { self.status };
        // Nothing may match a pose that was set, however much was measured.
        let sources = &estimate.sources;
        let missed = sources.iter().any(|source| source.residual > MISSED)
            || !sources.is_empty() && sources.iter().all(|source| source.inliers == 0);
        let low_confidence = missed || measured_fraction(statuses) < 1.0 - SOME;
        estimate.status = if status == Status::Tracking && low_confidence { Status::Degraded } else { status };
    }

    /// Updates the filter of every limb with this frame. Returns the roundness of the observed surface, see [`measure_support`].
    fn update_limbs(&mut self, context: Context, correspondences: &Correspondences, poses: &[Pose]) -> [f64; 2] {
        let (body, views) = (&context.model.body, context.observation.views);
        self.limbs.resize(poses.len(), LimbFilter::default());
        self.exclusive.count(body, poses, context.observation.candidates);
        let Self { raycasters, supports, .. } = self;
        let round = measure_support(views, body, poses, &context.model.extremities, raycasters, supports);
        for (limb, filter) in self.limbs.iter_mut().enumerate() {
            let support = &mut self.supports[limb];
            let patches = support.patches;
            let visible = patches.front_facing - patches.occluded;
            let exclusive = self.exclusive.area[limb];
            let unseen = patches.front_facing == 0.0;
            // Evidence for the limb, evidence against it and its unoccluded part, as fractions of its surface.
            let mut now = if unseen {
                [EVEN * exclusive / FEW, 0.0, 0.0]
            } else {
                let past = patches.free_space / patches.front_facing;
                [OF_EXCLUSIVE * ((exclusive / visible.max(FEW)).min(1.0) - past), past, visible / patches.front_facing]
            };
            let near = |pair: &SitePair| pair.weight > 0.0 && (pair.x - pair.p).length() < APART;
            let site = |pair: &SitePair| pair.limb == limb && near(pair);
            // Hip sites measure the pelvis, and shoulder sites the clavicles, where no depth image covers these limbs.
            let joined = |pair: &SitePair| unseen && near(pair) && limb_joined_at(body, poses, pair) == Some(limb);
            if correspondences.sites.iter().any(|pair| site(pair) || joined(pair)) {
                now = [OF_EXCLUSIVE, 0.0, 1.0];
                support.known = false;
            }
            // Without depth coverage, color images give the evidence.
            if let Some(colors) = correspondences.region_support.get(limb).filter(|_| unseen && now[0] == 0.0) {
                now = [OF_EXCLUSIVE * colors.own * colors.visible, colors.against, colors.visible];
            }
            // Depth images do not contradict a limb that point clouds of other sensors measure.
            support.known &= self.exclusive.clouds[limb] < FEW;
            [_, filter.contradicted, filter.visible] = now;
            filter.evidence = support_log_odds(now[0]);
            let far_end =
                |poses: &[Pose]| poses.get(limb).map(|pose| *pose * (body.limbs()[limb].shape.length() * Vec3::Z));
            let ends = far_end(poses).zip(far_end(context.previous));
            let motion = ends.map_or(Vec3::ZERO, |(now, before)| now - before);
            filter.unexpected = motion.distance(filter.motion);
            filter.motion = motion;
        }
        round
    }

    /// Updates the odds of every limb with the evidence of this frame and of a detection, if there is one.
    fn weigh_evidence(&mut self, context: Context, poses: &[Pose], detected: Option<Detected>) {
        let Self { limbs, supports, .. } = self;
        let (model, origin) = (context.model, context.observation.origin());
        for (limb, filter) in limbs.iter_mut().enumerate() {
            if !model.extremities.iter().any(|chain| chain.has(limb)) {
                filter.observe([filter.evidence; 2], 0.0, 0.0);
            }
        }
        for chain in &model.extremities {
            let both = [chain.upper, chain.lower];
            // By images, of each limb and of its outer part; what no image shows does not speak against the others.
            let [[upper, upper_end], [lower, lower_end]] = both.map(|limb| {
                let support = &supports[limb];
                if support.known { support.net_support().map(support_log_odds) } else { [f64::INFINITY; 2] }
            });
            let images = [
                [all_log_odds(&[upper, any_log_odds(upper_end, lower)]); 2],
                [all_log_odds(&[upper, lower]), all_log_odds(&[upper, lower, lower_end])],
            ];
            let others = [limbs[chain.upper].evidence, all_log_odds(&both.map(|limb| limbs[limb].evidence))];
            let unexpected = limbs[chain.upper].unexpected.max(limbs[chain.lower].unexpected);
            let next = [Some(chain.lower), chain.ends.first().copied()];
            for (number, limb) in both.into_iter().enumerate() {
                if !supports[limb].known {
                    limbs[limb].observe([others[number]; 2], 0.0, 0.0);
                    continue;
                }
                let there = [Some(limb), next[number]];
                let log_odds = detected.map(|detected| detection_log_odds(detected, &model.body, poses, origin, there));
                limbs[limb].observe(images[number], log_odds.unwrap_or_default(), unexpected);
            }
        }
    }
}

/// Returns the log odds that a limb's pose is right, from the detected positions of the proximal joints of `limbs`: the limb
/// itself and the next one. The sum over both joints contradicts a limb if the detection is far from most of it, even if one
/// joint agrees. Poses are in the working frame, whose origin in the world is `origin`.
fn detection_log_odds(detected: Detected, body: &Body, poses: &[Pose], origin: Vec3, limbs: [Option<usize>; 2]) -> f64 {
    let apart = |limb: usize| {
        let (parent, joint) = body.limbs()[limb].parent.as_ref()?;
        let detected = detected.hangs_by(limb)?;
        let tracked = poses[*parent] * joint.parent_from_joint.translation + origin;
        // For a right joint the expected square along an axis is the variance. The tracked position has the tolerance `EXPLAINED`,
        // the distance within which a limb explains a point.
        let variance = detected.sigma * detected.sigma + EXPLAINED * EXPLAINED;
        let apart = (tracked - detected.position).to_array();
        Some(apart.iter().map(|along| 0.5 * (1.0 - along * along / variance)).sum::<f64>())
    };
    limbs.into_iter().flatten().filter_map(apart).sum()
}

/// Returns the parent of the site's limb if the site lies at the joint between the two, so that it measures the parent, too. Body
/// models place hips and shoulders at slightly different positions.
fn limb_joined_at(body: &Body, poses: &[Pose], pair: &SitePair) -> Option<usize> {
    let (parent, joint) = body.limbs()[pair.limb].parent.as_ref()?;
    let center = poses[pair.limb].transform_point(joint.limb_from_joint.translation);
    ((pair.x - center).length() < EXPLAINED).then_some(*parent)
}

fn measured_fraction(limbs: &[LimbStatus]) -> f64 {
    limbs.iter().filter(|limb| **limb == LimbStatus::Measured).count() as f64 / limbs.len() as f64
}

/// Returns the body's status: lost without a measured root and half of the limbs that could be seen, or with less than a quarter of
/// all limbs measured; degraded when more than a quarter of the limbs are not measured.
fn overall(limbs: &[LimbStatus], is_visible: impl Fn(usize) -> bool) -> Status {
    let measured = measured_fraction(limbs);
    let is_measured = |limb: &usize| limbs[*limb] == LimbStatus::Measured;
    let visible = (0..limbs.len()).filter(|limb| is_measured(limb) || is_visible(*limb)).count() as f64;
    if measured < SOME || (!is_measured(&0) && measured * (limbs.len() as f64) < 2.0 * SOME * visible) {
        Status::Lost
    } else if measured < 1.0 - SOME {
        Status::Degraded
    } else {
        Status::Tracking
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::super::estimate::SourceReport;
    use super::*;
    use crate::body::LimbRole;
    use crate::detect::{DetectedJoint, Detection, JointMap};
    use crate::fit::Fit;
    use crate::observation::candidates::Candidates;
    use crate::observation::frame::Frame;
    use crate::observation::observer::Observation;
    use crate::testing::{before_wall, depth, first_arm, moved, put_board, standing, with_context, without_background};

    /// Assesses poses in one image, for the given number of frames.
    fn assess_frames(assessor: &mut Assessor, pixels: &[u16], poses: &[Pose], frames: usize) {
        let (model, config) = (standing().0, without_background());
        with_context(pixels, &config, &model, poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, poses, true);
            (0..frames).for_each(|_| assessor.assess(context, &fit.correspondences, poses, None));
        });
    }

    fn trusting() -> Assessor {
        let mut assessor = Assessor::default();
        assessor.trust_pose();
        assessor
    }

    fn reported(assessor: &Assessor) -> Estimate {
        let mut estimate = Estimate::default();
        assessor.report_status(&standing().0, &mut estimate);
        estimate
    }

    #[test]
    fn a_pose_that_the_user_set_is_trusted_before_its_first_frame() {
        let estimate = reported(&trusting());
        assert_eq!(estimate.status, Status::Tracking);
        assert_eq!(estimate.limb_status, vec![LimbStatus::Inferred; standing().1.len()]);
        assert!(estimate.limb_probability.iter().all(|p| p.is_nan()) && !estimate.limb_probability.is_empty());
        assert!(!trusting().is_reliable(0), "nothing was measured");
        assert_eq!(reported(&Assessor::default()).status, Status::Searching);
    }

    #[test]
    fn a_correct_pose_is_tracked_and_its_visible_limbs_are_measured() {
        let (model, poses) = standing();
        let mut assessor = trusting();
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 1);
        let estimate = reported(&assessor);
        assert_eq!((assessor.status, estimate.status), (Status::Tracking, Status::Tracking));
        // Clavicles and the neck have few visible patches that the trunk would not explain.
        let small = |limb: usize| matches!(model.body.roles().limb(limb), Some(LimbRole::Clavicle(_) | LimbRole::Neck));
        for (limb, (own, status)) in model.body.limbs().iter().zip(&estimate.limb_status).enumerate() {
            if small(limb) {
                continue;
            }
            assert_eq!((*status, assessor.is_reliable(limb)), (LimbStatus::Measured, true), "{}", own.name);
            assert!(estimate.limb_probability[limb] > 0.8, "{}", own.name);
        }
    }

    #[test]
    fn a_body_far_from_a_source_or_without_any_match_is_not_tracked() {
        let (model, poses) = standing();
        let mut assessor = trusting();
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 1);
        let with = |sources: &[(usize, f64)]| {
            let source = |&(inliers, residual)| SourceReport { count: 9, inliers, residual, ..SourceReport::default() };
            let mut estimate = Estimate { sources: sources.iter().map(source).collect(), ..Estimate::default() };
            assessor.report_status(&model, &mut estimate);
            estimate.status
        };
        let (near, far, none) = ((5, 0.02), (5, 0.2), (0, f64::NAN));
        assert_eq!([with(&[near]), with(&[near, none])], [Status::Tracking; 2]);
        assert_eq!([with(&[near, far]), with(&[none, none])], [Status::Degraded; 2]);
    }

    #[test]
    fn a_body_away_from_the_observed_surface_or_in_an_empty_image_is_lost() {
        let (model, poses) = standing();
        let nothing = vec![0; before_wall(&model.body, &poses).len()];
        let image = before_wall(&model.body, &poses);
        // A body whose surface is no longer observed is lost at once.
        for (pixels, off, frames) in [(&image, 0.5, 3), (&nothing, 0.0, 1)] {
            let mut assessor = trusting();
            assess_frames(&mut assessor, &image, &poses, 5);
            assess_frames(&mut assessor, pixels, &moved(&poses, off * Vec3::X), frames);
            let estimate = reported(&assessor);
            assert_eq!(estimate.status, Status::Lost);
            assert!(estimate.limb_status.iter().all(|status| *status != LimbStatus::Measured), "{estimate:?}");
        }
    }

    #[test]
    fn a_frame_without_measurements_loses_the_body_whatever_was_observed_before() {
        let (model, poses) = standing();
        let pixels = before_wall(&model.body, &poses);
        let mut assessor = trusting();
        assess_frames(&mut assessor, &pixels, &poses, 5);
        assert_eq!(reported(&assessor).status, Status::Tracking);
        with_context(&pixels, &without_background(), &model, &poses, |context| {
            let (frame, candidates) = (Frame::empty(1.0), Candidates::default());
            let mut observation = Observation { candidates: &candidates, ..context.observation };
            (observation.views.frame, observation.views.segmented) = (&frame, &[]);
            assessor.assess(Context { observation, ..context }, &Correspondences::default(), &poses, None);
        });
        assert_eq!(reported(&assessor).status, Status::Lost);
    }

    #[test]
    fn an_arm_behind_the_trunk_is_inferred_and_the_body_is_tracked() {
        let (model, mut poses) = standing();
        let arm = &model.extremities[first_arm(&model)];
        let aside = (arm.root(&model.body, &poses).x - poses[0].translation.x).signum();
        let behind = poses[0].translation + Vec3::new(0.02 * aside, -0.1, 0.16);
        arm.reach(&model.body, &mut poses, behind, 0.0);
        let mut assessor = trusting();
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 3);
        let estimate = reported(&assessor);
        assert_eq!(estimate.status, Status::Tracking);
        for limb in [arm.lower, arm.ends[0]] {
            assert_eq!((estimate.limb_status[limb], assessor.is_reliable(limb)), (LimbStatus::Inferred, false));
            assert!(estimate.limb_probability[limb] < 0.8);
        }
    }

    #[test]
    fn a_body_on_a_flat_surface_is_lost_eventually_and_at_once_after_a_move() {
        let (model, poses) = standing();
        let mut pixels = vec![0; depth(&model.body, &poses).len()];
        put_board(&mut pixels, Vec3::new(0.0, 0.0, 2.5), [0.35, 0.9]);
        let mut assessor = trusting();
        assess_frames(&mut assessor, &pixels, &poses, 10);
        assert_ne!(assessor.status, Status::Lost, "a few blurred frames may look flat");
        assess_frames(&mut assessor, &pixels, &poses, 10);
        assert_eq!(reported(&assessor).status, Status::Lost);
        // A body that becomes visible again needs a few frames to be tracked.
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 1);
        assert_eq!(assessor.status, Status::Lost);
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 4);
        assert_eq!(assessor.status, Status::Tracking);
        assessor.moved();
        assess_frames(&mut assessor, &pixels, &poses, 1);
        assert_eq!(assessor.status, Status::Lost);
    }

    #[test]
    fn a_small_flat_part_counts_less_for_roundness_than_a_body() {
        let (model, poses) = standing();
        let flat = |size: [f64; 2]| {
            let mut assessor = trusting();
            assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 1);
            let mut pixels = vec![0; depth(&model.body, &poses).len()];
            put_board(&mut pixels, Vec3::new(0.0, 0.0, 2.5), size);
            assess_frames(&mut assessor, &pixels, &poses, 20);
            assessor.round[0] < LITTLE * assessor.round[1]
        };
        assert_eq!([flat([0.35, 0.9]), flat([0.35, 0.1])], [true, false]);
    }

    #[test]
    fn a_lost_body_has_no_measured_limb_and_a_moved_one_is_assessed_again() {
        let (model, poses) = standing();
        let pixels = before_wall(&model.body, &poses);
        let mut assessor = trusting();
        assess_frames(&mut assessor, &pixels, &poses, 1);
        assessor.give_up();
        assert_eq!(reported(&assessor).status, Status::Lost);
        assert!((0..poses.len()).all(|limb| !assessor.is_reliable(limb)));
        assert_eq!(reported(&assessor).limb_status, vec![LimbStatus::Lost; poses.len()]);
        assert_eq!(reported(&assessor).limb_probability, vec![0.0; poses.len()]);
        assessor.moved();
        assess_frames(&mut assessor, &pixels, &poses, 1);
        assert_eq!(reported(&assessor).status, Status::Tracking);
    }

    #[test]
    fn the_status_of_a_body_follows_from_its_fraction_of_measured_limbs() {
        let (measured, other) = (LimbStatus::Measured, LimbStatus::Inferred);
        let first = |count: usize| [vec![measured; count], vec![other; 16 - count]].concat();
        assert_eq!(
            [16, 12, 11, 4, 3].map(|count| overall(&first(count), |_| true)),
            [Status::Tracking, Status::Tracking, Status::Degraded, Status::Degraded, Status::Lost]
        );
        let last = |count: usize| first(count).into_iter().rev().collect::<Vec<_>>();
        let without_root = |seen: usize| [8, 7, 4, 3].map(|count| overall(&last(count), |limb| limb < seen));
        assert_eq!(without_root(16), [Status::Degraded, Status::Lost, Status::Lost, Status::Lost]);
        let [_, half, quarter, few] = without_root(0);
        assert_eq!(
            [half, quarter, few],
            [Status::Degraded, Status::Degraded, Status::Lost],
            "the others are out of view"
        );
    }

    /// Log odds of the first arm's limbs for a detection with this standard deviation that is displaced by `aside`.
    fn log_odds(aside: Vec3, sigma: f64) -> [f64; 2] {
        let (model, poses) = standing();
        let body = &model.body;
        let names: Vec<String> = body.sites().iter().map(|site| site.name.clone()).collect();
        let place = |site| body.site_position(&poses, site) + aside + Vec3::X;
        let joint = |site| Some(DetectedJoint { position: place(site), sigma, visible: 1.0 });
        let detection = Detection { joints: (0..names.len()).map(joint).collect(), ..Detection::default() };
        let detected = Detected { detection: &detection, map: &JointMap::new(body, &names, &[]) };
        let arm = &model.extremities[0];
        [(arm.upper, Some(arm.lower)), (arm.lower, arm.ends.first().copied())]
            .map(|(limb, next)| detection_log_odds(detected, body, &poses, Vec3::X, [Some(limb), next]))
    }

    #[test]
    fn a_detection_supports_a_near_limb_and_contradicts_a_far_one_according_to_its_sigma() {
        for (there, aside) in log_odds(Vec3::ZERO, 0.03).into_iter().zip(log_odds(0.2 * Vec3::X, 0.03)) {
            assert!((there - 3.0).abs() < 1e-9 && aside < -10.0, "{there} {aside}");
        }
        assert!(
            log_odds(0.2 * Vec3::X, 0.2).iter().all(|value| *value > 0.0),
            "a detection of large sigma does not contradict"
        );
    }
}
