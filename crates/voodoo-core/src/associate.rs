//! Steps 2-4: which candidate belongs to which limb, fewer of them, and the closest points (K06 IV-B.2-4).

use crate::body::{Body, Limb};
use crate::candidates::{ANY_LIMB, Candidates};
use crate::config::{Config, Overlap};
use crate::correspondence::LimbMatches;
use crate::geometry::{Points, Pose, Vec3};
use crate::shape::Region;
use crate::simd::widest;

/// Squared distance of a candidate that lies outside a limb's box.
const OUTSIDE: f32 = f32::INFINITY;
/// Candidates looked at together: short, so that neighbours in an image share few limbs, and a whole number of SIMD lanes.
const BLOCK: usize = 32;
/// What single precision may err in the place of a box, metres; the boxes that only rule out are this much wider.
const ROUNDING: f32 = 1e-4;

/// Working memory of the assignment.
#[derive(Debug, Default)]
pub struct Assignment {
    /// Candidates of each limb, ascending.
    members: Vec<Vec<u32>>,
    boxes: Vec<LimbBox>,
    /// Squared rough distances of one block of candidates to each limb.
    squares: Vec<[f32; BLOCK]>,
}

impl Assignment {
    /// Step 2: assigns the candidates to limbs by the limbs' enlarged boxes and the overlap policy.
    pub fn assign(&mut self, body: &Body, poses: &[Pose], candidates: &Candidates, overlap: Overlap, box_margin: f64) {
        self.members.resize_with(poses.len(), Vec::new);
        self.members.iter_mut().for_each(Vec::clear);
        self.squares.resize(poses.len(), [OUTSIDE; BLOCK]);
        self.boxes.clear();
        let limbs = body.limbs().iter().zip(poses);
        self.boxes.extend(limbs.map(|(limb, pose)| LimbBox::new(limb, pose, box_margin)));
        for start in (0..candidates.len()).step_by(BLOCK) {
            let count = BLOCK.min(candidates.len() - start);
            let block = Block::load(&candidates.points, start, count);
            let (boxes, squares) = (&self.boxes, &mut self.squares);
            let closest = widest(
                #[inline(always)]
                || closest_limbs(&block, boxes, squares),
            );
            for (offset, limb) in candidates.limb[start..start + count].iter().enumerate() {
                match *limb {
                    ANY_LIMB => self.share(body, offset, start + offset, closest[offset], overlap),
                    limb => self.members[usize::from(limb)].push((start + offset) as u32),
                }
            }
        }
    }

