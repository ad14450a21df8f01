//! Finds persons in depth images: segments candidates, evaluates them with a small network, and reports joints in the world
//! frame.
//!
//! ```
//! use voodoo_core::HumanModel;
//! use voodoo_core::{Body, Config, Tracker};
//! use voodoo_detect::Detector;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let body = Body::human(1.75, HumanModel::Measured)?;
//! let tracker = Tracker::new(body, Config::default())?.with_detector(Box::new(Detector::new()));
//! assert!(tracker.can_search());
//! # Ok(())
//! # }
//! ```

mod components;
mod convolution;
pub mod crop;
mod floor;
mod names;
pub mod network;
mod product;
mod rejections;
pub mod segmentation;
#[cfg(test)]
mod testing;
mod view;
mod weights;
mod winograd;

pub use components::PersonCandidate;
pub use names::{JOINTS, LENGTHS};

use crop::Crop;
use network::{Answer, Memory, Network};
use rejections::Rejections;
use segmentation::Segmentation;
use std::sync::{Arc, LazyLock};
use voodoo_core::math::{Aabb, Pose, Vec3};
use voodoo_core::{
    Body, DepthImage, Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Ground, Surroundings, Unexpected,
};

/// Log odds above which a candidate counts as a person.
const PERSON: f64 = 0.0;
/// Maximum number of candidates that the network evaluates per image for [`DetectionQuery::All`]. Run time is proportional to it.
const MAX_EVALUATIONS: usize = 12;
/// Stature to which small persons are enlarged in the network's input, meters; and the fraction of it below which a person is small.
/// At the scale of adults a child of 1 m has too few pixels.
const ADULT: f64 = 1.7;
const SMALL: f64 = 0.9;
/// Bones of the left leg and the trunk from ankle to head: number of the length, and of the two joints. Joints of the right leg
/// follow those of the left.
const UPRIGHT: [[usize; 3]; 4] = [[2, 11, 13], [3, 13, 15], [6, 2, 1], [7, 1, 0]];
/// Fraction of the variance of joints that counts for the sum of these bones, because most errors are across them or common; and
/// the power of the distance from ankles to head over this sum by which its standard deviation grows: the joints of a bent body
/// cut its corners. Both were chosen on recordings that training does not see.
const ALONG: f64 = 0.1;
const BENT: i32 = 4;
/// The standard deviation of a Laplace distribution is this many times its scale.
const SIGMA_BY_SCALE: f64 = std::f64::consts::SQRT_2;

/// Finds persons in depth images, with a network of 17 joints and 9 lengths.
#[derive(Debug, Default)]
pub struct Detector {
    /// `None`: the network that ships with the library, which is read at first use.
    network: Option<Arc<Network>>,
    /// Stature of the persons, where it is known, meters; and its relative standard deviation.
    stature: Option<[f64; 2]>,
    memory: Memory,
    segmentation: Segmentation,
    /// Candidates of the last image's detections.
    found: Vec<PersonCandidate>,
    /// Log odds that the first evaluated candidate of the last image is a person, and its box in the world frame.
    nearest: Option<(f64, Aabb)>,
    rejections: Rejections,
}

/// The network that ships with the library, read at first use.
static SHIPPED: LazyLock<Result<Arc<Network>, Unexpected>> =
    LazyLock::new(|| Network::read(include_bytes!("../person.weights")).map(Arc::new));

impl Detector {
    /// A detector with the network that ships with the library. Its weights are read once per process, at the first image.
    pub fn new() -> Self {
        Self::default()
    }

    /// A detector with a user-supplied network.
    ///
    /// # Errors
    ///
    /// If the bytes are not weights of a network of this structure and with these joints.
    pub fn with_weights(bytes: &[u8]) -> Result<Self, Unexpected> {
        let network = Network::read(bytes)?;
        let (expected, found) = (JOINTS.len(), network.joints());
        Unexpected::unless(found == expected, "weights", format_args!("{expected} joints"), found)?;
        Ok(Self { network: Some(Arc::new(network)), ..Self::default() })
    }

    /// The detector for persons whose stature is known, meters, with this relative standard deviation: 0.02 for one that was
    /// measured. The lengths that it reports are scaled to that stature, in proportion to what either is known to.
    pub fn with_stature(self, stature: f64, sigma: f64) -> Self {
        Self { stature: Some([stature, sigma]), ..self }
    }
}

