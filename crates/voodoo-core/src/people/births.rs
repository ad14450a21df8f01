//! Births and returns: detections become tentative tracks, and confirmed ones new persons, or lost and absent ones who come back.

use super::clothes::Clothes;
use super::person::Person;
use super::tentative_tracks::{SAME_PERSON, TentativeTrack};
use super::{ONE_BODY, People, Refusal, assign};
use crate::body::Body;
use crate::detect::{Detected, DetectionQuery, PlacedDetection, Surroundings, fit_body};
use crate::math::{Pose, Vec3};
use crate::observation::frame::{DepthImage, Frame, PositionRelation};
use crate::observation::ownership::NO_OWNER;
use crate::relocalize::ENOUGH_ODDS;

/// Shortest time between two detections in pixels that no person explains, seconds, while anybody is tracked.
const DETECT_EVERY: f64 = 0.06;
/// Fraction of a detected person's segment that may show another person if the person does not explain it.
const LEFT_OVER: f64 = 0.3;
/// Largest number of persons after whom the rest of a segment is looked at again.
const MOST_TOGETHER: usize = 4;

impl People {
    /// Searches for new persons: in the frame's detections that show nobody who is tracked and where these are in its images, and in
    /// pixels that no person explains.
    pub(super) fn find_new(&mut self, frame: &Frame, of_detection: &[Option<usize>]) {
        self.tentative.prune(frame.stamp);
        for (detection, _) in frame.detections.iter().zip(of_detection).filter(|(_, person)| person.is_none()) {
            let fitted = self.detected_body().fit(&sites_of(detection.positions), true);
            let place = fitted.ok().and_then(|(_, poses)| poses.first().map(|root| root.translation));
            if let Some(place) = place.filter(|place| self.is_requested(frame, *place)) {
                self.tentative.update(TentativeTrack::given(frame.stamp, place, detection), None);
                if self.detector.knows && self.finds_new(frame.stamp) {
                    self.detect(frame, DetectionQuery::Near(place));
                }
            }
        }
        self.detect_new(frame);
        let mut confirmed = self.tentative.take_confirmed(frame.stamp);
        confirmed.retain(|track| !self.join_tracked(frame, track));
        let sums = self.tentative.updated_at(frame.stamp).map(|track| track.log_odds);
        self.refusal = sums.max_by(f64::total_cmp).map(|log_odds| Refusal::LowConfidence { log_odds });
        if !confirmed.is_empty() {
            self.associate(frame, &confirmed);
        }
    }

    /// Joins a tentative track to a person who is tracked beside it, if their pixels and its own, taken together, are detected as
    /// one person who is where that person is, or who explains the frame better where they were detected: then the person moves
    /// there. Returns whether it did.
    fn join_tracked(&mut self, frame: &Frame, track: &TentativeTrack) -> bool {
        let Some(image) = frame.images.get(track.image).filter(|_| !track.detection.pixels.is_empty()) else {
            return false;
        };
        let beside =
            self.tracked_except(None).into_iter().filter(|(_, place)| place.distance(track.place) < SAME_PERSON);
        let nearest = beside.min_by(|a, b| a.1.distance(track.place).total_cmp(&b.1.distance(track.place)));
        let Some((number, place)) = nearest else { return false };
        self.assignment.release(self.persons.len()..);
        let around = Surroundings {
            ground: frame.ground,
            excluded: frame.excluded,
            owners: &self.assignment.owners[track.image],
            own: Some(number as u16),
            ..Surroundings::default()
        };
        let found = self.detector.detect(&self.prototype, image, &around, DetectionQuery::Near(track.place));
        let Some(mut found) = found.into_iter().next() else { return false };
        let both = &mut found.detection.pixels;
        both.sort_unstable();
        let shared = track.detection.pixels.iter().filter(|pixel| both.binary_search(pixel).is_ok()).count();
        if shared as f64 <= (1.0 - LEFT_OVER) * track.detection.pixels.len() as f64 {
            return false;
        }
        found.root.distance(place) < found.root.distance(track.place)
            || self.reactivate(frame, &TentativeTrack::in_image(frame.stamp, found, track.image), number, number)
    }

