//! Detections: what a detector reports about the persons in a depth image, and the trait that a detector implements.
//!
//! The core holds no detector of its own. One is handed in, see [`Tracker::with_detector`](crate::Tracker::with_detector); its
//! joints go by the names of the body's sites.

mod bound;
mod joint_map;
mod measured;
mod placement;
mod skeleton;

pub(crate) use bound::{BoundDetector, PlacedDetection};
pub(crate) use joint_map::{Detected, JointMap};
pub(crate) use measured::DetectedLimbs;
pub(crate) use placement::{fit_body, fit_pose, is_sized_like, place};

use crate::body::Body;
use crate::math::{Aabb, Vec3, refill};
use crate::observation::background::Background;
use crate::observation::frame::{DepthImage, Ground};
use crate::observation::ownership::NO_OWNER;
use std::fmt::Debug;

/// Why a detector could not process an image. The frame is then processed without detections. [`Detect`] has an example.
pub type DetectError = Box<dyn std::error::Error + Send + Sync>;

/// Margin of a box around joints, meters: limbs are thicker than their joints.
const AROUND_JOINTS: f64 = 0.2;

/// Finds persons in depth images.
///
/// ```
/// use voodoo_core::{Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Surroundings};
/// use voodoo_core::math::Vec3;
/// use voodoo_core::DepthImage;
///
/// /// One person always stands at the same position.
/// #[derive(Clone, Debug)]
/// struct Standing;
///
/// impl Detect for Standing {
///     fn joints(&self) -> Vec<String> {
///         ["l_shoulder", "r_shoulder", "l_hip", "r_hip"].map(String::from).to_vec()
///     }
///
///     fn detect(
///         &mut self,
///         _image: &DepthImage,
///         _around: &Surroundings,
///         query: DetectionQuery,
///     ) -> Result<Vec<Detection>, DetectError> {
///         if matches!(query, DetectionQuery::Near(position) if position.distance(Vec3::new(2.4, 0.0, 1.0)) > 1.0) {
///             return Ok(Vec::new());
///         }
///         let places = [[2.4, -0.2, 1.45], [2.4, 0.2, 1.45], [2.4, -0.09, 0.94], [2.4, 0.09, 0.94]];
///         let joint = |at| Some(DetectedJoint { position: Vec3::from_array(at), sigma: 0.05, visible: 1.0 });
///         Ok(vec![Detection::new(places.map(joint).to_vec(), 5.0)])
///     }
///
///     fn fresh(&self) -> Box<dyn Detect> {
///         Box::new(self.clone())
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use voodoo_core::HumanModel;
/// use voodoo_core::{Body, Config, Tracker};
///
/// let tracker = Tracker::new(Body::human(1.75, HumanModel::Measured)?, Config::default())?.with_detector(Box::new(Standing));
/// assert!(tracker.can_search());
/// # Ok(())
/// # }
/// ```
pub trait Detect: Debug + Send + Sync {
    /// Names of the joints that it reports. They match names of the body's sites; for humans these are H-Anim names (ISO/IEC
    /// 19774). Names that the body lacks are ignored.
    fn joints(&self) -> Vec<String>;

    /// Names of the lengths that it reports, out of `upper_arm`, `forearm`, `thigh`, `shank`, `shoulder_width`, `hip_width`,
    /// `trunk` (`humanoid_root` to `vc7`), `neck` (`vc7` to `head_center`) and `stature`. Other names are ignored.
    fn lengths(&self) -> Vec<String> {
        Vec::new()
    }

    /// Whether it can find this body. By default: whether the body has sites with the names of its joints, and these sites fix
    /// the body's pose.
    fn knows(&self, body: &Body) -> bool {
        placement::fixes_pose(body, &self.joints())
    }

    /// Returns another detector of the same kind without state from images. With several persons, each gets its own.
    fn fresh(&self) -> Box<dyn Detect>;

    /// Returns the persons in an image, the most probable first.
    ///
    /// A detector may omit persons that the `query` does not ask for, but need not.
    ///
    /// # Errors
    ///
    /// Any failure to process the image. The tracker then processes the frame without detections, see
    /// [`Tracker::detector_error`](crate::Tracker::detector_error).
    fn detect(
        &mut self,
        image: &DepthImage,
        around: &Surroundings,
        query: DetectionQuery,
    ) -> Result<Vec<Detection>, DetectError>;

    /// Log odds that the object nearest to the position of the last [`DetectionQuery::Near`] is a person, with its box in the
    /// world frame. `None` if there is no object of a person's size, or if the detector does not compute this. Low log odds end a
    /// track that follows an object.
    fn nearest(&self) -> Option<(f64, Aabb)> {
        None
    }

    /// Log odds up to which it mistakes things that never move (plants, mannequins) for persons. They are subtracted from those of
    /// a detection of what has not moved since the camera started, and 1 from those of others.
    fn static_odds(&self) -> f64 {
        1.0
    }

    /// Reports that the detection with this index in the last image is not followed. [`DetectionQuery::Any`] and
    /// [`DetectionQuery::New`] may then evaluate other candidates first.
    fn reject(&mut self, _index: usize) {}
}

/// Which persons a detector is asked for. [`Detect`] has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DetectionQuery {
    /// All persons in the image.
    All,
    /// Any person: one candidate per image is enough. Candidates that were not rejected in earlier images come first.
    Any,
    /// Any person, without candidates that were rejected within the last few images.
    New,
    /// The person at this position, world frame, meters.
    Near(Vec3),
}

