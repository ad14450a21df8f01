//! The contour of limbs in depth images: where, across a limb, the body ends and the camera sees past it.

use crate::association::correspondence::ContourPair;
use crate::body::{Body, Limb};
use crate::math::{Points, Pose, Vec3};
use crate::observation::depth_view::{DepthView, Pixel};

/// Where along a limb its contour is looked for, in shares of its length; the ends belong to the neighbours as well.
const STATIONS: [f64; 5] = [0.2, 0.35, 0.5, 0.65, 0.8];
/// A return this far from the limb's axis in depth, beyond its own half thickness, is another thing, metres.
const DEPTH_REACH: f64 = 0.12;
/// A limb whose axis makes an angle with the line of sight of less than this sine (30 degrees) shows no sides: what ends there
/// is the next limb.
const ASLANT: f64 = 0.5;
/// How far beyond the limb's rim its edge is looked for, metres: clothes, and the error of a predicted pose.
const EDGE_REACH: f64 = 0.08;
/// The same beyond a free limb's tip, metres: along its axis a limb slides farther than across.
const TIP_REACH: f64 = 0.20;
/// An edge with the surface of another limb this near, metres, may be that limb's: it tells nothing of girths.
const OTHERS_EDGE: f32 = 0.03;
/// Edges are approached in strides of about this length, metres: a fraction of what is fitted, for speed.
const STRIDE: f64 = 0.008;
/// A stride is so many steps of half a pixel at most: in a coarse image it would pass over a thin limb.
const MOST_STEPS: f64 = 4.0;
/// The first look after the axis is at this share of the rim's distance: what lies well inside the limb is no edge.
const FIRST_LOOK: f64 = 0.4;
/// The edge lies between the two last looks: this share of a step before the last one, which saw past the body.
const EDGE_BEFORE: f64 = 0.25;
/// Steps are no shorter than those of half a pixel at this depth, metres.
const NEAREST_STEP: f64 = 0.1;

/// One place on the rim of a limb and the edge seen there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Direction in which the edge was looked for, limb frame, length one: across the limb at right angles to the line of
    /// sight, or along its axis.
    pub side: Vec3,
    /// Distance of the model's rim in that direction from the axis, or from the proximal end, metres.
    pub rim: f64,
    /// The rim's point nearest to the edge, limb frame.
    pub foot: Vec3,
    /// Distance of the seen edge, likewise, metres.
    pub seen: f64,
    /// The last place seen on the body, working frame.
    pub place: Vec3,
}

/// Looks for the edges on both sides of a limb, and at its tip when it ends free.
pub fn edges(view: &DepthView, limb: &Limb, working_from_limb: &Pose, mut found: impl FnMut(Edge)) {
    let shape = &limb.shape;
    let camera_from_limb = view.working_from_camera.inverse() * *working_from_limb;
    let mut look = |start: Vec3, side: Vec3, rim: f64, thickness: f64, foot: Vec3, reach: f64| {
        let (start, along) = (camera_from_limb * start, camera_from_limb.rotation * side);
        let search = ContourSearch { start, along, rim, thickness, reach };
        if let Some((seen, place)) = search.edge(view) {
            found(Edge { side, rim, foot, seen, place: view.working_from_camera * place });
        }
    };
    for t in STATIONS {
        let section = shape.section(t);
        let Some(facing) = section.facing(&camera_from_limb) else { continue };
        // Seen nearly end on, a limb has no sides.
        if facing.across.length() < ASLANT * facing.to_camera.length() {
            continue;
        }
        let thickness = section.extent(facing.ahead);
        for side in [facing.side, -facing.side] {
            look(section.centre(), side, section.extent(side), thickness, section.farthest_point(side), EDGE_REACH);
        }
    }
    let tip = Vec3::new(0.0, 0.0, shape.length());
    let sight = camera_from_limb.inverse_transform_vector(-(camera_from_limb * tip)).normalize_or(Vec3::X);
    let across = sight.with_z(0.0).length();
    if limb.match_caps[1] && across > ASLANT {
        // Seen aslant, the cap's rim stands out beyond its middle.
        let ahead = sight.with_z(0.0) / across;
        let radius = (shape.a1() * ahead.x).hypot(shape.b1() * ahead.y);
        let foot = tip - ahead * (radius * sight.z.signum());
        let rim = shape.length() + radius * sight.z.abs() / across;
        look(Vec3::ZERO, Vec3::Z, rim, shape.a1().max(shape.b1()), foot, TIP_REACH);
    }
}

/// A way across an image: from a point along a direction (camera frame), metres.
struct ContourSearch {
    start: Vec3,
    along: Vec3,
    rim: f64,
    thickness: f64,
    reach: f64,
}

