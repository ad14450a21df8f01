//! Finding people in a depth image: what may be one, what a network says of it, and where its joints are.

mod components;
mod convolution;
pub mod crop;
mod floor;
mod names;
pub mod network;
mod product;
mod rejections;
pub mod segmentation;
mod skeleton;
mod view;
pub mod weights;
mod winograd;

use crate::body::Body;
use crate::math::{Aabb, Pose, Vec3};
use crate::observation::frame::{DepthImage, Ground};
pub use components::Candidate;
use crop::Crop;
pub use names::{JOINTS, LENGTHS};
use network::{Answer, Memory, Network};
use rejections::Rejections;
use segmentation::Segmentation;
pub use skeleton::{lengths, take_lengths};
use std::sync::{Arc, OnceLock};
pub use view::Surroundings;
use weights::WeightsError;

/// Log odds from which on a candidate is taken for a person.
const PERSON: f32 = 0.0;
/// Candidates of an image that the network looks at where everybody is wanted: costs time in proportion.
const MOST_LOOKS: usize = 12;
/// The standard deviation of a Laplace distribution is this many times its scale.
const SIGMA_BY_SCALE: f64 = std::f64::consts::SQRT_2;

/// What is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// Everybody.
    All,
    /// Anybody: one candidate is looked at in each image, those first that were not found to be nobody in the images before.
    Anybody,
    /// Anybody, but nothing that was found to be nobody a few images ago.
    News,
    /// The person at this place of the world, metres.
    Near(Vec3),
}

/// A joint of a detected person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedJoint {
    /// Position in the world, metres.
    pub position: Vec3,
    /// Standard deviation along each axis, metres.
    pub sigma: f64,
    /// Probability that it is in the image and not hidden.
    pub visible: f64,
}

/// A person in a depth image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detection {
    /// Every joint of [`JOINTS`].
    pub joints: Vec<DetectedJoint>,
    /// Length and relative standard deviation of everything in [`LENGTHS`]; empty where the network does not tell it.
    pub lengths: Vec<[f64; 2]>,
    /// Log odds that the trunk faces the camera.
    pub facing: f64,
    /// Log odds that it is a person.
    pub person: f64,
    /// What the image shows of it: corners of its box in the world, metres.
    pub low: Vec3,
    /// The other corner.
    pub high: Vec3,
    /// The floor as the image shows it or as it was told, world frame.
    pub floor: Option<Ground>,
    /// Number of its candidate, see [`Detector::mask`].
    pub(crate) candidate: usize,
}

/// Finds people in depth images.
#[derive(Debug)]
pub struct Detector {
    network: Arc<Network>,
    memory: Memory,
    segmentation: Segmentation,
    found: Vec<Detection>,
    /// Log odds that what was looked at first of the last image is a person, and its box in the world.
    nearest: Option<(f64, Aabb)>,
    rejections: Rejections,
}

/// The network that comes with the library, read once.
fn shipped() -> Result<Arc<Network>, WeightsError> {
    static NETWORK: OnceLock<Result<Arc<Network>, WeightsError>> = OnceLock::new();
    let read = || Network::read(include_bytes!("person.weights")).map(Arc::new);
    NETWORK.get_or_init(read).clone()
}

impl Detection {
    /// A joint by its name in [`JOINTS`].
    pub fn joint(&self, name: &str) -> Option<&DetectedJoint> {
        JOINTS.iter().position(|joint| *joint == name).and_then(|index| self.joints.get(index))
    }

    /// The joint that is a site of a body, by the site's name.
    pub(crate) fn at_site(&self, body: &Body, site: usize) -> Option<&DetectedJoint> {
        self.joint(&body.sites()[site].name)
    }

    /// Where the person is: the root of its body, world frame, metres.
    pub(crate) fn place(&self) -> Option<Vec3> {
        self.joint("humanoid_root").map(|root| root.position)
    }

    /// The person's sizes as in [`LENGTHS`], metres: those that the network tells, else the joints' distances without the stature.
    pub fn sizes(&self) -> Vec<f64> {
        if !self.lengths.is_empty() {
            return self.lengths.iter().map(|length| length[0]).collect();
        }
        let joints: Vec<Vec3> = self.joints.iter().map(|joint| joint.position).collect();
        lengths(&joints)
    }
}

impl Detector {
    /// A detector with the network that comes with the library.
    pub fn new() -> Result<Self, WeightsError> {
        Ok(Self::of(shipped()?))
    }

    /// A detector with a network of one's own.
    pub fn with_weights(bytes: &[u8]) -> Result<Self, WeightsError> {
        let network = Network::read(bytes)?;
        if network.joints() != JOINTS.len() {
            return Err(WeightsError::new(format!("{} joints", JOINTS.len()), network.joints().to_string()));
        }
        Ok(Self::of(Arc::new(network)))
    }

    fn of(network: Arc<Network>) -> Self {
        Self {
            network,
            memory: Memory::default(),
            segmentation: Segmentation::default(),
            found: Vec::new(),
            nearest: None,
            rejections: Rejections::default(),
        }
    }

