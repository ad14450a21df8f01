//! What the frame says about every limb, and so about the body: measured, inferred or lost.
//!
//! A limb that lies on another explains points that the other explains as well, and the cameras see it where it is: neither
//! proves it right. What only this limb explains, against what of it should show, does; and a camera that sees past it proves
//! it wrong. For arms and legs, `limb_support` looks closer at what the depth images show; without any, an arm or leg is as
//! good as what it hangs on.
//!
//! All of an arm or leg has to be right for its lower limb to be: a forearm on an arm that nothing proves may be anything that is
//! seen there. An upper limb ends where its outer part shows or its lower limb begins.
//!
//! The body's own status rests on support alone, because a lost body is searched: arms on the trunk must not start that. But no
//! body is called tracked of which more than a quarter of the limbs is not measured.

mod detected;
mod edges;
mod exclusive;
mod limb_history;
mod spread;
mod two_state;

use super::estimate::{Estimate, LimbStatus, Status};
use crate::association::correspondence::SitePair;
use crate::body::two_bone::TwoBone;
use crate::body::{Body, Model};
use crate::detect::Detected;
use crate::fit::{Context, Matched};
use crate::hypotheses::APART;
use crate::math::{Pose, Vec3};
use crate::uncertainty::{EdgeFilter, Uncertainty};
use crate::visibility::evidence::{EXPLAINED, limb_visibility};
use crate::visibility::limb_support::{LimbSupport, measure_support};
use crate::visibility::render::LimbRaycaster;
use crate::visibility::roundness::roundness;
use crate::visibility::{FEW, LITTLE};
use detected::detection_log_odds;
use exclusive::Exclusive;
use limb_history::LimbHistory;
use two_state::{EVEN, all_log_odds, any_log_odds, support_log_odds};

/// Share of the past frames in what is known of how round a body is: a blurred frame is no cupboard.
const ROUNDNESS_MEMORY: f64 = 0.9;
/// Of a tracked body no larger share of the limbs is not measured. One of which no larger share is measured is lost, and so is one of
/// which less than twice that is where the root is not.
const SOME: f64 = 0.25;

/// Assesses every frame, and remembers what past ones said.
#[derive(Debug, Default)]
pub(super) struct Assessor {
    limbs: Vec<LimbHistory>,
    /// Roundness of what is seen where the body is thought to be.
    round: Option<f64>,
    /// The status of body and limbs that the tracker goes by; none of a limb before the first frame.
    status: Status,
    internal: Vec<LimbStatus>,
    exclusive: Exclusive,
    raycasters: Vec<LimbRaycaster>,
    supports: Vec<LimbSupport>,
    uncertainty: Uncertainty,
    edges: EdgeFilter,
    /// Of every limb by what edges told, a logarithm: above 0 it is in doubt. Empty where they are not all there is.
    edge_uncertainty: Vec<f64>,
}

impl Assessor {
    /// A pose that somebody vouches for is taken to be on a body until many frames say otherwise.
    pub(super) fn trust_pose(&mut self) {
        self.forget_limbs();
        self.status = Status::Tracking;
        self.round = Some(1.0);
    }

    /// Limbs were changed while the body had the reported `status`.
    pub(super) fn edited(&mut self, status: Status) {
        self.forget_limbs();
        self.status = status;
    }

    /// The body is somewhere else: nothing speaks for the new place but what is seen now.
    pub(super) fn moved(&mut self) {
        self.limbs.clear();
        self.round = None;
    }

    /// A pose that nobody vouches for: what is seen of it now decides.
    pub(super) fn distrust_pose(&mut self) {
        self.forget_limbs();
        self.round = None;
    }

    /// Whether the body, or one of its limbs, was not where it should have been.
    pub(super) fn has_suspect_limb(&self) -> bool {
        self.status != Status::Tracking || self.internal.contains(&LimbStatus::Lost)
    }

    /// The body is given up.
    fn give_up(&mut self) {
        self.status = Status::Lost;
        self.internal.fill(LimbStatus::Lost);
    }

    /// The status of the body that the tracker goes by.
    pub(super) fn status(&self) -> Status {
        self.status
    }

    /// Whether it is in doubt if one of the arms and legs is right.
    pub(super) fn is_uncertain(&self) -> bool {
        self.limbs.iter().any(LimbHistory::is_uncertain)
    }

    /// Whether the tracker relies on a limb.
    pub(super) fn is_reliable(&self, limb: usize) -> bool {
        self.internal.get(limb) == Some(&LimbStatus::Measured)
    }

