//! Steps 2-4: which candidate belongs to which limb, fewer of them, and the closest points (K06 IV-B.2-4).

use crate::body::{Body, Limb};
use crate::candidates::{ANY_LIMB, Candidates};
use crate::config::{Config, Overlap};
use crate::correspondence::LimbMatches;
use crate::geometry::Pose;
use crate::nearest::{NONE, Nearest};
use crate::shape::Region;
use crate::simd::widest;

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
        members.resize_with(poses.len(), Vec::new);
        members.iter_mut().for_each(Vec::clear);
        nearest.resize(candidates.len(), NONE);
        inside.resize(if overlap == Overlap::Exclusive { 0 } else { candidates.len() * poses.len() }, false);
        search.find(body, poses, box_margin, &candidates.clusters, nearest, inside);
        for (index, (nearest, known)) in (0..).zip(nearest.iter().zip(&candidates.limb)) {
            match *known {
                ANY_LIMB if *nearest == NONE => {}
                ANY_LIMB if overlap == Overlap::Exclusive => members[*nearest as usize].push(index),
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
        if kept == members.len() {
            matches.candidate.extend_from_slice(members);
        } else {
            matches.candidate.extend((0..kept).map(|sample| members[sample * members.len() / kept]));
        }
        pick(&matches.candidate, &candidates.points.x, &mut matches.measured.x);
        pick(&matches.candidate, &candidates.points.y, &mut matches.measured.y);
        pick(&matches.candidate, &candidates.points.z, &mut matches.measured.z);
    }
}

fn pick(candidates: &[u32], from: &[f32], to: &mut Vec<f32>) {
    to.clear();
    to.extend(candidates.iter().map(|candidate| from[*candidate as usize]));
}

/// Step 4: finds the closest points of a limb's sampled candidates; those too far or on a cap that faces a joint get weight
/// zero.
pub fn match_limb(limb: &Limb, pose: &Pose, candidates: &Candidates, max_distance: f64, matches: &mut LimbMatches) {
    pick(&matches.candidate, &candidates.weight, &mut matches.weight);
    limb.shape.closest_points(pose, &matches.measured, &mut matches.surface);
    let (refused, limit) = (refused_regions(limb), max_distance as f32);
    let LimbMatches { weight, surface, .. } = matches;
    widest(
        #[inline(always)]
        || {
            let found = surface.signed_distance.iter().zip(&surface.region);
            for (weight, (distance, region)) in weight.iter_mut().zip(found) {
                let kept = (distance.abs() <= limit) & (refused >> region & 1 == 0);
                *weight = if kept { *weight } else { 0.0 };
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
