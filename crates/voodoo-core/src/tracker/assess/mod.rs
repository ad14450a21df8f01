//! What the frame says about every limb, and so about the body: measured, inferred or lost.
//!
//! A limb that lies on another explains points that the other explains as well, and the cameras see it where it is: neither
//! proves it right. What only this limb explains, against what of it should show, does; and a camera that sees past it proves
//! it wrong. For arms and legs, `limb_support` looks closer at what the depth images show; without any, an arm or leg is as
//! good as what it hangs on.
//!
//! That is said twice. What the tracker goes by itself (the internal status: where a limb ended when all was well, whose girth a
//! contour shows) has to be proven along the whole limb and over several frames. What is reported of this frame has to be
//! reported before the limb is far off, and it asks for both limbs of an arm or leg: a forearm on an arm that nothing proves may
//! be anything that is seen there.
//!
//! The body's own status rests on support alone, because a lost body is searched: arms on the trunk must not start that. But no
//! body is called tracked of which more than a quarter of the limbs is not measured.

mod exclusive;
mod limb_history;

use super::estimate::{Estimate, LimbStatus, Status};
use crate::association::correspondence::SitePair;
use crate::body::Model;
use crate::body::two_bone::TwoBone;
use crate::fit::{Context, Matched};
use crate::visibility::evidence::limb_visibility;
use crate::visibility::limb_support::{LimbSupport, measure_support};
use crate::visibility::render::LimbRaycaster;
use crate::visibility::roundness::roundness;
use exclusive::Exclusive;
use limb_history::{LimbHistory, SUPPORT};

/// Shares are of this many visible patches at least.
const LEAST_VISIBLE: f64 = 8.0;
/// Without a depth image, points on a limb that make it measured.
const FEW: f64 = 5.0;
/// What is less round is no body, and the share of the past frames in what is known of it: a blurred frame is no cupboard.
const FLAT: f64 = 0.2;
const ROUNDNESS_MEMORY: f64 = 0.9;
/// Share of the limbs of a tracked body that are measured at least; with fewer than `SOME` measured it is lost, and with fewer
/// than `HALF` where the root is none of them.
const TRACKED: f64 = 0.75;
const HALF: f64 = 0.5;
const SOME: f64 = 0.25;
/// A site this far from its measurement does not support its limb, metres.
const SITE_REACH: f64 = 0.10;

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

    /// The body is given up.
    pub(super) fn give_up(&mut self) {
        self.status = Status::Lost;
        self.internal.fill(LimbStatus::Lost);
    }

    /// The status of the body that the tracker goes by.
    pub(super) fn status(&self) -> Status {
        self.status
    }

    /// Whether the tracker relies on a limb.
    pub(super) fn relied_on(&self, limb: usize) -> bool {
        self.internal.get(limb) == Some(&LimbStatus::Measured)
    }

    /// The status that the tracker goes by, of the body and its limbs.
    pub(super) fn assess(&mut self, context: Context, matched: Matched) {
        if context.seen.candidates.is_empty() && matched.correspondences.sites.is_empty() {
            // Nothing was measured: what was known before does not speak for this frame.
            self.limbs.clear();
        }
        self.update_limbs(context, matched);
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
            internal[limb] = limbs[limb].internal(internal[limb]);
        }
        inherit_status(extremities, internal);
        if let Some(now) = roundness(context.seen.views, &context.model.body, matched.poses) {
            let mixed = |before: f64| ROUNDNESS_MEMORY * before + (1.0 - ROUNDNESS_MEMORY) * now;
            self.round = Some(self.round.map_or(now, mixed));
        }
        if self.round.is_some_and(|round| round < FLAT) {
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
        // A body that is lost altogether has no limb that is not.
        if statuses.iter().any(|status| *status != LimbStatus::Lost) {
            for chain in &model.extremities {
                let [upper, lower] = [chain.upper, chain.lower].map(|limb| &self.limbs[limb]);
                statuses[chain.upper] = upper.reported_upper(lower, statuses[chain.upper]);
                statuses[chain.lower] = lower.reported_lower(upper, statuses[chain.lower]);
            }
            inherit_status(&model.extremities, statuses);
            for chain in &model.extremities {
                // A forearm may be known by its inner part, but not the hand.
                let hidden = statuses[chain.lower] == LimbStatus::Measured && !self.limbs[chain.lower].outer_shows();
                chain.ends.iter().filter(|_| hidden).for_each(|end| statuses[*end] = LimbStatus::Inferred);
            }
        }
        let doubtful = self.status == Status::Tracking && measured_share(statuses) < TRACKED;
        estimate.status = if doubtful { Status::Degraded } else { self.status };
    }

    fn forget_limbs(&mut self) {
        self.limbs.clear();
        self.internal.clear();
    }

    /// What this frame says about every limb.
    fn update_limbs(&mut self, context: Context, matched: Matched) {
        let (body, views, poses) = (&context.model.body, context.seen.views, matched.poses);
        self.limbs.resize(poses.len(), LimbHistory::default());
        self.exclusive.count(body, poses, context.seen.candidates);
        measure_support(views, body, poses, &context.model.extremities, &mut self.raycasters, &mut self.supports);
        for (limb, history) in self.limbs.iter_mut().enumerate() {
            let seen = limb_visibility(views, &body.limbs()[limb], &poses[limb]).image;
            let visible = seen.front_facing - seen.occluded;
            let exclusive = self.exclusive.weight[limb];
            let mut now = if seen.front_facing > 0.0 {
                let past = seen.free_space / seen.front_facing;
                [exclusive / visible.max(LEAST_VISIBLE), past, visible / seen.front_facing]
            } else {
                [SUPPORT * exclusive / FEW, 0.0, 0.0]
            };
            let site =
                |pair: &SitePair| pair.limb == limb && pair.weight > 0.0 && (pair.x - pair.p).length() < SITE_REACH;
            let mut support = self.supports[limb];
            if matched.correspondences.sites.iter().any(site) {
                now = [1.0, 0.0, 1.0];
                support.known = false;
            }
            // What other sensors than depth cameras see of a limb no depth image disproves.
            support.known &= self.exclusive.clouds[limb] < FEW;
            history.support(&support);
            history.update(now.map(|value| value.min(1.0)));
        }
    }
}

/// Hands and feet show too few patches to tell on their own: they have the status of what they hang on.
fn inherit_status(extremities: &[TwoBone], statuses: &mut [LimbStatus]) {
    for chain in extremities {
        chain.ends.iter().for_each(|end| statuses[*end] = statuses[chain.lower]);
    }
}

fn measured_share(limbs: &[LimbStatus]) -> f64 {
    limbs.iter().filter(|limb| **limb == LimbStatus::Measured).count() as f64 / limbs.len() as f64
}

/// Lost without a measured root and half of the limbs; degraded when more than a quarter of the limbs are not measured.
fn overall(limbs: &[LimbStatus]) -> Status {
    let measured = measured_share(limbs);
    if measured < SOME || (limbs[0] != LimbStatus::Measured && measured < HALF) {
        Status::Lost
    } else if measured < TRACKED {
        Status::Degraded
    } else {
        Status::Tracking
    }
}