    /// Gives a free candidate, at `offset` in the block, to its closest limb and to others as the policy says.
    fn share(&mut self, body: &Body, offset: usize, index: usize, closest: u32, policy: Overlap) {
        let closest = closest as usize;
        if closest >= self.members.len() {
            return;
        }
        match policy {
            Overlap::Exclusive => self.members[closest].push(index as u32),
            Overlap::Shared | Overlap::Adjacent => {
                for limb in 0..self.members.len() {
                    let inside = self.squares[limb][offset] < OUTSIDE;
                    if inside && (policy == Overlap::Shared || limb == closest || body.adjacent(limb, closest)) {
                        self.members[limb].push(index as u32);
                    }
                }
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
    let refused = refused_regions(limb);
    let limit = max_distance as f32;
    let found = matches.surface.signed_distance.iter().zip(&matches.surface.region);
    for (weight, (distance, region)) in matches.weight.iter_mut().zip(found) {
        let kept = (distance.abs() <= limit) & !refused[usize::from(*region)];
        *weight = if kept { *weight } else { 0.0 };
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

/// Some candidates, padded with the last of them.
struct Block {
    x: [f32; BLOCK],
    y: [f32; BLOCK],
    z: [f32; BLOCK],
}

impl Block {
    fn load(points: &Points, start: usize, count: usize) -> Self {
        let pad = |from: &[f32]| match from[start..].first_chunk() {
            Some(whole) => *whole,
            None => {
                let mut to = [from[start + count - 1]; BLOCK];
                to[..count].copy_from_slice(&from[start..]);
                to
            }
        };
        Self { x: pad(&points.x), y: pad(&points.y), z: pad(&points.z) }
    }

    #[inline(always)]
    fn bounds(&self) -> [[f32; 2]; 3] {
        [&self.x, &self.y, &self.z].map(|values| {
            let (mut low, mut high) = ([f32::MAX; 8], [f32::MIN; 8]);
            for lanes in values.as_chunks::<8>().0 {
                for lane in 0..8 {
                    low[lane] = if lanes[lane] < low[lane] { lanes[lane] } else { low[lane] };
                    high[lane] = if lanes[lane] > high[lane] { lanes[lane] } else { high[lane] };
                }
            }
            [low.into_iter().fold(f32::MAX, f32::min), high.into_iter().fold(f32::MIN, f32::max)]
        })
    }
}

/// The closest limb of every candidate of a block (a number too high: none), and the squared distances to all limbs.
#[inline(always)]
fn closest_limbs(block: &Block, boxes: &[LimbBox], squares: &mut [[f32; BLOCK]]) -> [u32; BLOCK] {
    let bounds = block.bounds();
    let (mut closest, mut least) = ([u32::MAX; BLOCK], [OUTSIDE; BLOCK]);
    for ((limb, shape), square) in (0..).zip(boxes).zip(squares) {
        if !shape.reaches(&bounds) {
            *square = [OUTSIDE; BLOCK];
            continue;
        }
        let (mut local, mut inside, mut any) = ([[0.0; BLOCK]; 3], [false; BLOCK], 0);
        for i in 0..BLOCK {
            let place = shape.local(block.x[i], block.y[i], block.z[i]);
            inside[i] = shape.holds(place);
            any |= u8::from(inside[i]);
            (local[0][i], local[1][i], local[2][i]) = (place[0], place[1], place[2]);
        }
        if any == 0 {
            *square = [OUTSIDE; BLOCK];
            continue;
        }
        for i in 0..BLOCK {
            let rough = shape.square([local[0][i], local[1][i], local[2][i]]);
            square[i] = if inside[i] { rough } else { OUTSIDE };
            let closer = square[i] < least[i];
            closest[i] = if closer { limb } else { closest[i] };
            least[i] = if closer { square[i] } else { least[i] };
        }
    }
    closest
}

/// Box test and rough distance of a tapered elliptic cylinder, in single precision for whole blocks of candidates.
#[derive(Debug)]
struct LimbBox {
    /// Columns of the rotation, and the shift, from the working frame to the limb's.
    axes: [[f32; 3]; 3],
    shift: [f32; 3],
    /// The enlarged box in the limb's frame.
    low: [f32; 3],
    high: [f32; 3],
    /// A box in the working frame that holds the enlarged one.
    around: [[f32; 2]; 3],
    length: f32,
    /// Semi-axes at the proximal end and their growth along the axis.
    a: [f32; 2],
    b: [f32; 2],
}

impl LimbBox {
    fn new(limb: &Limb, working_from_limb: &Pose, margin: f64) -> Self {
        let to_f32 = |v: Vec3| v.to_array().map(|value| value as f32);
        let limb_from_working = working_from_limb.inverse();
        let shape = &limb.shape;
        let bounds = shape.local_aabb();
        let (low, high) = (bounds.mins - Vec3::splat(margin), bounds.maxs + Vec3::splat(margin));
        let centre = to_f32(*working_from_limb * (0.5 * (low + high)));
        let half = 0.5 * (high - low);
        let reach = [(Vec3::X, half.x), (Vec3::Y, half.y), (Vec3::Z, half.z)]
            .map(|(axis, half)| (working_from_limb.rotation * axis).abs() * half);
        let reach = to_f32(reach[0] + reach[1] + reach[2]);
        Self {
            axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_f32(limb_from_working.rotation * axis)),
            shift: to_f32(limb_from_working.translation),
            low: to_f32(low),
            high: to_f32(high),
            around: [0, 1, 2].map(|axis| {
                let reach = reach[axis] + ROUNDING;
                [centre[axis] - reach, centre[axis] + reach]
            }),
            length: shape.length() as f32,
            a: [shape.a0() as f32, ((shape.a1() - shape.a0()) / shape.length()) as f32],
            b: [shape.b0() as f32, ((shape.b1() - shape.b0()) / shape.length()) as f32],
        }
    }

    /// False when nothing inside the bounds can be inside the box.
    #[inline(always)]
    fn reaches(&self, bounds: &[[f32; 2]; 3]) -> bool {
        self.around.iter().zip(bounds).all(|(own, other)| own[0] <= other[1] && other[0] <= own[1])
    }

    /// A point in the limb's frame.
    #[inline(always)]
    fn local(&self, x: f32, y: f32, z: f32) -> [f32; 3] {
        let local = |i: usize| self.axes[0][i] * x + self.axes[1][i] * y + self.axes[2][i] * z + self.shift[i];
        [local(0), local(1), local(2)]
    }

    /// Whether a point in the limb's frame lies in the enlarged box.
    #[inline(always)]
    fn holds(&self, local: [f32; 3]) -> bool {
        let inside = |axis: usize| (local[axis] >= self.low[axis]) & (local[axis] <= self.high[axis]);
        inside(0) & inside(1) & inside(2)
    }

    /// Square of about `(rho - 1) / |grad rho|` beside the limb, with `rho^2 = (x/a)^2 + (y/b)^2`, and of the distance beyond
    /// its ends.
    #[inline(always)]
    fn square(&self, local: [f32; 3]) -> f32 {
        let along = if local[2] > 0.0 { local[2] } else { 0.0 };
        let along = if along < self.length { along } else { self.length };
        let at_least = |value: f32, least: f32| if value > least { value } else { least };
        let a = at_least(self.a[0] + self.a[1] * along, 1e-4);
        let b = at_least(self.b[0] + self.b[1] * along, 1e-4);
        let over = 1.0 / (a * b);
        let (over_a, over_b) = (b * over, a * over);
        let (u, v) = (local[0] * over_a, local[1] * over_b);
        let rho_square = u * u + v * v;
        // grad rho = (u/a, v/b) / rho, so (rho - 1) / |grad rho| = (rho^2 - rho) / |(u/a, v/b)|.
        let (gx, gy) = (u * over_a, v * over_b);
        let rise = rho_square - rho_square.sqrt();
        let side_square = rise * rise / at_least(gx * gx + gy * gy, 1e-18);
        let beyond = local[2] - along;
        side_square + beyond * beyond
    }
}
