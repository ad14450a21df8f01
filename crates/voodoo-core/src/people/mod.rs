//! Tracks several persons at once. Each has a persistent number and a tracker of its own, and every frame is divided among the
//! trackers.
//!
//! A pixel is assigned to the person whose surface explains it. Pixels that no person explains may show a new person. A person
//! who returns gets the same number again if size, position and time agree.

mod assign;
mod clothes;
pub(crate) mod one;
mod options;
mod person;
mod pixel_assignment;
mod scene_model;
mod tentative_tracks;

use crate::body::{Body, Model};
use crate::config::{Config, SolverKind};
use crate::detect::{
    BoundDetector, Detect, DetectError, Detected, DetectionQuery, PlacedDetection, Surroundings, fit_body,
};
use crate::error::TrackError;
use crate::math::{Pose, Vec3};
use crate::observation::background::Background;
use crate::observation::frame::{DepthImage, DetectedPerson, Frame, PositionRelation};
use crate::observation::ownership::NO_OWNER;
use crate::relocalize::ENOUGH_ODDS;
use crate::threads::Threads;
use crate::tracker::BodyTracker;
use clothes::Clothes;
pub use options::PeopleOptions;
use person::Person;
use pixel_assignment::{PixelAssignment, PredictedBody};
use rayon::prelude::*;
use scene_model::SceneModel;
use tentative_tracks::{SAME_PERSON, TentativeTrack, TentativeTracks};

/// Shortest time between two detections in pixels that no person explains, seconds, while anybody is tracked.
const DETECT_EVERY: f64 = 0.06;
/// Fraction of a detected person's segment that may show another person if the person does not explain it.
const LEFT_OVER: f64 = 0.3;
/// Largest number of persons after whom the rest of a segment is looked at again.
const MOST_TOGETHER: usize = 4;
/// Two tracks whose roots are nearer than this are duplicates, meters.
const ONE_BODY: f64 = 0.3;
/// A track that lasted for less than this is not remembered, seconds.
const KNOWN_AFTER: f64 = 1.0;

/// Why somebody who was detected is not tracked, see [`People::refusal`].
///
/// ```
/// use voodoo_core::Refusal;
///
/// let words = Refusal::Doubtful { log_odds: 1.5 }.to_string();
/// assert!(words.starts_with("log odds of 1.5"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Refusal {
    /// The detections so far are not certain enough.
    Doubtful {
        /// Sum of their log odds.
        log_odds: f64,
    },
    /// At the detected joints hardly any limb would be measured.
    Unsupported,
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Doubtful { log_odds } => {
                write!(
                    f,
                    "log odds of {log_odds:.1} that it is a person, expected {ENOUGH_ODDS:.1} before it is tracked"
                )
            }
            Self::Unsupported => {
                f.write_str("a body at the detected joints, of which hardly any limb would be measured")
            }
        }
    }
}

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
    /// Whether everybody is wanted; otherwise only the one who is followed, and others are looked for when something moves.
    everybody: bool,
    stamp: Option<f64>,
    threads: Threads,
}

