//! Color regions: locates the contour of limbs in color images by the colors of limbs and their surroundings (R07 section 3).
//!
//! R07 alternates between segmenting the whole image, with the projected body as prior, and fitting the pose to the border. Here
//! only short lines across the body's contour are segmented, with the same two ingredients: the likelihood of each pixel under
//! the colors of the limb and of the surroundings, and the predicted contour. The edge on a line gives a distance along one
//! direction, as any other correspondence does.

mod empty_scene;
mod evidence;
mod histogram;
mod labels;
mod lines;
mod pixel_gain;
mod posterior;
mod scan;
mod segment;

use crate::association::correspondence::{Correspondences, EdgePair};
use crate::body::Body;
use crate::error::{TrackError, Unexpected};
use crate::math::{Pose, Vec3, refill, reset, shifted};
use crate::observation::frame::Frame;
use crate::observation::picture::{ColorImage, ColorPixels};
use empty_scene::EmptyScene;
use evidence::Evidence;
use histogram::ColorModel;
use labels::LimbLabels;
use lines::{Line, SAME_VIEW, Viewer};
use pixel_gain::camera_from_limb_at;
use posterior::MOST_REACH;
use scan::{EdgeSearch, ScanView};
use std::collections::BTreeMap;

/// The edge search of each step of a frame: wide and coarse at first, then narrower and finer.
const SEARCHES: [EdgeSearch; STEPS] = [
    EdgeSearch { reach: 8, every: 2.0 },
    EdgeSearch { reach: 5, every: 2.0 },
    EdgeSearch { reach: 6, every: 1.0 },
    EdgeSearch { reach: 5, every: 1.0 },
];
/// The edge search for estimating a limb's girth: as wide as one can be.
const SINGLE_EDGES: EdgeSearch = EdgeSearch { reach: MOST_REACH, every: 1.0 };
/// Label images are drawn in cells of two to this power pixels.
const CELL_BITS: u32 = 1;
/// Approximate spacing of lines along a limb, meters; and the least and greatest number of lines on each side.
const SPACING: f64 = 0.035;
const LEAST_LINES: usize = 3;
const MOST_LINES: usize = 16;
/// When color evidence is weak for more limbs than this, colors of all limbs are learned.
const MANY: usize = 4;
/// A unit is one pixel of a camera with this focal length, pixels.
const FOCAL: f64 = 520.0;

/// What was learned from the images of one camera, and working memory.
#[derive(Debug, Default)]
struct Learned {
    /// Pixels per unit in the last image.
    unit: f32,
    model: ColorModel,
    scene: Option<EmptyScene>,
    labels: LimbLabels,
    lines: Vec<Line>,
    known: bool,
}

/// Number of steps that is enough where only color edges are measured.
pub(crate) const STEPS: usize = 4;

/// Colors of the body and its surroundings for each camera, and the lines of the last search.
#[derive(Debug, Default)]
pub(crate) struct ColorRegions {
    /// By number of the camera.
    cameras: BTreeMap<u16, Learned>,
    /// Group of every limb: the limbs of one group have the same colors.
    groups: Vec<u16>,
    /// Time of the last frame, seconds.
    stamp: Option<f64>,
    /// Offset of the cameras that learn in the next frame.
    turn: usize,
    evidence: Vec<Evidence>,
    /// Label images of some limbs, one per camera, for what other limbs explain beside them; and whether each limb is drawn.
    backdrop: Vec<LimbLabels>,
    drawn: Vec<bool>,
    camera_from_limb: Vec<Pose>,
}

/// A frame and the body at its time, in the working frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Posed<'a> {
    /// The frame.
    pub frame: &'a Frame<'a>,
    /// The body.
    pub body: &'a Body,
    /// Its poses.
    pub poses: &'a [Pose],
    /// Its poses in the previous frame; empty where they are not known.
    pub previous: &'a [Pose],
    /// The working frame's origin in the world.
    pub origin: Vec3,
}

