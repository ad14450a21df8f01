//! The tracker of one person among whoever is there.

use super::person::Person;
use super::{People, PeopleOptions, Refusal};
use crate::body::Body;
use crate::config::Config;
use crate::detect::{Detect, DetectError};
use crate::error::TrackError;
use crate::math::{Pose, Vec3};
use crate::observation::frame::{Frame, Scope};
use crate::tracker::BodyTracker;
use crate::tracker::estimate::Estimate;
use std::ops::{Deref, DerefMut};

/// After the person has been away for this, whoever is there is followed, seconds.
const AWAY: f64 = 1.0;

/// Tracks one body through a sequence of frames.
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Body, Config, Frame, HumanModel, PositionRelation, Tracker};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let standing = body.rest_pose(Pose::IDENTITY);
/// let site = body.site_index("l_wrist")?;
/// let marker = body.site_position(&standing, site) + Vec3::X * 0.02;
/// let mut tracker = Tracker::new(body, Config::default())?;
/// tracker.reset_pose(&standing)?;
/// for stamp in [0.00, 0.03, 0.06] {
///     let wrist = PositionRelation { site, position: marker, weight: 20.0, bias: 0.0, source: 0 };
///     tracker.step(&Frame { positions: &[wrist], ..Frame::empty(stamp) })?;
/// }
/// assert!(tracker.estimate().sites[site].distance(marker) < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// It is a [`People`] of whom one is followed: a tracker with a detector also tracks everybody else in view, so that nobody else's
/// pixels are taken for the one who is followed. Queries and edits are those of the [`BodyTracker`] of that person.
#[derive(Debug)]
pub struct Tracker {
    /// The first person is the one who is followed.
    people: People,
}

impl Tracker {
    /// Returns a tracker of `body`. It has no pose until [`Tracker::reset`], or until it finds a person.
    pub fn new(body: Body, config: Config) -> Result<Self, TrackError> {
        let others = Config { threads: 1, ..config.clone() };
        let mut people = People::new(body.clone(), others, PeopleOptions::default())?;
        let mut person = Person::new(1, body, config, None, f64::INFINITY)?;
        person.followed = true;
        person.set_last_tracked(f64::NEG_INFINITY);
        people.persons.push(person);
        people.next_id += 1;
        Ok(Self { people })
    }

    /// Returns the tracker with a detector. The detector initializes the body without a pose, finds it again when it is lost,
    /// detects when the body is elsewhere than its track, and finds everybody else. Without a detector, a lost body is searched
    /// for in every foreground segment of its size.
    pub fn with_detector(mut self, detector: Box<dyn Detect>) -> Self {
        self.set_detector(Some(detector.fresh()));
        self.people = self.people.with_detector(detector);
        self
    }

    /// The error of the detector in the last step, if it failed. The step then ran without detections.
    pub fn detector_error(&self) -> Option<&DetectError> {
        self.people.detector_error()
    }

    /// Why somebody who was detected in the last step is not tracked, see [`People::refusal`].
    pub fn refusal(&self) -> Option<Refusal> {
        self.people.refusal()
    }

    /// Sets the pose, and with `fit_sizes` the sizes, from positions of named sites (index of the site, world position). Sizes
    /// are fitted starting from those of the body that was given to the tracker, not from those of an earlier reset. Stamps after
    /// a reset may start again from any time. On error the tracker is unchanged.
    pub fn reset(&mut self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<&Estimate, TrackError> {
        self.followed().tracker.reset(positions, fit_sizes)?;
        Ok(self.restarted())
    }

    /// Sets the pose of every limb directly.
    pub fn reset_pose(&mut self, world_from_limb: &[Pose]) -> Result<&Estimate, TrackError> {
        self.followed().tracker.reset_pose(world_from_limb)?;
        Ok(self.restarted())
    }

    /// Forgets everybody else, and the scene. The next frame may have any stamp.
    fn restarted(&mut self) -> &Estimate {
        let People { persons, scene, tentative, detector, last_detection, stamp, refusal, .. } = &mut self.people;
        persons.truncate(1);
        (*scene, *tentative) = Default::default();
        (*last_detection, *stamp, *refusal, detector.error) = (None, None, None, None);
        let person = self.followed();
        (person.present, person.stays) = (true, true);
        person.created = f64::NEG_INFINITY;
        person.set_last_tracked(f64::NEG_INFINITY);
        person.tracker.estimate()
    }

    /// Updates the pose with the next frame (K06 IV-B). On error the tracker is unchanged.
    pub fn step(&mut self, frame: &Frame) -> Result<&Estimate, TrackError> {
        self.check(frame)?;
        let id = self.followed().id;
        // What was measured on the one who is followed says nothing about others.
        let free = frame.clouds.iter().all(|cloud| cloud.scope == Scope::Free);
        let (clouds, own) = if free { (frame.clouds, &[][..]) } else { (&[][..], frame.clouds) };
        let shared = Frame { clouds, colors: &[], positions: &[], rays: &[], ..*frame };
        self.people.advance(&shared, &[(id, Frame { clouds: own, ..*frame })]);
        let person = self.followed();
        if !person.present {
            person.tracker.stop(frame.stamp);
            if !(frame.stamp - person.last_tracked < AWAY) {
                person.created = f64::INFINITY;
                person.set_last_tracked(f64::NEG_INFINITY);
                self.people.persons.truncate(1);
            }
        }
        Ok(self.estimate())
    }

    /// The one who is followed.
    fn followed(&mut self) -> &mut Person {
        &mut self.people.persons[0]
    }
}

/// Queries of the body that is followed.
impl Deref for Tracker {
    type Target = BodyTracker;

