//! Assigns the tracked skin regions to the sites head and hands.

use crate::skin::assignment::assign;
use crate::skin::blobs::{Blob, Blobs, ONE_HAND};
use voodoo_core::math::CostTable;

/// Time constant of the averaged squared distance to a site, seconds.
const AGREEMENT: f64 = 0.15;
/// Frame rate for which that holds, 1/s.
const RATE: f64 = 30.0;
/// Distances are clipped to this before averaging, as a fraction of the gate.
const FARTHEST_GATES: f64 = 2.0;
/// Cost of keeping an assignment at the edge of the gate.
const HELD: f64 = 0.3;
/// Greatest cost of keeping an assignment; less than the cost of no region.
const DRIFTED: f64 = 0.75;
/// Cost of taking a site from another region; it makes undoing a swap cheaper than the swap.
const TAKEN: f64 = 0.5;
/// Cost of a site without a region.
const NONE: f64 = 0.8;
/// A region loses its site after the two have disagreed for this time, seconds: the body stayed farther than
/// [`MISMATCH_DISTANCE`] from it, or it lay on another limb.
const MISMATCH_TIME: f64 = 0.25;
/// See [`MISMATCH_TIME`]; as a fraction of the gate.
const MISMATCH_DISTANCE: f64 = 1.25;
/// Longest interval between two frames that counts towards [`MISMATCH_TIME`], seconds, so that a mismatch needs several frames.
const LONGEST_PREDICTION: f64 = 0.1;
/// Frames in which a region must have been detected before it may be assigned to a distant site.
const OLD_ENOUGH: usize = 3;
/// Another region within this fraction of the gate makes a new assignment ambiguous, however near the first one is.
const RIVAL: f64 = 0.5;

/// Parameters of the assignment of regions to sites.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    /// Gate of a new region around the predicted site, meters.
    pub gate: f64,
    /// Growth of the gate while its site is not detected, meters per second.
    pub growth: f64,
    /// A new assignment requires that the second-best candidate is this many times as far as the best one.
    pub ambiguity: f64,
}

/// A site and its possible regions.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    /// Index of the site.
    pub site: usize,
    /// Largest gate, meters.
    pub widest: f64,
    /// Distance from each blob, meters.
    pub distance: Vec<f64>,
    /// For each blob: 0 if it cannot be the site, 1 if only near the predicted position, 2 if anywhere.
    pub allowed: Vec<u8>,
    /// For each blob, whether it lies on another part of the body in the estimated pose.
    pub elsewhere: Vec<bool>,
}

impl Blobs {
    /// Assigns the blobs of this frame, which come first in the list, to sites: pairs of choice index and blob index.
    pub(super) fn name(&mut self, choices: &mut [Choice], rules: &Rules, stamp: f64) -> Vec<(usize, usize)> {
        let count = choices.first().map_or(0, |choice| choice.distance.len());
        let elapsed = (stamp - self.stamp).clamp(0.0, LONGEST_PREDICTION);
        self.stamp = stamp;
        for choice in choices.iter_mut() {
            for (column, blob) in self.items[..count].iter_mut().enumerate() {
                blob.update_mismatch(choice, column, rules.gate, elapsed);
                if blob.mismatch[choice.site] > MISMATCH_TIME {
                    choice.allowed[column] = 0;
                }
            }
        }
        let owner = |choice: &Choice| {
            let mut blobs = self.items[..count].iter().zip(&choice.allowed);
            blobs.any(|(blob, allowed)| blob.label == Some(choice.site) && *allowed > 0)
        };
        let owners: Vec<usize> = choices.iter().filter(|choice| owner(choice)).map(|choice| choice.site).collect();
        let mut costs = vec![f64::INFINITY; choices.len() * count];
        for (row, choice) in choices.iter().enumerate() {
            let missed = &mut self.missed[choice.site];
            *missed = if missed.is_nan() { stamp } else { *missed };
            let reach = rules.gate.max((rules.gate + rules.growth * (stamp - *missed)).min(choice.widest));
            for column in 0..count {
                self.items[column].update_distance(choice.site, choice.distance[column], rules.gate);
                if let Some(value) = naming_cost(&self.items[..count], choice, column, &owners, (rules, reach)) {
                    costs[row * count + column] = value.sqrt();
                }
            }
        }
        let cost = CostTable::from_fn(choices.len(), count, |row, column| costs[row * count + column]);
        let named = assign(&cost, 1.0, Some(NONE));
        for blob in &mut self.items {
            let renamed = blob.label.is_some_and(|label| named.iter().any(|(row, _)| choices[*row].site == label));
            if renamed || blob.stamp == stamp {
                blob.label = None;
            }
        }
        for (row, column) in &named {
            self.items[*column].label = Some(choices[*row].site);
            self.missed[choices[*row].site] = stamp;
        }
        named
    }
}

impl Blob {
    /// Updates how long a blob has contradicted a site: it lies on another limb, or it has the site's label but the body does not
    /// approach it.
    fn update_mismatch(&mut self, choice: &Choice, column: usize, gate: f64, elapsed: f64) {
        let named = self.label == Some(choice.site) && self.sight.deep;
        let against = choice.elsewhere[column] || (named && choice.distance[column] > MISMATCH_DISTANCE * gate);
        let mismatch = &mut self.mismatch[choice.site];
        *mismatch = (*mismatch + if against { elapsed } else { -elapsed }).clamp(0.0, 2.0 * MISMATCH_TIME);
    }