/// A line across the contour of a limb in an image, and the color edge on it; pixels.
///
/// ```
/// use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
/// use voodoo_core::{Body, Camera, ColorImage, ColorPixels, Config, Frame, HumanModel};
/// use voodoo_core::{NO_LIMB, Rendering, Tracker, Viewpoint};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let standing = body.rest_pose(Pose::IDENTITY);
/// let camera = Camera::pinhole(320, 240, [290.0, 290.0, 159.5, 119.5])?;
/// let rotation = Quat::from_mat3(&Mat3::from_cols(Vec3::Y, -Vec3::Z, -Vec3::X));
/// let world_from_sensor = Pose::from_parts(Vec3::X * 3.0, rotation);
/// let mut rendering = Rendering::default();
/// rendering.render(&body, &standing, &Viewpoint { camera: &camera, world_from_sensor })?;
/// let red_on_gray: Vec<[u8; 3]> =
///     rendering.limb().iter().map(|limb| if *limb == NO_LIMB { [90; 3] } else { [200, 30, 30] }).collect();
///
/// let mut tracker = Tracker::new(body, Config::default())?;
/// tracker.reset_pose(&standing)?;
/// for stamp in [0.0, 0.03] {
///     let pixels = ColorPixels::Color(&red_on_gray);
///     let image = ColorImage { pixels, camera: &camera, world_from_sensor, stamp, number: 0, source: 0 };
///     tracker.step(&Frame { colors: &[image], ..Frame::empty(stamp) })?;
/// }
/// let near = tracker.region_lines(0).filter(|line| line.sigma.is_finite() && line.offset.abs() < 3.0); // pixels
/// assert!(near.count() > 50);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionLine {
    /// The limb.
    pub limb: usize,
    /// Pixel of the contour.
    pub place: [f32; 2],
    /// Unit vector outward.
    pub normal: [f32; 2],
    /// Distance of the edge outward.
    pub offset: f32,
    /// Standard deviation of that distance; infinite where there is no information.
    pub sigma: f32,
}

impl ColorRegions {
    /// Resets the learned colors of bodies and surroundings.
    pub(crate) fn clear(&mut self) {
        (self.stamp, self.turn) = (None, 0);
        self.cameras.values_mut().for_each(|camera| camera.known = false);
    }

    /// Sets the empty scene of a camera from images with their heights and widths; without images, removes it.
    pub(crate) fn set_background(
        &mut self,
        camera: u16,
        pictures: &[(ColorPixels, [usize; 2])],
    ) -> Result<(), TrackError> {
        self.cameras.entry(camera).or_default().scene = EmptyScene::from_pictures(pictures)?;
        Ok(())
    }

    /// Returns an error for images with distortion, and for those that cannot be compared with the empty scene.
    pub(crate) fn check(&self, frame: &Frame) -> Result<(), TrackError> {
        for (index, picture) in frame.colors.iter().enumerate() {
            let expected = "a pinhole camera: take the distortion out of the picture";
            let (what, lens) = (format_args!("color[{index}].camera"), picture.camera.lens());
            Unexpected::unless(!picture.camera.distorts(), what, expected, format_args!("{lens:?}"))?;
            let known = self.cameras.get(&picture.number);
            known.and_then(|camera| camera.scene.as_ref()).map_or(Ok(()), |scene| scene.check(picture, index))?;
        }
        Ok(())
    }

    /// Learns the colors of new cameras at the initial pose.
    pub(crate) fn begin(&mut self, posed: Posed) {
        if self.groups != posed.body.roles().groups() {
            posed.body.roles().groups().clone_into(&mut self.groups);
            self.cameras.values_mut().for_each(|camera| camera.known = false);
        }
        for picture in posed.frame.colors {
            let gray = picture.pixels.is_gray();
            let groups = self.groups.iter().map(|group| usize::from(*group) + 1).max().unwrap_or(0);
            let camera = self.cameras.entry(picture.number).or_default();
            if camera.known && camera.model.gray == gray {
                continue;
            }
            camera.model.clear(gray, groups);
            camera.known = true;
            self.evidence.clear();
            self.place_lines(picture, posed);
            self.teach(picture);
        }
    }

