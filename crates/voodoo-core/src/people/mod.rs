//! Several persons at once, each with a number that lasts: one tracker each, which share every frame between them.
//!
//! A pixel belongs to the person whose surface explains it; what nobody explains may be somebody new. Who comes back gets their
//! number back, where size, place and time agree.

mod assign;
mod claims;
mod clothes;
mod person;
mod scene;
mod strangers;
mod wanted;

use crate::body::{Body, Model};
use crate::config::Config;
use crate::detect::{BoundDetector, Detect, DetectError, Detected, DetectionQuery, Surroundings, sized};
use crate::error::TrackError;
use crate::math::Vec3;
use crate::observation::background::Background;
use crate::observation::frame::Frame;
use crate::observation::share::NOBODY;
use crate::relocalize::SAME_PERSON;
use crate::tracker::Tracker;
use claims::{Claimant, Claims};
use clothes::Clothes;
use person::Person;
use rayon::ThreadPool;
use rayon::prelude::*;
use scene::Scene;
use strangers::{Stranger, Strangers};
pub use wanted::Options;

/// The detector looks at what nobody explains this often at most, seconds.
const LOOK_EVERY: f64 = 0.06;
/// Two bodies whose roots are nearer than this are one, metres.
const ONE_BODY: f64 = 0.3;
/// Who was there for less than this is not remembered, seconds.
const KNOWN_AFTER: f64 = 1.0;

/// Follows several persons through frames.
#[derive(Debug)]
pub struct People {
    prototype: Body,
    config: Config,
    options: Options,
    persons: Vec<Person>,
    next_id: usize,
    claims: Claims,
    scene: Scene,
    strangers: Strangers,
    detector: BoundDetector,
    looked: Option<f64>,
    stamp: Option<f64>,
    threads: Option<ThreadPool>,
}

