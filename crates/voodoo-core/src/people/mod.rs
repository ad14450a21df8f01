//! Tracks several persons at once. Each has a persistent number and a tracker of its own, and every frame is divided among the
//! trackers.
//!
//! A pixel is assigned to the person whose surface explains it. Pixels that no person explains may show a new person. A person
//! who returns gets the same number again if size, position and time agree.

mod assign;
mod births;
mod clothes;
pub(crate) mod one;
mod options;
mod person;
mod pixel_assignment;
mod refusal;
mod scene_model;
mod tentative_tracks;

use crate::body::Body;
use crate::config::Config;
use crate::detect::{BoundDetector, Detect, DetectError};
use crate::error::{TrackError, Unexpected};
use crate::math::Vec3;
use crate::observation::frame::{DetectedPerson, Frame, PositionRelation};
use crate::relocalize::ENOUGH_ODDS;
use crate::threads::Threads;
use crate::tracker::BodyTracker;
pub use options::PeopleOptions;
use person::Person;
use pixel_assignment::{PixelAssignment, PredictedBody};
pub use refusal::Refusal;
use scene_model::SceneModel;
use std::borrow::Cow;
use tentative_tracks::{SAME_PERSON, TentativeTracks};

/// Two tracks whose roots are nearer than this are duplicates, meters.
const ONE_BODY: f64 = 0.2;

/// Tracks several persons through a sequence of frames.
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Body, Config, Frame, HumanModel, People, PeopleOptions};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let mut people = People::new(body.clone(), Config::default(), PeopleOptions::default())?;
/// for x in [0.0, 2.0] {
///     let standing = body.rest_pose(Pose::from_translation(Vec3::X * x));
///     let sites = 0..body.sites().len();
///     people.add(&sites.map(|site| (site, body.site_position(&standing, site))).collect::<Vec<_>>(), true)?;
/// }
/// let numbers: Vec<usize> = people.present().map(|(number, _tracker)| number).collect();
/// assert_eq!(numbers, [1, 2]);
/// people.step(&Frame::empty(0.0), &[])?;
/// assert_eq!(people.present().count(), 0); // nothing in the frame supports them
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct People {
    prototype: Body,
    config: Config,
    options: PeopleOptions,
    persons: Vec<Person>,
    next_id: usize,
    assignment: PixelAssignment,
    scene: SceneModel,
    tentative: TentativeTracks,
    detector: BoundDetector,
    last_detection: Option<f64>,
    refusal: Option<Refusal>,
    stamp: Option<f64>,
    threads: Threads,
}

impl People {
    /// Returns a tracker of no persons. Every new person gets a copy of `prototype`.
    pub fn new(prototype: Body, config: Config, options: PeopleOptions) -> Result<Self, TrackError> {
        config.check()?;
        let threads = Threads::new(&config)?;
        Ok(Self {
            prototype,
            options,
            persons: Vec::new(),
            next_id: 1,
            assignment: PixelAssignment::default(),
            scene: SceneModel::default(),
            tentative: TentativeTracks::default(),
            detector: BoundDetector::default(),
            last_detection: None,
            refusal: None,
            stamp: None,
            threads,
            config: Config { threads: 1, ..config },
        })
    }

    /// Returns the tracker with a detector; every person's tracker gets one of its own. Without a detector no person is found,
    /// and each person to be tracked has to be added by [`Self::add`].
    pub fn with_detector(mut self, detector: Box<dyn Detect>) -> Self {
        self.detector.set(Some(detector), &self.prototype);
        self
    }

    /// The error of a detector in the last step, if one failed: that of the shared detector, else that of a person's.
    pub fn detector_error(&self) -> Option<&DetectError> {
        self.detector.error.as_ref().or_else(|| self.persons.iter().find_map(|person| person.tracker.detector_error()))
    }

    /// Why somebody who was detected in the last step is not tracked; `None` if nobody was, or everybody is.
    pub fn refusal(&self) -> Option<Refusal> {
        self.refusal
    }

    /// Returns the body that every new person starts from.
    pub fn prototype(&self) -> &Body {
        &self.prototype
    }

    /// Returns number and tracker of every present person, in the order in which they were created.
    pub fn present(&self) -> impl Iterator<Item = (usize, &BodyTracker)> {
        self.persons.iter().filter(|person| person.present).map(|person| (person.id, &person.tracker))
    }