/// The candidates that a query evaluates, in order of evaluation.
fn order<'a>(
    candidates: &'a [PersonCandidate],
    rejections: &Rejections,
    query: DetectionQuery,
    camera_from_world: &Pose,
) -> Vec<&'a PersonCandidate> {
    let is_open = |candidate: &&_| query != DetectionQuery::New || !rejections.is_rejected(candidate);
    let mut order: Vec<_> = candidates.iter().filter(is_open).collect();
    match query {
        DetectionQuery::All => {}
        DetectionQuery::Any | DetectionQuery::New => {
            order.sort_by_key(|candidate| rejections.last_rejection(candidate));
        }
        DetectionQuery::Near(place) => {
            let place = *camera_from_world * place;
            order.sort_by(|a, b| a.distance(place).total_cmp(&b.distance(place)));
        }
    }
    order
}

impl Detect for Detector {
    fn joints(&self) -> Vec<String> {
        JOINTS.map(String::from).to_vec()
    }

    fn lengths(&self) -> Vec<String> {
        LENGTHS.map(String::from).to_vec()
    }

    /// Whether the body has all of its joints, as human bodies do.
    fn knows(&self, body: &Body) -> bool {
        JOINTS.iter().all(|joint| body.site_index(joint).is_ok())
    }

    fn fresh(&self) -> Box<dyn Detect> {
        Box::new(Self { network: self.network.clone(), stature: self.stature, ..Self::default() })
    }

    /// Plants reach log odds of up to 4; persons of whom more than half is visible reach 8.
    fn static_odds(&self) -> f64 {
        5.0
    }

    fn detect(
        &mut self,
        image: &DepthImage,
        around: &Surroundings,
        query: DetectionQuery,
    ) -> Result<Vec<Detection>, DetectError> {
        let network = self.network.clone().map_or_else(|| SHIPPED.clone(), Ok)?;
        self.found.clear();
        self.nearest = None;
        self.rejections.next_image();
        self.segmentation.find(image, around);
        let Self { memory, segmentation, found: accepted, nearest, rejections, stature, .. } = self;
        let mut found: Vec<(&PersonCandidate, Detection)> = Vec::new();
        let most = if query == DetectionQuery::All { MAX_EVALUATIONS } else { 1 };
        let order = order(&segmentation.candidates, rejections, query, &image.world_from_sensor.inverse());
        for candidate in order.into_iter().take(most) {
            let mut evaluate = |enlarged: f64| {
                let crop = segmentation.crop(candidate, enlarged)?;
                let answer = network.evaluate(&crop.pixels, memory);
                Some(detection(&answer, &crop, candidate, &image.world_from_sensor))
            };
            let Some(mut detection) = evaluate(enlargement(stature.map(|[stature, _]| stature))) else { continue };
            nearest.get_or_insert((detection.person, detection.bounds));
            if detection.person > PERSON {
                let enlarged = enlargement(detection.lengths.last().map(|[length, _]| *length));
                if let Some(known) = *stature {
                    scale_to(&mut detection.lengths, known);
                } else if enlarged > 1.0
                    && let Some(again) = evaluate(enlarged)
                {
                    detection = of_small_person(&detection, again);
                }
            }
            rejections.record(candidate, detection.person > PERSON);
            if detection.person > PERSON {
                found.push((candidate, detection));
            }
        }
        found.sort_by(|(_, a), (_, b)| b.person.total_cmp(&a.person));
        let floor = segmentation.floor.map(|floor| {
            let normal = image.world_from_sensor.rotation * floor.normal;
            Ground { normal, offset: floor.offset + normal.dot(image.world_from_sensor.translation) }
        });
        let mut kept = Vec::new();
        for (candidate, mut detection) in found {
            // Of candidates that share components only the most confident is kept.
            if accepted.iter().any(|other| other.overlaps(candidate)) {
                continue;
            }
            detection.floor = floor;
            detection.pixels = segmentation.mask(candidate);
            accepted.push(candidate.clone());
            kept.push(detection);
        }
        Ok(kept)
    }

    fn nearest(&self) -> Option<(f64, Aabb)> {
        self.nearest
    }

