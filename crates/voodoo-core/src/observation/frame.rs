//! All measurements of one instant, from any number of sensors (K06 IV-A). Data is borrowed: nothing is copied on input.

use std::fmt::Display;

use crate::body::Body;
use crate::camera::Camera;
use crate::error::{TrackError, Unexpected};
use crate::math::{Aabb, PLACE, Pose, Vec3, is_place, is_rigid};
use crate::observation::picture::ColorImage;

/// Median depths that cameras measure, meters: meters taken for millimeters are below, and millimeters taken for meters beyond.
const MEASURED: std::ops::RangeInclusive<f64> = 0.01..=100.0;
/// Number of pixels that suffice for a median depth.
const MEDIAN_SAMPLE: usize = 256;

/// Three-dimensional points in the caller's memory layout, in meters.
///
/// [`Cloud`] has an example.
#[derive(Clone, Copy, Debug)]
pub enum PointSlice<'a> {
    /// Single precision.
    F32(&'a [[f32; 3]]),
    /// Double precision.
    F64(&'a [[f64; 3]]),
}

impl PointSlice<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(points) => points.len(),
            Self::F64(points) => points.len(),
        }
    }

    /// True when there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The point at `index`.
    pub fn get(&self, index: usize) -> Vec3 {
        match self {
            Self::F32(points) => Vec3::from_array(points[index].map(f64::from)),
            Self::F64(points) => Vec3::from_array(points[index]),
        }
    }
}

/// What is known in advance about the limb that 3-D points belong to (K06 IV-A, the first three kinds).
///
/// [`Cloud`] has an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Unknown: background, or any limb.
    Free,
    /// On the tracked body: the whole-body box is not applied.
    Body,
    /// On this limb: no box is applied.
    Limb(usize),
}

/// 3-D points of one sensor.
///
/// ```
/// use voodoo_core::math::Pose;
/// use voodoo_core::{Body, Cloud, Frame, HumanModel, PointSlice, Scope};
///
/// // A tactile glove: all of its points lie on the left hand.
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let contacts = [[0.02_f32, 0.0, 0.01], [0.02, 0.01, 0.03]];
/// let cloud = Cloud {
///     points: PointSlice::F32(&contacts),
///     world_from_sensor: Pose::IDENTITY,
///     weight: 1.0,
///     scope: Scope::Limb(body.limb_index("l_hand")?),
///     source: 0,
/// };
/// Frame { clouds: &[cloud], ..Frame::empty(0.0) }.check(&body, None)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Cloud<'a> {
    /// The points in the sensor's frame.
    pub points: PointSlice<'a>,
    /// Pose of the sensor.
    pub world_from_sensor: Pose,
    /// Weight of each point.
    pub weight: f64,
    /// What is known about the limb that they belong to.
    pub scope: Scope,
    /// Index of the source, for the report.
    pub source: u16,
}

/// The pixels of a depth image, row by row: distance along the optical axis; 0, negative or not finite means no return.
///
/// [`DepthImage`] has an example.
#[derive(Clone, Copy, Debug)]
pub enum DepthPixels<'a> {
    /// In units of `meters_per_unit`.
    U16(&'a [u16]),
    /// In units of `meters_per_unit`.
    F32(&'a [f32]),
}

impl DepthPixels<'_> {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        match self {
            Self::U16(pixels) => pixels.len(),
            Self::F32(pixels) => pixels.len(),
        }
    }

    /// True when there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value of a pixel; a value that is not finite or not above zero means no return.
    #[inline(always)]
    pub fn get(&self, index: usize) -> f32 {
        match self {
            Self::U16(pixels) => f32::from(pixels[index]),
            Self::F32(pixels) => pixels[index],
        }
    }

    /// The median depth of a sample of the pixels, meters, if no camera measures it, so that `meters_per_unit` is wrong; `None` if
    /// it may be right.
    ///
    /// ```
    /// use voodoo_core::DepthPixels;
    ///
    /// let meters = DepthPixels::F32(&[2.5; 12]);
    /// assert_eq!([0.001, 1.0].map(|unit| meters.implausible_depth(unit)), [Some(0.0025), None]);
    /// ```
    pub fn implausible_depth(&self, meters_per_unit: f64) -> Option<f64> {
        let mut sample = [0.0; MEDIAN_SAMPLE];
        // An odd step, so that the sample has pixels of all columns.
        let step = (self.len() / MEDIAN_SAMPLE) | 1;
        let returns = (0..self.len()).step_by(step).map(|index| self.get(index)).filter(|z| *z > 0.0 && z.is_finite());
        let count = sample.iter_mut().zip(returns).map(|(place, z)| *place = z).count();
        let returned = sample.get_mut(..count).filter(|returned| !returned.is_empty())?;
        let median = f64::from(*returned.select_nth_unstable_by(count / 2, f32::total_cmp).1) * meters_per_unit;
        (!MEASURED.contains(&median)).then_some(median)
    }
}