    /// Finds the edges of the limbs that are `is_requested` in all images, in this step of a frame.
    pub(crate) fn find(
        &mut self,
        posed: Posed,
        step: usize,
        is_requested: impl Fn(usize) -> bool,
        found: &mut Correspondences,
    ) {
        let search = SEARCHES[step.min(STEPS - 1)];
        reset(&mut self.evidence, posed.poses.len(), Evidence::default());
        self.find_within(posed, search, Some(&is_requested), &mut found.regions);
        refill(&mut found.region_support, self.evidence.iter().map(Evidence::support));
    }

    /// Finds every edge on its own, for all limbs: where a limb is wider than modeled, the edges of both sides lie outward.
    pub(crate) fn find_single_edges(&mut self, posed: Posed, pairs: &mut Vec<EdgePair>) {
        self.find_within(posed, SINGLE_EDGES, None, pairs);
    }

    /// Finds edges: of the requested limbs, with both sides searched together; or of all limbs, each edge on its own.
    fn find_within(
        &mut self,
        posed: Posed,
        search: EdgeSearch,
        is_requested: Option<&dyn Fn(usize) -> bool>,
        pairs: &mut Vec<EdgePair>,
    ) {
        let together = is_requested.is_some();
        pairs.clear();
        for picture in posed.frame.colors {
            self.place_lines(picture, posed);
            let Self { cameras, groups, evidence, .. } = self;
            // A camera that changed between grayscale and color has not learned colors yet.
            let is_known = |camera: &&mut Learned| camera.known && camera.model.gray == picture.pixels.is_gray();
            let Some(camera) = cameras.get_mut(&picture.number).filter(is_known) else { continue };
            let mut lines = std::mem::take(&mut camera.lines);
            let (unit, view) = (camera.unit, ScanView { picture, camera, groups });
            let working_from_camera = shifted(&picture.world_from_sensor, posed.origin);
            pairs.reserve(lines.capacity());
            for line in &mut lines {
                let limb = usize::from(line.limb);
                let searched = is_requested.is_none_or(|is_requested| is_requested(limb));
                let found = if searched { scan::edge_on(&view, line, search, together) } else { None };
                line.edge = found;
                if together {
                    let length = posed.body.limbs()[limb].shape.length();
                    evidence[limb].take(line.foot.z / length, found.map(|found| found.beside));
                }
                let Some(edge) = found.filter(|edge| edge.information > 0.0) else { continue };
                let motion = line.motion / f64::from(unit);
                let slope = motion.length();
                pairs.push(EdgePair {
                    limb,
                    x: posed.poses[limb] * line.foot,
                    normal: working_from_camera.rotation * (motion / slope),
                    distance: f64::from(edge.mean) / slope,
                    information: f64::from(edge.information) * slope * slope,
                    source: picture.source,
                });
            }
            camera.lines = lines;
        }
    }