    fn reject(&mut self, index: usize) {
        if let Some(candidate) = self.found.get(index) {
            self.rejections.record(candidate, false);
        }
    }
}

/// Factor by which a person of this stature is enlarged in the network's input; 1 where the stature is not known.
fn enlargement(stature: Option<f64>) -> f64 {
    stature.map(|stature| ADULT / stature).filter(|factor| factor * SMALL > 1.0).unwrap_or(1.0)
}

/// The enlarged evaluation of a person who looked small in the first one, its lengths scaled to its joints. Part of an adult looks
/// like a child who is enlarged, so the less sure of both tells whether it is a person, and how precisely the stature is known.
fn of_small_person(first: &Detection, mut enlarged: Detection) -> Detection {
    if let Some(measured) = stature_of_joints(&enlarged) {
        scale_to(&mut enlarged.lengths, measured);
    }
    enlarged.person = enlarged.person.min(first.person);
    if let (Some([_, before]), Some([_, sigma])) = (first.lengths.last(), enlarged.lengths.last_mut()) {
        *sigma = sigma.max(*before);
    }
    enlarged
}

/// The stature that the joints of a detection measure, meters, and its relative standard deviation: the reported one times the
/// sum of the bones from ankles to head, over the sum of their reported lengths.
fn stature_of_joints(detection: &Detection) -> Option<[f64; 2]> {
    let [mut measured, mut reported, mut variance] = [0.0; 3];
    let joint = |number: usize| detection.joints.get(number).copied().flatten();
    for [length, from, to] in UPRIGHT {
        let sides: &[usize] = if from > to { &[0] } else { &[0, 1] };
        let share = 1.0 / sides.len() as f64;
        for side in sides {
            let (from, to) = (joint(from + side)?, joint(to + side)?);
            measured += share * from.position.distance(to.position);
            variance += share * share * (from.sigma * from.sigma + to.sigma * to.sigma);
        }
        reported += detection.lengths.get(length)?[0];
    }
    let [head, left, right] = [joint(0)?, joint(15)?, joint(16)?].map(|joint| joint.position);
    let straight = head.distance(0.5 * (left + right)) / measured;
    let [stature, _] = detection.lengths.last()?;
    let found = [stature * measured / reported, (ALONG * variance).sqrt() / measured / straight.min(1.0).powi(BENT)];
    found.iter().all(|value| value.is_normal()).then_some(found)
}

/// Scales reported lengths, the last of which is the stature, to a stature that was measured otherwise, with its relative standard
/// deviation. Errors of lengths are mostly those of the scale.
fn scale_to(lengths: &mut [[f64; 2]], [measured, sigma]: [f64; 2]) {
    let Some([reported, own]) = lengths.last_mut() else { return };
    let factor = (measured / *reported).powf(*own * *own / (*own * *own + sigma * sigma));
    *own = *own * sigma / own.hypot(sigma);
    lengths.iter_mut().for_each(|[length, _]| *length *= factor);
}

/// Converts the network's output to a detection in the world frame.
fn detection(answer: &Answer, crop: &Crop, candidate: &PersonCandidate, world_from_camera: &Pose) -> Detection {
    let joint = |((place, log_scale), visible): ((&[f32; 3], &f32), &f32)| {
        Some(DetectedJoint {
            position: *world_from_camera * crop.to_camera(Vec3::from_array(place.map(f64::from))),
            sigma: SIGMA_BY_SCALE * f64::from(*log_scale).exp() / crop.enlarged,
            visible: 1.0 / (1.0 + f64::from(-visible).exp()),
        })
    };
    let joints = answer.joints.iter().zip(&answer.log_scale).zip(&answer.visible).map(joint).collect();
    let length = |(length, scale): (&f32, &f32)| {
        [f64::from(*length).exp() / crop.enlarged, SIGMA_BY_SCALE * f64::from(*scale).exp()]
    };
    let bounds = Aabb::from_points(candidate.bounds.corners().map(|corner| *world_from_camera * corner));
    Detection {
        joints,
        lengths: answer.log_lengths.iter().zip(&answer.log_length_scale).map(length).collect(),
        facing: Some(f64::from(answer.facing)),
        person: f64::from(answer.person),
        bounds,
        ..Detection::default()
    }
}
