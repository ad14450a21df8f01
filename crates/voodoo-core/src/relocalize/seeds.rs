//! Where and which way round a lost body may stand at a segment: rough looks at every direction, at rest and as it was last
//! tracked.

use super::facing::{Known, facing_cost};
use super::posture::{Place, Postures};
use crate::fit::Context;
use crate::hypotheses::explain;
use crate::math::{Pose, Quat, Vec3, WeightedPoints};
use crate::observation::segments::Segment;
use crate::visibility::evidence::{Visibility, limb_visibility};

/// Directions the body is turned to, evenly: costs time in proportion.
const HEADINGS: usize = 8;
/// Up to this distance rough looks take a point as explained, metres.
const EXPLAINED_ROUGHLY: f64 = 0.10;
/// Depth of a body's middle behind the middle of what a camera sees of it, metres: half a trunk.
const BEHIND: f64 = 0.08;
/// Rough looks that are refined, besides the opposite of the best.
const KEPT: usize = 3;

/// A rough look: its cost and its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seed {
    cost: f64,
    heading: f64,
    root: Pose,
    /// Joints as when last tracked, instead of at rest.
    tracked: bool,
}

/// Working memory of rough looks.
#[derive(Debug, Default)]
pub(super) struct RoughLook {
    /// The points at the segment.
    pub(super) sample: WeightedPoints,
    pub(super) nearest: Vec<f32>,
    pub(super) distances: Vec<f32>,
    poses: Vec<Pose>,
}

/// What of the segment the body's height is taken from.
const HEIGHTS: [Height; 3] = [Height::Middle, Height::Top, Height::Ground];

#[derive(Clone, Copy, Debug)]
enum Height {
    Middle,
    Top,
    Ground,
}

/// Puts the body at the segment in every way and keeps the best of different directions, the opposite of the best among them.
pub(super) fn find_seeds(
    rough: &mut RoughLook,
    context: Context,
    known: Known,
    segment: &Segment,
    seeds: &mut Vec<Seed>,
) {
    let mut all = [const { None::<Seed> }; HEADINGS];
    for (number, slot) in all.iter_mut().enumerate() {
        let heading = std::f64::consts::TAU * number as f64 / HEADINGS as f64;
        for tracked in [false, true] {
            for height in HEIGHTS {
                let Some(root) = place(context, known.postures, segment, heading, tracked, height) else { continue };
                let mut seed = Seed { cost: 0.0, heading, root, tracked };
                seed.cost = rough_cost(rough, context, known, &seed);
                if slot.is_none_or(|best| seed.cost < best.cost) {
                    *slot = Some(seed);
                }
            }
        }
    }
    seeds.clear();
    let mut ranked = all;
    ranked.sort_unstable_by(|a, b| {
        let cost = |slot: &Option<Seed>| slot.map_or(f64::INFINITY, |seed| seed.cost);
        cost(a).total_cmp(&cost(b))
    });
    seeds.extend(ranked.into_iter().flatten().take(KEPT));
    let Some(best) = seeds.first().copied() else { return };
    let opposite = |heading: f64| (heading - best.heading).cos() < -0.99;
    let behind = all.into_iter().flatten().find(|seed| opposite(seed.heading));
    if let Some(behind) = behind.filter(|_| !seeds.iter().any(|seed| opposite(seed.heading))) {
        seeds.push(behind);
    }
}

/// Root of the body at a segment: the middles together, or the tops, or on the ground.
fn place(
    context: Context,
    postures: &Postures,
    segment: &Segment,
    heading: f64,
    tracked: bool,
    height: Height,
) -> Option<Pose> {
    let up = postures.up;
    let posture = postures.posture(tracked);
    let root = posture.first()?.rotation;
    // Upright by the axis of the root limb; a posture that was tracked keeps its lean.
    let stand = if tracked { root } else { Quat::from_rotation_arc(root * Vec3::Z, up) * root };
    let axis = up.any_orthonormal_vector();
    let ahead = postures.level(stand * Vec3::X).normalize_or(axis);
    let now = ahead.dot(up.cross(axis)).atan2(ahead.dot(axis));
    let turn = Quat::from_axis_angle(up, heading - now) * stand * root.inverse();
    let extent = Extent::of(context, posture, turn, up);
    let across = segment.centre + BEHIND * postures.level(segment.view) - extent.middle;
    let rise = match height {
        Height::Middle => across.dot(up),
        Height::Top => (segment.low * up).max(segment.high * up).element_sum() - extent.high,
        Height::Ground => {
            let origin = context.seen.origin();
            let ground = context.seen.frame().ground;
            ground.map(|ground| ground.about(origin).offset - extent.low)?
        }
    };
    Some(Pose::from_parts(postures.level(across) + up * rise, (turn * root).normalize()))
}

fn rough_cost(rough: &mut RoughLook, context: Context, known: Known, seed: &Seed) -> f64 {
    let RoughLook { sample, nearest, distances, poses } = rough;
    put(known.postures, seed, poses);
    nearest.clear();
    nearest.resize(sample.len(), f32::INFINITY);
    let body = &context.model.body;
    let mut visible = Visibility::default();
    for (limb, (part, pose)) in body.limbs().iter().zip(&*poses).enumerate() {
        explain(body, limb, poses, &sample.points, nearest, distances);
        visible += limb_visibility(context.seen.views, part, pose);
    }
    let unexplained = |(d, w): (&f32, &f64)| w * (f64::from(*d) / EXPLAINED_ROUGHLY).powi(2).min(1.0);
    let points: f64 = nearest.iter().zip(&sample.weights).map(unexplained).sum();
    let stamp = context.seen.frame().stamp;
    points + visible.cost() + facing_cost(known, seed.root.rotation, stamp)
}

/// Where a turned posture lies about its root: its middle, and its lowest and highest places along up.
struct Extent {
    middle: Vec3,
    low: f64,
    high: f64,
}

impl Extent {
    fn of(context: Context, posture: &[Pose], turn: Quat, up: Vec3) -> Self {
        let (mut middle, mut weight) = (Vec3::ZERO, 0.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let origin = posture[0].translation;
        for (limb, pose) in context.model.body.limbs().iter().zip(posture) {
            let ends = [Vec3::ZERO, Vec3::Z * limb.shape.length()].map(|end| turn * (*pose * end - origin));
            let size = limb.shape.length() * (limb.shape.a0() + limb.shape.b1());
            middle += size * 0.5 * (ends[0] + ends[1]);
            weight += size;
            for end in ends {
                low = low.min(end.dot(up));
                high = high.max(end.dot(up));
            }
        }
        Self { middle: middle / weight, low, high }
    }
}

/// A posture with its root at the seed, into `poses`.
pub(super) fn put(postures: &Postures, seed: &Seed, poses: &mut Place) {
    let posture = postures.posture(seed.tracked);
    let moved = posture.first().map_or(Pose::identity(), |root| seed.root * root.inverse());
    poses.clear();
    poses.extend(posture.iter().map(|pose| moved * *pose));
}