    /// The lines of the last search in a camera's image.
    pub(crate) fn lines(&self, camera: u16) -> impl Iterator<Item = RegionLine> + '_ {
        self.cameras.get(&camera).into_iter().flat_map(|camera| {
            let unit = camera.unit;
            camera.lines.iter().map(move |line| {
                let [mean, information] = line.edge.map_or([0.0; 2], |edge| [edge.mean, edge.information]);
                RegionLine {
                    limb: usize::from(line.limb),
                    place: line.place,
                    normal: line.normal,
                    offset: unit * mean,
                    sigma: unit / information.sqrt(),
                }
            })
        })
    }

    /// Learns colors at the fitted pose: from every second camera in turn, because consecutive frames are similar.
    pub(crate) fn learn(&mut self, frame: &Frame) {
        let turn = self.turn;
        frame.colors.iter().skip(turn).step_by(2).for_each(|picture| self.teach(picture));
        self.turn = 1 - turn;
        self.stamp = Some(frame.stamp);
    }

    /// Places the lines of one image.
    fn place_lines(&mut self, picture: &ColorImage, posed: Posed) {
        let Self { cameras, stamp, camera_from_limb, .. } = self;
        let limb = camera_from_limb_at(*stamp, picture, posed);
        refill(camera_from_limb, (0..posed.poses.len()).map(limb));
        let [fx, fy] = picture.camera.focal();
        let body = posed.body;
        let Learned { unit, labels, lines, .. } = cameras.entry(picture.number).or_default();
        *unit = (0.5 * (fx + fy) / FOCAL) as f32;
        labels.draw(body, camera_from_limb, picture.camera, CELL_BITS, |_| true);
        lines.clear();
        // Reserves the full capacity at once: the number of lines differs from pose to pose.
        lines.reserve(2 * MOST_LINES * camera_from_limb.len());
        let (camera, world_from_camera) = (picture.camera, picture.world_from_sensor);
        let beside = |pose: &Pose| pose.translation.distance(world_from_camera.translation) < SAME_VIEW;
        let depth = posed.frame.images.iter().find(|image| beside(&image.world_from_sensor));
        let viewer = Viewer { body, camera, labels, unit: *unit, world_from_camera, depth };
        for (limb, pose) in camera_from_limb.iter().enumerate() {
            let lines_a_side = (body.limbs()[limb].shape.length() / SPACING).round() as usize;
            viewer.add(limb, pose, lines_a_side.clamp(LEAST_LINES, MOST_LINES), lines);
        }
    }

    /// Learns the colors along the lines of one image, except those of limbs with weak evidence.
    fn teach(&mut self, picture: &ColorImage) {
        let Self { cameras, groups, evidence, .. } = self;
        let Some(camera) = cameras.get_mut(&picture.number) else { return };
        let unit = camera.unit;
        // When the evidence is weak for many limbs at once, the light has changed.
        let light = evidence.iter().filter(|evidence| evidence.is_weak()).count() > MANY;
        for line in &camera.lines {
            let weak = evidence.get(usize::from(line.limb)).is_some_and(Evidence::is_weak);
            if !line.hidden && (light || !weak) {
                let group = usize::from(groups[usize::from(line.limb)]);
                camera.model.count(picture, &camera.labels, group, unit, line);
            }
        }
        camera.model.learn();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::observation::picture::ColorPixels;
    use crate::testing::{pinhole, standing};

    #[test]
    fn a_camera_that_turns_from_grayscale_to_color_has_no_edges_before_it_learned() {
        let (model, poses) = standing();
        let (gray, color) = (vec![200; 160 * 120], vec![[200; 3]; 160 * 120]);
        let mut regions = ColorRegions::default();
        let mut pairs = Vec::new();
        let mut edges = |pixels, learns: bool| {
            let camera = pinhole(160, 120, [140.0, 140.0, 79.5, 59.5]);
            let colors =
                [ColorImage { pixels, camera, world_from_sensor: Pose::IDENTITY, stamp: 0.0, number: 0, source: 0 }];
            let frame = &Frame { colors: &colors, ..Frame::empty(0.0) };
            let posed = Posed { frame, body: &model.body, poses: &poses, previous: &[], origin: Vec3::ZERO };
            if learns {
                regions.begin(posed);
            }
            regions.find_single_edges(posed, &mut pairs);
            assert!(regions.lines(0).count() > 0, "the body is in the picture");
            pairs.len()
        };
        edges(ColorPixels::Gray(&gray), true);
        assert_eq!(edges(ColorPixels::Color(&color), false), 0);
    }
}