    /// Detects persons in pixels that no person explains, if it is time to.
    fn detect_new(&mut self, frame: &Frame) {
        let everybody_there = self.options.only.as_ref().is_some_and(|only| {
            only.iter().all(|id| self.persons.iter().any(|person| person.id == *id && person.is_tracked()))
        });
        let tracked = self.persons.iter().any(Person::is_tracked);
        let wait = match tracked {
            true if self.searches_everywhere(frame) || !self.scene.shows_nobody_new => DETECT_EVERY,
            true => f64::INFINITY,
            false => 0.0,
        };
        if everybody_there
            || !self.finds_new(frame.stamp)
            || !self.detector.knows
            || self.last_detection.is_some_and(|last| frame.stamp - last < wait)
        {
            return;
        }
        let first = self.last_detection.replace(frame.stamp).is_none();
        // Of several persons who touch, those who are found first show where the others are.
        let query = match tracked {
            true if !first => DetectionQuery::New,
            false if self.followed().is_none() => DetectionQuery::Any,
            _ => DetectionQuery::All,
        };
        self.detect(frame, query);
    }

    /// Whether somebody may be in what does not move: before every view was searched, and while somebody is lost.
    fn searches_everywhere(&self, frame: &Frame) -> bool {
        let searched = frame.images.iter().all(|image| self.scene.is_old(image, frame.stamp));
        self.followed().is_none()
            && (!searched || self.persons.iter().any(|person| person.present && !person.is_tracked()))
    }

    /// Whether a detection may be of somebody new or lost, and not of a person whose given start nothing confirmed yet.
    fn finds_new(&self, stamp: f64) -> bool {
        let unconfirmed = |person: &Person| person.is_tracked() && !person.tracker.is_confirmed(stamp);
        let relocalizes = self.config.relocalization && self.config.solver.is_whole_body();
        (relocalizes || !self.persons.iter().any(|person| person.present)) && !self.persons.iter().any(unconfirmed)
    }

    fn detect(&mut self, frame: &Frame, query: DetectionQuery) {
        for number in 0..frame.images.len() {
            let mut found = self.detect_in_image(frame, number, query);
            // Persons who touch are one segment: what a detected person leaves of it may show another one.
            let mut newcomers = Vec::new();
            for next in 0..MOST_TOGETHER {
                let Some(one) = found.get(next) else { break };
                let detected = Detected { detection: &one.detection, map: &self.detector.map };
                newcomers.extend(fit_body(&self.prototype, detected));
                // Newcomers are numbered after all persons.
                let (image, pixels) = (&frame.images[number], &one.detection.pixels);
                self.assignment.assign_segment(image, number, pixels, self.persons.len(), &newcomers);
                if let Some(place) = self.rest_of_segment(image, number, pixels) {
                    found.extend(self.detect_in_image(frame, number, DetectionQuery::Near(place)));
                }
            }
            for found in found {
                let still = self.scene.is_still(&frame.images[number], &found.detection.pixels);
                let odds = still.then(|| self.detector.static_odds());
                self.tentative.update(TentativeTrack::in_image(frame.stamp, found, number), odds);
            }
        }
    }