/// A joint of a detected person.
///
/// [`Detection`] has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedJoint {
    /// Position in the world, meters.
    pub position: Vec3,
    /// Standard deviation along each axis, meters.
    pub sigma: f64,
    /// Probability that the joint is inside the image and not occluded.
    pub visible: f64,
}

/// A person in a depth image.
///
/// ```
/// use voodoo_core::math::Vec3;
/// use voodoo_core::{DetectedJoint, Detection};
///
/// let joint = |x, y, z| Some(DetectedJoint { position: Vec3::new(x, y, z), sigma: 0.05, visible: 0.9 });
/// let mut person = Detection::new(vec![joint(2.4, -0.2, 1.45), joint(2.4, 0.2, 1.45), None], 5.0);
/// person.facing = Some(3.0);
/// assert!((person.bounds.maxs.y - 0.4).abs() < 1e-12); // the box around the joints has a margin of 0.2 m
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detection {
    /// The joints of [`Detect::joints`], in that order; `None` for one that was not found.
    pub joints: Vec<Option<DetectedJoint>>,
    /// Length (meters) and relative standard deviation of everything in [`Detect::lengths`], in that order; or empty.
    pub lengths: Vec<[f64; 2]>,
    /// Log odds that the trunk faces the camera; `None` where the detector does not report it.
    pub facing: Option<f64>,
    /// Log odds `ln(p / (1 - p))` that it is a person. A sum of approximately 4, over one or several detections, confirms a
    /// person.
    pub person: f64,
    /// Box around the observed surface, world frame, meters.
    pub bounds: Aabb,
    /// The ground plane, estimated from the image or given by [`Surroundings::ground`], world frame.
    pub floor: Option<Ground>,
    /// Indices of its pixels. If empty, the pixels within its box are used.
    pub pixels: Vec<usize>,
}

impl Detection {
    /// A person with these joints and log odds. The joints span its box; nothing else is reported.
    pub fn new(joints: Vec<Option<DetectedJoint>>, person: f64) -> Self {
        let positions = joints.iter().flatten().map(|joint| Aabb::new(joint.position, joint.position));
        let bounds = positions.reduce(Aabb::union).unwrap_or_default().enlarged(AROUND_JOINTS);
        Self { bounds, joints, person, ..Self::default() }
    }
}

/// What is known about the scene besides the image.
///
/// ```
/// use voodoo_core::math::{Aabb, Pose, Vec3};
/// use voodoo_core::{Camera, DepthImage, DepthPixels, Surroundings};
///
/// let camera = Camera::pinhole(2, 1, [1.0, 1.0, 0.0, 0.0])?;
/// let (pixels, world_from_sensor) = (DepthPixels::F32(&[2.0, 3.0]), Pose::IDENTITY);
/// let image = DepthImage { pixels, camera: &camera, meters_per_unit: 1.0, world_from_sensor, weight: 1.0, source: 0 };
/// let coat_stand = Aabb::new(Vec3::new(2.5, -0.5, 2.5), Vec3::new(3.5, 0.5, 3.5));
/// let around = Surroundings { excluded: &[coat_stand], ..Surroundings::default() };
/// let mut depth = Vec::new();
/// around.open_depth(&image, &mut depth);
/// assert_eq!(depth, [2.0, 0.0]); // without the pixel inside the excluded box
/// # Ok::<(), voodoo_core::Unexpected>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Surroundings<'a> {
    /// The ground plane, world frame.
    pub ground: Option<Ground>,
    /// Upward direction where no ground plane is known, world frame, unit length.
    pub up: Option<Vec3>,
    /// Depth of the learned background at every pixel, meters; empty if none was learned.
    pub background: &'a [f32],
    /// World-frame boxes that contain no persons.
    pub excluded: &'a [Aabb],
    /// The owner of each pixel, including owners that are to be ignored; empty if no pixel is owned.
    pub owners: &'a [u16],
    /// An owner whose pixels may still belong to the person.
    pub own: Option<u16>,
}

impl Surroundings<'_> {
    /// Whether a pixel with a depth of `z` meters shows the background or a person who is tracked already.
    pub fn explains(&self, index: usize, z: f32) -> bool {
        self.is_others(index) || self.background.get(index).is_some_and(|depth| Background::contains(*depth, z))
    }

    /// Whether a pixel shows a person who is tracked already.
    pub fn is_others(&self, index: usize) -> bool {
        self.owners.get(index).is_some_and(|owner| *owner != NO_OWNER && Some(*owner) != self.own)
    }

    /// Whether a point of the world lies in one of the excluded boxes.
    pub fn excludes(&self, point: Vec3) -> bool {
        self.excluded.iter().any(|bounds| bounds.contains(point))
    }

    /// Writes the depth of every pixel of an image, meters. It is 0 where there is no return, and where the return is known not
    /// to belong to a requested person.
    pub fn open_depth(&self, image: &DepthImage, depth: &mut Vec<f32>) {
        let open_pixel = |index| {
            let excluded = |z| self.excludes(image.world_from_sensor * image.back_project(index, z));
            let open = |z: &f32| !self.explains(index, *z) && (self.excluded.is_empty() || !excluded(*z));
            image.depth(index).filter(open).unwrap_or(0.0)
        };
        refill(depth, (0..image.pixels.len()).map(open_pixel));
    }
}
