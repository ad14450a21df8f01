//! Steps 2-4: assigns candidates to limbs, samples them, and finds the closest points (K06 IV-B.2-4).

use crate::association::correspondence::LimbMatches;
use crate::association::nearest_limb::{NONE, NearestLimb};
use crate::body::{Body, Limb};
use crate::config::{Config, Overlap};
use crate::math::{Points, Pose, reset, vectorized};
use crate::observation::candidates::{ANY_LIMB, Candidates};
use crate::shape::Region;

/// Working memory of the assignment.
#[derive(Debug, Default)]
pub(crate) struct Assignment {
    /// Candidate indices of each limb, ascending.
    members: Vec<Vec<u32>>,
    search: NearestLimb,
    /// The nearest limb of each candidate.
    nearest: Vec<u32>,
}

impl Assignment {
    /// Step 2: assigns the candidates to limbs by the limbs' enlarged boxes and the overlap policy. Limbs inside other limbs
    /// get none unless `buried`.
    pub(crate) fn assign(
        &mut self,
        body: &Body,
        poses: &[Pose],
        candidates: &Candidates,
        overlap: Overlap,
        box_margin: f64,
        buried: bool,
    ) {
        let Self { members, search, nearest } = self;
        // One more list for the candidates outside all boxes.
        members.resize_with(poses.len() + 1, Vec::new);
        for limb in members.iter_mut() {
            limb.clear();
            // Reserves the full capacity at once, so that no frame reallocates.
            limb.reserve(candidates.len());
        }
        nearest.resize(candidates.len(), NONE);
        search.place(body, poses, box_margin, buried);
        search.find(&candidates.clusters, nearest);
        if overlap == Overlap::Exclusive {
            let count = candidates.len();
            let (nearest, known) = (&nearest[..count], &candidates.limb[..count]);
            let limb_of = |index: usize| {
                let limb = if known[index] == ANY_LIMB { nearest[index] } else { u32::from(known[index]) };
                (limb as usize).min(poses.len())
            };
            // Consecutive candidates mostly belong to the same limb; pushing them one at a time would wait for the list length
            // each time.
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
                ANY_LIMB => {
                    let (place, nearest) = (index as usize, *nearest as usize);
                    let Points { x, y, z } = &candidates.points;
                    for limb in search.around([x[place], y[place], z[place]]) {
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
    pub(crate) fn sample_limb(
        &self,
        index: usize,
        candidates: &Candidates,
        config: &Config,
        matches: &mut LimbMatches,
    ) {
        let members = &self.members[index];
        let kept = sampled_count(members.len(), config);
        matches.candidate.clear();
        matches.left_out.clear();
        matches.reserve(config.max_limb_points.min(candidates.len()), candidates.len());
        if kept == members.len() {
            matches.candidate.extend_from_slice(members);
        } else {
            let sample = |number: usize| number * members.len() / kept;
            matches.candidate.extend((0..kept).map(|number| members[sample(number)]));
            for number in 0..kept {
                let others = &members[sample(number) + 1..sample(number + 1)];
                matches.left_out.extend(others.iter().map(|candidate| [*candidate, number as u32]));
            }
        }
        pick(candidates, matches);
        reset(&mut matches.own, matches.candidate.len(), 1.0);
    }
}

/// Copies the positions and weights of a limb's sampled candidates.
fn pick(candidates: &Candidates, matches: &mut LimbMatches) {
    let LimbMatches { candidate, measured, base_weight, .. } = matches;
    measured.resize(candidate.len());
    base_weight.resize(candidate.len(), 0.0);
    // Columns of equal length: one bounds check of the index covers them all.
    let count = candidates.len();
    let Points { x, y, z } = &candidates.points;
    let (x, y, z, weight) = (&x[..count], &y[..count], &z[..count], &candidates.weight[..count]);
    let places = measured.x.iter_mut().zip(&mut measured.y).zip(&mut measured.z).zip(base_weight);
    for (index, (((to_x, to_y), to_z), base_weight)) in candidate.iter().zip(places) {
        let index = *index as usize;
        (*to_x, *to_y, *to_z, *base_weight) = (x[index], y[index], z[index], weight[index]);
    }
}

/// The weight of a point falls smoothly to zero over this last fraction of the maximum distance.
const GATE_FADE: f32 = 0.3;

/// Step 4: finds the closest points of a limb's sampled candidates. Points that are too far, or closest to a cap that faces a
/// joint, get weight zero. With `fades`, the weight falls to zero continuously.
pub(crate) fn match_limb(limb: &Limb, pose: &Pose, max_distance: f64, fades: bool, matches: &mut LimbMatches) {
    limb.shape.closest_points(pose, &matches.measured, &mut matches.surface);
    let (refused, limit) = (refused_regions(limb), max_distance as f32);
    let LimbMatches { weight, base_weight, surface, .. } = matches;
    weight.resize(base_weight.len(), 0.0);
    let per_meter = if fades { 1.0 / (GATE_FADE * limit) } else { f32::INFINITY };
    vectorized!({
        let found = base_weight.iter().zip(&surface.signed_distance).zip(&surface.region);
        for (weight, ((base_weight, distance), region)) in weight.iter_mut().zip(found) {
            let kept = (distance.abs() <= limit) & (refused >> *region as u32 & 1 == 0);
            let fade = ((limit - distance.abs()) * per_meter).min(1.0);
            *weight = if kept { *base_weight * fade * fade * (3.0 - 2.0 * fade) } else { 0.0 };
        }
    });
}

/// How many of a limb's candidates are used (K06 IV-B.3).
fn sampled_count(members: usize, config: &Config) -> usize {
    (members / config.sampling_factor).max(config.min_limb_points).min(config.max_limb_points).min(members)
}

/// Caps and rims that face a joint lie inside the body: one bit per region.
fn refused_regions(limb: &Limb) -> u32 {
    let [proximal, distal] = limb.match_caps;
    let both = |cap: Region, rim: Region, matched: bool| if matched { 0 } else { 1 << cap as u32 | 1 << rim as u32 };
    both(Region::ProximalCap, Region::ProximalRim, proximal) | both(Region::DistalCap, Region::DistalRim, distal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::math::Vec3;
    use crate::observation::background::Backgrounds;
    use crate::observation::candidates::body_box;
    use crate::observation::frame::{Cloud, Frame, PointSlice, Scope};
    use crate::testing::views;

    const MARGIN: f64 = 0.1;

    /// A body, and points around it; the last ten are known to lie on limb 3.
    fn scene() -> (Body, Vec<Pose>, Candidates) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = body.rest_pose(Pose::IDENTITY);
        let points: Vec<[f64; 3]> = (0..3000_usize)
            .map(|n| [0.4, 0.9, 2.4].map(|size| size * 1e-3 * ((n * 7919 + (size * 1e3) as usize * n) % 1000) as f64))
            .map(|[x, y, z]| [x - 0.2, y - 0.45, z - 1.2])
            .collect();
        let cloud = |points, scope| Cloud {
            points: PointSlice::F64(points),
            world_from_sensor: Pose::IDENTITY,
            weight: 1.0,
            scope,
            source: 0,
        };
        let clouds = [cloud(&points, Scope::Free), cloud(&points[..10], Scope::Limb(3))];
        let mut candidates = Candidates::default();
        let bounds = body_box(&body, &poses, 0.3);
        let frame = Frame { clouds: &clouds, ..Frame::empty(0.0) };
        candidates.gather(views(&frame, &Backgrounds::default()), &bounds, &Config::default());
        assert!(candidates.len() > 1500);
        (body, poses, candidates)
    }

    /// The limbs that contain each candidate after an assignment.
    fn holders(overlap: Overlap) -> (Body, Vec<Pose>, Candidates, Vec<Vec<usize>>) {
        let (body, poses, candidates) = scene();
        let mut assignment = Assignment::default();
        assignment.assign(&body, &poses, &candidates, overlap, MARGIN, true);
        let mut holders = vec![Vec::new(); candidates.len()];
        for (limb, members) in assignment.members[..poses.len()].iter().enumerate() {
            assert!(members.is_sorted_by(|a, b| a < b), "ascending, none twice");
            members.iter().for_each(|index| holders[*index as usize].push(limb));
        }
        (body, poses, candidates, holders)
    }

    /// Whether a limb's enlarged box contains a candidate; `None` within rounding error of its border.
    fn in_box(body: &Body, poses: &[Pose], limb: usize, point: Vec3) -> Option<bool> {
        let (bounds, local) = (body.limbs()[limb].shape.local_aabb(), poses[limb].inverse_transform_point(point));
        let outside = (bounds.mins - local).max(local - bounds.maxs).max_element() - MARGIN;
        (outside.abs() > 1e-5).then_some(outside < 0.0)
    }

    #[test]
    fn shared_gives_a_point_to_every_limb_whose_box_holds_it() {
        let (body, poses, candidates, holders) = holders(Overlap::Shared);
        for (index, holders) in holders.iter().enumerate().filter(|(index, _)| candidates.limb[*index] == ANY_LIMB) {
            for limb in 0..poses.len() {
                if let Some(inside) = in_box(&body, &poses, limb, candidates.points.get(index)) {
                    assert_eq!(holders.contains(&limb), inside, "point {index}, limb {limb}");
                }
            }
        }
    }

    #[test]
    fn exclusive_gives_a_point_to_one_limb_and_known_points_to_theirs() {
        let (body, poses, candidates, holders) = holders(Overlap::Exclusive);
        let mut near = 0;
        for (index, holders) in holders.iter().enumerate() {
            if candidates.limb[index] != ANY_LIMB {
                assert_eq!(*holders, [3]);
                continue;
            }
            assert!(holders.len() <= 1);
            let point = candidates.points.get(index);
            let distance = |limb: usize| {
                body.limbs()[limb].shape.closest_point(poses[limb].inverse_transform_point(point)).signed_distance
            };
            let Some(limb) = holders.first() else { continue };
            let least = (0..poses.len()).map(distance).fold(f64::INFINITY, f64::min);
            // The distance is approximate away from the surface, and accurate near and outside it.
            if least > 0.0 && least < 0.03 {
                assert!(distance(*limb) < least + 0.01, "point {index}: {} m, not {least} m", distance(*limb));
                near += 1;
            }
        }
        assert!(near > 50, "{near}");
    }

    #[test]
    fn sampling_keeps_as_many_points_as_configured() {
        let config = Config { sampling_factor: 4, min_limb_points: 20, max_limb_points: 60, ..Config::default() };
        for (members, kept) in [(0, 0), (10, 10), (40, 20), (100, 25), (1000, 60)] {
            assert_eq!(sampled_count(members, &config), kept, "of {members}");
        }
    }

    #[test]
    fn far_points_and_caps_at_joints_weigh_nothing() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let limb = &body.limbs()[body.limb_index("l_forearm").unwrap()];
        let (length, radius) = (limb.shape.length(), limb.shape.a0());
        let mut matches = LimbMatches::default();
        for place in [[radius + 0.01, 0.0, 0.4 * length], [0.5, 0.0, 0.4 * length], [0.0, 0.0, -0.02]] {
            matches.measured.push(place.map(|value| value as f32));
            matches.base_weight.push(0.7);
        }
        match_limb(limb, &Pose::IDENTITY, 0.15, false, &mut matches);
        assert_eq!(matches.weight, [0.7, 0.0, 0.0], "beside the limb, too far, beyond the elbow");
    }
}