    /// The status that the tracker goes by, of the body and its limbs; `detected` is what a detector says of this frame, if it looked
    /// and the pose is not taken from it.
    pub(super) fn assess(&mut self, context: Context, matched: Matched, detected: Option<Detected>) {
        if context.observation.candidates.is_empty() && matched.correspondences.sites.is_empty() {
            // Nothing was measured: what was known before does not speak for this frame.
            self.limbs.clear();
        }
        self.update_limbs(context, matched, detected);
        let extremities = &context.model.extremities;
        let Self { limbs, internal, .. } = self;
        internal.clear();
        internal.extend(limbs.iter().map(LimbHistory::supported));
        for chain in extremities {
            if internal[chain.lower] == LimbStatus::Measured {
                internal[chain.lower] = internal[chain.upper];
            }
        }
        inherit_status(extremities, internal);
        // By support alone: a lost body is searched, and arms on the trunk must not start that.
        self.status = overall(internal);
        for limb in extremities.iter().flat_map(|chain| [chain.upper, chain.lower]) {
            internal[limb] = limbs[limb].status(internal[limb]);
        }
        inherit_status(extremities, internal);
        if let Some(now) = roundness(context.observation.views, &context.model.body, matched.poses) {
            let mixed = |before: f64| ROUNDNESS_MEMORY * before + (1.0 - ROUNDNESS_MEMORY) * now;
            self.round = Some(self.round.map_or(now, mixed));
        }
        if self.round.is_some_and(|round| round < LITTLE) {
            self.give_up();
        }
    }

    /// Reports the status of the body and its limbs: the one place that writes them into an estimate. No body is tracked of which
    /// too many limbs are not measured.
    pub(super) fn report_status(&self, model: &Model, estimate: &mut Estimate) {
        let statuses = &mut estimate.limb_status;
        statuses.clear();
        if self.internal.is_empty() {
            // Nothing was seen of a pose that was set.
            statuses.resize(model.body.limbs().len(), LimbStatus::Inferred);
            estimate.status = self.status;
            return;
        }
        statuses.extend_from_slice(&self.internal);
        self.report_edges(&model.extremities, statuses);
        // A body that is lost altogether has no limb that is not.
        if statuses.iter().any(|status| *status != LimbStatus::Lost) {
            for chain in &model.extremities {
                // A forearm may be known by its inner part, but not the hand.
                let hidden =
                    statuses[chain.lower] == LimbStatus::Measured && !self.limbs[chain.lower].is_end_supported();
                chain.ends.iter().filter(|_| hidden).for_each(|end| statuses[*end] = LimbStatus::Inferred);
            }
        }
        let status = if self.is_by_edges_alone() { overall(statuses) } else { self.status };
        let limb_suspect = status == Status::Tracking && measured_fraction(statuses) < 1.0 - SOME;
        estimate.status = if limb_suspect { Status::Degraded } else { status };
    }

    fn forget_limbs(&mut self) {
        self.limbs.clear();
        self.internal.clear();
    }

    /// What this frame says about every limb.
    fn update_limbs(&mut self, context: Context, matched: Matched, detected: Option<Detected>) {
        let (body, views, poses) = (&context.model.body, context.observation.views, matched.poses);
        self.limbs.resize(poses.len(), LimbHistory::default());
        self.exclusive.count(body, poses, context.observation.candidates);
        measure_support(views, body, poses, &context.model.extremities, &mut self.raycasters, &mut self.supports);
        for (limb, history) in self.limbs.iter_mut().enumerate() {
            let visibility = limb_visibility(views, &body.limbs()[limb], &poses[limb]).image;
            let visible = visibility.front_facing - visibility.occluded;
            let exclusive = self.exclusive.weight[limb];
            let mut now = if visibility.front_facing > 0.0 {
                let past = visibility.free_space / visibility.front_facing;
                [exclusive / visible.max(FEW), past, visible / visibility.front_facing]
            } else {
                [2.0 * EVEN * exclusive / FEW, 0.0, 0.0]
            };
            let near = |pair: &SitePair| pair.weight > 0.0 && (pair.x - pair.p).length() < APART;
            let site = |pair: &SitePair| pair.limb == limb && near(pair);
            // The hips tell where the pelvis is, the shoulders the clavicles: where no depth image looks, that is measured.
            let unseen = visibility.front_facing == 0.0;
            let joined = |pair: &SitePair| unseen && near(pair) && limb_joined_at(body, poses, pair) == Some(limb);
            let support = &mut self.supports[limb];
            if matched.correspondences.sites.iter().any(|pair| site(pair) || joined(pair)) {
                now = [1.0, 0.0, 1.0];
                support.known = false;
            }
            // Where no depth image looks, pictures tell.
            if let Some(colors) = matched.correspondences.region_support.get(limb).filter(|_| unseen && now[0] == 0.0) {
                now = [colors.own[0] * colors.visible, colors.against[0], colors.visible];
            }
            // What other sensors than depth cameras see of a limb no depth image disproves.
            support.known &= self.exclusive.clouds[limb] < FEW;
            history.update(now.map(|value| value.min(1.0)));
            let far_end =
                |poses: &[Pose]| poses.get(limb).map(|pose| *pose * (body.limbs()[limb].shape.length() * Vec3::Z));
            history
                .moved(far_end(poses).zip(far_end(context.previous)).map_or(Vec3::ZERO, |(now, before)| now - before));
        }
        self.weigh_images(context, poses, detected);
    }