impl People {
    /// Returns a tracker of no persons. Every new person gets a copy of `prototype`.
    pub fn new(prototype: Body, config: Config, options: PeopleOptions) -> Result<Self, TrackError> {
        let threads = Threads::new(&config)?;
        Ok(Self {
            prototype,
            options,
            persons: Vec::new(),
            next_id: 1,
            assignment: PixelAssignment::default(),
            scene: SceneModel::new(config.background),
            tentative: TentativeTracks::default(),
            detector: BoundDetector::default(),
            last_detection: None,
            refusal: None,
            everybody: true,
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
        self.detector.error().or_else(|| self.persons.iter().find_map(|person| person.tracker.detector_error()))
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

    /// Forgets everybody but the first person, and the scene. The next frame may have any stamp.
    fn forget_others(&mut self) {
        self.persons.truncate(1);
        (self.scene, self.tentative) = (SceneModel::new(self.config.background), TentativeTracks::default());
        (self.last_detection, self.stamp) = (None, None);
    }

    /// Returns a person with the next number, who is not present yet.
    fn nobody_yet(&self, stamp: f64) -> Result<Person, TrackError> {
        let (body, config) = (self.prototype.clone(), self.config.clone());
        Person::new(self.next_id, body, config, self.detector.fresh(), stamp)
    }

    /// Updates all persons with the next frame. `own` has the frames of those persons who have measurements that the others lack;
    /// a person is fitted to color pictures only if their own frame has any.
    /// On error nothing changes.
    pub fn step(&mut self, frame: &Frame, own: &[(usize, Frame)]) -> Result<(), TrackError> {
        frame.check(&self.prototype, self.stamp)?;
        own.iter().try_for_each(|(_, frame)| frame.check(&self.prototype, self.stamp))?;
        self.advance(frame, own);
        Ok(())
    }

    /// Updates all persons with a frame that was checked.
    fn advance(&mut self, frame: &Frame, own: &[(usize, Frame)]) {
        self.stamp = Some(frame.stamp);
        self.refusal = None;
        self.detector.clear_error();
        self.scene.register(frame);
        self.assign_pixels(frame);
        let shown = self.match_detections(frame);
        self.follow(frame, own, &shown);
        for person in &self.persons {
            if let Some((image, pixels)) = person.tracker.moved_to().filter(|_| person.present) {
                self.scene.release(frame, image, pixels);
            }
        }
        // A lost person owns no pixels, and must not become part of the scene.
        if !self.persons.iter().any(|person| person.present && !person.is_tracked()) {
            self.scene.learn(frame, self.assignment.owners());
        }
        self.prune_tracks();
        self.find_new(frame, &shown);
        self.delete_expired(frame.stamp);
    }

    /// Assigns every pixel and free point to the person whose surface explains it.
    fn assign_pixels(&mut self, frame: &Frame) {
        for person in self.persons.iter_mut().filter(|person| person.present) {
            person.tracker.predict(frame.stamp, &mut person.expected);
        }
        // Lost persons own no pixels.
        let predicted = (0..)
            .zip(&self.persons)
            .filter(|(_, person)| person.is_tracked())
            .map(|(number, person)| PredictedBody { number, body: person.tracker.body(), poses: &person.expected });
        self.assignment.assign(frame, self.scene.known(), predicted);
    }

    /// Returns the index of the tracked person whom each of the frame's detections shows, if it shows one.
    fn match_detections(&self, frame: &Frame) -> Vec<Option<usize>> {
        if frame.detections.is_empty() {
            return Vec::new();
        }
        let tracked: Vec<usize> = (0..self.persons.len()).filter(|number| self.persons[*number].is_tracked()).collect();
        let distance = |detection: &DetectedPerson, person: &Person| {
            let body = person.tracker.body();
            let each = detection.positions.iter().filter(|of| of.site < body.sites().len());
            let sum: f64 = each.map(|of| body.site_position(&person.expected, of.site).distance(of.position)).sum();
            if detection.positions.is_empty() { f64::INFINITY } else { sum / detection.positions.len() as f64 }
        };
        let costs = |detection| tracked.iter().map(|number| distance(detection, &self.persons[*number])).collect();
        let costs: Vec<Vec<f64>> = frame.detections.iter().map(costs).collect();
        assign::assign(&costs, SAME_PERSON).into_iter().map(|column| column.map(|column| tracked[column])).collect()
    }

    /// Steps every tracker with its own pixels and points, and with the detections that show the person.
    fn follow(&mut self, frame: &Frame, own: &[(usize, Frame)], shown: &[Option<usize>]) {
        let (assignment, scene) = (&self.assignment, self.scene.known());
        // With several persons, color pictures only serve to identify them.
        let shared = &Frame { colors: &[], ..*frame };
        let work = |(number, person): (usize, &mut Person)| {
            if person.present {
                let ownership = assignment.ownership(number, scene);
                let mut of = *own.iter().find(|(id, _)| *id == person.id).map_or(shared, |(_, frame)| frame);
                let detection = shown.iter().position(|shown| *shown == Some(number));
                let positions = detection.map(|detection| {
                    let count = person.tracker.body().sites().len();
                    let known = frame.detections[detection].positions.iter().filter(|of| of.site < count);
                    of.positions.iter().chain(known).copied().collect::<Vec<PositionRelation>>()
                });
                of.positions = positions.as_deref().unwrap_or(of.positions);
                person.tracker.step(&of, ownership);
                person.update(frame, ownership);
            }
        };
        match self.threads.pool() {
            // Each person is processed by a single thread, so the result does not depend on the number of threads.
            Some(pool) => pool.install(|| self.persons.par_iter_mut().enumerate().for_each(work)),
            None => self.persons.iter_mut().enumerate().for_each(work),
        }
    }

    /// Prunes tracks: duplicates (the one that explains fewer pixels, or the newer), and tracks outside the region or not
    /// requested.
    fn prune_tracks(&mut self) {
        for newer in 0..self.persons.len() {
            let place = self.persons[newer].place;
            for older in 0..newer {
                let [a, b] = [older, newer].map(|number| &self.persons[number]);
                if a.is_tracked() && b.is_tracked() && a.place.distance(place) < ONE_BODY {
                    let more = self.assignment.count(newer) > self.assignment.count(older);
                    let fewer = if more && !a.followed { older } else { newer };
                    self.persons[fewer].present = false;
                }
            }
            let is_followed = self.options.allows(place) && self.options.includes(self.persons[newer].id);
            self.persons[newer].present &= is_followed;
        }
    }

    /// Searches for new persons: in the frame's detections that show nobody who is tracked, and in pixels that no person explains.
    fn find_new(&mut self, frame: &Frame, shown: &[Option<usize>]) {
        self.tentative.prune(frame.stamp);
        for (detection, _) in frame.detections.iter().zip(shown).filter(|(_, shown)| shown.is_none()) {
            let fitted = self.detected_body().fit(&sites_of(detection.positions), true);
            let place = fitted.ok().and_then(|(_, poses)| poses.first().map(|root| root.translation));
            if let Some(place) = place.filter(|place| self.is_requested(frame, *place)) {
                self.tentative.update(TentativeTrack::given(frame.stamp, place, detection), None);
            }
        }
        self.detect_new(frame);
        let confirmed = self.tentative.take_confirmed(frame.stamp);
        self.refusal = self.tentative.greatest_at(frame.stamp).map(|log_odds| Refusal::Doubtful { log_odds });
        if !confirmed.is_empty() {
            self.associate(frame, &confirmed);
        }
    }

    /// Detects persons in pixels that no person explains, if it is time to.
    fn detect_new(&mut self, frame: &Frame) {
        let everybody_there = self.options.only.as_ref().is_some_and(|only| {
            only.iter().all(|id| self.persons.iter().any(|person| person.id == *id && person.is_tracked()))
        });
        let tracked = self.persons.iter().any(Person::is_tracked);
        let wait = match tracked {
            true if self.everybody || self.scene.shows_something_new() => DETECT_EVERY,
            true => f64::INFINITY,
            false => 0.0,
        };
        if everybody_there
            || !self.finds_new(frame.stamp)
            || !self.detector.knows()
            || self.last_detection.is_some_and(|last| frame.stamp - last < wait)
        {
            return;
        }
        self.last_detection = Some(frame.stamp);
        self.detect(frame, if tracked { DetectionQuery::New } else { DetectionQuery::Any });
    }

    /// Whether a detection may be of somebody new or lost, and not of a person whose given start nothing confirmed yet.
    fn finds_new(&self, stamp: f64) -> bool {
        let unconfirmed = |person: &Person| person.is_tracked() && !person.tracker.is_confirmed(stamp);
        let relocalizes = self.config.relocalization && self.config.solver != SolverKind::Limbwise;
        (relocalizes || !self.persons.iter().any(|person| person.present)) && !self.persons.iter().any(unconfirmed)
    }

    fn detect(&mut self, frame: &Frame, query: DetectionQuery) {
        for number in 0..frame.images.len() {
            let mut found = self.detect_in_image(frame, number, query);
            // Persons who touch are one segment: what a detected person leaves of it may show another one.
            let mut newcomers = Vec::new();
            for next in 0..MOST_TOGETHER {
                let Some(one) = found.get(next) else { break };
                let detected = Detected { detection: &one.detection, map: self.detector.map() };
                newcomers.extend(fit_body(&Model::new(self.prototype.clone()), detected));
                self.assign_segment(frame, number, &one.detection.pixels, &newcomers);
                if let Some(place) = self.rest_of_segment(&frame.images[number], number, &one.detection.pixels) {
                    found.extend(self.detect_in_image(frame, number, DetectionQuery::Near(place)));
                }
            }
            for found in found {
                let still = self.scene.is_still(frame, number, &found.detection.pixels);
                let odds = still.then(|| self.detector.static_odds());
                self.tentative.update(TentativeTrack::in_image(frame.stamp, found, number), odds);
            }
        }
    }

    /// Returns the persons who are detected in an image, and are to be tracked.
    fn detect_in_image(&mut self, frame: &Frame, number: usize, query: DetectionQuery) -> Vec<PlacedDetection> {
        let image = &frame.images[number];
        let scene = self.scene.known().of_image(image).map_or(&[][..], Background::depth);
        let around = Surroundings {
            ground: frame.ground,
            excluded: frame.excluded,
            owners: self.assignment.owners().get(number).map_or(&[], Vec::as_slice),
            // A person may have stood there since the camera started, so only an old background is excluded.
            background: if self.scene.is_old(number, frame.stamp) { scene } else { &[] },
            ..Surroundings::default()
        };
        let mut found = self.detector.detect(&self.prototype, image, &around, query);
        found.retain(|found| {
            let requested = self.is_requested(frame, found.root);
            if !requested {
                self.detector.reject(found.index);
            }
            requested
        });
        found
    }

    /// Assigns pixels of a segment to newcomers, who are numbered after all persons.
    fn assign_segment(&mut self, frame: &Frame, image: usize, pixels: &[usize], newcomers: &[(Body, Vec<Pose>)]) {
        let bodies = (self.persons.len() as u16..).zip(newcomers).map(|(number, (body, poses))| PredictedBody {
            number,
            body,
            poses,
        });
        self.assignment.assign_segment(&frame.images[image], image, pixels, bodies);
    }

    /// Returns the middle of those pixels of a segment that nobody owns, world frame, if these are many.
    fn rest_of_segment(&self, image: &DepthImage, number: usize, pixels: &[usize]) -> Option<Vec3> {
        let owners = &self.assignment.owners()[number];
        let free = || pixels.iter().filter(|pixel| owners[**pixel] == NO_OWNER);
        let place = |pixel: usize| image.back_project(pixel, image.pixels.get(pixel) * image.meters_per_unit as f32);
        let (count, sum) = (free().count() as f64, free().map(|pixel| place(*pixel)).sum::<Vec3>());
        (count > LEFT_OVER * pixels.len() as f64).then(|| image.world_from_sensor * (sum / count))
    }

    /// Whether a person detected at a position is to be tracked.
    fn is_requested(&self, frame: &Frame, place: Vec3) -> bool {
        let others = self.tracked_except(None);
        self.options.allows(place) && self.options.room(frame, place, &others).is_some()
    }

    /// Returns indices and positions of all tracked persons, except one.
    fn tracked_except(&self, one: Option<usize>) -> Vec<(usize, Vec3)> {
        let others =
            (0..self.persons.len()).filter(|number| self.persons[*number].is_tracked() && Some(*number) != one);
        others.map(|number| (number, self.persons[number].place)).collect()
    }

    /// Associates confirmed tentative tracks with absent persons by a linear assignment; spawns new tracks for the others. The
    /// assignment includes all other tentative tracks of this frame.
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
        let given = assign::assign(&costs, NEW);
        let known = |column: Option<usize>| column.map(|column| absent[column]);
        // Who comes with others gets their own pixels.
        let (first, mut newcomers, mut numbers) = (self.persons.len(), Vec::new(), Vec::new());
        for (track, column) in confirmed.iter().zip(&given) {
            let tracked = known(*column).filter(|number| self.persons[*number].is_tracked());
            let fitted = if tracked.is_none() { self.fit_track(track) } else { None };
            numbers.push(fitted.is_some().then_some(first + newcomers.len()));
            newcomers.extend(fitted);
        }
        let others: Vec<(Body, Vec<Pose>)> =
            self.tentative.updated_at(frame.stamp).filter_map(|track| self.fit_track(track)).collect();
        newcomers.extend(others);
        for track in confirmed.iter().filter(|track| !track.detection.pixels.is_empty()) {
            self.assign_segment(frame, track.image, &track.detection.pixels, &newcomers);
        }
        for ((track, given), own) in confirmed.iter().zip(given).zip(numbers) {
            let known = given.map(|column| absent[column]);
            let others = self.tracked_except(known);
            let Some(leaves) = self.options.room(frame, track.place, &others) else { continue };
            let came = match known {
                Some(number) => self.reactivate(frame, track, number, own.unwrap_or(number)),
                None => self.spawn(frame, track, own.unwrap_or(first)),
            };
            if !came {
                self.refusal = Some(Refusal::Unsupported);
            }
            if let Some(leaves) = leaves.filter(|_| came) {
                self.persons[leaves].present = false;
            }
            if came && self.options.limit.is_some_and(|limit| self.present().count() > limit) {
                // With the limit exceeded, the new person replaces those who are hidden.
                self.persons.iter_mut().for_each(|person| person.present &= person.is_tracked());
            }
        }
    }

    /// Whether this person may match one of the tentative tracks: an absent or lost person, and one who explains fewer pixels
    /// than a tentative track near them.
    fn may_match(&self, number: usize, candidates: &[TentativeTrack]) -> bool {
        let person = &self.persons[number];
        let beside = |track: &&TentativeTrack| track.place.distance(person.place) < SAME_PERSON;
        let visible = candidates.iter().filter(beside).map(|track| track.detection.pixels.len()).max();
        !person.is_tracked() || visible.is_some_and(|visible| self.assignment.count(number) < visible)
    }

    /// Returns the detection of a tentative track.
    fn detected<'a>(&'a self, track: &'a TentativeTrack) -> Detected<'a> {
        Detected { detection: &track.detection, map: self.detector.map() }
    }

    /// Returns the body of a tentative track, in its sizes, and its poses.
    fn fit_track(&self, track: &TentativeTrack) -> Option<(Body, Vec<Pose>)> {
        let model = Model::new(self.prototype.clone());
        match track.positions.as_slice() {
            [] => fit_body(&model, self.detected(track)),
            positions => self.detected_body().fit(&sites_of(positions), true).ok(),
        }
    }

    /// The body whose sites the frame's detections name: that of the one who is followed may have been edited.
    fn detected_body(&self) -> &Body {
        let followed = self.persons.first().filter(|person| person.followed);
        followed.map_or(&self.prototype, |person| person.tracker.body())
    }

    /// Returns the colors of a tentative track's clothes.
    fn clothes_of_track(&self, frame: &Frame, track: &TentativeTrack) -> Clothes {
        let mut clothes = Clothes::default();
        if let Some((body, poses)) = self.fit_track(track) {
            let tracked = |owner: u16| usize::from(owner) < self.persons.len();
            let free = |image: usize, pixel: usize| {
                self.assignment.owners()[image].get(pixel).is_some_and(|owner| !tracked(*owner))
            };
            clothes.observe(frame, &body, &poses, free);
        }
        clothes
    }

    /// Spawns a new person at a tentative track. Returns whether the person is there.
    fn spawn(&mut self, frame: &Frame, track: &TentativeTrack, own: usize) -> bool {
        let full = self.persons.len() >= usize::from(NO_OWNER);
        if full || !self.options.includes(self.next_id) {
            return false;
        }
        let Ok(person) = self.nobody_yet(frame.stamp) else { return false };
        self.persons.push(person);
        let came = self.reactivate(frame, track, self.persons.len() - 1, own);
        if came {
            self.next_id += 1;
        } else {
            self.persons.pop();
        }
        came
    }

    /// Starts a person's tracker at a tentative track, in the pixels whose owner is `own`. Returns whether the person is there.
    fn reactivate(&mut self, frame: &Frame, track: &TentativeTrack, number: usize, own: usize) -> bool {
        self.scene.release(frame, track.image, &track.detection.pixels);
        let person = &mut self.persons[number];
        if !self.options.includes(person.id) {
            return false;
        }
        let known = person.created < frame.stamp;
        let ownership = self.assignment.ownership(own, self.scene.known());
        let detected = Detected { detection: &track.detection, map: self.detector.map() };
        let placed = PlacedDetection { index: 0, root: track.place, detection: track.detection.clone() };
        let depth_frame = &Frame { colors: &[], ..*frame };
        let came = if !track.positions.is_empty() {
            let frame = depth_frame.with_positions(&track.positions);
            person.tracker.start_at_positions(&frame, ownership, !known)
        } else if person.present {
            person.tracker.recover(depth_frame, ownership, placed)
        } else {
            person.tracker.start_at_detection(depth_frame, ownership, placed, known)
        };
        if came {
            person.present = true;
            person.created = person.created.min(frame.stamp);
            person.update_stature(detected);
        }
        person.update(frame, ownership);
        // A lost person's own tracker may have found them in the same frame.
        let place = person.place;
        let twice = self.tracked_except(Some(number)).iter().any(|(_, other)| other.distance(place) < ONE_BODY);
        self.persons[number].present &= !twice;
        came && !twice
    }

    /// Deletes persons who have been absent for too long, and absent ones whose track was short.
    fn delete_expired(&mut self, stamp: f64) {
        let forget_after = self.options.forget_after;
        self.persons.retain(|person| {
            let remembered =
                person.last_tracked - person.created >= KNOWN_AFTER && stamp - person.last_tracked < forget_after;
            person.present || person.followed || remembered
        });
    }
}

/// Sites and their measured positions.
fn sites_of(positions: &[PositionRelation]) -> Vec<(usize, Vec3)> {
    positions.iter().map(|relation| (relation.site, relation.position)).collect()
}

/// Cost of a new person in the assignment, nats.
const NEW: f64 = 4.0;
/// Distance that a person may move, meters: at once, and in addition per second.
const COMES: [f64; 2] = [0.4, 1.2];
/// Mean and standard deviation of the clothes distance between two views of one person.
const CLOTHES: [f64; 2] = [0.10, 0.07];
/// Evidence of equal clothes for the same person, nats.
const LIKE_CLOTHES: f64 = 3.0;

/// Returns the cost of a person's having moved to a position, nats.
fn distance_cost(person: &Person, place: Vec3, stamp: f64) -> f64 {
    let reach = COMES[0] + COMES[1] * (stamp - person.last_tracked);
    let far = person.place.distance(place) / reach;
    if far > 2.0 { f64::INFINITY } else { 0.5 * far * far }
}

/// Returns the cost of assigning a tentative track to this person, nats; `size` is the part from the person's stature.
fn person_cost(person: &Person, size: f64, track: &TentativeTrack, clothes: &Clothes, stamp: f64) -> f64 {
    let far = distance_cost(person, track.place, stamp);
    let distance = person.clothes.distance(clothes);
    let color =
        distance.map_or(0.0, |distance| 0.5 * ((distance - CLOTHES[0]).max(0.0) / CLOTHES[1]).powi(2) - LIKE_CLOTHES);
    far + size + color
}