    /// Whether the next frame needs color pictures: a person's clothes have not been updated for a while, or an absent person may
    /// return.
    pub fn needs_colors(&self) -> bool {
        let stamp = self.stamp.unwrap_or(f64::NEG_INFINITY);
        self.persons.iter().any(|person| !person.is_tracked() || person.are_clothes_due(stamp))
    }

    /// Tracks only persons with these numbers from now on; with `None` all persons.
    pub fn restrict_to(&mut self, ids: Option<Vec<usize>>) {
        self.options.only = ids;
        self.prune_tracks();
    }

    /// Adds a person at positions of named sites (index of the site, world position), and returns their number: that of a lost or
    /// absent person who may have moved there, or the number of a new one. On error no person is added.
    pub fn add(&mut self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<usize, TrackError> {
        let stamp = self.stamp.unwrap_or(f64::NEG_INFINITY);
        let mut person = self.nobody_yet(stamp)?;
        person.tracker.reset(positions, fit_sizes)?;
        person.present = true;
        person.place = person.tracker.estimate().world_from_limb.first().map_or(Vec3::ZERO, |root| root.translation);
        let far = |known: &Person| known.distance_cost(person.place, stamp);
        let known = self.persons.iter_mut().filter(|known| !known.is_tracked() && far(known) < ENOUGH_ODDS);
        if let Some(known) = known.min_by(|a, b| far(a).total_cmp(&far(b))) {
            known.tracker.reset(positions, false)?;
            (known.present, known.place) = (true, person.place);
            known.set_last_tracked(stamp);
            return Ok(known.id);
        }
        self.persons.push(person);
        self.next_id += 1;
        Ok(self.next_id - 1)
    }

    /// Returns a person with the next number, who is not present yet.
    fn nobody_yet(&self, stamp: f64) -> Result<Person, TrackError> {
        let (body, config) = (self.prototype.clone(), self.config.clone());
        Person::new(self.next_id, body, config, self.detector.fresh(), stamp)
    }

    /// Updates all persons with the next frame. `own` has what was measured on single persons in addition, by their numbers: points,
    /// positions and rays, and color pictures, to which nobody else is fitted. On error nothing changes.
    pub fn step(&mut self, frame: &Frame, own: &[(usize, Frame)]) -> Result<(), TrackError> {
        frame.check(&self.prototype, self.stamp)?;
        for (id, other) in own {
            other.check(&self.prototype, self.stamp)?;
            let what = format_args!("stamp of what was measured on person {id}");
            Unexpected::unless(other.stamp == frame.stamp, what, format_args!("{}", frame.stamp), other.stamp)?;
            let person = self.persons.iter().find(|person| person.id == *id);
            person.map_or(Ok(()), |person| person.tracker.check_colors(other))?;
        }
        self.advance(frame, own);
        Ok(())
    }

    /// Updates all persons with a frame that was checked.
    fn advance(&mut self, frame: &Frame, own: &[(usize, Frame)]) {
        self.stamp = Some(frame.stamp);
        self.refusal = None;
        self.detector.error = None;
        if self.config.background {
            self.scene.known.register(frame);
        }
        self.assign_pixels(frame);
        let of_detection = self.match_detections(frame);
        let detected = frame.detections.iter().zip(&of_detection).filter_map(|(detection, person)| {
            person.map(|number| (number, self.own_positions(&self.persons[number], detection.positions)))
        });
        let detected: Vec<_> = detected.collect();
        self.follow(frame, own, &detected);
        for person in &self.persons {
            if let Some((image, pixels)) = person.tracker.moved_to.as_ref().filter(|_| person.present) {
                self.scene.known.release(frame, *image, pixels);
            }
        }
        // A lost person must not become part of the scene, and is searched for in the pixels assigned to them as well.
        if !self.persons.iter().any(|person| person.present && !person.is_tracked()) {
            self.scene.learn(frame, &self.assignment.owners);
        }
        for number in (0..self.persons.len()).filter(|number| !self.persons[*number].is_tracked()) {
            self.assignment.release(number..=number);
        }
        self.prune_tracks();
        self.find_new(frame, &of_detection);
        // Persons who have been absent for too long are deleted.
        let forget_after = self.options.forget_after;
        self.persons
            .retain(|person| person.present || person.followed || frame.stamp - person.last_tracked < forget_after);
    }

    /// Assigns every pixel and free point to the person whose surface explains it.
    fn assign_pixels(&mut self, frame: &Frame) {
        for person in self.persons.iter_mut().filter(|person| person.present) {
            person.tracker.predict(frame.stamp, &mut person.expected);
        }
        let predicted = (0..)
            .zip(&self.persons)
            .filter(|(_, person)| person.present)
            .map(|(number, person)| PredictedBody { number, body: person.tracker.body(), poses: &person.expected });
        self.assignment.assign(frame, &self.scene.known, predicted);
    }

    /// Returns the index of the tracked person whom each of the frame's detections shows, if it shows one.
    fn match_detections(&self, frame: &Frame) -> Vec<Option<usize>> {
        if frame.detections.is_empty() {
            return Vec::new();
        }
        let tracked: Vec<usize> = (0..self.persons.len()).filter(|number| self.persons[*number].is_tracked()).collect();
        let distance = |detection: &DetectedPerson, person: &Person| {
            let (body, positions) = (person.tracker.body(), self.own_positions(person, detection.positions));
            let each = positions.iter().map(|of| body.site_position(&person.expected, of.site).distance(of.position));
            if positions.is_empty() { f64::INFINITY } else { each.sum::<f64>() / positions.len() as f64 }
        };
        let costs = |detection| tracked.iter().map(|number| distance(detection, &self.persons[*number])).collect();
        let costs: Vec<Vec<f64>> = frame.detections.iter().map(costs).collect();
        let assigned = assign::assign(&costs, |_| SAME_PERSON);
        assigned.into_iter().map(|column| column.map(|column| tracked[column])).collect()
    }

    /// Steps every tracker with its own pixels and points, and with the positions in the detections that show the person (number).
    fn follow(&mut self, frame: &Frame, own: &[(usize, Frame)], detected: &[(usize, Vec<PositionRelation>)]) {
        let (assignment, scene) = (&self.assignment, &self.scene.known);
        let nothing = Frame::empty(frame.stamp);
        let work = |(number, person): (usize, &mut Person)| {
            if person.present {
                let ownership = assignment.ownership(number, scene);
                let own = own.iter().find(|(id, _)| *id == person.id).map_or(&nothing, |(_, own)| own);
                let detected = detected.iter().find(|(of, _)| *of == number).map_or(&[][..], |(_, detected)| detected);
                let positions = joined(frame.positions, own.positions);
                let (clouds, positions) = (joined(frame.clouds, own.clouds), joined(&positions, detected));
                let rays = joined(frame.rays, own.rays);
                // With several persons, the frame's color pictures only serve to identify them.
                let of = Frame { clouds: &clouds, positions: &positions, rays: &rays, colors: own.colors, ..*frame };
                person.tracker.step(&of, ownership);
                person.update(frame, ownership);
            }
        };
        self.threads.each(&mut self.persons, work);
    }

    /// Prunes tracks: duplicates (the one that explains fewer pixels, or the newer), and tracks outside the region or not
    /// requested. Somebody new who is a duplicate is the other person, where the new track is if that explains more.
    fn prune_tracks(&mut self) {
        for newer in 0..self.persons.len() {
            let place = self.persons[newer].place;
            for older in 0..newer {
                let [a, b] = [older, newer].map(|number| &self.persons[number]);
                if a.is_tracked() && b.is_tracked() && a.place.distance(place) < ONE_BODY {
                    let more = !a.followed && self.assignment.count(newer) > self.assignment.count(older);
                    let new = b.is_new();
                    if more && new {
                        let (before, rest) = self.persons.split_at_mut(newer);
                        before[older].exchange_track(&mut rest[0]);
                    }
                    let fewer = if more && !new { older } else { newer };
                    self.persons[fewer].present = false;
                }
            }
            let is_followed = self.options.allows(place) && self.options.includes(self.persons[newer].id);
            self.persons[newer].present &= is_followed;
        }
    }
}

/// Both lists as one; copied only where neither is empty.
fn joined<'a, T: Copy>(first: &'a [T], second: &'a [T]) -> Cow<'a, [T]> {
    match (first, second) {
        (_, []) => first.into(),
        ([], _) => second.into(),
        _ => [first, second].concat().into(),
    }
}