    /// The people in an image, the surest first.
    pub fn detect(&mut self, image: &DepthImage, around: &Surroundings, wanted: Wanted) -> &[Detection] {
        let Self { network, memory, segmentation, found, nearest, rejections } = self;
        found.clear();
        *nearest = None;
        rejections.next_image();
        segmentation.find(image, around);
        let camera_from_world = image.world_from_sensor.inverse();
        let mut order: Vec<usize> = (0..segmentation.candidates().len()).collect();
        let at = |number: usize| &segmentation.candidates()[number];
        match wanted {
            Wanted::All => {}
            Wanted::Anybody => order.sort_by_key(|number| rejections.last(at(*number))),
            Wanted::News => {
                order.retain(|number| !rejections.is_old(at(*number)));
                order.sort_by_key(|number| rejections.last(at(*number)));
            }
            Wanted::Near(place) => {
                let place = camera_from_world * place;
                order.sort_by(|a, b| at(*a).distance(place).total_cmp(&at(*b).distance(place)));
            }
        }
        let mut looks = 0;
        for number in order {
            let candidate = &segmentation.candidates()[number];
            let Some(crop) = segmentation.crop(candidate) else { continue };
            let answer = network.look(&crop.pixels, memory);
            looks += 1;
            if nearest.is_none() {
                *nearest = Some((f64::from(answer.person), in_world(candidate, &image.world_from_sensor)));
            }
            if answer.person > PERSON {
                found.push(detection(&answer, &crop, candidate, number, &image.world_from_sensor));
            }
            rejections.note(candidate, answer.person > PERSON);
            if looks == MOST_LOOKS || wanted != Wanted::All {
                break;
            }
        }
        found.sort_by(|a, b| b.person.total_cmp(&a.person));
        // Of candidates that share parts the surest stays.
        let shared = |a: &Detection, b: &Detection| {
            let [a, b] = [a, b].map(|detection| &segmentation.candidates()[detection.candidate]);
            a.shares(b)
        };
        let mut kept: Vec<Detection> = Vec::new();
        for detection in found.drain(..) {
            if !kept.iter().any(|other| shared(other, &detection)) {
                kept.push(detection);
            }
        }
        let floor = segmentation.floor().map(|floor| {
            let normal = image.world_from_sensor.rotation * floor.normal;
            Ground { normal, offset: floor.offset + normal.dot(image.world_from_sensor.translation) }
        });
        kept.iter_mut().for_each(|detection| detection.floor = floor);
        *found = kept;
        found
    }

    /// Log odds that what was looked at first of the last image is a person, with its box in the world; none if nothing there
    /// has a person's size.
    pub fn first_look(&self) -> Option<(f64, Aabb)> {
        self.nearest
    }

    /// Nobody asks for a person of the last image: others are looked at before them.
    pub fn refuse(&mut self, detection: &Detection) {
        if let Some(candidate) = self.segmentation.candidates().get(detection.candidate) {
            self.rejections.note(candidate, false);
        }
    }

    /// Indices of the pixels of a detection of the last image.
    pub fn mask(&self, detection: &Detection, into: &mut Vec<usize>) {
        into.clear();
        if let Some(candidate) = self.segmentation.candidates().get(detection.candidate) {
            self.segmentation.mask(candidate, into);
        }
    }
}

/// The box about a candidate's box.
fn in_world(candidate: &Candidate, world_from_camera: &Pose) -> Aabb {
    let corners = [candidate.low, candidate.high];
    let corner = |number: usize| {
        let pick = |bit: usize, axis: usize| corners[(number >> bit) & 1][axis];
        *world_from_camera * Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    };
    Aabb::from_points((0..8).map(corner))
}

/// What the network said, in the world.
fn detection(
    answer: &Answer,
    crop: &Crop,
    candidate: &Candidate,
    number: usize,
    world_from_camera: &Pose,
) -> Detection {
    let joint = |((place, log_scale), visible): ((&[f32; 3], &f32), &f32)| DetectedJoint {
        position: *world_from_camera * crop.to_camera(Vec3::from_array(place.map(f64::from))),
        sigma: SIGMA_BY_SCALE * f64::from(*log_scale).exp(),
        visible: 1.0 / (1.0 + f64::from(-visible).exp()),
    };
    let joints = answer.joints.iter().zip(&answer.log_scale).zip(&answer.visible).map(joint).collect();
    let length = |(length, scale): (&f32, &f32)| [f64::from(*length).exp(), SIGMA_BY_SCALE * f64::from(*scale).exp()];
    let bounds = in_world(candidate, world_from_camera);
    Detection {
        joints,
        lengths: answer.log_lengths.iter().zip(&answer.log_length_scale).map(length).collect(),
        facing: f64::from(answer.facing),
        person: f64::from(answer.person),
        low: bounds.mins,
        high: bounds.maxs,
        floor: None,
        candidate: number,
    }
}
