//! The depth contour of limbs: where, perpendicular to a limb, the body ends and the camera sees past it.

use crate::association::correspondence::EdgePair;
use crate::body::{Body, Limb};
use crate::math::{Points, Pose, Vec3, refill, smooth_step, vectorized};
use crate::observation::depth_view::{DepthView, Pixel};
use crate::visibility::along_limb;

/// Where along a limb its contour is searched for, as fractions of its length; the ends also belong to the neighbors.
const STATIONS: [f64; 5] = along_limb(0.2);
/// A return that differs in depth from the limb's axis by more than this plus the limb's half thickness is another object,
/// meters.
const DEPTH_REACH: f64 = 0.12;
/// Sine of the least angle between a limb's axis and the line of sight (30 degrees). Below it, the sides of the limb are not
/// visible: an edge there belongs to the next limb.
const ASLANT: f64 = 0.5;
/// How far outside the limb's rim its edge is searched for, meters: clothes, and the error of a predicted pose.
const EDGE_REACH: f64 = 0.08;
/// How far beyond the tip of a free end the edge is searched for, meters: a limb slides farther along its axis than across it.
const TIP_REACH: f64 = 0.20;
/// An edge this near to the surface of another limb may belong to that limb, meters: it gives no evidence for girths.
const OTHERS_EDGE: f32 = 0.03;
/// Approximate stride of the search for an edge, meters: a fraction of the quantities that are fitted, for speed.
const STRIDE: f64 = 0.008;
/// Maximum stride in steps of half a pixel: in a coarse image, longer strides would miss a thin limb.
const MOST_STEPS: f64 = 4.0;
/// The first sample after the axis is at this fraction of the rim's distance: far inside the limb there is no edge.
const FIRST_STEP: f64 = 0.4;
/// The edge lies between the last sample on the body and the first one past it, where half of the interpolated pixels show the
/// body. This interval is bisected this many times, and the edge is interpolated in the last one.
const HALVINGS: usize = 5;
/// How far past the edge the camera must see past the body, in steps of half a pixel.
const PAST_STEPS: f64 = 2.4;
/// Fraction of the reach, and of the rim's distance, over which the weight of an edge fades at the ends of its search.
const FADE: f64 = 0.4;
/// Interval of the sine of the angle between a limb's axis and the line of sight over which the weight of its edges rises.
const ASLANT_FADE: f64 = 0.1;
/// Outside its rim, a limb loses the weight of an edge over this distance, meters, unless the edge is nearer to the limb than to
/// all others: by the second distance for the full weight.
const OWNER_FADE: [f64; 2] = [0.01, 0.02];
/// Steps are at least half a pixel at this depth, meters.
const NEAREST_STEP: f64 = 0.1;

/// One point on the rim of a limb and the edge observed there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DepthEdge {
    /// Direction in which the edge was searched for, limb frame, unit length: perpendicular to the limb and to the line of
    /// sight, or along the limb's axis.
    pub side: Vec3,
    /// Distance of the model's rim in that direction, from the axis or from the proximal end, meters.
    pub rim: f64,
    /// The rim's point nearest to the edge, limb frame.
    pub foot: Vec3,
    /// Distance of the observed edge, measured in the same way, meters.
    pub reach: f64,
    /// A point observed on the body, a pixel inside of the edge, working frame.
    pub place: Vec3,
    /// Weight from 0 to 1. It falls to 0 where the edge is lost to another limb or object, or to the end of the search.
    pub weight: f64,
}

