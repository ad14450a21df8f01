//! Who is followed: how many, where, and who of them.

use crate::math::{Aabb, Vec3};
use crate::observation::frame::Frame;

/// Somebody takes the place of another when they are nearer to a camera by this, meters: two at one distance do not take turns.
const CLEARLY_NEARER: f64 = 0.3;

/// Who is looked for. [`PeopleOptions::default`] is everybody everywhere.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PeopleOptions {
    /// Persons that are followed at the same time, at most; none: any number.
    pub limit: Option<usize>,
    /// Of more than that the nearest to a camera are followed; else those who came first.
    pub nearest: bool,
    /// Who is away for longer is somebody new when they come back, seconds.
    pub forget_after: f64,
    /// Where persons are, world frame; none: everywhere.
    pub region: Option<Aabb>,
    /// Numbers of those who are followed, and nobody else; none: everybody.
    pub only: Option<Vec<usize>>,
}

impl Default for PeopleOptions {
    fn default() -> Self {
        Self { limit: None, nearest: false, forget_after: 60.0, region: None, only: None }
    }
}

impl PeopleOptions {
    /// Whether persons are followed at a place.
    pub(super) fn allows(&self, place: Vec3) -> bool {
        self.region.is_none_or(|region| region.contains(place))
    }

    /// Whether somebody of this number is followed.
    pub(super) fn includes(&self, id: usize) -> bool {
        self.only.as_ref().is_none_or(|only| only.contains(&id))
    }

    /// Whether there is room for somebody at a place beside those at `others`; who has to go for that.
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
