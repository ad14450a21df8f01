//! Detectors that are passed from Python.

use std::collections::HashMap;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};
use voodoo_core::math::{Vec3, matrix};
use voodoo_core::{DepthImage, Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Ground, Surroundings};

use crate::arrays::{Row, contiguous, vector};
use crate::errors::{ConfigError, MeasurementError, unless, warn, wrong, wrong_argument};

/// Standard deviation of a joint for which a detector reports none, meters.
const SIGMA: f64 = 0.05;
/// Probabilities are clipped to this distance from 0 and 1, so that their log odds are finite.
const LEAST: f64 = 1e-7;

/// The `detector` argument of a caller: "shipped", None, a `voodoo.Detector`, or an object with `joints` and `detect(image)`.
pub(crate) fn detector(given: &Bound<'_, PyAny>) -> PyResult<Option<Box<dyn Detect>>> {
    if given.is_none() {
        return Ok(None);
    }
    if given.cast::<PyString>().is_ok_and(|word| word == "shipped") {
        #[cfg(feature = "detect")]
        return Ok(Some(Box::new(voodoo_detect::Detector::new())));
        // A build without a detector.
        #[cfg(not(feature = "detect"))]
        return Ok(None);
    }
    #[cfg(feature = "detect")]
    if let Ok(detector) = given.cast::<crate::detect::PyDetector>() {
        return Ok(Some(detector.try_borrow()?.0.fresh()));
    }
    if given.hasattr("joints")? && given.hasattr("detect")? {
        return Ok(Some(Box::new(PythonDetector::new(given)?)));
    }
    let expected = "\"shipped\", None, a voodoo.Detector, or an object with joints and detect(image)";
    Err(ConfigError::new_err(wrong("detector", expected, given)))
}

/// Counts and reports that a detector failed in a step, which continued without it: a warning, or KeyboardInterrupt and the like
/// unchanged.
pub(crate) fn warn_of_detector(py: Python<'_>, error: Option<&DetectError>, failures: &mut usize) -> PyResult<()> {
    let Some(error) = error else { return Ok(()) };
    *failures += 1;
    let cause = error.downcast_ref::<PyErr>();
    if let Some(cause) = cause.filter(|cause| !cause.is_instance_of::<PyException>(py)) {
        return Err(cause.clone_ref(py));
    }
    let text = format!("the detector failed, the step went on without it: {error}");
    // Python's own wrapper of the step is one stack frame; its caller is the next.
    warn(py, "DetectorWarning", text, 2).inspect_err(|raised| {
        raised.set_cause(py, cause.map(|cause| cause.clone_ref(py)));
    })
}

/// An object with `joints`, `lengths` and `detect(image)`.
#[derive(Clone, Debug)]
struct PythonDetector {
    object: Arc<Py<PyAny>>,
    joints: Vec<String>,
    lengths: Vec<String>,
}

impl PythonDetector {
    fn new(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let names = |attribute: &str| -> PyResult<Vec<String>> {
            let Some(found) = object.getattr_opt(attribute)? else { return Ok(Vec::new()) };
            let name = format!("detector.{attribute}");
            found.extract().map_err(|_| ConfigError::new_err(wrong(&name, "a sequence of names", &found)))
        };
        Ok(Self { joints: names("joints")?, lengths: names("lengths")?, object: Arc::new(object.clone().unbind()) })
    }

    /// Converts an object with the attributes of `voodoo.detectors.DetectedPerson`.
    fn detection(&self, person: &Bound<'_, PyAny>, image: &DepthImage) -> PyResult<Detection> {
        if person.getattr("joints")?.is_none() {
            return Err(wrong_argument("joints", "a mapping from names", &person.getattr("joints")?));
        }
        let positions: HashMap<String, Bound<'_, PyAny>> = mapping(person, "joints")?;
        if let Some(name) = positions.keys().find(|name| !self.joints.contains(name)) {
            let text = format!("joints: expected some of {}, found {name:?}", self.joints.join(", "));
            return Err(MeasurementError::new_err(text));
        }
        let (sigma, visible) = (of_each(person, "joint_sigma", SIGMA)?, of_each(person, "visible", 1.0)?);
        let joint = |name: &String| {
            let Some(position) = positions.get(name) else { return Ok(None) };
            let position = vector(&format!("joints[{name}]"), position)?;
            Ok(Some(DetectedJoint { position, sigma: sigma(name), visible: visible(name) }))
        };
        let joints = self.joints.iter().map(joint).collect::<PyResult<Vec<_>>>()?;
        let confidence = log_odds(person, "confidence")?;
        Ok(Detection {
            lengths: self.lengths_of(person)?,
            facing: log_odds(person, "facing")?,
            floor: floor(person)?,
            pixels: pixels(person, image)?,
            ..Detection::new(joints, confidence.unwrap_or(0.0))
        })
    }

    /// All lengths that the detector names, or `None`.
    fn lengths_of(&self, person: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 2]>> {
        let lengths: HashMap<String, f64> = mapping(person, "lengths")?;
        if lengths.is_empty() {
            return Ok(Vec::new());
        }
        let sigmas: HashMap<String, f64> = mapping(person, "length_sigma")?;
        let length = |name: &String| {
            let (found, all) = (lengths.get(name).zip(sigmas.get(name)), self.lengths.join(", "));
            let missing = || format!("lengths and length_sigma: expected all of {all}, found none of {name}");
            let (length, sigma) = found.ok_or_else(|| MeasurementError::new_err(missing()))?;
            Ok([*length, sigma / length])
        };
        self.lengths.iter().map(length).collect()
    }
}

