//! Steps 2-4: which candidate belongs to which limb, fewer of them, and the closest points (K06 IV-B.2-4).

use crate::body::{Body, Limb};
use crate::candidates::{ANY_LIMB, Candidates};
use crate::config::{Config, Overlap};
use crate::correspondence::LimbMatches;
use crate::geometry::{Pose, Vec3};
use crate::shape::Region;

/// Distance of a candidate that lies outside a limb's box.
const OUTSIDE: f32 = f32::INFINITY;

/// Working memory of the assignment.
#[derive(Debug, Default)]
pub struct Assignment {
    /// `distance[limb * candidates + i]`: rough distance to the surface inside the limb's box, else infinite.
    distance: Vec<f32>,
    /// Candidates of each limb.
    members: Vec<Vec<u32>>,
}

impl Assignment {
    /// Step 2: assigns the candidates to limbs by the limbs' enlarged boxes and the overlap policy.
    pub fn assign(&mut self, body: &Body, poses: &[Pose], candidates: &Candidates, overlap: Overlap, box_margin: f64) {
        let count = candidates.len();
        self.distance.resize(count * poses.len(), OUTSIDE);
        self.members.resize_with(poses.len(), Vec::new);
        self.members.truncate(poses.len());
        self.members.iter_mut().for_each(Vec::clear);
        if count == 0 {
            return;
        }
        for ((limb, pose), row) in body.limbs().iter().zip(poses).zip(self.distance.chunks_exact_mut(count)) {
            BoxDistance::new(limb, pose, box_margin).fill(candidates, row);
        }
        for index in 0..count {
            match candidates.limb[index] {
                ANY_LIMB => self.share(body, index, count, overlap),
                limb => self.members[usize::from(limb)].push(index as u32),
            }
        }
    }

    fn share(&mut self, body: &Body, index: usize, count: usize, policy: Overlap) {
        let limbs = self.members.len();
        let (mut closest, mut least) = (0, OUTSIDE);
        for limb in 0..limbs {
            let distance = self.distance[limb * count + index];
            if distance < least {
                (closest, least) = (limb, distance);
            }
        }
        if least == OUTSIDE {
            return;
        }
        match policy {
            Overlap::Exclusive => self.members[closest].push(index as u32),
            Overlap::Shared | Overlap::Adjacent => {
                for limb in 0..limbs {
                    let inside = self.distance[limb * count + index] < OUTSIDE;
                    if inside && (policy == Overlap::Shared || limb == closest || body.adjacent(limb, closest)) {
                        self.members[limb].push(index as u32);
                    }
                }
            }
        }
    }

    /// Steps 3 and 4: samples the candidates of a limb and finds their closest points; those too far or on a cap that faces
    /// a joint get weight zero.
    pub fn match_limb(
        &self,
        index: usize,
        limb: &Limb,
        pose: &Pose,
        candidates: &Candidates,
        config: &Config,
        max_distance: f64,
        matches: &mut LimbMatches,
    ) {
        let members = &self.members[index];
        let kept = sampled_count(members.len(), config);
        matches.candidate.clear();
        matches.measured.clear();
        matches.weight.clear();
        for sample in 0..kept {
            let candidate = members[sample * members.len() / kept] as usize;
            matches.candidate.push(candidate as u32);
            let points = &candidates.points;
            matches.measured.push([points.x[candidate], points.y[candidate], points.z[candidate]]);
            matches.weight.push(candidates.weight[candidate]);
        }
        limb.shape.closest_points(pose, &matches.measured, &mut matches.surface);
        let refused = refused_regions(limb);
        let limit = max_distance as f32;
        for ((weight, distance), region) in
            matches.weight.iter_mut().zip(&matches.surface.signed_distance).zip(&matches.surface.region)
        {
            if distance.abs() > limit || refused[usize::from(*region)] {
                *weight = 0.0;
            }
        }
    }
}

/// How many of a limb's candidates are used (K06 IV-B.3).
fn sampled_count(members: usize, config: &Config) -> usize {
    (members / config.sampling_factor).max(config.min_limb_points).min(config.max_limb_points).min(members)
}

/// Caps and rims that face a joint lie inside the body.
fn refused_regions(limb: &Limb) -> [bool; 5] {
    let [proximal, distal] = limb.match_caps;
    let mut refused = [false; 5];
    refused[Region::ProximalCap as usize] = !proximal;
    refused[Region::ProximalRim as usize] = !proximal;
    refused[Region::DistalCap as usize] = !distal;
    refused[Region::DistalRim as usize] = !distal;
    refused
}

/// Box test and rough distance of a tapered elliptic cylinder, in single precision for whole rows of candidates.
struct BoxDistance {
    axes: [[f32; 3]; 3],
    shift: [f32; 3],
    low: [f32; 3],
    high: [f32; 3],
    length: f32,
    a: [f32; 2],
    b: [f32; 2],
}

impl BoxDistance {
    fn new(limb: &Limb, pose: &Pose, margin: f64) -> Self {
        let to_f32 = |v: Vec3| v.to_array().map(|value| value as f32);
        let limb_from_working = pose.inverse();
        let bounds = limb.shape.local_aabb();
        let shape = &limb.shape;
        Self {
            axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_f32(limb_from_working.rotation * axis)),
            shift: to_f32(limb_from_working.translation),
            low: to_f32(bounds.mins - Vec3::splat(margin)),
            high: to_f32(bounds.maxs + Vec3::splat(margin)),
            length: shape.length() as f32,
            a: [shape.a0() as f32, ((shape.a1() - shape.a0()) / shape.length()) as f32],
            b: [shape.b0() as f32, ((shape.b1() - shape.b0()) / shape.length()) as f32],
        }
    }

    fn fill(&self, candidates: &Candidates, row: &mut [f32]) {
        let points = &candidates.points;
        let coordinates = points.x.iter().zip(&points.y).zip(&points.z);
        for (distance, ((x, y), z)) in row.iter_mut().zip(coordinates) {
            *distance = self.distance(*x, *y, *z);
        }
    }

    /// About `(rho - 1) / |grad rho|` beside the limb with `rho^2 = (x/a)^2 + (y/b)^2`, and the distance beyond its ends.
    #[inline(always)]
    fn distance(&self, x: f32, y: f32, z: f32) -> f32 {
        let local = [0, 1, 2].map(|i| self.axes[0][i] * x + self.axes[1][i] * y + self.axes[2][i] * z + self.shift[i]);
        let inside = |axis: usize| (local[axis] >= self.low[axis]) & (local[axis] <= self.high[axis]);
        let along = local[2].clamp(0.0, self.length);
        let a = (self.a[0] + self.a[1] * along).max(1e-4);
        let b = (self.b[0] + self.b[1] * along).max(1e-4);
        let (u, v) = (local[0] / a, local[1] / b);
        let square = u * u + v * v;
        let rho = square.sqrt();
        let gradient = ((u / a) * (u / a) + (v / b) * (v / b)).sqrt().max(1e-9);
        let side = ((square - rho) / gradient).abs();
        let beyond = (local[2] - along).abs();
        let distance = (side * side + beyond * beyond).sqrt();
        if inside(0) & inside(1) & inside(2) { distance } else { OUTSIDE }
    }
}