impl People {
    /// Everybody who comes gets a copy of `prototype`.
    pub fn new(prototype: Body, config: Config, options: Options) -> Result<Self, TrackError> {
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
            claims: Claims::default(),
            scene: Scene::default(),
            strangers: Strangers::default(),
            detector: BoundDetector::default(),
            looked: None,
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
    pub fn there(&self) -> impl Iterator<Item = (usize, &Tracker)> {
        self.persons.iter().filter(|person| person.there).map(|person| (person.id, &person.tracker))
    }

    /// Whether colour pictures would tell something in the next frame: of somebody whose clothes were not looked at for a while,
    /// or of somebody who may come back.
    pub fn wants_colors(&self) -> bool {
        let stamp = self.stamp.unwrap_or(f64::NEG_INFINITY);
        self.persons.iter().any(|person| !person.tracked() || person.due(stamp))
    }

    /// Follows these numbers and nobody else from now on; with `None` everybody.
    pub fn only(&mut self, ids: Option<Vec<usize>>) {
        self.options.only = ids;
        self.part();
    }

    /// Somebody is where these positions of named sites say (index of the site, world position): who was lost or away and can have
    /// come there, or somebody new; their number. On error nobody came.
    pub fn add(&mut self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<usize, TrackError> {
        let stamp = self.stamp.unwrap_or(f64::NEG_INFINITY);
        let mut person = self.nobody_yet(stamp)?;
        person.tracker.reset(positions, fit_sizes)?;
        person.there = true;
        person.place = person.tracker.estimate().world_from_limb.first().map_or(Vec3::ZERO, |root| root.translation);
        let far = |known: &Person| came_from(known, person.place, stamp);
        let known = self.persons.iter_mut().filter(|known| !known.tracked() && far(known) < NEW);
        if let Some(known) = known.min_by(|a, b| far(a).total_cmp(&far(b))) {
            known.tracker.reset(positions, false)?;
            (known.there, known.place, known.seen) = (true, person.place, stamp);
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
        self.scene.meet(frame);
        self.share_out(frame);
        self.follow(frame, own);
        self.scene.learn(frame, self.claims.owners());
        self.part();
        self.look(frame);
        self.forget(frame.stamp);
        Ok(())
    }

    /// Gives every pixel and free point to whose surface explains it.
    fn share_out(&mut self, frame: &Frame) {
        for person in self.persons.iter_mut().filter(|person| person.there) {
            person.tracker.expect(frame.stamp, &mut person.expected);
        }
        // Who is lost explains nothing.
        let claimants = (0..)
            .zip(&self.persons)
            .filter(|(_, person)| person.tracked())
            .map(|(number, person)| Claimant { number, body: person.tracker.body(), poses: &person.expected });
        self.claims.settle(frame, self.scene.known(), claimants);
    }

    /// Every tracker by its share.
    fn follow(&mut self, frame: &Frame, own: &[(usize, Frame)]) {
        let (claims, scene) = (&self.claims, self.scene.known());
        let work = |(number, person): (usize, &mut Person)| {
            if person.there {
                let share = claims.share(number, scene);
                let of = own.iter().find(|(id, _)| *id == person.id).map_or(frame, |(_, frame)| frame);
                person.tracker.step_among(of, share);
                person.note(frame, share);
            }
        };
        match &self.threads {
            // Every person is worked on by one thread: the result does not depend on their number.
            Some(pool) => pool.install(|| self.persons.par_iter_mut().enumerate().for_each(work)),
            None => self.persons.iter_mut().enumerate().for_each(work),
        }
    }

    /// Of two on one body the one that explains less of it goes, or the younger; who leaves the region goes, and who is not wanted.
    fn part(&mut self) {
        for younger in 0..self.persons.len() {
            let place = self.persons[younger].place;
            for older in 0..younger {
                let [a, b] = [older, younger].map(|number| &self.persons[number]);
                if a.tracked() && b.tracked() && a.place.distance(place) < ONE_BODY {
                    let more = self.claims.explained(younger) > self.claims.explained(older);
                    self.persons[if more { older } else { younger }].there = false;
                }
            }
            let wanted = self.options.allows(place) && self.options.wants(self.persons[younger].id);
            self.persons[younger].there &= wanted;
        }
    }

    /// Looks for somebody at what nobody explains.
    fn look(&mut self, frame: &Frame) {
        let everybody_there = self.options.only.as_ref().is_some_and(|only| {
            only.iter().all(|id| self.persons.iter().any(|person| person.id == *id && person.tracked()))
        });
        if everybody_there || !self.detector.knows() || self.looked.is_some_and(|last| frame.stamp - last < LOOK_EVERY)
        {
            return;
        }
        self.looked = Some(frame.stamp);
        self.strangers.fade(frame.stamp);
        self.detect(frame, DetectionQuery::New);
        let believed = self.strangers.believed(frame.stamp);
        if !believed.is_empty() {
            self.welcome(frame, &believed);
        }
    }

    fn detect(&mut self, frame: &Frame, query: DetectionQuery) {
        for (number, image) in frame.images.iter().enumerate() {
            let scene = self.scene.known().of(image).map_or(&[][..], Background::depth);
            let around = Surroundings {
                ground: frame.ground,
                excluded: frame.excluded,
                owners: self.claims.owners().get(number).map_or(&[], Vec::as_slice),
                // Somebody may have stood there from the start.
                background: if self.scene.is_old(number, frame.stamp) { scene } else { &[] },
                ..Surroundings::default()
            };
            for found in self.detector.look(&self.prototype, image, &around, query) {
                if !self.asked_for(frame, found.root) {
                    self.detector.reject(found.index);
                    continue;
                }
                let still = self.scene.shows(frame, number, &found.detection.pixels);
                self.strangers.note(frame.stamp, found, number, still);
            }
        }
    }

    /// Whether somebody where a person is seen is to be followed.
    fn asked_for(&self, frame: &Frame, place: Vec3) -> bool {
        let others = self.others_than(None);
        self.options.allows(place) && self.options.room(frame, place, &others).is_some()
    }

    /// Numbers and places of those who are seen.
    fn others_than(&self, one: Option<usize>) -> Vec<(usize, Vec3)> {
        let others = (0..self.persons.len()).filter(|number| self.persons[*number].tracked() && Some(*number) != one);
        others.map(|number| (number, self.persons[number].place)).collect()
    }

    /// Those who are believed to be persons get a tracker: their own when they are somebody who was there. Who they are is asked
    /// together with all others who are seen.
    fn welcome(&mut self, frame: &Frame, believed: &[Stranger]) {
        let absent: Vec<usize> = (0..self.persons.len()).filter(|number| self.may_be(*number, believed)).collect();
        if !absent.is_empty() {
            self.detect(frame, DetectionQuery::All);
            self.strangers.leave_out(believed);
        }
        let cost = |stranger: &Stranger| {
            let clothes = self.clothes_of(frame, stranger);
            let size = |number: usize| self.persons[number].unlike(self.detected(stranger));
            let cost =
                |number: &usize| person_cost(&self.persons[*number], size(*number), stranger, &clothes, frame.stamp);
            absent.iter().map(cost).collect()
        };
        let costs: Vec<Vec<f64>> = believed.iter().chain(self.strangers.seen_at(frame.stamp)).map(cost).collect();
        for (stranger, given) in believed.iter().zip(assign::assign(&costs, NEW)) {
            let known = given.map(|column| absent[column]);
            let others = self.others_than(known);
            let Some(leaves) = self.options.room(frame, stranger.place, &others) else { continue };
            let came = match known {
                Some(number) => self.take_up(frame, stranger, number),
                None => self.bear(frame, stranger),
            };
            if let Some(leaves) = leaves.filter(|_| came) {
                self.persons[leaves].there = false;
            }
            if came && self.options.limit.is_some_and(|limit| self.there().count() > limit) {
                // Somebody else takes the place of who is hidden.
                self.persons.iter_mut().for_each(|person| person.there &= person.tracked());
            }
        }
    }

    /// Whether one of the strangers may be this person: who is away, and who follows less than what such a stranger shows beside
    /// them.
    fn may_be(&self, number: usize, strangers: &[Stranger]) -> bool {
        let person = &self.persons[number];
        let beside = |stranger: &&Stranger| stranger.place.distance(person.place) < SAME_PERSON;
        let shown = strangers.iter().filter(beside).map(|stranger| stranger.detection.pixels.len()).max();
        !person.tracked() || shown.is_some_and(|shown| self.claims.explained(number) < shown)
    }

    /// What the detector reported of a stranger.
    fn detected<'a>(&'a self, stranger: &'a Stranger) -> Detected<'a> {
        Detected { detection: &stranger.detection, map: self.detector.map() }
    }

    /// What a stranger wears.
    fn clothes_of(&self, frame: &Frame, stranger: &Stranger) -> Clothes {
        let mut clothes = Clothes::default();
        if let Some((body, poses)) = sized(&Model::new(self.prototype.clone()), self.detected(stranger)) {
            let free = |image: usize, pixel: usize| self.claims.owners()[image].get(pixel) == Some(&NOBODY);
            clothes.look(frame, &body, &poses, free);
        }
        clothes
    }

    /// Somebody new, if they are there.
    fn bear(&mut self, frame: &Frame, stranger: &Stranger) -> bool {
        let full = self.persons.len() >= usize::from(NOBODY);
        if full || !self.options.wants(self.next_id) {
            return false;
        }
        let Ok(person) = self.nobody_yet(frame.stamp) else { return false };
        self.persons.push(person);
        let came = self.take_up(frame, stranger, self.persons.len() - 1);
        if came {
            self.next_id += 1;
        } else {
            self.persons.pop();
        }
        came
    }

    /// Starts a person's tracker where a stranger is seen; whether they are there.
    fn take_up(&mut self, frame: &Frame, stranger: &Stranger, number: usize) -> bool {
        self.scene.release(frame, stranger.image, &stranger.detection.pixels);
        let person = &mut self.persons[number];
        if !self.options.wants(person.id) {
            return false;
        }
        let known = person.born < frame.stamp;
        let share = self.claims.share(number, self.scene.known());
        let detected = Detected { detection: &stranger.detection, map: self.detector.map() };
        let came = person.tracker.begin(frame, share, detected, known);
        if came {
            person.there = true;
            person.measure(detected);
        }
        person.note(frame, share);
        // Who was lost may have been found by their own tracker in this very frame.
        let place = person.place;
        let twice = self.others_than(Some(number)).iter().any(|(_, other)| other.distance(place) < ONE_BODY);
        self.persons[number].there &= !twice;
        came && !twice
    }

    /// Forgets who has been away for too long, and who was there for a moment only.
    fn forget(&mut self, stamp: f64) {
        let forget_after = self.options.forget_after;
        self.persons.retain(|person| {
            let remembered = person.seen - person.born >= KNOWN_AFTER && stamp - person.seen < forget_after;
            person.there || remembered
        });
    }
}

/// Cost of somebody new.
const NEW: f64 = 4.0;
/// How far a person comes at once and in a second, metres.
const COMES: [f64; 2] = [0.4, 1.2];
/// How unlike the clothes of one person are who is seen twice, and the spread of that.
const CLOTHES: [f64; 2] = [0.10, 0.07];
/// What like clothes speak for a person.
const LIKE_CLOTHES: f64 = 3.0;

/// What speaks against a person's having come to a place.
fn came_from(person: &Person, place: Vec3, stamp: f64) -> f64 {
    let reach = COMES[0] + COMES[1] * (stamp - person.seen);
    let far = person.place.distance(place) / reach;
    if far > 2.0 { f64::INFINITY } else { 0.5 * far * far }
}

/// What speaks against a stranger's being this person; `size`: of which their sizes do.
fn person_cost(person: &Person, size: f64, stranger: &Stranger, clothes: &Clothes, stamp: f64) -> f64 {
    let far = came_from(person, stranger.place, stamp);
    let unlike = person.clothes.unlike(clothes);
    let color = unlike.map_or(0.0, |unlike| 0.5 * ((unlike - CLOTHES[0]).max(0.0) / CLOTHES[1]).powi(2) - LIKE_CLOTHES);
    far + size + color
}