/// An organized depth image; its pixels are free points.
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Camera, DepthImage, DepthPixels};
///
/// let camera = Camera::pinhole(4, 3, [2.0, 2.0, 1.0, 1.0])?;
/// let millimeters = [2000_u16; 12];
/// let image = DepthImage {
///     pixels: DepthPixels::U16(&millimeters),
///     camera: &camera,
///     meters_per_unit: 0.001,
///     world_from_sensor: Pose::IDENTITY,
///     weight: 1.0,
///     source: 0,
/// };
/// assert_eq!(image.back_project(4 + 1, 2.0), Vec3::new(0.0, 0.0, 2.0)); // row 1, column 1: the principal point
/// # Ok::<(), voodoo_core::Unexpected>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DepthImage<'a> {
    /// All pixels of the camera.
    pub pixels: DepthPixels<'a>,
    /// Its calibration; the lens may have distortion.
    pub camera: &'a Camera,
    /// Length of one unit of the pixels, meters.
    pub meters_per_unit: f64,
    /// Pose of the camera's optical frame (x right, y down, z forward).
    pub world_from_sensor: Pose,
    /// Weight of each point.
    pub weight: f64,
    /// Index of the source, for the report.
    pub source: u16,
}

impl DepthImage<'_> {
    /// The point of a pixel in the camera frame for a depth of `z` meters.
    pub fn back_project(&self, index: usize, z: f32) -> Vec3 {
        let [x, y] = self.camera.pixel_ray(index % self.camera.width(), index / self.camera.width());
        f64::from(z) * Vec3::new(x, y, 1.0)
    }

    /// The measured depth of a pixel, meters; `None` without a return.
    #[inline(always)]
    pub(crate) fn depth(&self, index: usize) -> Option<f32> {
        let z = self.pixels.get(index) * self.meters_per_unit as f32;
        (z > 0.0 && z.is_finite()).then_some(z)
    }

    /// Returns the measured depth at the pixel that a world point projects to (as stored; see [`DepthPixels`] for no return)
    /// and the depth of the point itself, meters; `None` outside the image.
    pub fn measured(&self, place: Vec3) -> Option<[f64; 2]> {
        let point = self.world_from_sensor.inverse_transform_point(place);
        let index = self.camera.index_of(point)?;
        Some([f64::from(self.pixels.get(index)) * self.meters_per_unit, point.z])
    }
}

/// A measured position of a named site (K06 IV-A: 3-D point-to-point relation).
///
/// [`Frame`] has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionRelation {
    /// Index of the site.
    pub site: usize,
    /// Measured position, world frame.
    pub position: Vec3,
    /// Weight.
    pub weight: f64,
    /// Bias, meters: the measurement may have a constant error of this size. Within it the measurement has no effect; beyond it,
    /// the remaining distance pulls.
    pub bias: f64,
    /// Index of the source, for the report.
    pub source: u16,
}

