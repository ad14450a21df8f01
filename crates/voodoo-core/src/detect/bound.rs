//! A user-supplied detector, bound to a body.

use super::{Detect, DetectError, Detected, DetectedJoint, Detection, DetectionQuery, JointMap, Surroundings, place};
use crate::body::Body;
use crate::error::Unexpected;
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
    /// The mapping of its joints and lengths to the body.
    pub map: JointMap,
    /// Whether a detector is set and can find the body.
    pub knows: bool,
    /// The last error since this was cleared.
    pub error: Option<DetectError>,
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

    /// Another detector of the same kind with no state from images.
    pub(crate) fn fresh(&self) -> Option<Box<dyn Detect>> {
        self.detector.as_ref().map(|detector| detector.fresh())
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
            for (index, detection) in found.iter().enumerate() {
                check(detection, &self.map, image).map_err(|wrong| format!("detection[{index}].{wrong}"))?;
            }
            Ok(found)
        });
        let found = checked.unwrap_or_else(|error| {
            self.error = Some(error);
            Vec::new()
        });
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
        let mut depth = Vec::new();
        around.open_depth(image, &mut depth);
        let within = |index: &usize| {
            detection.bounds.contains(image.world_from_sensor * image.back_project(*index, depth[*index]))
        };
        detection.pixels = (0..depth.len()).filter(|index| depth[*index] > 0.0).filter(within).collect();
    }
    detection
}

/// Rejects a detection with invalid values.
fn check(detection: &Detection, map: &JointMap, image: &DepthImage) -> Result<(), Unexpected> {
    let Detection { joints, lengths, facing, person, bounds, floor, pixels } = detection;
    let (found, named) = (joints.len(), map.sites.len());
    Unexpected::unless(found == named, "joints", format_args!("{named}, as the detector names them"), found)?;
    let (found, named) = (lengths.len(), map.lengths);
    let valid = found == 0 || found == named;
    Unexpected::unless(valid, "lengths", format_args!("{named}, as the detector names them"), found)?;
    for (number, joint) in joints.iter().enumerate() {
        let Some(DetectedJoint { position, sigma, visible }) = joint else { continue };
        let what = format_args!("joints[{number}]");
        Unexpected::unless(is_place(*position), what, "finite meters", position)?;
        let valid = *sigma > 0.0 && sigma.is_finite();
        Unexpected::unless(valid, format_args!("{what}.sigma"), "finite meters > 0", sigma)?;
        Unexpected::unless((0.0..=1.0).contains(visible), format_args!("{what}.visible"), "0 to 1", visible)?;
    }
    for length in lengths.as_flattened() {
        Unexpected::unless(*length > 0.0 && length.is_finite(), "lengths", "finite numbers > 0", length)?;
    }
    let valid = !person.is_nan() && !facing.is_some_and(f64::is_nan);
    Unexpected::unless(valid, "person and facing", "log odds", "no number")?;
    let valid = is_place(bounds.mins) && is_place(bounds.maxs);
    Unexpected::unless(valid, "bounds", "finite meters", format_args!("{bounds:?}"))?;
    let valid = floor.is_none_or(|floor| floor.normal.is_finite() && floor.offset.is_finite());
    Unexpected::unless(valid, "floor", "finite numbers", format_args!("{floor:?}"))?;
    let (most, below) = (pixels.iter().max().copied().unwrap_or_default(), image.pixels.len());
    Unexpected::unless(pixels.is_empty() || most < below, "pixels", format_args!("indices below {below}"), most)
}
