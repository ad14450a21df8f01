//! Finding a body where a detector sees a person: one that nobody said where it is, a lost one, and one that is elsewhere than it
//! is tracked.
//!
//! The body is put there as the detector sees it and refined; it is taken where it explains the frame no worse by the score of all
//! hypotheses and is not lost itself.

mod belief;
mod doubt;
mod hidden;
mod people;
mod search;
mod trials;
mod watch;

use crate::association::correspondence::Correspondences;
use crate::body::{Body, Model};
use crate::detect::{Detect, DetectError, Detected, DetectionQuery, JointMap, is_sized_like, posed, sized};
use crate::fit::{Context, Fit, UNKNOWN_MOTION};
use crate::math::{Aabb, Pose, Vec3, shifted};
use crate::observation::candidates::{Candidates, body_box};
use crate::observation::depth_view::DepthViews;
use crate::observation::frame::{Frame, Ground};
use crate::observation::observer::Own;
use crate::observation::share::Share;
use belief::Belief;
pub(crate) use belief::{ENOUGH_ODDS, LOOK_COSTS, SAME_PERSON};
pub use doubt::Seen;
use doubt::{Doubt, SIGMAS};
use people::People;
use search::Search;
use trials::Trials;
pub use watch::Sighting;
use watch::Watch;

/// Finds bodies. Remembers what a detector said, and how long the body has been lost.
#[derive(Debug, Default)]
pub struct Relocalizer {
    watch: Watch,
    candidates: Candidates,
    matched: Correspondences,
    trials: Trials,
    search: Search,
    people: People,
    doubt: Doubt,
    belief: Belief,
}

impl Relocalizer {
    /// Takes the detector that finds this body.
    pub fn set_detector(&mut self, detector: Option<Box<dyn Detect>>, body: &Body) {
        self.people.set_detector(detector, body);
    }

    /// The body's limbs or sites have changed.
    pub fn bind(&mut self, body: &Body) {
        self.people.bind(body);
    }

    /// What the detector's joints are on the body.
    pub fn map(&self) -> &JointMap {
        self.people.map()
    }

    /// Why the detector could not look, since [`Self::clear_error`].
    pub fn error(&self) -> Option<&DetectError> {
        self.people.error()
    }

    /// Forgets the detector's last error.
    pub fn clear_error(&mut self) {
        self.people.clear_error();
    }

    /// Forgets everything that was remembered of an earlier track.
    pub fn restart(&mut self, model: &Model, poses: &[Pose]) {
        self.watch.restart();
        self.doubt.restart();
        self.belief = Belief::default();
        self.people.bind(&model.body);
        self.people.keep_floor(false);
        self.search.remember(poses);
    }

    /// Whether the body can be found without a pose.
    pub fn finds(&self) -> bool {
        self.people.know()
    }

    /// A body of a detected person's sizes, or with `known` ones that the model has, and its poses, world frame.
    pub fn placed(&self, model: &Model, detected: Detected, known: bool) -> Option<(Body, Vec<Pose>)> {
        if known { Some((model.body.clone(), posed(&model.body, detected)?)) } else { sized(model, detected) }
    }

    /// Body and poses of the surest person in a frame.
    pub fn first(&mut self, frame: &Frame, model: &Model) -> Option<(Body, Vec<Pose>)> {
        self.people.look(&model.body, frame, None, DetectionQuery::Any);
        let place = self.people.place()?;
        if !self.belief.observe(Some(place)) {
            return None;
        }
        self.belief = Belief::default();
        sized(model, self.people.seen()?)
    }

    /// The track was started: `itself` where a detector saw somebody, and nobody had said where.
    pub fn take_note_of_start(&mut self, itself: bool) {
        self.doubt.found_itself(itself);
        self.people.keep_floor(itself);
    }

    /// The floor under a body that was found, where nobody tells it; world frame.
    pub fn floor(&self) -> Option<Ground> {
        self.people.floor
    }

    /// Whether nobody had said where the track starts.
    pub fn found_itself(&self) -> bool {
        self.doubt.itself()
    }

    /// Whether the track was started less than a second ago.
    pub fn young(&self, stamp: f64) -> bool {
        self.doubt.young(stamp)
    }

    /// The pose of a body that fits best what a detector saw in this frame, world frame; the body is that of a start, or has the
    /// sizes that the detector saw where they are surely others.
    pub fn posed(&self, model: &Model, set: &Body) -> Option<(Body, Vec<Pose>)> {
        let detected = self.people.seen()?;
        if is_sized_like(set, detected, SIGMAS) {
            return Some((set.clone(), posed(set, detected)?));
        }
        sized(model, detected)
    }

