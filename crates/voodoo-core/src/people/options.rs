//! Options for the persons that are tracked: how many, where, and which numbers.

use crate::math::{Aabb, Vec3};
use crate::observation::frame::Frame;

/// A person replaces a tracked one only if they are nearer to a camera by this, meters. The margin keeps two persons at similar
/// distances from replacing each other in turn.
const CLEARLY_NEARER: f64 = 0.3;

/// Which persons are tracked. [`PeopleOptions::default`] allows any number of persons everywhere.
///
/// ```
/// use voodoo_core::{Body, Config, HumanModel, People, PeopleOptions};
///
/// let mut options = PeopleOptions::default();
/// (options.limit, options.nearest) = (Some(1), true); // only the person nearest to a camera
/// let people = People::new(Body::human(1.75, HumanModel::Measured)?, Config::default(), options)?;
/// assert_eq!(people.present().count(), 0); // nobody before the first frame
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PeopleOptions {
    /// Largest number of persons tracked at the same time; `None`: any number.
    pub limit: Option<usize>,
    /// With more persons than `limit`, track those nearest to a camera; otherwise those who came first.
    pub nearest: bool,
    /// A person who returns after being absent for longer than this gets a new number, seconds.
    pub forget_after: f64,
    /// Region in which persons are tracked, world frame; `None`: everywhere.
    pub region: Option<Aabb>,
    /// Numbers of the only persons that are tracked; `None`: all persons.
    pub only: Option<Vec<usize>>,
}

impl Default for PeopleOptions {
    fn default() -> Self {
        Self { limit: None, nearest: false, forget_after: 60.0, region: None, only: None }
    }
}

impl PeopleOptions {
    /// Whether persons are tracked at a position.
    pub(super) fn allows(&self, place: Vec3) -> bool {
        self.region.is_none_or(|region| region.contains(place))
    }

    /// Whether the person with this number is tracked.
    pub(super) fn includes(&self, id: usize) -> bool {
        self.only.as_ref().is_none_or(|only| only.contains(&id))
    }

    /// Returns `None` if the limit leaves no room for a person at `place` in addition to `others`; otherwise the number of the
    /// person to be replaced, if one has to be.
    pub(super) fn room(&self, frame: &Frame, place: Vec3, others: &[(usize, Vec3)]) -> Option<Option<usize>> {
        if self.limit.is_none_or(|limit| others.len() < limit) {
            return Some(None);
        }
        let distance = |place: Vec3| {
            let cameras = frame.images.iter().map(|image| image.world_from_sensor.translation);
            cameras.map(|camera| camera.distance(place)).fold(f64::INFINITY, f64::min)
        };
        let farthest = others.iter().max_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
        (self.nearest && distance(place) + CLEARLY_NEARER < distance(farthest.1)).then_some(Some(farthest.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_frame;

    #[test]
    fn who_is_nearer_takes_the_place_of_the_farthest() {
        let others = [(0, Vec3::new(0.0, 0.0, 3.0)), (4, Vec3::new(0.0, 0.0, 4.0))];
        let room = |options: &PeopleOptions, z: f64| {
            with_frame(&[0; 160 * 124], 0.0, |frame| options.room(frame, Vec3::new(0.0, 0.0, z), &others))
        };
        let any = PeopleOptions::default();
        let two = PeopleOptions { limit: Some(2), ..any.clone() };
        let nearest = PeopleOptions { nearest: true, ..two.clone() };
        assert_eq!([room(&any, 9.0), room(&two, 2.0)], [Some(None), None]);
        assert_eq!([3.8, 2.0].map(|z| room(&nearest, z)), [None, Some(Some(4))]);
    }

    #[test]
    fn numbers_and_places_can_be_left_out() {
        let region = Some(Aabb::new(Vec3::ZERO, Vec3::ONE));
        let options = PeopleOptions { region, only: Some(vec![2]), ..PeopleOptions::default() };
        assert!(options.includes(2) && !options.includes(1) && PeopleOptions::default().includes(1));
        assert!(options.allows(Vec3::splat(0.5)) && !options.allows(Vec3::splat(1.5)));
    }
}