/// Finds the edges on both sides of a limb, and at its tip if that end is free.
pub(crate) fn edges(view: &DepthView, limb: &Limb, working_from_limb: &Pose, mut found: impl FnMut(DepthEdge)) {
    let shape = &limb.shape;
    let camera_from_limb = view.working_from_camera.inverse() * *working_from_limb;
    let mut search = |start: Vec3, side: Vec3, rim: f64, thickness: f64, foot: Vec3, reach: f64, sine: f64| {
        let (start, along) = (camera_from_limb * start, camera_from_limb.rotation * side);
        let search = ContourSearch { start, along, rim, thickness, reach };
        let edge = vectorized!(search.edge(view));
        if let Some((at, place, weight)) = edge {
            let weight = weight * smooth_step((sine - ASLANT) / ASLANT_FADE);
            found(DepthEdge { side, rim, foot, reach: at, place: view.working_from_camera * place, weight });
        }
    };
    for t in STATIONS {
        let section = shape.section(t);
        let Some(facing) = section.facing(&camera_from_limb) else { continue };
        // The sides of a limb viewed nearly end on are not visible.
        let sine = facing.across.length() / facing.to_camera.length();
        if sine <= ASLANT {
            continue;
        }
        let thickness = section.extent(facing.ahead);
        for side in [facing.side, -facing.side] {
            let (rim, foot) = (section.extent(side), section.farthest_point(side));
            search(section.center(), side, rim, thickness, foot, EDGE_REACH, sine);
        }
    }
    let tip = Vec3::new(0.0, 0.0, shape.length());
    let sight = (camera_from_limb.rotation.inverse() * -(camera_from_limb * tip)).normalize_or(Vec3::X);
    let across = sight.with_z(0.0).length();
    if limb.match_caps[1] && across > ASLANT {
        // In an oblique view, the rim of the cap projects beyond its center.
        let ahead = sight.with_z(0.0) / across;
        let [_, end] = shape.ends();
        let radius = (end.a * ahead.x).hypot(end.b * ahead.y);
        let foot = tip - ahead * (radius * sight.z.signum());
        let rim = shape.length() + radius * sight.z.abs() / across;
        search(Vec3::ZERO, Vec3::Z, rim, end.a.max(end.b), foot, TIP_REACH, across);
    }
}

/// A search path in an image: from a point along a direction (camera frame), meters.
struct ContourSearch {
    start: Vec3,
    along: Vec3,
    rim: f64,
    thickness: f64,
    reach: f64,
}

impl ContourSearch {
    /// Finds where the body ends on the path: returns the distance from its start, a point that was observed a pixel before that,
    /// and the weight of the edge. Returns `None` when another object occludes it, when the pixels past it are unknown, or when
    /// there is no edge within reach.
    #[inline(always)]
    fn edge(&self, view: &DepthView) -> Option<(f64, Vec3, f64)> {
        let [fx, fy] = view.image.camera.focal();
        let focal = fx.max(fy);
        let step = 0.5 * self.start.z.max(NEAREST_STEP) / focal;
        let deep = self.thickness + DEPTH_REACH;
        // Long strides up to the first sample past the body.
        let stride = step * (STRIDE / step).floor().clamp(1.0, MOST_STEPS);
        let mut on = None;
        let mut r = 0.0;
        while r <= self.rim + self.reach {
            let place = self.start + self.along * r;
            match view.at(place) {
                Pixel::Foreground(z) if (z - place.z).abs() <= deep => on = Some(r),
                _ => return self.between(view, on?, r, step),
            }
            r = if r == 0.0 { (FIRST_STEP * self.rim).max(step) } else { r + stride };
        }
        None
    }

    /// Locates the edge between a sample on the body and one past it, from interpolated pixels, so that it moves continuously
    /// with the path. `step` is half a pixel.
    #[inline(always)]
    fn between(&self, view: &DepthView, on: f64, past: f64, step: f64) -> Option<(f64, Vec3, f64)> {
        let deep = self.thickness + DEPTH_REACH;
        let shares = |r: f64| view.shares(self.start + self.along * r, deep);
        let (mut on, mut past) = ((on - step, 1.0), (past + step, 0.0));
        for _ in 0..HALVINGS {
            let middle = 0.5 * (on.0 + past.0);
            let body = shares(middle).body;
            *(if body >= 0.5 { &mut on } else { &mut past }) = (middle, body);
        }
        let at = on.0 + (past.0 - on.0) * (on.1 - 0.5) / (on.1 - past.1);
        let reached =
            smooth_step((self.rim + self.reach - at) / (FADE * self.reach)) * smooth_step(at / (FADE * self.rim));
        if reached <= 0.0 {
            return None;
        }
        let weight = reached * smooth_step(2.0 * shares(at + PAST_STEPS * step).past - 0.5);
        if weight <= 0.0 {
            return None;
        }
        let inside = self.start + self.along * (at - 2.0 * step);
        let depth = view.shares(inside, deep).depth.unwrap_or(inside.z);
        Some((at, inside * (depth / inside.z), weight))
    }
}

