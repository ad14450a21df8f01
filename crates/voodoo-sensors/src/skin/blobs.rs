//! Skin regions tracked from frame to frame.
//!
//! In K06 each face or hand has a region tracker of its own, which knows where its region was in the last frame. So a region
//! keeps its label (its site) while it moves continuously, even when the body model lags. The body model assigns labels to new
//! regions. A label passes to another region only when that one agrees better with the model for some time.

use crate::skin::assignment::assign;
use voodoo_core::math::{CostTable, Vec3};

/// Greatest distance of a region from its extrapolated position between two frames, meters.
const BLOB_JUMP: f64 = 0.12;
/// The same distance for a region that was detected only once, whose velocity is unknown.
const UNKNOWN_JUMP: f64 = 0.24;
/// A distance below this fraction of the greatest one counts as continuous motion.
const AS_EXPECTED: f64 = 0.5;
/// A region that was not detected for this time loses its label, seconds.
const FORGET: f64 = 0.25;
/// Greatest speed of a hand, meters per second.
const FASTEST: f64 = 8.0;
/// Growth of the position uncertainty of a region that is not detected, meters per second.
const UNSEEN_SPEED: f64 = 2.0;
/// Nominal interval between frames, seconds: an undetected time that a region of the last frame always has.
const PERIOD: f64 = 1.0 / 30.0;
/// Two candidates within this distance are one hand, meters.
pub(super) const ONE_HAND: f64 = 0.09;

/// A candidate in 3-D.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Unit direction from the camera's focal point, world frame.
    pub direction: Vec3,
    /// Position on the surface, meters; at a guessed distance without depth.
    pub place: Vec3,
    /// Whether its distance was measured by a depth camera.
    pub deep: bool,
    /// False if it cannot be a hand.
    pub hand: bool,
    /// Label of its region in the mask.
    pub region: i32,
    /// Whether no surface behind it was ever observed, so that it may be part of the scene.
    pub still: bool,
}

/// A tracked region: its last detection, its velocity and its distance from each site.
#[derive(Clone, Debug, PartialEq)]
pub struct Blob {
    /// Last detection.
    pub sight: Sight,
    /// Time of that detection, seconds.
    pub stamp: f64,
    /// Velocity, meters per second.
    pub velocity: Vec3,
    /// Number of frames in which it was detected.
    pub count: usize,
    /// Index of the site that it is assigned to.
    pub label: Option<usize>,
    /// For each site the running mean of the squared distance, in units of the gate; NaN if unknown.
    pub far: Vec<f64>,
    /// For each site, how long the region has contradicted it, seconds.
    pub mismatch: Vec<f64>,
}

impl Blob {
    fn new(sight: Sight, stamp: f64, sites: usize) -> Self {
        let (far, mismatch) = (vec![f64::NAN; sites], vec![0.0; sites]);
        Self { sight, stamp, velocity: Vec3::ZERO, count: 1, label: None, far, mismatch }
    }

    /// Updates the region with a detection.
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

    /// Takes over the label and history of a blob that is the same region as one detected in this frame.
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

    /// Distance of a detection from the extrapolated position, in units of the greatest possible one.
    fn pose_difference(&self, sight: &Sight, stamp: f64) -> f64 {
        let expected = self.sight.place + self.velocity * (stamp - self.stamp);
        let mut offset = sight.place - expected;
        if !(self.sight.deep && sight.deep) {
            offset -= sight.direction * offset.dot(sight.direction);
        }
        offset.length() / self.limit(stamp)
    }
}

/// All tracked regions of one camera.
#[derive(Clone, Debug)]
pub struct Blobs {
    /// Blobs of the last frame first, in the order of its candidates.
    pub items: Vec<Blob>,
    /// For each site the time of its last detection or of its first miss; NaN if it was never searched for.
    pub(super) missed: Vec<f64>,
    pub(super) stamp: f64,
}

impl Blobs {
    /// Returns an empty tracker for this number of sites.
    pub fn new(sites: usize) -> Self {
        Self { items: Vec::new(), missed: vec![f64::NAN; sites], stamp: f64::NEG_INFINITY }
    }

    /// Updates the blobs with the detections of a frame; detection `i` becomes blob `i`. Blobs that were not detected for long
    /// are removed.
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
            // A detection far from the extrapolated position belongs to the region of this frame that has a label already.
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