    /// What this frame's images, and a detector that looked at them, say about arms and legs.
    fn weigh_images(&mut self, context: Context, poses: &[Pose], detected: Option<Detected>) {
        let Self { limbs, supports, .. } = self;
        let (model, origin) = (context.model, context.observation.origin());
        for chain in &model.extremities {
            let log_odds = |limb: usize, part: usize| {
                let support = &supports[limb];
                if support.known { support_log_odds(support.net_support()[part]) } else { f64::INFINITY }
            };
            let [upper, lower] = [chain.upper, chain.lower].map(|limb| log_odds(limb, 0));
            let [upper_end, lower_end] = [chain.upper, chain.lower].map(|limb| log_odds(limb, 1));
            let of_upper = all_log_odds(&[upper, any_log_odds(upper_end, lower)]);
            let of_lower = [all_log_odds(&[upper, lower]), all_log_odds(&[upper, lower, lower_end])];
            let unexpected = limbs[chain.upper].unexpected().max(limbs[chain.lower].unexpected());
            let next = [Some(chain.lower), chain.ends.first().copied()];
            for ((limb, evidence), next) in
                [(chain.upper, [of_upper; 2]), (chain.lower, of_lower)].into_iter().zip(next)
            {
                if !supports[limb].known {
                    limbs[limb].clear_states();
                    continue;
                }
                let log_odds = detected
                    .map(|detected| detection_log_odds(detected, &model.body, poses, origin, [Some(limb), next]));
                limbs[limb].observe(evidence, log_odds.unwrap_or_default(), unexpected);
            }
        }
    }
}

/// The limb that a site at a joint tells of besides its own: the one that its own hangs on. Models put hips and shoulders a little
/// apart.
fn limb_joined_at(body: &Body, poses: &[Pose], pair: &SitePair) -> Option<usize> {
    let (parent, joint) = body.limbs()[pair.limb].parent.as_ref()?;
    let center = poses[pair.limb].transform_point(joint.limb_from_joint.translation);
    ((pair.x - center).length() < EXPLAINED).then_some(*parent)
}

/// Hands and feet show too few patches to tell on their own: they have the status of what they hang on.
fn inherit_status(extremities: &[TwoBone], statuses: &mut [LimbStatus]) {
    for chain in extremities {
        chain.ends.iter().for_each(|end| statuses[*end] = statuses[chain.lower]);
    }
}

fn measured_fraction(limbs: &[LimbStatus]) -> f64 {
    limbs.iter().filter(|limb| **limb == LimbStatus::Measured).count() as f64 / limbs.len() as f64
}

