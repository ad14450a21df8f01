//! Steps 2-4: which candidate belongs to which limb, fewer of them, and the closest points (K06 IV-B.2-4).

use crate::association::correspondence::LimbMatches;
use crate::association::nearest_limb::{NONE, Nearest};
use crate::body::{Body, Limb};
use crate::config::{Config, Overlap};
use crate::math::{Points, Pose, widest};
use crate::observation::candidates::{ANY_LIMB, Candidates};
use crate::shape::Region;

/// Working memory of the assignment.
#[derive(Debug, Default)]
pub struct Assignment {
    /// Candidates of each limb, ascending.
    members: Vec<Vec<u32>>,
    search: Nearest,
    /// The nearest limb of each candidate.
    nearest: Vec<u32>,
    /// Which limbs' boxes hold each candidate, where the policy asks for it.
    inside: Vec<bool>,
}

impl Assignment {
    /// Step 2: assigns the candidates to limbs by the limbs' enlarged boxes and the overlap policy.
    pub fn assign(&mut self, body: &Body, poses: &[Pose], candidates: &Candidates, overlap: Overlap, box_margin: f64) {
        let Self { members, search, nearest, inside } = self;
        // One more for those in no limb's box.
        members.resize_with(poses.len() + 1, Vec::new);
        for limb in members.iter_mut() {
            limb.clear();
            // Room at once, not when a limb comes to hold more than ever before.
            limb.reserve(candidates.len());
        }
        nearest.resize(candidates.len(), NONE);
        inside.resize(if overlap == Overlap::Exclusive { 0 } else { candidates.len() * poses.len() }, false);
        search.find(body, poses, box_margin, &candidates.clusters, nearest, inside);
        if overlap == Overlap::Exclusive {
            let count = candidates.len();
            let (nearest, known) = (&nearest[..count], &candidates.limb[..count]);
            let limb_of = |index: usize| {
                let limb = if known[index] == ANY_LIMB { nearest[index] } else { u32::from(known[index]) };
                (limb as usize).min(poses.len())
            };
            // Those of a row of pixels mostly follow each other: one at a time would wait for the length of the list.
            let mut start = 0;
            while start < count {
                let limb = limb_of(start);
                let end = (start + 1..count).find(|index| limb_of(*index) != limb).unwrap_or(count);
                members[limb].extend(start as u32..end as u32);
                start = end;
            }
            return;
        }
        for (index, (nearest, known)) in (0..).zip(nearest.iter().zip(&candidates.limb)) {
            match *known {
                ANY_LIMB if *nearest == NONE => {}
                ANY_LIMB => {
                    let inside = &inside[index as usize * poses.len()..][..poses.len()];
                    for (limb, _) in inside.iter().enumerate().filter(|(_, inside)| **inside) {
                        let nearest = *nearest as usize;
                        if overlap == Overlap::Shared || limb == nearest || body.adjacent(limb, nearest) {
                            members[limb].push(index);
                        }
                    }
                }
                limb => members[usize::from(limb)].push(index),
            }
        }
    }

    /// Step 3: samples the candidates of a limb.
    pub fn sample_limb(&self, index: usize, candidates: &Candidates, config: &Config, matches: &mut LimbMatches) {
        let members = &self.members[index];
        let kept = sampled_count(members.len(), config);
        matches.candidate.clear();
        matches.reserve(config.max_limb_points.min(candidates.len()));
        if kept == members.len() {
            matches.candidate.extend_from_slice(members);
        } else {
            matches.candidate.extend((0..kept).map(|sample| members[sample * members.len() / kept]));
        }
        pick(candidates, matches);
    }
}

/// Copies places and weights of a limb's sampled candidates.
fn pick(candidates: &Candidates, matches: &mut LimbMatches) {
    let LimbMatches { candidate, measured, base_weight, .. } = matches;
    measured.resize(candidate.len());
    base_weight.resize(candidate.len(), 0.0);
    // Columns of one length: one check of the index serves them all.
    let count = candidates.len();
    let Points { x, y, z } = &candidates.points;
    let (x, y, z, weight) = (&x[..count], &y[..count], &z[..count], &candidates.weight[..count]);
    let places = measured.x.iter_mut().zip(&mut measured.y).zip(&mut measured.z).zip(base_weight);
    for (index, (((to_x, to_y), to_z), base_weight)) in candidate.iter().zip(places) {
        let index = *index as usize;
        (*to_x, *to_y, *to_z, *base_weight) = (x[index], y[index], z[index], weight[index]);
    }
}

/// Step 4: finds the closest points of a limb's sampled candidates; those too far or on a cap that faces a joint get weight
/// zero.
pub fn match_limb(limb: &Limb, pose: &Pose, max_distance: f64, matches: &mut LimbMatches) {
    limb.shape.closest_points(pose, &matches.measured, &mut matches.surface);
    let (refused, limit) = (refused_regions(limb), max_distance as f32);
    let LimbMatches { weight, base_weight, surface, .. } = matches;
    weight.resize(base_weight.len(), 0.0);
    widest(
        #[inline(always)]
        || {
            let found = base_weight.iter().zip(&surface.signed_distance).zip(&surface.region);
            for (weight, ((base_weight, distance), region)) in weight.iter_mut().zip(found) {
                let kept = (distance.abs() <= limit) & (refused >> region & 1 == 0);
                *weight = if kept { *base_weight } else { 0.0 };
            }
        },
    );
}

/// How many of a limb's candidates are used (K06 IV-B.3).
fn sampled_count(members: usize, config: &Config) -> usize {
    (members / config.sampling_factor).max(config.min_limb_points).min(config.max_limb_points).min(members)
}

/// Caps and rims that face a joint lie inside the body: one bit a region.
fn refused_regions(limb: &Limb) -> u32 {
    let [proximal, distal] = limb.match_caps;
    let both = |cap: Region, rim: Region, matched: bool| if matched { 0 } else { 1 << cap as u32 | 1 << rim as u32 };
    both(Region::ProximalCap, Region::ProximalRim, proximal) | both(Region::DistalCap, Region::DistalRim, distal)
}