/// A named site that was observed along a ray (K06 IV-A: 2-D point-to-line relation).
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Body, Camera, Frame, HumanModel, RayRelation};
///
/// // A network found the left wrist in a pixel of a camera at the origin.
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let camera = Camera::pinhole(640, 480, [525.0, 525.0, 319.5, 239.5])?;
/// let [x, y] = camera.ray([412.0, 200.5]).ok_or("a pixel outside the domain of the lens")?;
/// let (site, world_from_sensor) = (body.site_index("l_wrist")?, Pose::IDENTITY);
/// let (origin, direction) = (world_from_sensor.translation, world_from_sensor.rotation * Vec3::new(x, y, 1.0));
/// let ray = RayRelation { site, origin, direction, weight: 8.0, bias: 0.0, source: 0 };
/// Frame { rays: &[ray], ..Frame::empty(0.0) }.check(&body, None)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayRelation {
    /// Index of the site.
    pub site: usize,
    /// Start of the ray (the focal point), world frame.
    pub origin: Vec3,
    /// Direction of the ray, world frame, of any length above zero.
    pub direction: Vec3,
    /// Weight.
    pub weight: f64,
    /// Bias, meters: the measurement may have a constant error of this size. Within it the measurement has no effect; beyond it,
    /// the remaining distance pulls.
    pub bias: f64,
    /// Index of the source, for the report.
    pub source: u16,
}

/// A person whom something other than the tracker's own detector found in this instant: keypoints triangulated from several
/// cameras, a network's joints, markers.
///
/// Its positions measure the tracked person whom they are nearest to. Where they show nobody who is tracked, that person is tracked
/// from this frame on: a lost or absent one who may have moved there, or a new one, as soon as the log odds of successive detections
/// sum to some 4. Positions that do not determine the pose of the body start nobody.
///
/// ```
/// use voodoo_core::math::{Pose, Vec3};
/// use voodoo_core::{Body, Config, DetectedPerson, Frame, HumanModel, PositionRelation, Tracker};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let standing = body.rest_pose(Pose::from_translation(Vec3::X * 2.0));
/// let measured = |site| PositionRelation { site, position: body.site_position(&standing, site), weight: 8.0, bias: 0.0, source: 0 };
/// let positions: Vec<PositionRelation> = (0..body.sites().len()).map(measured).collect();
/// let person = DetectedPerson { positions: &positions, person: f64::INFINITY };
/// let mut tracker = Tracker::new(body, Config::default())?;
/// let estimate = tracker.step(&Frame { detections: &[person], ..Frame::empty(0.0) })?;
/// assert!(estimate.world_from_limb[0].translation.distance(standing[0].translation) < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedPerson<'a> {
    /// Measured positions of sites; three that are not collinear determine the pose. Somebody new starts from them unless the
    /// detector finds the joints more precisely in an image of the frame; a weight of 1 stands for 0.1 m.
    pub positions: &'a [PositionRelation],
    /// Log odds `ln(p / (1 - p))` that it is a person; infinite if that is certain.
    pub person: f64,
}

/// The ground plane: points `p` with `normal . p < offset` lie below it.
///
/// ```
/// use voodoo_core::Ground;
/// use voodoo_core::math::Vec3;
///
/// let floor = Ground { normal: Vec3::Z, offset: -0.9 }; // 0.9 m below the origin
/// assert!((floor.height(Vec3::new(2.0, 0.0, 0.3)) - 1.2).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Unit vector pointing up, world frame.
    pub normal: Vec3,
    /// Offset of the ground plane along the normal, meters.
    pub offset: f64,
}

impl Ground {
    /// The same plane in a frame with its origin at `origin`, a world position.
    pub fn relative_to(self, origin: Vec3) -> Self {
        Self { offset: self.offset - self.normal.dot(origin), ..self }
    }