    /// Updates the running mean with a distance from a site.
    fn update_distance(&mut self, site: usize, distance: f64, gate: f64) {
        let sample = (distance / gate).min(FARTHEST_GATES).powi(2);
        let weight = if self.count == 1 { 1.0 } else { 1.0 - (-1.0 / (RATE * AGREEMENT)).exp() };
        let far = &mut self.far[site];
        *far = (1.0 - weight) * if far.is_nan() { sample } else { *far } + weight * sample;
    }
}

/// Cost of assigning a blob to a site; `None` where that is impossible.
fn naming_cost(
    blobs: &[Blob],
    choice: &Choice,
    column: usize,
    owners: &[usize],
    (rules, reach): (&Rules, f64),
) -> Option<f64> {
    let able = |column: usize| {
        let (near, allowed) = (choice.distance[column], choice.allowed[column]);
        let far = near < reach && allowed > 1 && blobs[column].count >= OLD_ENOUGH;
        allowed > 0 && !choice.elsewhere[column] && (near < rules.gate || far)
    };
    let (blob, near) = (&blobs[column], choice.distance[column]);
    let far = blob.far[choice.site];
    if blob.label == Some(choice.site) && choice.allowed[column] > 0 {
        return Some((HELD * far).min(DRIFTED));
    }
    if !able(column) {
        return None;
    }
    if owners.contains(&choice.site) || blob.label.is_some_and(|label| owners.contains(&label)) {
        return (blob.count >= OLD_ENOUGH && near < rules.gate).then_some(TAKEN + far);
    }
    let rival = |other: &usize| {
        able(*other) && blobs[*other].label.is_none() && blobs[*other].sight.place.distance(blob.sight.place) > ONE_HAND
    };
    let rivals = (0..blobs.len()).filter(rival).map(|other| choice.distance[other]);
    let clear = rivals.fold(f64::INFINITY, f64::min) >= (rules.ambiguity * near).max(RIVAL * rules.gate);
    clear.then(|| DRIFTED * (near / reach).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skin::blobs::Sight;
    use voodoo_core::math::Vec3;

    const RULES: Rules = Rules { gate: 0.12, growth: 1.0, ambiguity: 1.5 };

    fn sight(x: f64) -> Sight {
        let place = Vec3::new(x, 0.0, 2.0);
        Sight { direction: Vec3::Z, place, deep: true, hand: true, region: (100.0 * x) as i32, still: false }
    }

    fn choice(site: usize, distance: &[f64], allowed: u8) -> Choice {
        let count = distance.len();
        let (distance, allowed) = (distance.to_vec(), vec![allowed; count]);
        Choice { site, widest: 0.8, distance, allowed, elsewhere: vec![false; count] }
    }

    #[test]
    fn a_name_is_given_where_one_region_is_nearest_and_kept_while_the_body_falls_behind() {
        let mut blobs = Blobs::new(2);
        blobs.follow(&[sight(0.0), sight(0.5)], 0.0);
        let mut near = [choice(0, &[0.02, 0.5], 1), choice(1, &[0.5, 0.03], 1)];
        assert_eq!(blobs.name(&mut near, &RULES, 0.0), [(0, 0), (1, 1)]);
        blobs.follow(&[sight(0.1), sight(0.5)], 0.033);
        let mut behind = [choice(0, &[0.13, 0.5], 1), choice(1, &[0.4, 0.03], 1)];
        assert_eq!(blobs.name(&mut behind, &RULES, 0.033), [(0, 0), (1, 1)]);
        for step in 2..20 {
            let stamp = 0.033 * f64::from(step);
            blobs.follow(&[sight(0.1), sight(0.5)], stamp);
            let mut off = [choice(0, &[0.2, 0.5], 1), choice(1, &[0.4, 0.03], 1)];
            let named = blobs.name(&mut off, &RULES, stamp);
            assert_eq!(named.len() == 2, step < 9, "{step}: in doubt for a quarter of a second");
        }
    }

    #[test]
    fn two_that_could_be_it_are_none() {
        let mut blobs = Blobs::new(1);
        blobs.follow(&[sight(0.0), sight(0.15)], 0.0);
        assert_eq!(blobs.name(&mut [choice(0, &[0.07, 0.08], 1)], &RULES, 0.0), []);
        assert_eq!(blobs.name(&mut [choice(0, &[0.03, 0.11], 1)], &RULES, 0.01), [(0, 0)]);
    }

    #[test]
    fn from_afar_only_an_old_region_is_named_and_only_after_a_while() {
        let mut blobs = Blobs::new(1);
        for step in 0..12 {
            let stamp = 0.033 * f64::from(step);
            blobs.follow(&[sight(0.3)], stamp);
            let named = blobs.name(&mut [choice(0, &[0.3], 2)], &RULES, stamp);
            assert_eq!(named.len() == 1, step >= 6, "{step}");
        }
    }
}
