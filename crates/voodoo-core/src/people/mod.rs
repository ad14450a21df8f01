//! Several persons at once, each with a number that lasts: one tracker each, which share every frame between them.
//!
//! A pixel belongs to the person whose surface explains it; what nobody explains may be somebody new. Who comes back gets their
//! number back, where size, place and time agree.

mod assign;
mod clothes;
mod options;
mod person;
mod pixel_assignment;
mod scene_model;
mod tentative_tracks;

use crate::body::{Body, Model};
use crate::config::Config;
use crate::detect::{BoundDetector, Detect, DetectError, Detected, DetectionQuery, Surroundings, fit_body};
use crate::error::TrackError;
use crate::math::Vec3;
use crate::observation::background::Background;
use crate::observation::frame::Frame;
use crate::observation::ownership::NO_OWNER;
use crate::relocalize::SAME_PERSON;
use crate::tracker::Tracker;
use clothes::Clothes;
pub use options::PeopleOptions;
use person::Person;
use pixel_assignment::{PixelAssignment, PredictedBody};
use rayon::ThreadPool;
use rayon::prelude::*;
use scene_model::SceneModel;
use tentative_tracks::{TentativeTrack, TentativeTracks};

/// The detector looks at what nobody explains this often at most, seconds.
const DETECT_EVERY: f64 = 0.06;
/// Two bodies whose roots are nearer than this are one, meters.
const ONE_BODY: f64 = 0.3;
/// Who was there for less than this is not remembered, seconds.
const KNOWN_AFTER: f64 = 1.0;

/// Follows several persons through frames.
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
    stamp: Option<f64>,
    threads: Option<ThreadPool>,
}

impl People {
    /// Everybody who comes gets a copy of `prototype`.
    pub fn new(prototype: Body, config: Config, options: PeopleOptions) -> Result<Self, TrackError> {
        let threads = match config.threads {
            1 => None,
            count => Some(rayon::ThreadPoolBuilder::new().num_threads(count).build().map_err(|error| {
                TrackError::measurement("threads", "a number of threads the system can start", error.to_string())
            })?),
        };
        Ok(Self {
            prototype,
            config: Config { threads: 1, ..config },
            options,
            persons: Vec::new(),
            next_id: 1,
            assignment: PixelAssignment::default(),
            scene: SceneModel::default(),
            tentative: TentativeTracks::default(),
            detector: BoundDetector::default(),
            last_detection: None,
            stamp: None,
            threads,
        })
    }

    /// The same with a detector, of which every person's tracker gets one of its own. Without one, nobody is found: who is to be
    /// followed is [`Self::add`]ed.
    pub fn with_detector(mut self, detector: Box<dyn Detect>) -> Self {
        self.detector.set(Some(detector), &self.prototype);
        self
    }

    /// Why a detector could not look in the last step, if one could not: that of all, else that of a person.
    pub fn detector_error(&self) -> Option<&DetectError> {
        self.detector.error().or_else(|| self.persons.iter().find_map(|person| person.tracker.detector_error()))
    }

    /// What everybody's body starts from.
    pub fn prototype(&self) -> &Body {
        &self.prototype
    }

    /// Those who are there: their number and their tracker, in the order in which they came.
    pub fn present(&self) -> impl Iterator<Item = (usize, &Tracker)> {
        self.persons.iter().filter(|person| person.present).map(|person| (person.id, &person.tracker))
    }

    /// Whether color pictures would tell something in the next frame: of somebody whose clothes were not looked at for a while,
    /// or of somebody who may come back.
    pub fn needs_colors(&self) -> bool {
        let stamp = self.stamp.unwrap_or(f64::NEG_INFINITY);
        self.persons.iter().any(|person| !person.is_tracked() || person.are_clothes_due(stamp))
    }

    /// Follows these numbers and nobody else from now on; with `None` everybody.
    pub fn restrict_to(&mut self, ids: Option<Vec<usize>>) {
        self.options.only = ids;
        self.prune_tracks();
    }