    /// Height of a point above the floor, meters.
    pub fn height(&self, point: Vec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// All measurements of one instant.
///
/// [`Frame::empty`] makes one without measurements, for the fields that are not given.
///
/// ```
/// use voodoo_core::math::Vec3;
/// use voodoo_core::{Body, Frame, Ground, HumanModel, PositionRelation};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let site = body.site_index("l_wrist")?;
/// let wrist = PositionRelation { site, position: Vec3::new(0.1, 0.2, 1.5), weight: 20.0, bias: 0.0, source: 0 };
/// let ground = Some(Ground { normal: Vec3::Z, offset: 0.0 });
/// let frame = Frame { positions: &[wrist], ground, ..Frame::empty(0.0) };
/// frame.check(&body, None)?;
/// assert!(frame.check(&body, Some(1.0)).is_err()); // not after the previous frame
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Frame<'a> {
    /// Seconds.
    pub stamp: f64,
    /// 3-D points.
    pub clouds: &'a [Cloud<'a>],
    /// Depth images.
    pub images: &'a [DepthImage<'a>],
    /// Color images.
    pub colors: &'a [ColorImage<'a>],
    /// Sites with measured positions.
    pub positions: &'a [PositionRelation],
    /// Sites observed along rays.
    pub rays: &'a [RayRelation],
    /// Persons who were found in this instant.
    pub detections: &'a [DetectedPerson<'a>],
    /// The ground plane, if it is known.
    pub ground: Option<Ground>,
    /// Boxes of the world whose points belong to no person: the robot's own arm, a coat stand.
    pub excluded: &'a [Aabb],
}

impl Frame<'_> {
    /// A frame without measurements.
    pub fn empty(stamp: f64) -> Self {
        Self { stamp, ..Self::default() }
    }

    /// Returns an error for unusable input, before any of it reaches the tracker's state.
    ///
    /// Depth images and point clouds may hold NaN only where the sensor had no return. In a depth image it counts as "no
    /// return"; in a cloud it is an error (drop such rows before).
    pub fn check(&self, body: &Body, previous_stamp: Option<f64>) -> Result<(), TrackError> {
        Unexpected::unless(self.stamp.is_finite(), "stamp", "a finite time in seconds", self.stamp)?;
        if let Some(previous) = previous_stamp.filter(|previous| *previous >= self.stamp) {
            return Err(TrackError::TimeBackwards { previous, found: self.stamp });
        }
        for (index, cloud) in self.clouds.iter().enumerate() {
            check_weight(format_args!("points[{index}].weight"), cloud.weight)?;
            check_pose(format_args!("points[{index}].world_from_sensor"), &cloud.world_from_sensor)?;
            if let Scope::Limb(limb) = cloud.scope {
                let (what, valid) = (format_args!("points[{index}].limb"), limb < body.limbs().len());
                Unexpected::unless(valid, what, "the index of a limb", limb)?;
            }
            if let Some(row) = (0..cloud.points.len()).find(|row| !is_place(cloud.points.get(*row))) {
                let found = format!("{:?} in row {row}", cloud.points.get(row).to_array());
                Unexpected::unless(false, format_args!("points[{index}].points"), PLACE, found)?;
            }
        }
        for (index, image) in self.images.iter().enumerate() {
            let (what, unit) = (format_args!("depth[{index}]"), image.meters_per_unit);
            check_size(format_args!("{what}.image"), image.pixels.len(), image.camera)?;
            let valid = unit > 0.0 && unit.is_finite();
            Unexpected::unless(valid, format_args!("{what}.meters_per_unit"), "a finite length above zero", unit)?;
            check_weight(format_args!("{what}.weight"), image.weight)?;
            check_pose(format_args!("{what}.world_from_sensor"), &image.world_from_sensor)?;
        }
        for (index, picture) in self.colors.iter().enumerate() {
            picture.check(index, self.stamp, &self.colors[..index])?;
        }
        for (index, relation) in self.positions.iter().enumerate() {
            check_position(format_args!("positions[{index}]"), relation, body)?;
        }
        for (index, detection) in self.detections.iter().enumerate() {
            for (number, relation) in detection.positions.iter().enumerate() {
                check_position(format_args!("detections[{index}].positions[{number}]"), relation, body)?;
            }
            let what = format_args!("detections[{index}].person");
            Unexpected::unless(!detection.person.is_nan(), what, "log odds", "NaN")?;
        }
        for (index, relation) in self.rays.iter().enumerate() {
            let what = format_args!("rays[{index}]");
            check_relation(what, relation.site, relation.weight, relation.bias, body)?;
            check_place(format_args!("{what}.origin"), relation.origin)?;
            check_place(format_args!("{what}.direction"), relation.direction)?;
            let (known, found) = (relation.direction.length() >= 1e-9, relation.direction.to_array());
            let (what, found) = (format_args!("{what}.direction"), format_args!("{found:?}"));
            Unexpected::unless(known, what, "a vector that is not zero", found)?;
        }
        if let Some(Ground { normal, offset }) = self.ground {
            let valid = offset.is_finite() && normal.is_normalized();
            let found = format_args!("normal {:?} and offset {offset}", normal.to_array());
            Unexpected::unless(valid, "ground", "a unit normal and a finite offset", found)?;
        }
        for (index, Aabb { mins, maxs }) in self.excluded.iter().enumerate() {
            let valid = mins.is_finite() && maxs.is_finite() && mins.cmple(*maxs).all();
            let found = format_args!("{:?} to {:?}", mins.to_array(), maxs.to_array());
            Unexpected::unless(valid, format_args!("excluded[{index}]"), "a low and a high corner", found)?;
        }
        Ok(())
    }
}

