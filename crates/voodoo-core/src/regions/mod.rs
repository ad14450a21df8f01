//! Colour regions: where the contour of limbs lies in pictures, by what limbs and their surroundings look like (R07 section 3).
//!
//! R07 alternates between a segmentation of the whole picture with the projected body as prior and a pose from its border. Here
//! only short lines across the body's contour are segmented, with the same two ingredients: how likely each pixel is the limb's
//! or the surroundings', and where the body is thought to be. A line's edge is a distance along one direction, as any other
//! correspondence.

mod histogram;
mod labels;
mod lens;
mod lines;
mod models;
mod posterior;
mod scan;

use crate::association::correspondence::RegionPair;
use crate::body::Body;
use crate::error::TrackError;
use crate::math::{Pose, Quat, ShortestAxis, Vec3, shifted};
use crate::observation::frame::{ColorImage, ColorPixels, Frame};
use histogram::Kind;
use labels::Labels;
use lens::Lens;
use lines::{Line, Viewer};
use models::ColorModel;
use scan::Scanner;

/// How far from the contour its edge is looked for in the steps of a frame, units.
const REACH: [usize; 4] = [15, 10, 6, 5];
/// Where along a limb lines are.
const HEIGHTS: [f64; 6] = [1.0 / 12.0, 3.0 / 12.0, 5.0 / 12.0, 7.0 / 12.0, 9.0 / 12.0, 11.0 / 12.0];
/// A unit is a pixel of a lens with this focal length, pixels.
const FOCAL: f64 = 520.0;
/// Standard deviation of the body's own contour, units: limbs are no cones.
const MODEL_ERROR: f32 = 2.0;

/// What the pictures of one camera have taught, and working memory.
#[derive(Debug, Default)]
struct Camera {
    number: u16,
    lens: Lens,
    model: ColorModel,
    labels: Labels,
    lines: Vec<Line>,
    camera_from_limb: Vec<Pose>,
    known: bool,
}

/// Colours of the body and its surroundings, camera by camera, and the lines of the last look.
#[derive(Debug, Default)]
pub struct Regions {
    cameras: Vec<Camera>,
    /// Group of every limb: those of one group have the same colours.
    groups: Vec<u16>,
    /// Time of the last frame, seconds.
    stamp: Option<f64>,
    scanner: Scanner,
}

/// The body at the time of a frame, in the working frame.
#[derive(Clone, Copy, Debug)]
pub struct Posed<'a> {
    /// The body.
    pub body: &'a Body,
    /// Its poses.
    pub poses: &'a [Pose],
    /// Its poses in the frame before; empty where they are not known.
    pub previous: &'a [Pose],
    /// The working frame's origin in the world.
    pub origin: Vec3,
}

impl Regions {
    /// Forgets what bodies and surroundings look like.
    pub fn clear(&mut self) {
        self.stamp = None;
        self.cameras.iter_mut().for_each(|camera| camera.known = false);
    }

    /// Keeps what a camera sees without anybody.
    pub fn set_background(&mut self, _camera: u16, _pictures: &[(ColorPixels, [usize; 2])]) -> Result<(), TrackError> {
        Ok(())
    }

    /// Learns the colours of cameras that are new at the pose where the body is thought to be.
    pub fn begin(&mut self, frame: &Frame, posed: Posed) {
        if self.groups.len() != posed.poses.len() {
            self.groups = groups(posed.body);
            self.cameras.iter_mut().for_each(|camera| camera.known = false);
        }
        for picture in frame.colors {
            let kind = Kind::of(&picture.pixels);
            let groups = self.groups.iter().map(|group| usize::from(*group) + 1).max().unwrap_or(0);
            let camera = self.camera(picture.camera);
            if camera.known && camera.model.kind == kind {
                continue;
            }
            camera.model.clear(kind, groups);
            camera.known = true;
            self.look(frame, picture, posed);
            self.teach(picture);
        }
    }

