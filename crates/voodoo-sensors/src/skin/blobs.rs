//! Skin regions followed from picture to picture.
//!
//! A face or hand tracker of K06 is a tracker of its own: it knows where its region was a moment ago. So a region keeps its name while
//! it moves on continuously, even when the body model has fallen behind, and the model names regions where they appear. A name
//! changes hands only when another region agrees with the model better for some time.

use crate::skin::assignment::assign;
use voodoo_core::math::{CostTable, Vec3};

/// A region is at most this far from where its motion would have it, from one picture to the next, meters.
const BLOB_JUMP: f64 = 0.12;
/// The same for a region that was seen once: nothing is known about its motion.
const UNKNOWN_JUMP: f64 = 0.24;
/// What is within this share of the possible motion went on as expected.
const AS_EXPECTED: f64 = 0.5;
/// A region that was not seen for so long has lost its name, seconds.
const FORGET: f64 = 0.25;
/// No hand moves faster, meters a second.
const FASTEST: f64 = 8.0;
/// A region that is not seen gets away from its expected place this fast, meters a second.
const UNSEEN_SPEED: f64 = 2.0;
/// Pictures come about this far apart, seconds: so long a region that was seen in the last one may have been away.
const PERIOD: f64 = 1.0 / 30.0;
/// Two candidates this near are one hand, meters.
pub(super) const ONE_HAND: f64 = 0.09;

/// A candidate in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Unit vector in the world from the camera's focal point.
    pub direction: Vec3,
    /// On the surface, meters, or at a guessed distance.
    pub place: Vec3,
    /// Whether a depth camera saw it.
    pub deep: bool,
    /// False where it cannot be a hand.
    pub hand: bool,
    /// Number of its region.
    pub region: i32,
    /// Whether nothing behind it was ever seen: it may be a thing, not the person.
    pub still: bool,
}

/// A region that is followed: where it was last seen, how it moves, and how far it was from each site.
#[derive(Clone, Debug, PartialEq)]
pub struct Blob {
    /// Where it was last seen.
    pub sight: Sight,
    /// When, seconds.
    pub stamp: f64,
    /// Meters a second.
    pub velocity: Vec3,
    /// Pictures in which it was seen.
    pub count: usize,
    /// Number of the site whose name it has.
    pub label: Option<usize>,
    /// Of each site how far it was from there, squared shares of the gate; NaN: not known.
    pub far: Vec<f64>,
    /// Of each site how long it has spoken against being it, seconds.
    pub mismatch: Vec<f64>,
}

impl Blob {
    fn new(sight: Sight, stamp: f64, sites: usize) -> Self {
        let (far, mismatch) = (vec![f64::NAN; sites], vec![0.0; sites]);
        Self { sight, stamp, velocity: Vec3::ZERO, count: 1, label: None, far, mismatch }
    }

    /// It was seen again.
    fn update(&mut self, sight: Sight, stamp: f64) {
        let elapsed = stamp - self.stamp;
        if elapsed > 0.0 {
            let mut velocity = (sight.place - self.sight.place) / elapsed;
            if !(sight.deep && self.sight.deep) {
                velocity -= sight.direction * velocity.dot(sight.direction);
            }
            if velocity.length() < FASTEST {
                self.velocity = 0.5 * self.velocity + 0.5 * velocity;
            }
        }
        (self.sight, self.stamp) = (sight, stamp);
        self.count += 1;
    }

    /// It is the same as a blob that was seen just now, which takes over its name and history.
    fn merge(self, newer: &mut Self) {
        if self.label.is_some() && newer.label.is_none() {
            (newer.label, newer.far, newer.mismatch) = (self.label, self.far, self.mismatch);
            newer.count = newer.count.max(self.count);
        }
    }

    fn limit(&self, stamp: f64) -> f64 {
        let jump = if self.count > 1 { BLOB_JUMP } else { UNKNOWN_JUMP };
        jump + UNSEEN_SPEED * (stamp - self.stamp - PERIOD).max(0.0)
    }

    /// Distance of a sight from where the blob should be, in units of what is possible.
    fn pose_difference(&self, sight: &Sight, stamp: f64) -> f64 {
        let expected = self.sight.place + self.velocity * (stamp - self.stamp);
        let mut offset = sight.place - expected;
        if !(self.sight.deep && sight.deep) {
            offset -= sight.direction * offset.dot(sight.direction);
        }
        offset.length() / self.limit(stamp)
    }
}