/// Rejects an image that has not a value for every pixel of its camera.
pub(super) fn check_size(what: impl Display, pixels: usize, camera: &Camera) -> Result<(), Unexpected> {
    let found = format_args!("{pixels} for {}x{}", camera.width(), camera.height());
    Unexpected::unless(pixels == camera.pixels(), what, "all pixels of the camera", found)
}

fn check_position(what: impl Display, relation: &PositionRelation, body: &Body) -> Result<(), Unexpected> {
    check_relation(&what, relation.site, relation.weight, relation.bias, body)?;
    check_place(format_args!("{what}.position"), relation.position)
}

fn check_relation(what: impl Display, site: usize, weight: f64, bias: f64, body: &Body) -> Result<(), Unexpected> {
    let valid = site < body.sites().len();
    Unexpected::unless(valid, format_args!("{what}.site"), "the index of a site", site)?;
    check_weight(format_args!("{what}.weight"), weight)?;
    let valid = bias.is_finite() && bias >= 0.0;
    Unexpected::unless(valid, format_args!("{what}.bias"), "a finite length, zero or above", bias)
}

fn check_weight(what: impl Display, weight: f64) -> Result<(), Unexpected> {
    // Points are weighed in single precision.
    let valid = (weight as f32).is_finite() && weight > 0.0;
    Unexpected::unless(valid, what, "a weight above zero, 1e38 at most", weight)
}

/// Rejects a position that is not valid.
fn check_place(what: impl Display, place: Vec3) -> Result<(), Unexpected> {
    Unexpected::unless(is_place(place), what, PLACE, format_args!("{:?}", place.to_array()))
}

pub(crate) fn check_pose(what: impl Display, pose: &Pose) -> Result<(), Unexpected> {
    Unexpected::unless(is_rigid(pose), what, "a rigid transform", format_args!("{pose:?}"))
}

/// Rejects other than one valid pose for each limb.
pub(crate) fn check_poses(body: &Body, world_from_limb: &[Pose]) -> Result<(), Unexpected> {
    let [poses, limbs] = [world_from_limb.len(), body.limbs().len()];
    let found = format_args!("{poses} poses for {limbs} limbs, or one not finite");
    let valid = poses == limbs && world_from_limb.iter().all(is_rigid);
    Unexpected::unless(valid, "world_from_limb", "one rigid pose a limb", found)
}