    /// Returns the persons who are detected in an image, and are to be tracked.
    fn detect_in_image(&mut self, frame: &Frame, number: usize, query: DetectionQuery) -> Vec<PlacedDetection> {
        let image = &frame.images[number];
        let scene = self.scene.known.depth(image);
        let around = Surroundings {
            ground: frame.ground,
            excluded: frame.excluded,
            owners: self.assignment.owners.get(number).map_or(&[], Vec::as_slice),
            // A person may have stood there since the camera started, so only an old background is excluded.
            background: if self.scene.is_old(image, frame.stamp) { scene } else { &[] },
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

    /// Returns the middle of those pixels of a segment that nobody owns, world frame, if these are many.
    fn rest_of_segment(&self, image: &DepthImage, number: usize, pixels: &[usize]) -> Option<Vec3> {
        let owners = &self.assignment.owners[number];
        let measured = || pixels.iter().filter_map(|pixel| image.depth(*pixel).map(|z| (*pixel, z)));
        let free = || measured().filter(|(pixel, _)| owners[*pixel] == NO_OWNER);
        let sum: Vec3 = free().map(|(pixel, z)| image.back_project(pixel, z)).sum();
        let [count, all] = [free().count(), measured().count()].map(|count| count as f64);
        (count > LEFT_OVER * all).then(|| image.world_from_sensor * (sum / count))
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
        let cost = |(rank, track): (usize, &TentativeTrack)| {
            let clothes = self.clothes_of_track(frame, track);
            let size = |number: usize| self.persons[number].stature_cost(self.detected(track));
            let cost =
                |number: &usize| person_cost(&self.persons[*number], size(*number), track, &clothes, frame.stamp);
            absent.iter().map(|number| cost(number) + FIRST * rank as f64).collect()
        };
        let tracks: Vec<&TentativeTrack> = confirmed.iter().chain(self.tentative.updated_at(frame.stamp)).collect();
        let costs: Vec<Vec<f64>> = tracks.iter().copied().enumerate().map(cost).collect();
        // A detection that nobody is left for may be of somebody new, or of nobody.
        let known = assign::assign(&costs, |row| tracks[row].log_odds.min(ENOUGH_ODDS));
        let known: Vec<Option<usize>> = known.into_iter().map(|column| column.map(|column| absent[column])).collect();
        let numbers = self.assign_to_newcomers(frame, confirmed, &known);
        for ((track, known), own) in confirmed.iter().zip(known).zip(numbers) {
            let others = self.tracked_except(known);
            let Some(leaves) = self.options.room(frame, track.place, &others) else { continue };
            let mut came = match known {
                Some(number) => self.reactivate(frame, track, number, own.unwrap_or(number)),
                None => own.is_some_and(|own| self.spawn(frame, track, own)),
            };
            let beside = |number: usize| {
                let person = &self.persons[number];
                person.is_tracked() && person.place.distance(track.place) > ONE_BODY
            };
            if !came && known.is_some_and(beside) {
                // That person stays where they are, and it is somebody else.
                let own = self.assign_to_newcomers(frame, std::slice::from_ref(track), &[None]);
                came = own[0].is_some_and(|own| self.spawn(frame, track, own));
            }
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

    /// Assigns the segments of confirmed tracks to the bodies that start there, and to those of this frame's other tentative tracks,
    /// so that each gets their own pixels. Returns the number that owns the pixels of each confirmed track; a person who is tracked
    /// already has pixels.
    fn assign_to_newcomers(
        &mut self,
        frame: &Frame,
        confirmed: &[TentativeTrack],
        known: &[Option<usize>],
    ) -> Vec<Option<usize>> {
        let (first, mut newcomers, mut numbers) = (self.persons.len(), Vec::new(), Vec::new());
        for (track, known) in confirmed.iter().zip(known) {
            let tracked = known.is_some_and(|number| self.persons[number].is_tracked());
            let fitted = if tracked { None } else { self.fit_track(track) };
            numbers.push(fitted.is_some().then_some(first + newcomers.len()));
            newcomers.extend(fitted);
        }
        newcomers.extend(self.tentative.updated_at(frame.stamp).filter_map(|track| self.fit_track(track)));
        for track in confirmed.iter().filter(|track| !track.detection.pixels.is_empty()) {
            let (image, pixels) = (&frame.images[track.image], &track.detection.pixels);
            self.assignment.assign_segment(image, track.image, pixels, first, &newcomers);
        }
        numbers
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
        Detected { detection: &track.detection, map: &self.detector.map }
    }

    /// Returns the body of a tentative track, in its sizes, and its poses.
    fn fit_track(&self, track: &TentativeTrack) -> Option<(Body, Vec<Pose>)> {
        match track.positions.as_slice() {
            [] => fit_body(&self.prototype, self.detected(track)),
            positions => self.detected_body().fit(&sites_of(positions), true).ok(),
        }
    }

    /// The one who is followed, `None` where everybody is wanted. Others than that one are looked for only when something moves: a
    /// look at every piece of furniture takes as long as three frames.
    fn followed(&self) -> Option<&Person> {
        self.persons.first().filter(|person| person.followed)
    }

    /// The body whose sites the frame's detections name: that of the one who is followed may have been edited.
    fn detected_body(&self) -> &Body {
        self.followed().map_or(&self.prototype, |person| person.tracker.body())
    }

    /// Positions of sites of `detected_body`, as those of the sites of the same names of a person.
    pub(super) fn own_positions(&self, person: &Person, positions: &[PositionRelation]) -> Vec<PositionRelation> {
        let (theirs, body) = (self.detected_body(), person.tracker.body());
        let own = |of: &PositionRelation| {
            let site = if person.followed { of.site } else { body.site_index(&theirs.sites()[of.site].name).ok()? };
            Some(PositionRelation { site, ..*of })
        };
        positions.iter().filter_map(own).collect()
    }

    /// Returns the colors of a tentative track's clothes, where there are color pictures.
    fn clothes_of_track(&self, frame: &Frame, track: &TentativeTrack) -> Clothes {
        let mut clothes = Clothes::default();
        if !frame.colors.is_empty()
            && let Some((body, poses)) = self.fit_track(track)
        {
            let tracked = |owner: u16| usize::from(owner) < self.persons.len();
            let free = |image: usize, pixel: usize| {
                self.assignment.owners[image].get(pixel).is_some_and(|owner| !tracked(*owner))
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
        if !self.options.includes(self.persons[number].id) {
            return false;
        }
        self.scene.known.release(frame, track.image, &track.detection.pixels);
        let positions = self.own_positions(&self.persons[number], &track.positions);
        let person = &mut self.persons[number];
        let known = person.created < frame.stamp;
        let ownership = self.assignment.ownership(own, &self.scene.known);
        let detected = Detected { detection: &track.detection, map: &self.detector.map };
        let placed = PlacedDetection { index: 0, root: track.place, detection: track.detection.clone() };
        let depth_frame = &Frame { colors: &[], ..*frame };
        let came = if !track.positions.is_empty() {
            let frame = &Frame { positions: &positions, ..*depth_frame };
            person.tracker.start_at_positions(frame, ownership, !known)
        } else if person.present {
            person.tracker.recover(depth_frame, ownership, track.image, placed)
        } else {
            person.tracker.start_at_detection(depth_frame, ownership, placed, known)
        };
        if came {
            person.present = true;
            person.created = person.created.min(frame.stamp);
            person.place_known = frame.stamp;
            detected.stature().into_iter().for_each(|reported| person.stature.update(reported));
        }
        person.update(frame, ownership);
        // A lost person's own tracker may have found them in the same frame.
        let place = person.place;
        let twice = self.tracked_except(Some(number)).iter().any(|(_, other)| other.distance(place) < ONE_BODY);
        self.persons[number].present &= !twice;
        came && !twice
    }
}

/// Sites and their measured positions.
fn sites_of(positions: &[PositionRelation]) -> Vec<(usize, Vec3)> {
    positions.iter().map(|relation| (relation.site, relation.position)).collect()
}

/// Cost of each track that comes before, nats: of equal ones the first is taken.
const FIRST: f64 = 1e-6;
/// Mean and standard deviation of the clothes distance between two views of one person.
const CLOTHES: [f64; 2] = [0.10, 0.07];
/// Evidence of equal clothes for the same person, nats.
const LIKE_CLOTHES: f64 = 3.0;

/// Returns the cost of assigning a tentative track to this person, nats; `size` is the part from the person's stature.
fn person_cost(person: &Person, size: f64, track: &TentativeTrack, clothes: &Clothes, stamp: f64) -> f64 {
    let far = person.distance_cost(track.place, stamp);
    // Clothes of which a part is visible, or at a wrong pose, may be far off: linear beyond a standard deviation.
    let color = person.clothes.distance(clothes).map_or(0.0, |distance| {
        let off = ((distance - CLOTHES[0]) / CLOTHES[1]).max(0.0);
        off.min(1.0) * (off - 0.5 * off.min(1.0)) - LIKE_CLOTHES
    });
    far + size + color
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::config::Config;
    use crate::people::PeopleOptions;
    use crate::testing::image;

    #[test]
    fn the_rest_of_a_segment_is_where_pixels_have_returns() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut people = People::new(body, Config::default(), PeopleOptions::default()).unwrap();
        let mut pixels = vec![2.0; 24 * 16];
        people.assignment.owners = vec![vec![NO_OWNER; pixels.len()]];
        let segment: Vec<usize> = (0..48).collect();
        let rest = |people: &People, pixels: &[f32]| people.rest_of_segment(&image(pixels, 24, 20.0), 0, &segment);
        let whole = rest(&people, &pixels).unwrap();
        assert_eq!(whole.z, 2.0);
        // The second row has none, the first row is somebody's.
        pixels[24..48].copy_from_slice(&[0.0, -1.0, f32::NAN, f32::INFINITY].repeat(6));
        assert_eq!(rest(&people, &pixels).unwrap().z, 2.0);
        people.assignment.owners[0][..24].fill(0);
        assert_eq!(rest(&people, &pixels), None);
    }
}
