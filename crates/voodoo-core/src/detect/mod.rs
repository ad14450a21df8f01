//! Detections: what a detector reports of the persons in a depth image, and the trait that a detector implements.
//!
//! The core holds no detector of its own. One is handed in, see [`Tracker::with_detector`](crate::Tracker::with_detector); its
//! joints go by the names of the body's sites.

mod bound;
mod joint_map;
mod placement;
mod skeleton;

pub(crate) use bound::{BoundDetector, PlacedDetection};
pub(crate) use joint_map::{Detected, JointMap};
pub(crate) use placement::{fit_body, fit_pose, is_sized_like, place};

use crate::body::Body;
use crate::math::{Aabb, Pose, Vec3};
use crate::observation::background::Background;
use crate::observation::frame::{DepthImage, Ground};
use crate::observation::ownership::NO_OWNER;
use std::fmt::Debug;

/// Why a detector could not look at an image. The frame is processed without detections.
pub type DetectError = Box<dyn std::error::Error + Send + Sync>;

/// A box about joints is this much larger than they span, meters: limbs are thicker than their joints.
const AROUND_JOINTS: f64 = 0.2;

/// Finds persons in depth images.
///
/// ```
/// use voodoo_core::detect::{Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Surroundings};
/// use voodoo_core::math::Vec3;
/// use voodoo_core::observation::frame::DepthImage;
///
/// /// Somebody always stands at the same place.
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
///         _query: DetectionQuery,
///     ) -> Result<Vec<Detection>, DetectError> {
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
/// use voodoo_core::body::HumanModel;
/// use voodoo_core::{Body, Config, Tracker};
///
/// let tracker = Tracker::new(Body::human(1.75, HumanModel::Full)?, Config::default())?.with_detector(Box::new(Standing));
/// assert!(tracker.can_search());
/// # Ok(())
/// # }
/// ```
pub trait Detect: Debug + Send + Sync {
    /// Names of the joints that it reports: those of sites of the body, for humans H-Anim's (ISO/IEC 19774). Names that the body
    /// lacks are ignored.
    fn joints(&self) -> Vec<String>;

    /// Names of the lengths that it reports, of `upper_arm`, `forearm`, `thigh`, `shank`, `shoulder_width`, `hip_width`, `trunk`
    /// (`humanoid_root` to `vc7`), `neck` (`vc7` to `head_center`) and `stature`. Other names are ignored.
    fn lengths(&self) -> Vec<String> {
        Vec::new()
    }

    /// Whether it can find this body. By default: the body has sites with the names of its joints, and they fix its pose.
    fn knows(&self, body: &Body) -> bool {
        placement::fixes_pose(body, &self.joints())
    }

    /// Another detector of the same kind that has seen no image: one of several persons gets its own.
    fn fresh(&self) -> Box<dyn Detect>;

    /// The persons in an image, the most probable first.
    ///
    /// A detector may leave out whom the `query` does not ask for; it need not.
    ///
    /// # Errors
    ///
    /// Whatever keeps it from looking; the tracker then goes on without it in this frame, see
    /// [`Tracker::detector_error`](crate::Tracker::detector_error).
    fn detect(
        &mut self,
        image: &DepthImage,
        around: &Surroundings,
        query: DetectionQuery,
    ) -> Result<Vec<Detection>, DetectError>;

    /// Log odds that what stands nearest to the place of the last [`DetectionQuery::Near`] is a person, with its box in the world;
    /// none if nothing of a person's size is there, or where the detector does not tell. A track on what is no person ends by this.
    fn nearest(&self) -> Option<(f64, Aabb)> {
        None
    }

    /// The detection with this index of the last image is not followed: [`DetectionQuery::Any`] and [`DetectionQuery::New`] may
    /// look at others first.
    fn reject(&mut self, _index: usize) {}
}

/// Whom a detector is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DetectionQuery {
    /// Everybody.
    All,
    /// Anybody: one candidate an image will do, those first that were not found to be nobody in the images before.
    Any,
    /// Anybody, but nothing that was found to be nobody a few images ago.
    New,
    /// The person at this place of the world, meters.
    Near(Vec3),
}