    /// The pose in which a detector saw this body in this frame, world frame.
    pub fn shown(&self, body: &Body) -> Option<Vec<Pose>> {
        posed(body, self.people.seen()?)
    }

    /// Lets a detector look at a frame where that is due. `root` is where the body is expected, world frame; `doubtful`: a limb
    /// was not where it should be in the frame before, or it is `unsure` whether one was, or the body `lost`.
    pub fn look(&mut self, body: &Body, frame: &Frame, root: Vec3, doubtful: bool, unsure: bool, lost: bool) {
        // A body that was found a moment ago may face the other way.
        let often = lost || self.watch.open();
        if self.doubt.due(frame.stamp, doubtful, unsure, often) && self.people.know() {
            let query = if lost { DetectionQuery::Any } else { DetectionQuery::Near(root) };
            self.people.look(body, frame, None, query);
            // What stands before a hidden body is somebody else.
            self.people.leave_out(|place| self.watch.hidden.by(frame, place));
        } else {
            self.people.forget();
        }
    }

    /// The same for one of several persons: good tracks are looked at, too, and who is lost is not looked for here.
    pub fn look_at_share(&mut self, body: &Body, frame: &Frame, share: Share, root: Vec3, lost: bool) {
        if self.doubt.due(frame.stamp, true, false, false) && !lost && self.people.know() {
            self.people.look(body, frame, Some(share), DetectionQuery::Near(root));
            self.people.leave_out(|place| place.distance(root) > SAME_PERSON);
        } else {
            self.people.forget();
        }
    }

    /// What a detector saw in this frame counts for nothing.
    pub fn forget(&mut self) {
        self.people.forget();
    }