    /// Somebody is where these positions of named sites say (index of the site, world position): who was lost or away and can have
    /// come there, or somebody new; their number. On error nobody came.
    pub fn add(&mut self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<usize, TrackError> {
        let stamp = self.stamp.unwrap_or(f64::NEG_INFINITY);
        let mut person = self.nobody_yet(stamp)?;
        person.tracker.reset(positions, fit_sizes)?;
        person.present = true;
        person.place = person.tracker.estimate().world_from_limb.first().map_or(Vec3::ZERO, |root| root.translation);
        let far = |known: &Person| distance_cost(known, person.place, stamp);
        let known = self.persons.iter_mut().filter(|known| !known.is_tracked() && far(known) < NEW);
        if let Some(known) = known.min_by(|a, b| far(a).total_cmp(&far(b))) {
            known.tracker.reset(positions, false)?;
            (known.present, known.place, known.last_tracked) = (true, person.place, stamp);
            return Ok(known.id);
        }
        self.persons.push(person);
        self.next_id += 1;
        Ok(self.next_id - 1)
    }

    /// Somebody who is not there yet, with the next number.
    fn nobody_yet(&self, stamp: f64) -> Result<Person, TrackError> {
        let (body, config) = (self.prototype.clone(), self.config.clone());
        Person::new(self.next_id, body, config, self.detector.fresh(), stamp)
    }

    /// The next instant; `own` has the frames of those of whom more was measured than of others. On error everything is as before.
    pub fn step(&mut self, frame: &Frame, own: &[(usize, Frame)]) -> Result<(), TrackError> {
        frame.check(&self.prototype, self.stamp)?;
        own.iter().try_for_each(|(_, frame)| frame.check(&self.prototype, self.stamp))?;
        self.stamp = Some(frame.stamp);
        self.detector.clear_error();
        self.scene.register(frame);
        self.assign_pixels(frame);
        self.follow(frame, own);
        self.scene.learn(frame, self.assignment.owners());
        self.prune_tracks();
        self.detect_new(frame);
        self.delete_expired(frame.stamp);
        Ok(())
    }

    /// Gives every pixel and free point to whose surface explains it.
    fn assign_pixels(&mut self, frame: &Frame) {
        for person in self.persons.iter_mut().filter(|person| person.present) {
            person.tracker.predict(frame.stamp, &mut person.expected);
        }
        // Who is lost explains nothing.
        let predicted = (0..)
            .zip(&self.persons)
            .filter(|(_, person)| person.is_tracked())
            .map(|(number, person)| PredictedBody { number, body: person.tracker.body(), poses: &person.expected });
        self.assignment.assign(frame, self.scene.known(), predicted);
    }

    /// Every tracker by its share.
    fn follow(&mut self, frame: &Frame, own: &[(usize, Frame)]) {
        let (assignment, scene) = (&self.assignment, self.scene.known());
        let work = |(number, person): (usize, &mut Person)| {
            if person.present {
                let ownership = assignment.ownership(number, scene);
                let of = own.iter().find(|(id, _)| *id == person.id).map_or(frame, |(_, frame)| frame);
                person.tracker.step_owned(of, ownership);
                person.update(frame, ownership);
            }
        };
        match &self.threads {
            // Every person is worked on by one thread: the result does not depend on their number.
            Some(pool) => pool.install(|| self.persons.par_iter_mut().enumerate().for_each(work)),
            None => self.persons.iter_mut().enumerate().for_each(work),
        }
    }

    /// Of two on one body the one that explains less of it goes, or the younger; who leaves the region goes, and who is not wanted.
    fn prune_tracks(&mut self) {
        for younger in 0..self.persons.len() {
            let place = self.persons[younger].place;
            for older in 0..younger {
                let [a, b] = [older, younger].map(|number| &self.persons[number]);
                if a.is_tracked() && b.is_tracked() && a.place.distance(place) < ONE_BODY {
                    let more = self.assignment.count(younger) > self.assignment.count(older);
                    self.persons[if more { older } else { younger }].present = false;
                }
            }
            let is_followed = self.options.allows(place) && self.options.includes(self.persons[younger].id);
            self.persons[younger].present &= is_followed;
        }
    }

    /// Looks for somebody at what nobody explains.
    fn detect_new(&mut self, frame: &Frame) {
        let everybody_there = self.options.only.as_ref().is_some_and(|only| {
            only.iter().all(|id| self.persons.iter().any(|person| person.id == *id && person.is_tracked()))
        });
        if everybody_there
            || !self.detector.knows()
            || self.last_detection.is_some_and(|last| frame.stamp - last < DETECT_EVERY)
        {
            return;
        }
        self.last_detection = Some(frame.stamp);
        self.tentative.prune(frame.stamp);
        self.detect(frame, DetectionQuery::New);
        let confirmed = self.tentative.take_confirmed(frame.stamp);
        if !confirmed.is_empty() {
            self.associate(frame, &confirmed);
        }
    }

    fn detect(&mut self, frame: &Frame, query: DetectionQuery) {
        for (number, image) in frame.images.iter().enumerate() {
            let scene = self.scene.known().of_image(image).map_or(&[][..], Background::depth);
            let around = Surroundings {
                ground: frame.ground,
                excluded: frame.excluded,
                owners: self.assignment.owners().get(number).map_or(&[], Vec::as_slice),
                // Somebody may have stood there from the start.
                background: if self.scene.is_old(number, frame.stamp) { scene } else { &[] },
                ..Surroundings::default()
            };
            for found in self.detector.detect(&self.prototype, image, &around, query) {
                if !self.is_requested(frame, found.root) {
                    self.detector.reject(found.index);
                    continue;
                }
                let still = self.scene.is_still(frame, number, &found.detection.pixels);
                self.tentative.update(frame.stamp, found, number, still);
            }
        }
    }

    /// Whether somebody where a person is seen is to be followed.
    fn is_requested(&self, frame: &Frame, place: Vec3) -> bool {
        let others = self.tracked_except(None);
        self.options.allows(place) && self.options.room(frame, place, &others).is_some()
    }

    /// Numbers and places of those who are seen.
    fn tracked_except(&self, one: Option<usize>) -> Vec<(usize, Vec3)> {
        let others =
            (0..self.persons.len()).filter(|number| self.persons[*number].is_tracked() && Some(*number) != one);
        others.map(|number| (number, self.persons[number].place)).collect()
    }

    /// Those who are believed to be persons get a tracker: their own when they are somebody who was there. Who they are is asked
    /// together with all others who are seen.
    fn associate(&mut self, frame: &Frame, confirmed: &[TentativeTrack]) {
        let absent: Vec<usize> = (0..self.persons.len()).filter(|number| self.may_match(*number, confirmed)).collect();
        if !absent.is_empty() {
            self.detect(frame, DetectionQuery::All);
            self.tentative.discard(confirmed);
        }
        let cost = |track: &TentativeTrack| {
            let clothes = self.clothes_of_track(frame, track);
            let size = |number: usize| self.persons[number].stature_cost(self.detected(track));
            let cost =
                |number: &usize| person_cost(&self.persons[*number], size(*number), track, &clothes, frame.stamp);
            absent.iter().map(cost).collect()
        };
        let costs: Vec<Vec<f64>> = confirmed.iter().chain(self.tentative.updated_at(frame.stamp)).map(cost).collect();
        for (track, given) in confirmed.iter().zip(assign::assign(&costs, NEW)) {
            let known = given.map(|column| absent[column]);
            let others = self.tracked_except(known);
            let Some(leaves) = self.options.room(frame, track.place, &others) else { continue };
            let came = match known {
                Some(number) => self.reactivate(frame, track, number),
                None => self.spawn(frame, track),
            };
            if let Some(leaves) = leaves.filter(|_| came) {
                self.persons[leaves].present = false;
            }
            if came && self.options.limit.is_some_and(|limit| self.present().count() > limit) {
                // Somebody else takes the place of who is hidden.
                self.persons.iter_mut().for_each(|person| person.present &= person.is_tracked());
            }
        }
    }

    /// Whether one of the strangers may be this person: who is away, and who follows less than what such a stranger shows beside
    /// them.
    fn may_match(&self, number: usize, candidates: &[TentativeTrack]) -> bool {
        let person = &self.persons[number];
        let beside = |track: &&TentativeTrack| track.place.distance(person.place) < SAME_PERSON;
        let visible = candidates.iter().filter(beside).map(|track| track.detection.pixels.len()).max();
        !person.is_tracked() || visible.is_some_and(|visible| self.assignment.count(number) < visible)
    }

    /// What the detector reported of a stranger.
    fn detected<'a>(&'a self, track: &'a TentativeTrack) -> Detected<'a> {
        Detected { detection: &track.detection, map: self.detector.map() }
    }

    /// What a stranger wears.
    fn clothes_of_track(&self, frame: &Frame, track: &TentativeTrack) -> Clothes {
        let mut clothes = Clothes::default();
        if let Some((body, poses)) = fit_body(&Model::new(self.prototype.clone()), self.detected(track)) {
            let free = |image: usize, pixel: usize| self.assignment.owners()[image].get(pixel) == Some(&NO_OWNER);
            clothes.observe(frame, &body, &poses, free);
        }
        clothes
    }

    /// Somebody new, if they are there.
    fn spawn(&mut self, frame: &Frame, track: &TentativeTrack) -> bool {
        let full = self.persons.len() >= usize::from(NO_OWNER);
        if full || !self.options.includes(self.next_id) {
            return false;
        }
        let Ok(person) = self.nobody_yet(frame.stamp) else { return false };
        self.persons.push(person);
        let came = self.reactivate(frame, track, self.persons.len() - 1);
        if came {
            self.next_id += 1;
        } else {
            self.persons.pop();
        }
        came
    }

    /// Starts a person's tracker where a stranger is seen; whether they are there.
    fn reactivate(&mut self, frame: &Frame, track: &TentativeTrack, number: usize) -> bool {
        self.scene.release(frame, track.image, &track.detection.pixels);
        let person = &mut self.persons[number];
        if !self.options.includes(person.id) {
            return false;
        }
        let known = person.created < frame.stamp;
        let ownership = self.assignment.ownership(number, self.scene.known());
        let detected = Detected { detection: &track.detection, map: self.detector.map() };
        let came = person.tracker.start_at_detection(frame, ownership, detected, known);
        if came {
            person.present = true;
            person.update_stature(detected);
        }
        person.update(frame, ownership);
        // Who was lost may have been found by their own tracker in this very frame.
        let place = person.place;
        let twice = self.tracked_except(Some(number)).iter().any(|(_, other)| other.distance(place) < ONE_BODY);
        self.persons[number].present &= !twice;
        came && !twice
    }

    /// Forgets who has been away for too long, and who was there for a moment only.
    fn delete_expired(&mut self, stamp: f64) {
        let forget_after = self.options.forget_after;
        self.persons.retain(|person| {
            let remembered =
                person.last_tracked - person.created >= KNOWN_AFTER && stamp - person.last_tracked < forget_after;
            person.present || remembered
        });
    }
}

/// Cost of somebody new.
const NEW: f64 = 4.0;
/// How far a person comes at once and in a second, meters.
const COMES: [f64; 2] = [0.4, 1.2];
/// How unlike the clothes of one person are who is seen twice, and the spread of that.
const CLOTHES: [f64; 2] = [0.10, 0.07];
/// What like clothes speak for a person.
const LIKE_CLOTHES: f64 = 3.0;

/// What speaks against a person's having come to a place.
fn distance_cost(person: &Person, place: Vec3, stamp: f64) -> f64 {
    let reach = COMES[0] + COMES[1] * (stamp - person.last_tracked);
    let far = person.place.distance(place) / reach;
    if far > 2.0 { f64::INFINITY } else { 0.5 * far * far }
}

/// What speaks against a stranger's being this person; `size`: of which their sizes do.
fn person_cost(person: &Person, size: f64, track: &TentativeTrack, clothes: &Clothes, stamp: f64) -> f64 {
    let far = distance_cost(person, track.place, stamp);
    let distance = person.clothes.distance(clothes);
    let color =
        distance.map_or(0.0, |distance| 0.5 * ((distance - CLOTHES[0]).max(0.0) / CLOTHES[1]).powi(2) - LIKE_CLOTHES);
    far + size + color
}