    /// The edges of all limbs in all pictures, in the given step of a frame.
    pub fn find(&mut self, frame: &Frame, posed: Posed, step: usize, pairs: &mut Vec<RegionPair>) {
        pairs.clear();
        let reach = REACH[step.min(REACH.len() - 1)];
        for picture in frame.colors {
            self.look(frame, picture, posed);
            let Self { cameras, groups, scanner, .. } = self;
            let Some(camera) = cameras.iter().find(|camera| camera.number == picture.camera && camera.known) else {
                continue;
            };
            let unit = unit_of(&camera.lens);
            let view = scan::View { picture, model: &camera.model, labels: &camera.labels, groups, unit };
            let working_from_camera = shifted(&picture.world_from_sensor, posed.origin);
            for line in &camera.lines {
                let Some(edge) = scanner.edge(&view, line, reach) else { continue };
                let motion = line.motion / f64::from(unit);
                let slope = motion.length();
                let information = edge.information / (1.0 + edge.information * MODEL_ERROR * MODEL_ERROR);
                let limb = usize::from(line.limb);
                pairs.push(RegionPair {
                    limb,
                    x: posed.poses[limb] * line.foot,
                    normal: working_from_camera.rotation * (motion / slope),
                    distance: f64::from(edge.mean) / slope,
                    information: f64::from(information) * slope * slope,
                    source: picture.source,
                });
            }
        }
    }

    /// Learns colours where the body was found.
    pub fn learn(&mut self, frame: &Frame, posed: Posed) {
        for picture in frame.colors {
            self.look(frame, picture, posed);
            self.teach(picture);
        }
        self.stamp = Some(frame.stamp);
    }

    fn camera(&mut self, number: u16) -> &mut Camera {
        let index = self.cameras.iter().position(|camera| camera.number == number).unwrap_or_else(|| {
            self.cameras.push(Camera { number, ..Camera::default() });
            self.cameras.len() - 1
        });
        &mut self.cameras[index]
    }

    /// Places the lines of one picture.
    fn look(&mut self, frame: &Frame, picture: &ColorImage, posed: Posed) {
        let Posed { body, poses, previous, origin } = posed;
        let passed = self.stamp.map_or(f64::INFINITY, |stamp| frame.stamp - stamp);
        let share = (picture.stamp - frame.stamp) / passed;
        let camera = self.camera(picture.camera);
        let camera_from_working = shifted(&picture.world_from_sensor, origin).inverse();
        camera.camera_from_limb.clear();
        for (limb, pose) in poses.iter().enumerate() {
            // The body of the moment that the camera saw.
            let then =
                previous.get(limb).filter(|_| share != 0.0).map_or(*pose, |before| moved_on(before, pose, share));
            camera.camera_from_limb.push(camera_from_working * then);
        }
        camera.lens = Lens::of(picture);
        let Camera { lens, labels, lines, camera_from_limb, .. } = camera;
        labels.draw(body, camera_from_limb, lens);
        lines.clear();
        let viewer = Viewer { body, lens, labels, unit: unit_of(lens) };
        for (limb, pose) in camera_from_limb.iter().enumerate() {
            viewer.add(limb, pose, &HEIGHTS, lines);
        }
    }

    /// Learns the colours along the lines of one picture.
    fn teach(&mut self, picture: &ColorImage) {
        let Self { cameras, groups, .. } = self;
        let Some(camera) = cameras.iter_mut().find(|camera| camera.number == picture.camera) else { return };
        let unit = unit_of(&camera.lens);
        for line in &camera.lines {
            scan::count(picture, &camera.labels, groups, unit, line, &mut camera.model);
        }
        camera.model.learn();
    }
}

/// Pixels a unit.
fn unit_of(lens: &Lens) -> f32 {
    (0.5 * (lens.intrinsics[0] + lens.intrinsics[1]) / FOCAL) as f32
}

/// Where a limb is a share of the last motion later.
fn moved_on(before: &Pose, now: &Pose, share: f64) -> Pose {
    let turn = (now.rotation * before.rotation.inverse()).to_scaled_axis_shortest();
    let shift = now.translation - before.translation;
    Pose::from_parts(now.translation + share * shift, Quat::from_scaled_axis(share * turn) * now.rotation)
}

/// Groups of limbs with the same colours: the two of a pair, and what hardly moves with what it is joined to.
fn groups(body: &Body) -> Vec<u16> {
    let stem = |name: &str| name.trim_start_matches("l_").trim_start_matches("r_").to_owned();
    let limbs = body.limbs();
    let mut names: Vec<String> = Vec::new();
    let mut groups: Vec<u16> = Vec::new();
    for limb in limbs {
        let carried = limb.parent.as_ref().filter(|(_, joint)| joint.motion < CARRIED).map(|(parent, _)| *parent);
        if let Some(parent) = carried {
            groups.push(groups[parent]);
            continue;
        }
        let name = stem(&limb.name);
        let group = names.iter().position(|known| *known == name).unwrap_or_else(|| {
            names.push(name);
            names.len() - 1
        });
        groups.push(group as u16);
    }
    groups
}

/// A joint whose motion is less than this, radians, carries a limb in the clothes of its parent: the clavicle.
const CARRIED: f64 = 0.05;
