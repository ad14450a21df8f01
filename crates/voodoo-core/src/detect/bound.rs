//! A user-supplied detector, bound to a body.

use super::{Detect, DetectError, Detected, Detection, DetectionQuery, JointMap, Surroundings, place, world_point};
use crate::body::Body;
use crate::math::{Aabb, Vec3, is_place};
use crate::observation::frame::DepthImage;

/// A detection and the position of the body's root that follows from it.
#[derive(Clone, Debug)]
pub(crate) struct PlacedDetection {
    /// Index among the detections of its image, for [`Detect::reject`].
    pub index: usize,
    /// The body's root, world frame, meters.
    pub root: Vec3,
    /// The detection.
    pub detection: Detection,
}

/// An optional detector with its names resolved on a body. Its reports are validated.
#[derive(Debug, Default)]
pub(crate) struct BoundDetector {
    detector: Option<Box<dyn Detect>>,
    map: JointMap,
    knows: bool,
    error: Option<DetectError>,
}

impl BoundDetector {
    /// Sets the detector for this body.
    pub(crate) fn set(&mut self, detector: Option<Box<dyn Detect>>, body: &Body) {
        self.detector = detector;
        self.bind(body);
    }

    /// Resolves the names again after the body has changed.
    pub(crate) fn bind(&mut self, body: &Body) {
        let detector = self.detector.as_deref();
        self.map = detector
            .map_or_else(JointMap::default, |detector| JointMap::new(body, &detector.joints(), &detector.lengths()));
        self.knows = detector.is_some_and(|detector| detector.knows(body));
    }

    /// Whether a detector is set and can find the body.
    pub(crate) fn knows(&self) -> bool {
        self.knows
    }

    /// The mapping of its joints and lengths to the body.
    pub(crate) fn map(&self) -> &JointMap {
        &self.map
    }

    /// Another detector of the same kind with no state from images.
    pub(crate) fn fresh(&self) -> Option<Box<dyn Detect>> {
        self.detector.as_ref().map(|detector| detector.fresh())
    }

    /// The last error since [`Self::clear_error`].
    pub(crate) fn error(&self) -> Option<&DetectError> {
        self.error.as_ref()
    }

    /// Clears the last error.
    pub(crate) fn clear_error(&mut self) {
        self.error = None;
    }

    /// Returns the persons that the detector reports in an image; for [`DetectionQuery::Near`] only the nearest. Returns none
    /// where the detector fails or reports invalid values, see [`Self::error`].
    pub(crate) fn detect(
        &mut self,
        body: &Body,
        image: &DepthImage,
        around: &Surroundings,
        query: DetectionQuery,
    ) -> Vec<PlacedDetection> {
        let Some(detector) = self.detector.as_mut() else { return Vec::new() };
        let checked = detector.detect(image, around, query).and_then(|found| {
            let each = found.iter().enumerate();
            each.into_iter().try_for_each(|(index, detection)| check(index, detection, &self.map, image))?;
            Ok(found)
        });
        let found = match checked {
            Ok(found) => found,
            Err(error) => {
                self.error = Some(error);
                return Vec::new();
            }
        };
        let map = &self.map;
        let placed = |(index, detection): (usize, Detection)| {
            let root = place(body, Detected { detection: &detection, map })?;
            Some(PlacedDetection { index, root, detection: with_pixels(detection, image, around) })
        };
        let mut found: Vec<PlacedDetection> = found.into_iter().enumerate().filter_map(placed).collect();
        if let DetectionQuery::Near(near) = query {
            let apart = |placed: &PlacedDetection| placed.root.distance(near);
            found = found.into_iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).into_iter().collect();
        }
        found
    }

    /// See [`Detect::nearest`].
    pub(crate) fn nearest(&self) -> Option<(f64, Aabb)> {
        self.detector.as_ref().filter(|_| self.error.is_none())?.nearest()
    }

    /// See [`Detect::static_odds`].
    pub(crate) fn static_odds(&self) -> f64 {
        self.detector.as_ref().map_or(0.0, |detector| detector.static_odds())
    }

    /// See [`Detect::reject`].
    pub(crate) fn reject(&mut self, index: usize) {
        if let Some(detector) = &mut self.detector {
            detector.reject(index);
        }
    }
}

/// Fills in the pixels of a detection: those within its box, where the detector does not report any.
fn with_pixels(mut detection: Detection, image: &DepthImage, around: &Surroundings) -> Detection {
    if detection.pixels.is_empty() {
        let bounds = Aabb { mins: detection.low, maxs: detection.high };
        let mut depth = Vec::new();
        around.open_depth(image, &mut depth);
        let within = |index: &usize| bounds.contains(world_point(image, *index, depth[*index]));
        detection.pixels = (0..depth.len()).filter(|index| depth[*index] > 0.0).filter(within).collect();
    }
    detection
}

/// Rejects a detection with invalid values.
fn check(index: usize, detection: &Detection, map: &JointMap, image: &DepthImage) -> Result<(), DetectError> {
    let wrong = |what: &str, expected: String, found: String| -> Result<(), DetectError> {
        Err(format!("detection[{index}].{what}: expected {expected}, found {found}").into())
    };
    let Detection { joints, lengths, facing, person, low, high, floor, pixels } = detection;
    if joints.len() != map.sites.len() {
        return wrong("joints", format!("{}, as the detector names them", map.sites.len()), joints.len().to_string());
    }
    if !lengths.is_empty() && lengths.len() != map.lengths {
        return wrong("lengths", format!("{}, as the detector names them", map.lengths), lengths.len().to_string());
    }
    for (number, joint) in joints.iter().enumerate().filter_map(|(number, joint)| Some((number, joint.as_ref()?))) {
        if !is_place(joint.position) {
            return wrong(&format!("joints[{number}]"), "finite meters".into(), format!("{:?}", joint.position));
        }
        if !(joint.sigma > 0.0 && joint.sigma.is_finite()) {
            return wrong(&format!("joints[{number}].sigma"), "finite meters > 0".into(), joint.sigma.to_string());
        }
        if !(0.0..=1.0).contains(&joint.visible) {
            return wrong(&format!("joints[{number}].visible"), "0 to 1".into(), joint.visible.to_string());
        }
    }
    if let Some(pair) = lengths.iter().find(|pair| !pair.iter().all(|value| *value > 0.0 && value.is_finite())) {
        return wrong("lengths", "finite numbers > 0".into(), format!("{pair:?}"));
    }
    if person.is_nan() || facing.is_some_and(f64::is_nan) {
        return wrong("person and facing", "log odds".into(), "no number".into());
    }
    if !(is_place(*low) && is_place(*high)) {
        return wrong("low and high", "finite meters".into(), format!("{low:?} and {high:?}"));
    }
    if let Some(floor) = floor.filter(|floor| !floor.normal.is_finite() || !floor.offset.is_finite()) {
        return wrong("floor", "finite numbers".into(), format!("{floor:?}"));
    }
    match pixels.iter().find(|pixel| **pixel >= image.pixels.len()) {
        Some(pixel) => wrong("pixels", format!("indices below {}", image.pixels.len()), pixel.to_string()),
        None => Ok(()),
    }
}