/// Lost without a measured root and half of the limbs; degraded when more than a quarter of the limbs are not measured.
fn overall(limbs: &[LimbStatus]) -> Status {
    let measured = measured_fraction(limbs);
    if measured < SOME || (limbs[0] != LimbStatus::Measured && measured < 2.0 * SOME) {
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
    use super::*;
    use crate::association::correspondence::Correspondences;
    use crate::body::LimbRole;
    use crate::fit::Fit;
    use crate::observation::candidates::Candidates;
    use crate::observation::frame::Frame;
    use crate::testing::{before_wall, depth, first_arm, moved, put_board, standing, with_context, without_background};

    /// Lets an assessor look at poses in an image, in so many frames.
    fn assess_frames(assessor: &mut Assessor, pixels: &[u16], poses: &[Pose], frames: usize) {
        let (model, config) = (standing().0, without_background());
        with_context(pixels, &config, &model, poses, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, poses);
            (0..frames).for_each(|_| assessor.assess(context, fit.matched(poses), None));
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
    fn a_pose_that_was_set_is_trusted_before_anything_is_visible() {
        let estimate = reported(&trusting());
        assert_eq!(estimate.status, Status::Tracking);
        assert_eq!(estimate.limb_status, vec![LimbStatus::Inferred; standing().1.len()]);
        assert!(!trusting().is_reliable(0), "nothing was seen");
        assert_eq!(reported(&Assessor::default()).status, Status::Searching);
    }

    #[test]
    fn a_right_pose_is_tracked_and_what_is_visible_of_it_is_measured() {
        let (model, poses) = standing();
        let mut assessor = trusting();
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 1);
        let estimate = reported(&assessor);
        assert_eq!((assessor.status(), estimate.status), (Status::Tracking, Status::Tracking));
        // Clavicles and a neck show little that the trunk would not explain.
        let small = |limb: usize| matches!(model.body.roles().limb(limb), Some(LimbRole::Clavicle(_) | LimbRole::Neck));
        for (limb, (own, status)) in model.body.limbs().iter().zip(&estimate.limb_status).enumerate() {
            if small(limb) {
                continue;
            }
            assert_eq!((*status, assessor.is_reliable(limb)), (LimbStatus::Measured, true), "{}", own.name);
        }
    }

    #[test]
    fn a_body_beside_what_is_visible_is_lost_and_so_is_one_before_nothing() {
        let (model, poses) = standing();
        let nothing = vec![0; before_wall(&model.body, &poses).len()];
        let image = before_wall(&model.body, &poses);
        // What no longer shows at all is lost at once.
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
    fn a_frame_that_measures_nothing_loses_the_body_whatever_was_visible_before() {
        let (model, poses) = standing();
        let pixels = before_wall(&model.body, &poses);
        let mut assessor = trusting();
        assess_frames(&mut assessor, &pixels, &poses, 5);
        assert_eq!(reported(&assessor).status, Status::Tracking);
        with_context(&pixels, &without_background(), &model, &poses, |context| {
            let (frame, candidates) = (Frame::empty(1.0), Candidates::default());
            let mut observation = context.observation.with(&candidates);
            (observation.views.frame, observation.views.segmented) = (&frame, &[]);
            let matched = Matched { correspondences: &Correspondences::default(), poses: &poses };
            assessor.assess(Context { observation, ..context }, matched, None);
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
        }
    }

    #[test]
    fn what_is_flat_is_lost_in_time_and_at_once_where_nobody_trusts_it() {
        let (model, poses) = standing();
        let mut pixels = vec![0; depth(&model.body, &poses).len()];
        put_board(&mut pixels, Vec3::new(0.0, 0.0, 2.5), [0.35, 0.9]);
        let mut assessor = trusting();
        assess_frames(&mut assessor, &pixels, &poses, 10);
        assert_ne!(assessor.status(), Status::Lost, "a blurred frame is flat, too");
        assess_frames(&mut assessor, &pixels, &poses, 10);
        assert_eq!(reported(&assessor).status, Status::Lost);
        // A body that comes back does so in time.
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 1);
        assert_eq!(assessor.status(), Status::Lost);
        assess_frames(&mut assessor, &before_wall(&model.body, &poses), &poses, 4);
        assert_eq!(assessor.status(), Status::Tracking);
        assessor.moved();
        assess_frames(&mut assessor, &pixels, &poses, 1);
        assert_eq!(assessor.status(), Status::Lost);
    }

    #[test]
    fn a_body_given_up_has_no_limb_and_one_that_moved_is_judged_anew() {
        let (model, poses) = standing();
        let pixels = before_wall(&model.body, &poses);
        let mut assessor = trusting();
        assess_frames(&mut assessor, &pixels, &poses, 1);
        assessor.give_up();
        assert_eq!(reported(&assessor).status, Status::Lost);
        assert!((0..poses.len()).all(|limb| !assessor.is_reliable(limb)));
        assert_eq!(reported(&assessor).limb_status, vec![LimbStatus::Lost; poses.len()]);
        assessor.moved();
        assess_frames(&mut assessor, &pixels, &poses, 1);
        assert_eq!(reported(&assessor).status, Status::Tracking);
    }

    #[test]
    fn shares_of_limbs_decide_what_the_body_is() {
        let (measured, other) = (LimbStatus::Measured, LimbStatus::Inferred);
        let first = |count: usize| [vec![measured; count], vec![other; 16 - count]].concat();
        assert_eq!(
            [16, 12, 11, 4, 3].map(|count| overall(&first(count))),
            [Status::Tracking, Status::Tracking, Status::Degraded, Status::Degraded, Status::Lost]
        );
        let last = |count: usize| first(count).into_iter().rev().collect::<Vec<_>>();
        assert_eq!([8, 7].map(|count| overall(&last(count))), [Status::Degraded, Status::Lost], "without the root");
    }
}