impl ContourSearch {
    /// How far from the start the body ends, and the last place seen on it; `None` when another thing stands before it, when
    /// the image does not tell, or when no edge comes within reach.
    fn edge(&self, view: &DepthView) -> Option<(f64, Vec3)> {
        let focal = view.image.intrinsics[0].max(view.image.intrinsics[1]);
        let step = 0.5 * self.start.z.max(NEAREST_STEP) / focal;
        let deep = self.thickness + DEPTH_REACH;
        let mut last: Option<(Vec3, f64)> = None;
        let mut r = 0.0;
        // Long strides as far as the first look past the body, then back, and on in small steps.
        let mut stride = step * (STRIDE / step).floor().clamp(1.0, MOST_STEPS);
        let mut from = 0.0;
        while r <= self.rim + self.reach {
            let place = self.start + self.along * r;
            match view.at(place) {
                Pixel::Unknown => return None,
                Pixel::Foreground(z) if z < place.z - deep => return None,
                Pixel::Foreground(z) if z <= place.z + deep => {
                    last = Some((place, z));
                    from = r;
                }
                Pixel::Foreground(_) | Pixel::Background(_) => {
                    let (last, z) = last?;
                    if stride <= step || r - from <= step {
                        // The edge lies between the two last looks.
                        return Some((r - EDGE_BEFORE * step, last * (z / last.z)));
                    }
                    (r, stride) = (from, step);
                }
            }
            r = if r == 0.0 { (FIRST_LOOK * self.rim).max(step) } else { r + stride };
        }
        None
    }
}

/// The contours of all limbs in all depth images of a frame, and working memory.
#[derive(Debug, Default)]
pub struct Contours {
    edges: Vec<Found>,
    places: Points,
    distance: Vec<f32>,
    least: Vec<f32>,
    closest: Vec<usize>,
    strangers: Vec<f32>,
}

/// The edge of a limb, and where it stands in the working frame.
#[derive(Clone, Copy, Debug)]
struct Found {
    limb: usize,
    edge: Edge,
    target: Vec3,
    /// Distance of the edge to the nearest other limb, metres.
    stranger: f32,
}

impl Contours {
    /// Forgets all edges.
    pub fn clear(&mut self) {
        self.edges.clear();
    }

    /// Looks for the edges at `poses`.
    pub fn find<'a>(&mut self, body: &Body, poses: &[Pose], views: impl Iterator<Item = DepthView<'a>>) {
        self.edges.clear();
        self.places.clear();
        for view in views {
            for (limb, (part, pose)) in body.limbs().iter().zip(poses).enumerate() {
                edges(&view, part, pose, |edge| {
                    self.places.push(edge.place.to_array().map(|value| value as f32));
                    let target = *pose * (edge.foot + edge.side * (edge.seen - edge.rim));
                    self.edges.push(Found { limb, edge, target, stranger: f32::INFINITY });
                });
            }
        }
        self.find_closest(body, poses);
        let mut closest = self.closest.iter();
        let mut strangers = self.strangers.iter();
        self.edges.retain_mut(|found| {
            let closest = closest.next();
            found.stranger = strangers.next().copied().unwrap_or(f32::INFINITY);
            // Beyond the rim, the edge may be another limb's.
            found.edge.seen <= found.edge.rim || closest == Some(&found.limb)
        });
    }

    /// The limb that is nearest to each place, and how near the nearest is that is not the edge's own.
    fn find_closest(&mut self, body: &Body, poses: &[Pose]) {
        let count = self.places.len();
        self.least.clear();
        self.least.resize(count, f32::INFINITY);
        self.closest.clear();
        self.closest.resize(count, 0);
        self.strangers.clear();
        self.strangers.resize(count, f32::INFINITY);
        for (index, (limb, pose)) in body.limbs().iter().zip(poses).enumerate() {
            limb.shape.approximate_distances(pose, &self.places, &mut self.distance);
            for ((least, closest), distance) in self.least.iter_mut().zip(&mut self.closest).zip(&self.distance) {
                if distance < least {
                    (*least, *closest) = (*distance, index);
                }
            }
            for ((found, stranger), distance) in self.edges.iter().zip(&mut self.strangers).zip(&self.distance) {
                if found.limb != index {
                    *stranger = stranger.min(*distance);
                }
            }
        }
    }

    /// The edges on the sides of a limb that were found apart from other limbs.
    pub fn sides(&self, limb: usize) -> impl Iterator<Item = Edge> {
        let own =
            move |found: &&Found| found.limb == limb && found.stranger >= OTHERS_EDGE && found.edge.side != Vec3::Z;
        self.edges.iter().filter(own).map(|found| found.edge)
    }

    /// The rims at `poses` and the edges that were found, as pairs.
    pub fn pairs(&self, poses: &[Pose], pairs: &mut Vec<ContourPair>) {
        pairs.clear();
        pairs.extend(self.edges.iter().map(|Found { limb, edge, target, .. }| {
            let (x, normal) = (poses[*limb] * edge.foot, poses[*limb].rotation * edge.side);
            ContourPair { limb: *limb, x, normal, distance: normal.dot(*target - x) }
        }));
    }
}
