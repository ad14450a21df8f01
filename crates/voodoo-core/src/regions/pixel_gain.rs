//! How much of the images only one limb explains: each pixel is assigned to the limb that is visible there.
//!
//! When both legs are fitted to the contour of one leg, both match its colors. What a limb explains in addition to the other
//! limbs distinguishes this case.

use super::histogram::{MOST_RATIO, bin_of};
use super::labels::{LimbLabels, NOTHING};
use super::lines::NEARER_BY;
use super::scan::ScanView;
use super::{ColorRegions, Posed};
use crate::association::correspondence::RegionSupport;
use crate::body::two_bone::TwoBone;
use crate::camera::Camera;
use crate::math::{Pose, Vec3, extrapolated, refill, shifted};
use crate::observation::candidates::REFERENCE_PATCH;
use crate::observation::picture::ColorImage;
use crate::shape::TaperedEllipticCylinder;
use crate::visibility::{ALONG_LIMB, across_limb};

/// Sample positions across a limb, as fractions of its projected radius.
const OVER: [f64; 5] = across_limb(0.7);
/// Backdrops are drawn in cells of two to this power pixels.
const BACKDROP_BITS: u32 = 2;

impl ColorRegions {
    /// Draws the `visible` limbs into the backdrop of each camera, which shows only them afterwards.
    pub(crate) fn draw(&mut self, posed: Posed, visible: impl Fn(usize) -> bool) {
        let Self { backdrop, drawn, camera_from_limb, .. } = self;
        refill(drawn, (0..posed.poses.len()).map(&visible));
        backdrop.resize_with(posed.frame.colors.len(), LimbLabels::default);
        for (picture, labels) in posed.frame.colors.iter().zip(backdrop) {
            let limb = camera_from_limb_at(self.stamp, picture, posed);
            refill(camera_from_limb, (0..posed.poses.len()).map(limb));
            labels.draw(posed.body, camera_from_limb, picture.camera, BACKDROP_BITS, &visible);
        }
    }

    /// Color evidence for a limb, in patches, averaged over all cameras: the area that the limb explains better than what would be
    /// visible without it, minus the area that it explains worse; and its area in the images, occluded or not. For a limb with
    /// unambiguous colors the first is its whole visible area.
    ///
    /// What would be visible without it are the limbs that were drawn into the backdrop last. Of a limb that is drawn there itself,
    /// only the pixels count that show it, and nothing is known to be behind it.
    pub(crate) fn pixel_gain(&self, posed: Posed, limb: usize) -> [f64; 2] {
        let is_drawn = self.drawn.get(limb).is_some_and(|drawn| *drawn);
        // What would be visible at a cell without the limb, which has this depth there; `None` where the limb is occluded.
        let behind = |(label, behind): (u16, f32), depth: f64| {
            if is_drawn {
                return (usize::from(label) == limb).then_some(NOTHING);
            }
            (label == NOTHING || f64::from(behind) > depth - f64::from(NEARER_BY)).then_some(label)
        };
        let [mut gained, mut all] = [0.0; 2];
        let shape = &posed.body.limbs()[limb].shape;
        let group = usize::from(self.groups[limb]);
        for (picture, labels) in posed.frame.colors.iter().zip(&self.backdrop) {
            let known = self.cameras.get(&picture.number);
            let Some(camera) = known.filter(|camera| camera.known && camera.model.knows(group)) else { continue };
            let view = ScanView { picture, camera, groups: &self.groups };
            let camera_from_limb = camera_from_limb_at(self.stamp, picture, posed)(limb);
            places(shape, &camera_from_limb, picture.camera, |[u, v], depth, area| {
                all += area;
                let [width, height] = [picture.camera.width(), picture.camera.height()];
                if !(u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64) {
                    return;
                }
                let (column, row) = (u as usize, v as usize);
                if let Some(other) = behind(labels.at(column, row), depth) {
                    let pixel = row * width + column;
                    let bin = bin_of(&picture.pixels, pixel);
                    // The log ratio as a fraction of its bound.
                    gained += area * f64::from(view.ratio(group, other, pixel, bin) / MOST_RATIO);
                }
            });
        }
        let cameras = posed.frame.colors.len().max(1) as f64;
        [gained / cameras, all / cameras]
    }

    /// Writes to `supports` what every limb of the arms and legs explains that no limb outside its own arm or leg does.
    pub(crate) fn pixel_gains(&mut self, posed: Posed, chains: &[TwoBone], supports: &mut [RegionSupport]) {
        for chain in chains {
            self.draw(posed, |limb| !chain.has(limb));
            for limb in chain.limbs() {
                [supports[limb].gained, supports[limb].area] = self.pixel_gain(posed, limb);
            }
        }
    }
}

/// The limbs' poses in a camera's frame at the time of its image; `last` is the time of the last frame.
pub(super) fn camera_from_limb_at<'a>(
    last: Option<f64>,
    picture: &ColorImage,
    Posed { frame, poses, previous, origin, .. }: Posed<'a>,
) -> impl Fn(usize) -> Pose + use<'a> {
    // Time from the frame to the image, as a fraction of the interval of the last motion.
    let passed = last.map_or(f64::INFINITY, |last| frame.stamp - last);
    let fraction = (picture.stamp - frame.stamp) / passed;
    let camera_from_working = shifted(&picture.world_from_sensor, origin).inverse();
    move |limb| {
        let (now, before) = (&poses[limb], previous.get(limb).filter(|_| fraction != 0.0));
        camera_from_working * before.map_or(*now, |before| extrapolated(before, now, fraction))
    }
}

/// Sample positions on a limb in a camera's image: pixels (the corner of the first pixel is the origin), depth in meters, and
/// area in patches.
fn places(
    shape: &TaperedEllipticCylinder,
    camera_from_limb: &Pose,
    camera: &Camera,
    mut each: impl FnMut([f64; 2], f64, f64),
) {
    let ends = [0.0, shape.length()].map(|along| *camera_from_limb * (Vec3::Z * along));
    if ends.iter().any(|end| end.z < super::labels::NEAREST_END) {
        return;
    }
    let [Some(start), Some(end)] = ends.map(|end| camera.project(end)) else { return };
    let axis = [end[0] - start[0], end[1] - start[1]];
    let length = (axis[0] * axis[0] + axis[1] * axis[1]).sqrt().max(1e-6);
    let aside = [-axis[1] / length, axis[0] / length];
    let radii = shape.ends().map(|end| 0.5 * (end.a + end.b));
    let [fx, fy] = camera.focal();
    let focal = 0.5 * (fx + fy);
    for along in ALONG_LIMB {
        let center = ends[0] + (ends[1] - ends[0]) * along;
        let radius = radii[0] + (radii[1] - radii[0]) * along;
        let meter = focal / center.z;
        let Some(observed) = camera.project(center) else { continue };
        let [u, v] = observed.map(|value| value + 0.5);
        let patch = length / meter * 2.0 * radius / (ALONG_LIMB.len() * OVER.len()) as f64 / REFERENCE_PATCH;
        for across in OVER {
            let off = across * radius * meter;
            each([u + off * aside[0], v + off * aside[1]], center.z - radius, patch);
        }
    }
}
