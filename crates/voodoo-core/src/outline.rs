//! The outline of limbs in depth images: where, across a limb, the body ends and the camera sees past it.

use crate::body::{Body, Limb};
use crate::correspondence::EdgePair;
use crate::geometry::{Pose, Vec3};
use crate::view::{Pixel, View};

/// Places along a limb that are looked at; the ends belong to the neighbours as well.
pub const STATIONS: [f64; 5] = [0.2, 0.35, 0.5, 0.65, 0.8];
/// A return this far from the limb's axis in depth, beyond its own half thickness, is another thing, metres.
const DEPTH_REACH: f64 = 0.12;
/// How far beyond the limb's rim its edge is looked for, metres.
const EDGE_REACH: f64 = 0.08;

/// One place on the rim of a limb and the edge seen there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Place along the axis, share of the length.
    pub t: f64,
    /// Direction across the limb, at right angles to its axis and to the line of sight; limb frame, length one.
    pub side: Vec3,
    /// Distance of the model's rim from the axis, metres.
    pub rim: f64,
    /// The rim's point nearest to the edge, limb frame.
    pub foot: Vec3,
    /// Distance of the seen edge from the axis, metres.
    pub seen: f64,
}

/// Looks for the edges on both sides of a limb. `owns` tells whether a point (working frame) is nearer to this limb than to
/// all others: an edge of another limb is none of this one.
pub fn edges(
    view: &View,
    limb: &Limb,
    working_from_limb: &Pose,
    mut owns: impl FnMut(Vec3) -> bool,
    mut found: impl FnMut(Edge),
) {
    let shape = &limb.shape;
    let camera_from_limb = view.working_from_camera.inverse() * *working_from_limb;
    let focal = view.image.intrinsics[0].max(view.image.intrinsics[1]);
    for t in STATIONS {
        let (a, b) = (shape.a0() + t * (shape.a1() - shape.a0()), shape.b0() + t * (shape.b1() - shape.b0()));
        let axis = Vec3::new(0.0, 0.0, t * shape.length());
        let centre = camera_from_limb * axis;
        let sight = camera_from_limb.inverse_transform_vector(-centre);
        let Some(ahead) = sight.with_z(0.0).try_normalize() else { continue };
        // Seen nearly end on, a limb has no sides.
        if centre.z < 0.1 || sight.with_z(0.0).length() < 0.5 * sight.length() {
            continue;
        }
        let thickness = (a * ahead.x).hypot(b * ahead.y);
        for side in [Vec3::new(-ahead.y, ahead.x, 0.0), Vec3::new(ahead.y, -ahead.x, 0.0)] {
            let rim = (a * side.x).hypot(b * side.y);
            let across = camera_from_limb.rotation * side;
            let step = 0.5 * centre.z / focal;
            let mut last = None;
            let mut r = 0.0;
            let seen = loop {
                match view.at(centre + across * r) {
                    Pixel::Something(z) if z < centre.z - thickness - DEPTH_REACH => break None,
                    Pixel::Something(z) if z <= centre.z + thickness + DEPTH_REACH => last = Some(z),
                    Pixel::Unknown => break None,
                    Pixel::Something(_) | Pixel::Scene(_) => break last.map(|z| (r, z)),
                }
                // What lies well inside the limb is no edge: one look on the way out will do.
                r = if r == 0.0 { (0.4 * rim).max(step) } else { r + step };
                if r > rim + EDGE_REACH {
                    break None;
                }
            };
            let Some((seen, z)) = seen else { continue };
            // The edge lies between the two last looks.
            let seen = seen - 0.25 * step;
            // The last pixel of the body before the edge.
            let place = centre + across * (seen - step).max(0.0);
            if seen > rim && !owns(view.working_from_camera * (place * (z / place.z))) {
                continue;
            }
            let foot = Vec3::new(a * a * side.x / rim, b * b * side.y / rim, axis.z);
            found(Edge { t, side, rim, foot, seen });
        }
    }
}

/// Edges of all limbs in all depth images as pairs, into `pairs`.
pub fn match_edges<'a>(body: &Body, poses: &[Pose], views: impl Iterator<Item = View<'a>>, pairs: &mut Vec<EdgePair>) {
    pairs.clear();
    for view in views {
        for (index, (limb, pose)) in body.limbs().iter().zip(poses).enumerate() {
            let owns = |point| body.closest_limb(poses, point) == index;
            edges(&view, limb, pose, owns, |edge| {
                let (x, normal) = (*pose * edge.foot, pose.rotation * edge.side);
                pairs.push(EdgePair { limb: index, x, normal, distance: edge.seen - edge.rim });
            });
        }
    }
}