impl Detect for PythonDetector {
    fn joints(&self) -> Vec<String> {
        self.joints.clone()
    }

    fn lengths(&self) -> Vec<String> {
        self.lengths.clone()
    }

    fn fresh(&self) -> Box<dyn Detect> {
        Box::new(self.clone())
    }

    fn detect(
        &mut self,
        image: &DepthImage,
        around: &Surroundings,
        query: DetectionQuery,
    ) -> Result<Vec<Detection>, DetectError> {
        // A step has released the GIL.
        let found = Python::attach(|py| {
            let found = self.object.bind(py).call_method1("detect", (input(py, image, around, query)?,))?;
            found.try_iter()?.map(|person| self.detection(&person?, image)).collect::<PyResult<Vec<Detection>>>()
        });
        let mut persons = found?;
        persons.sort_by(|a, b| b.person.total_cmp(&a.person));
        Ok(persons)
    }
}

/// A `voodoo.detectors.DetectorImage`.
fn input<'py>(
    py: Python<'py>,
    image: &DepthImage,
    around: &Surroundings,
    query: DetectionQuery,
) -> PyResult<Bound<'py, PyAny>> {
    let [width, height] = [image.camera.width(), image.camera.height()];
    let ([fx, fy], [cx, cy], lens) = (image.camera.focal(), image.camera.center(), image.camera.lens());
    let distortion = PyTuple::new(py, lens.coefficients())?;
    let camera = py.import("voodoo.model.camera")?.getattr("Camera")?;
    let camera = camera.call1((width, height, fx, fy, cx, cy, distortion, lens.model()))?;
    let mut depth = Vec::new();
    around.open_depth(image, &mut depth);
    let depth = PyArray1::from_vec(py, depth).reshape([height, width])?;
    let pose = PyArray1::from_slice(py, matrix(&image.world_from_sensor).as_flattened()).reshape([4, 4])?;
    let floor = around.ground.map(|Ground { normal, offset }| (normal.to_array(), offset));
    let (query, near) = match query {
        DetectionQuery::All => ("all", None),
        DetectionQuery::Any => ("any", None),
        DetectionQuery::New => ("new", None),
        DetectionQuery::Near(place) => ("near", Some(Row(place))),
    };
    py.import("voodoo.detectors")?.getattr("DetectorImage")?.call1((depth, camera, pose, floor, query, near))
}

/// An attribute that is a mapping by names; empty where it is missing or None.
fn mapping<'py, T>(person: &Bound<'py, PyAny>, attribute: &str) -> PyResult<HashMap<String, T>>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    let Some(found) = given(person, attribute)? else { return Ok(HashMap::new()) };
    let pairs = found.py().get_type::<PyDict>().call1((&found,));
    pairs.and_then(|pairs| pairs.extract()).map_err(|_| wrong_argument(attribute, "a mapping from names", &found))
}

/// An attribute; none where it is missing or None.
fn given<'py>(person: &Bound<'py, PyAny>, attribute: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    Ok(person.getattr_opt(attribute)?.filter(|found| !found.is_none()))
}

/// An attribute that is one number, or a mapping with one for every joint.
fn of_each(person: &Bound<'_, PyAny>, attribute: &str, default: f64) -> PyResult<impl Fn(&str) -> f64> {
    let found = given(person, attribute)?;
    let one = found.as_ref().map_or(Some(default), |found| found.extract::<f64>().ok());
    let each: HashMap<String, f64> = if one.is_some() { HashMap::new() } else { mapping(person, attribute)? };
    Ok(move |name: &str| one.or_else(|| each.get(name).copied()).unwrap_or(default))
}

/// Log odds of an attribute that is a probability, or None.
fn log_odds(person: &Bound<'_, PyAny>, attribute: &str) -> PyResult<Option<f64>> {
    let Some(found) = given(person, attribute)? else { return Ok(None) };
    let wrong = || wrong_argument(attribute, "a probability, from 0 to 1", &found);
    let probability = found.extract::<f64>().ok().filter(|value| (0.0..=1.0).contains(value));
    let probability = probability.ok_or_else(wrong)?.clamp(LEAST, 1.0 - LEAST);
    Ok(Some((probability / (1.0 - probability)).ln()))
}

/// The attribute `floor`: normal and offset, or None.
fn floor(person: &Bound<'_, PyAny>) -> PyResult<Option<Ground>> {
    let Some(found) = given(person, "floor")? else { return Ok(None) };
    let wrong = |_| wrong_argument("floor", "a unit normal and an offset in meters", &found);
    let (normal, offset): (Bound<'_, PyAny>, f64) = found.extract().map_err(wrong)?;
    let normal: Vec3 = vector("floor[0]", &normal)?;
    unless(normal.is_normalized(), "floor[0]", "a unit normal", normal)?;
    Ok(Some(Ground { normal, offset }))
}

/// The attribute `mask` (height, width) bool, as indices; none where it is missing or None.
fn pixels(person: &Bound<'_, PyAny>, image: &DepthImage) -> PyResult<Vec<usize>> {
    let Some(found) = given(person, "mask")? else { return Ok(Vec::new()) };
    let array = contiguous(&found).ok().and_then(|array| array.cast_into::<PyArray2<bool>>().ok());
    let [height, width] = [image.camera.height(), image.camera.width()];
    let array = array.filter(|array| array.shape() == [height, width]).ok_or_else(|| {
        let expected = format!("an array of shape ({height}, {width}) and dtype bool");
        wrong_argument("mask", &expected, &found)
    })?;
    let view = array.readonly();
    Ok(view.as_slice()?.iter().enumerate().filter(|(_, visible)| **visible).map(|(index, _)| index).collect())
}