    fn deref(&self) -> &BodyTracker {
        &self.people.persons[0].tracker
    }
}

/// Edits of the body that is followed.
impl DerefMut for Tracker {
    fn deref_mut(&mut self) -> &mut BodyTracker {
        &mut self.followed().tracker
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::Model;
    use crate::testing::{before_wall, moved, put_board, standing, with_frame};

    /// A lamp beside the head: inside the body's box, but farther from the body than its pixels are.
    const LAMP: Vec3 = Vec3::new(0.34, -0.76, 2.6);

    fn with_lamp(model: &Model, poses: &[Pose]) -> Vec<u16> {
        let mut pixels = before_wall(&model.body, poses);
        put_board(&mut pixels, LAMP, [0.06; 2]);
        pixels
    }

    /// Numbers of candidates in successive frames, for a body that was set at these poses.
    fn candidates(poses: &[Pose], images: &[&[u16]]) -> Vec<usize> {
        let mut tracker = Tracker::new(standing().0.body, Config::default()).unwrap();
        tracker.reset_pose(poses).unwrap();
        let feed = |(number, pixels): (usize, &&[u16])| {
            with_frame(pixels, number as f64 / 30.0, |frame| tracker.step(frame).unwrap().sources[0].count)
        };
        images.iter().enumerate().map(feed).collect()
    }

    #[test]
    fn detections_of_others_have_the_sites_of_their_bodies_after_an_edit_of_the_followed_one() {
        let (model, poses) = standing();
        let aside = moved(&poses, 2.0 * Vec3::X);
        let sites = 0..model.body.sites().len();
        let all: Vec<_> = sites.map(|site| (site, model.body.site_position(&aside, site))).collect();
        let mut tracker = Tracker::new(model.body.clone(), Config::default()).unwrap();
        tracker.reset_pose(&poses).unwrap();
        tracker.people.add(&all, false).unwrap();
        tracker.remove_limb("l_upperarm").unwrap();
        let (edited, other) = (tracker.body(), &tracker.people.persons[1]);
        assert!(edited.sites().len() < model.body.sites().len());
        let named = edited.sites().iter().enumerate().map(|(site, of)| {
            let position = all[model.body.site_index(&of.name).unwrap()].1;
            crate::PositionRelation { site, position, weight: 1.0, bias: 0.0, source: 0 }
        });
        let own = tracker.people.own_positions(other, &named.collect::<Vec<_>>());
        assert_eq!(own.len(), edited.sites().len());
        assert!(own.iter().all(|of| of.position == all[of.site].1), "{own:?}");
    }

    #[test]
    fn what_stands_beside_the_body_from_the_start_is_scene_and_what_comes_later_is_not() {
        let (model, poses) = standing();
        let (lamp, alone) = (with_lamp(&model, &poses), before_wall(&model.body, &poses));
        let without = candidates(&poses, &[alone.as_slice(); 4]);
        assert!(without[3] > 1000, "{without:?}");
        assert_eq!(candidates(&poses, &[lamp.as_slice(); 4])[3], without[3]);
        let comes = candidates(&poses, &[alone.as_slice(), &alone, &alone, &lamp]);
        assert!(comes[3] > without[3] + 20, "it may be a hand: {comes:?}");
    }

    #[test]
    fn a_body_that_stands_still_becomes_no_scene_even_if_its_pose_was_set_a_little_off() {
        let (model, poses) = standing();
        let pixels = before_wall(&model.body, &poses);
        let off = |off: f64| candidates(&moved(&poses, off * Vec3::X), &[pixels.as_slice(); 70]);
        let [set, beside] = [0.0, 0.08].map(off);
        assert_eq!(set[69], set[2]);
        assert!(beside[69] + 10 > set[2], "{} of {}", beside[69], set[2]);
    }
}