/// The contours of all limbs in all depth images of a frame, and working memory.
#[derive(Debug, Default)]
pub(crate) struct Contours {
    edges: Vec<LimbEdge>,
    places: Points,
    distance: Vec<f32>,
}

/// The edge of a limb, and its position in the working frame.
#[derive(Clone, Copy, Debug)]
struct LimbEdge {
    limb: usize,
    edge: DepthEdge,
    target: Vec3,
    /// Index of the image's source.
    source: u16,
    /// Distances from the edge to the limb and to the nearest other one, meters.
    own: f32,
    others: f32,
}

impl Contours {
    /// Clears all edges.
    pub(crate) fn clear(&mut self) {
        self.edges.clear();
    }

    /// Finds the edges at `poses`.
    pub(crate) fn find<'a>(&mut self, body: &Body, poses: &[Pose], views: impl Iterator<Item = DepthView<'a>>) {
        self.edges.clear();
        self.places.clear();
        for view in views {
            for (limb, (part, pose)) in body.limbs().iter().zip(poses).enumerate() {
                edges(&view, part, pose, |edge| {
                    self.places.push(edge.place.as_vec3().to_array());
                    let target = *pose * (edge.foot + edge.side * (edge.reach - edge.rim));
                    let (source, own, others) = (view.image.source, f32::INFINITY, f32::INFINITY);
                    self.edges.push(LimbEdge { limb, edge, target, source, own, others });
                });
            }
        }
        for (index, (limb, pose)) in body.limbs().iter().zip(poses).enumerate() {
            limb.shape.approximate_distances(pose, &self.places, &mut self.distance);
            for (found, distance) in self.edges.iter_mut().zip(&self.distance) {
                let least = if found.limb == index { &mut found.own } else { &mut found.others };
                *least = least.min(*distance);
            }
        }
        self.edges.retain_mut(|LimbEdge { edge, own, others, .. }| {
            // Outside the rim, the edge may belong to another limb.
            let [beyond, nearer] = OWNER_FADE;
            let inside = 1.0 - smooth_step((edge.reach - edge.rim) / beyond);
            edge.weight *= inside.max(smooth_step(f64::from(*others - *own) / nearer));
            edge.weight > 0.0
        });
    }

    /// The edges on the sides of a limb that are clear of other limbs.
    pub(crate) fn sides(&self, limb: usize) -> impl Iterator<Item = DepthEdge> {
        let own =
            move |found: &&LimbEdge| found.limb == limb && found.others >= OTHERS_EDGE && found.edge.side != Vec3::Z;
        self.edges.iter().filter(own).map(|found| found.edge)
    }

    /// The rim points at `poses` and the edges that were found, as pairs. `sigma` is the standard deviation of an edge, meters.
    pub(crate) fn pairs(&self, poses: &[Pose], sigma: f64, pairs: &mut Vec<EdgePair>) {
        let pair = |LimbEdge { limb, edge, target, source, .. }: &LimbEdge| {
            let (x, normal) = (poses[*limb] * edge.foot, poses[*limb].rotation * edge.side);
            let information = 1.0 / (sigma * sigma) * edge.weight;
            EdgePair { limb: *limb, x, normal, distance: normal.dot(*target - x), information, source: *source }
        };
        refill(pairs, self.edges.iter().map(pair));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;
    use crate::observation::background::Backgrounds;
    use crate::observation::depth_view::DepthViews;
    use crate::observation::frame::{DepthImage, Frame};
    use crate::shape::TaperedEllipticCylinder;
    use crate::testing::{everything, image};

    const WIDTH: usize = 120;
    const FOCAL: f64 = 400.0;

    /// What the camera sees of a single limb with nothing behind it: exact ray casting in every pixel.
    fn shoot(shape: &TaperedEllipticCylinder, pose: &Pose) -> Vec<f32> {
        let empty = vec![0.0; WIDTH * WIDTH];
        let camera: DepthImage = image(&empty, WIDTH, FOCAL);
        let limb_from_camera = pose.inverse();
        let depth = |index: usize| {
            let ray = camera.back_project(index, 1.0);
            let hit = shape.cast_ray(limb_from_camera.translation, limb_from_camera.rotation * ray);
            hit.map_or(0.0, |distance| (distance / ray.length()) as f32)
        };
        (0..WIDTH * WIDTH).map(depth).collect()
    }

    /// Runs `ask` with the view of a segmented image.
    fn with_view<T>(pixels: &[f32], ask: impl FnOnce(DepthView) -> T) -> T {
        let images = [image(pixels, WIDTH, FOCAL)];
        let frame = Frame { images: &images, ..Frame::empty(0.0) };
        let backgrounds = Backgrounds::default();
        let views =
            DepthViews { frame: &frame, ownership: everything(&backgrounds), segmented: &[true], origin: Vec3::ZERO };
        ask(views.iter().next().unwrap())
    }

    /// A forearm across the image, two meters away, perpendicular to the line of sight.
    fn forearm() -> (Limb, Pose) {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let mut limb = body.limbs()[body.limb_index("l_forearm").unwrap()].clone();
        limb.shape = TaperedEllipticCylinder::new(0.3, 0.05, 0.045, 0.035, 0.03).unwrap();
        limb.match_caps = [false, true];
        (limb, Pose::new(Vec3::new(-0.15, 0.0, 2.0), Vec3::new(0.0, std::f64::consts::FRAC_PI_2, 0.0)))
    }

    #[test]
    fn the_contour_is_found_where_the_limb_ends() {
        let (limb, pose) = forearm();
        let pixel = 2.0 / FOCAL;
        // The limb in the image is wider and longer than the model by this amount.
        for wider in [-0.01, 0.0, 0.015] {
            let [a0, b0, a1, b1] =
                [limb.shape.a0(), limb.shape.b0(), limb.shape.a1(), limb.shape.b1()].map(|axis| axis + wider);
            let observed = TaperedEllipticCylinder::new(limb.shape.length() + wider, a0, b0, a1, b1).unwrap();
            let mut found = Vec::new();
            with_view(&shoot(&observed, &pose), |view| edges(&view, &limb, &pose, |edge| found.push(edge)));
            assert_eq!(found.len(), 2 * STATIONS.len() + 1, "both sides, and the tip");
            for edge in found {
                let off = edge.reach - edge.rim - wider;
                assert!(off.abs() < pixel, "{wider} wider: off by {off} m at {edge:?}");
            }
        }
    }

    #[test]
    fn an_edge_stays_where_it_is_visible_when_the_model_moves_a_little() {
        let (limb, pose) = forearm();
        let pixels = shoot(&limb.shape, &pose);
        let step = 0.5 * 2.0 / FOCAL;
        let observed = |off: f64| {
            let moved = Pose::from_parts(pose.translation + Vec3::new(0.0, off * step, 0.0), pose.rotation);
            let mut found = Vec::new();
            with_view(&pixels, |view| {
                edges(&view, &limb, &moved, |edge| found.push((moved * (edge.side * edge.reach)).y));
            });
            found.truncate(2 * STATIONS.len());
            found
        };
        let all: Vec<Vec<f64>> = (0..8).map(|eighth| observed(f64::from(eighth) / 8.0)).collect();
        for edge in 0..2 * STATIONS.len() {
            let places = all.iter().map(|found| found[edge]);
            let spread = places.clone().fold(f64::MIN, f64::max) - places.fold(f64::MAX, f64::min);
            assert!(spread < 0.1 * step, "edge {edge} is seen {spread} m apart, steps are {step} m");
        }
    }

    #[test]
    fn what_stands_before_a_limb_hides_its_contour_and_an_aslant_limb_has_none() {
        let (limb, pose) = forearm();
        let before = vec![1.5_f32; WIDTH * WIDTH];
        with_view(&before, |view| edges(&view, &limb, &pose, |edge| panic!("{edge:?} before the limb")));
        // Nearly end on: the far end is hidden behind the near one.
        let aslant = Pose::new(Vec3::new(0.0, 0.0, 2.0), Vec3::new(0.0, 0.3, 0.0));
        with_view(&shoot(&limb.shape, &aslant), |view| edges(&view, &limb, &aslant, |edge| panic!("{edge:?} end on")));
    }
}