/// All regions of one camera's picture that are followed.
#[derive(Clone, Debug)]
pub struct Blobs {
    /// Those of the last picture first, in the order of its candidates.
    pub items: Vec<Blob>,
    /// Of each site when it was last seen, or first missed; NaN: never looked for.
    pub(super) missed: Vec<f64>,
    pub(super) stamp: f64,
}

impl Blobs {
    /// None yet, for so many sites.
    pub fn new(sites: usize) -> Self {
        Self { items: Vec::new(), missed: vec![f64::NAN; sites], stamp: f64::NEG_INFINITY }
    }

    /// Takes up the sights of a picture, each of which is then the blob of its number; those that were not seen for long are dropped.
    pub fn follow(&mut self, sights: &[Sight], stamp: f64) {
        let apart = |row: usize, column: usize| self.items[row].pose_difference(&sights[column], stamp);
        let cost = CostTable::from_fn(self.items.len(), sights.len(), apart);
        let pairs = assign(&cost, 1.0, None);
        let near = |&(row, column): &(usize, usize)| cost.at(row, column) < AS_EXPECTED;
        let kept: Vec<i32> = pairs
            .iter()
            .filter(|pair| self.items[pair.0].label.is_some() && near(pair))
            .map(|(_, column)| sights[*column].region)
            .collect();
        let mut items: Vec<Option<Blob>> = self.items.drain(..).map(Some).collect();
        let mut updated: Vec<Option<Blob>> = vec![None; sights.len()];
        for pair in &pairs {
            let Some(mut blob) = items[pair.0].take() else { continue };
            // What reappears far from where it was going, as a part of a region that has a name, is that one's.
            if !near(pair) && kept.contains(&sights[pair.1].region) {
                blob.label = None;
            }
            blob.update(sights[pair.1], stamp);
            updated[pair.1] = Some(blob);
        }
        let new =
            |(blob, sight): (Option<Blob>, &Sight)| blob.unwrap_or_else(|| Blob::new(*sight, stamp, self.missed.len()));
        let mut found: Vec<Blob> = updated.into_iter().zip(sights).map(new).collect();
        for mut blob in items.into_iter().flatten() {
            if blob.stamp >= stamp || stamp - blob.stamp >= FORGET {
                continue;
            }
            blob.velocity *= 0.5;
            let limit = blob.limit(stamp);
            match sights.iter().position(|sight| blob.pose_difference(sight, stamp) * limit <= ONE_HAND) {
                Some(same) => blob.merge(&mut found[same]),
                None => found.push(blob),
            }
        }
        self.items = found;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(x: f64) -> Sight {
        let place = Vec3::new(x, 0.0, 2.0);
        Sight { direction: Vec3::Z, place, deep: true, hand: true, region: 1, still: false }
    }

    #[test]
    fn a_region_goes_on_and_is_known_again_after_a_gap() {
        let mut blobs = Blobs::new(3);
        for step in 0..5 {
            blobs.follow(&[sight(0.05 * f64::from(step)), sight(1.0)], 0.033 * f64::from(step));
        }
        blobs.items[0].label = Some(1);
        assert_eq!((blobs.items.len(), blobs.items[0].count), (2, 5));
        assert!((blobs.items[0].velocity.x - 1.42).abs() < 0.1);
        blobs.follow(&[sight(1.0)], 0.165);
        assert_eq!((blobs.items.len(), blobs.items[1].label), (2, Some(1)), "not seen for a moment");
        blobs.follow(&[sight(0.26), sight(1.0)], 0.198);
        assert_eq!((blobs.items[0].label, blobs.items[0].count), (Some(1), 6));
        blobs.follow(&[sight(1.0)], 0.5);
        assert_eq!(blobs.items.len(), 1, "not seen for long");
    }

    #[test]
    fn without_depth_only_what_is_across_the_ray_counts() {
        let far = Sight { place: Vec3::new(0.0, 0.0, 5.0), deep: false, ..sight(0.0) };
        let mut blobs = Blobs::new(1);
        blobs.follow(&[sight(0.0)], 0.0);
        blobs.follow(&[far], 0.033);
        assert_eq!((blobs.items.len(), blobs.items[0].count), (1, 2));
        assert_eq!(blobs.items[0].velocity, Vec3::ZERO);
    }
}