/// A joint of a detected person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedJoint {
    /// Position in the world, meters.
    pub position: Vec3,
    /// Standard deviation along each axis, meters.
    pub sigma: f64,
    /// Probability that it is in the image and not hidden.
    pub visible: f64,
}

/// A person in a depth image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detection {
    /// The joints of [`Detect::joints`], in that order; `None` for one that was not found.
    pub joints: Vec<Option<DetectedJoint>>,
    /// Length (meters) and relative standard deviation of everything in [`Detect::lengths`], in that order; or empty.
    pub lengths: Vec<[f64; 2]>,
    /// Log odds that the trunk faces the camera; `None` where the detector does not tell.
    pub facing: Option<f64>,
    /// Log odds that it is a person. About 4, over one look or several, make a person: `ln(p / (1 - p))` of a probability `p`.
    pub person: f64,
    /// What the image shows of it: corners of its box in the world, meters.
    pub low: Vec3,
    /// The other corner.
    pub high: Vec3,
    /// The floor as the image shows it or as [`Surroundings::ground`] gives it, world frame.
    pub floor: Option<Ground>,
    /// Indices of the pixels that show it; empty: those that lie within its box.
    pub pixels: Vec<usize>,
}

impl Detection {
    /// A person with these joints, which span its box, and log odds; nothing else is reported.
    pub fn new(joints: Vec<Option<DetectedJoint>>, person: f64) -> Self {
        let positions = || joints.iter().flatten().map(|joint| joint.position);
        let around = Vec3::splat(AROUND_JOINTS);
        let low = positions().reduce(Vec3::min).unwrap_or_default() - around;
        let high = positions().reduce(Vec3::max).unwrap_or_default() + around;
        Self { low, high, joints, person, ..Self::default() }
    }
}

/// What is known of the place beside the image.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surroundings<'a> {
    /// The floor, world frame.
    pub ground: Option<Ground>,
    /// Direction upwards where no floor is known, world frame, unit length.
    pub up: Option<Vec3>,
    /// Depth of the learned background at every pixel, meters; empty where none was learned.
    pub background: &'a [f32],
    /// Boxes of the world that hold nobody.
    pub excluded: &'a [Aabb],
    /// Who explains each pixel, and who does not matter among them; empty where nobody does.
    pub owners: &'a [u16],
    /// Whose pixels may be the person all the same.
    pub own: Option<u16>,
}

impl Surroundings<'_> {
    /// Whether a pixel with a depth of `z` meters shows the background, or somebody who is tracked already.
    pub fn explains(&self, index: usize, z: f32) -> bool {
        let others = self.owners.get(index).is_some_and(|owner| *owner != NO_OWNER && Some(*owner) != self.own);
        others || self.background.get(index).is_some_and(|depth| Background::contains(*depth, z))
    }

    /// Whether a place of the world is in one of the boxes that hold nobody.
    pub fn excludes(&self, point: Vec3) -> bool {
        self.excluded.iter().any(|bounds| bounds.contains(point))
    }

    /// The depth of every pixel of an image, meters; 0 where nothing returned, and where it is known that what returned is nobody who
    /// is asked for.
    pub fn open_depth(&self, image: &DepthImage, depth: &mut Vec<f32>) {
        depth.clear();
        depth.extend((0..image.pixels.len()).map(|index| {
            let z = image.pixels.get(index) * image.meters_per_unit as f32;
            let open = z > 0.0 && z.is_finite() && !self.explains(index, z);
            let excluded = || self.excludes(world_point(image, index, z));
            if open && (self.excluded.is_empty() || !excluded()) { z } else { 0.0 }
        }));
    }
}

/// The place in the world that a pixel shows at a depth of `z` meters.
fn world_point(image: &DepthImage, index: usize, z: f32) -> Vec3 {
    let world_from_sensor: &Pose = &image.world_from_sensor;
    *world_from_sensor * image.back_project(index, z)
}