    /// What a detector saw in this frame, if it looked.
    pub fn detected(&self) -> Option<Detected<'_>> {
        self.people.seen()
    }

    /// The pixels in which it saw it.
    pub fn own(&self) -> Own<'_> {
        self.people.own()
    }

    /// Notes what a frame shows where the body's joints are, the root's first, world frame: what hides the body is somebody else.
    pub fn look_out(&mut self, views: DepthViews, joints: impl Iterator<Item = Vec3>, tracked: bool, lost: bool) {
        self.watch.hidden.observe(views, joints, tracked, !lost);
    }

    /// What a detector that looked at this frame says of a body at these poses, world frame; of a `young` track and of one `among`
    /// several persons also of its arms and legs.
    pub fn weigh(
        &mut self,
        body: &Body,
        world_from_limb: &[Pose],
        lost: bool,
        young: bool,
        among: bool,
    ) -> Option<Seen> {
        let detected = self.people.seen().filter(|_| lost || self.doubt.weighs())?;
        // A lost body is where a person is seen for sure.
        Some(match lost {
            true if self.belief.observe(self.people.place()) => Seen::Elsewhere,
            true => Seen::NotThere,
            false => self.doubt.weigh(detected, body, world_from_limb, young, among),
        })
    }

    /// Whether nobody is there any more, as frames up to this one say: the body is `lost` for long, or no person.
    pub fn nobody(&mut self, stamp: f64, lost: bool) -> bool {
        self.doubt.nobody(stamp, lost, self.people.verdict())
    }

    /// The poses that a detector saw in this frame, refined, where they are no worse than the present ones; working frame. What
    /// `fit` has matched is as before when it returns.
    pub fn try_detected(&mut self, context: Context, fit: &mut Fit, present: &[Pose], lost: bool) -> Option<&[Pose]> {
        let detected = self.people.seen()?;
        let origin = context.seen.origin();
        let mut place = posed(&context.model.body, detected)?;
        place.iter_mut().for_each(|pose| *pose = shifted(pose, origin));
        let (low, high) = (detected.detection.low - origin, detected.detection.high - origin);
        let margin = context.config.body_box_margin;
        let there = Aabb::new(low - Vec3::splat(margin), high + Vec3::splat(margin));
        // What the present pose explains must not be left behind, unless it is `lost` there.
        let here = if lost { there } else { body_box(&context.model.body, present, margin) };
        let bounds = Aabb::new(there.mins.min(here.mins), there.maxs.max(here.maxs));
        // What was believed is tried now: the next time it has to be believed anew.
        self.doubt.tried();
        self.belief = Belief::default();
        fit.exchange(&mut self.matched);
        self.candidates.gather(context.seen.frame(), origin, &bounds, context.seen.views.backgrounds, context.config);
        let seen = context.seen.with(&self.candidates);
        let at = Context { seen, previous: &[], time_scale: UNKNOWN_MOTION, ..context };
        let better = self.trials.at_detection(at, fit, present, &place);
        fit.exchange(&mut self.matched);
        better.then(|| self.trials.tried())
    }

    /// In how many of the last frames the body was lost, from the one on in which that is no blur; `None` otherwise.
    pub fn searched(&self) -> Option<usize> {
        self.watch.searched()
    }

    /// Notes what a frame said of the body at these poses.
    pub fn observe(&mut self, sighting: Sighting, poses: &[Pose]) {
        self.watch.observe(sighting);
        if sighting.tracked {
            self.search.remember(poses);
        }
    }

    /// Looks for a lost body that no detector sees; its poses where it explains the frame better than at `present`. What `fit` has
    /// matched is as before when it returns.
    pub fn search(&mut self, context: Context, fit: &mut Fit, present: &[Pose]) -> Option<&[Pose]> {
        let (frame, origin) = (context.seen.frame(), context.seen.origin());
        if self.searched().is_none() || self.people.know() && !frame.images.is_empty() {
            return None;
        }
        let backgrounds = context.seen.views.backgrounds;
        self.search.segments.find(frame, origin, backgrounds, context.config);
        fit.exchange(&mut self.matched);
        let mut found = false;
        let mut index = 0;
        while let Some(segment) = self.search.segment(index).filter(|_| !found) {
            index += 1;
            // What stands before a hidden body is another one.
            let other = self.watch.hidden.by(frame, segment.centre + origin);
            if other || !self.search.fits(&context.model.body, segment) {
                continue;
            }
            let margin = Vec3::splat(context.config.body_box_margin);
            let bounds = Aabb::new(segment.low - margin, segment.high + margin);
            self.candidates.gather(frame, origin, &bounds, backgrounds, context.config);
            let seen = context.seen.with(&self.candidates);
            let at = Context { seen, previous: &[], time_scale: UNKNOWN_MOTION, ..context };
            found = self.search.at(segment, at, fit, &mut self.trials, present);
        }
        fit.exchange(&mut self.matched);
        found.then(|| self.trials.tried())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::testing::{depth, farthest, moved, put_board, standing, turned, with_context, without_background};

    /// Where a lost body of another kind is in the frame after it was found, which was last tracked half a metre beside the
    /// camera's axis.
    fn found(pixels: &[u16]) -> Option<Vec<Pose>> {
        let (model, poses) = standing();
        let present = moved(&poses, -0.5 * Vec3::X);
        let config = without_background();
        let mut relocalizer = Relocalizer::default();
        relocalizer.restart(&model, &present);
        let sighting = |stamp, lost| Sighting { stamp, lost, tracked: !lost, silent: false };
        with_context(pixels, &config, &model, &present, |context| {
            let mut fit = Fit::new(&config).unwrap();
            fit.match_last(context, &present);
            let before = format!("{:?}", fit.correspondences());
            for (stamp, lost) in [(-0.4, false), (-0.3, true)] {
                relocalizer.observe(sighting(stamp, lost), &present);
                assert!(relocalizer.search(context, &mut fit, &present).is_none());
            }
            relocalizer.observe(sighting(-0.2, true), &present);
            let mut found = relocalizer.search(context, &mut fit, &present).map(<[Pose]>::to_vec);
            assert_eq!(format!("{:?}", fit.correspondences()), before);
            // The next two frames, which show the same.
            for _ in 0..2 {
                found.iter_mut().for_each(|poses| {
                    let predicted = poses.clone();
                    with_context(pixels, &config, &model, &predicted, |context| fit.run(context, &predicted, poses));
                });
            }
            found
        })
    }

    #[test]
    fn a_body_that_no_detector_knows_is_found_a_metre_beside_its_last_place() {
        let (model, poses) = standing();
        for turn in [0.0, 0.4] {
            let place = turned(&moved(&poses, 0.5 * Vec3::X), poses[0].translation + 0.5 * Vec3::X, Vec3::Y, turn);
            let off = farthest(&found(&depth(&model.body, &place)).unwrap(), &place);
            assert!(off < 0.028, "{off} m off");
        }
    }

    #[test]
    fn nothing_is_found_where_nothing_is_seen_or_what_is_seen_is_too_small_or_too_large() {
        let empty = vec![0; depth(&standing().0.body, &standing().1).len()];
        assert_eq!(found(&empty), None);
        for (depth, size) in [(2.6, [0.15, 0.2]), (3.5, [1.9, 1.4])] {
            let mut pixels = empty.clone();
            put_board(&mut pixels, Vec3::new(0.0, 0.0, depth), size);
            assert_eq!(found(&pixels), None, "{size:?}");
        }
    }
}
