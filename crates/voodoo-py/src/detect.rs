//! Detection of people in depth images.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::HumanModel;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Frame};
use voodoo_core::{DepthImage, DepthPixels, Ground};
use voodoo_core::{Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Surroundings};
use voodoo_detect::crop::SIZE;
use voodoo_detect::segmentation::Segmentation;
use voodoo_detect::{Detector, JOINTS, LENGTHS};

use crate::arrays::{contiguous, vector};
use crate::borrowed::depth_images;
use crate::camera::camera_of;
use crate::errors::{IntoPy, exception, wrong_argument};
use crate::frame::PyFrame;

#[doc = stub!("Detector")]
#[pyclass(name = "Detector", module = "voodoo")]
pub struct PyDetector(pub Detector);

#[pymethods]
impl PyDetector {
    #[new]
    #[pyo3(signature = (*, weights=None))]
    fn new(py: Python<'_>, weights: Option<PathBuf>) -> PyResult<Self> {
        let refused = |message: String| exception(py, "MeasurementError", message);
        let detector = match weights {
            None => Ok(Detector::new()),
            Some(path) => std::fs::read(&path)
                .map_err(|error| format!("{}: expected a readable file, found {error}", path.display()))
                .and_then(|bytes| {
                    Detector::with_weights(&bytes).map_err(|error| format!("{}: {error}", path.display()))
                }),
        };
        detector.map(Self).map_err(refused)
    }

    #[doc = stub!("Detector.detect")]
    #[pyo3(signature = (frame, *, up=None))]
    fn detect(&mut self, py: Python<'_>, frame: &PyFrame, up: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<PyDetection>> {
        let any = Body::human(1.75, HumanModel::Full).map_err(|error| error.into_py(py))?;
        let views = frame.depth_views(py);
        let images = depth_images(&views)?;
        let input =
            Frame::empty(frame.stamp).with_images(&images).with_ground(frame.ground).with_excluded(&frame.excluded);
        input.check(&any, None).map_err(|error| error.into_py(py))?;
        let up = match up {
            Some(up) => Some(
                vector("up", up)?
                    .try_normalize()
                    .ok_or_else(|| wrong_argument(py, "up", "a vector that is not zero", up))?,
            ),
            None => None,
        };
        let detector = &mut self.0;
        let found = py.detach(|| {
            let mut found: Vec<PyDetection> = Vec::new();
            for image in &images {
                let around =
                    Surroundings { ground: input.ground, up, excluded: input.excluded, ..Surroundings::default() };
                for detection in detector.detect(image, &around, DetectionQuery::All)? {
                    let source = frame.sources.get(usize::from(image.source)).cloned().unwrap_or_default();
                    found.push(PyDetection { detection, size: [image.camera.height(), image.camera.width()], source });
                }
            }
            Ok::<_, DetectError>(found)
        });
        let mut found = found.map_err(|error| exception(py, "MeasurementError", error.to_string()))?;
        found.sort_by(|a, b| b.detection.person.total_cmp(&a.detection.person));
        Ok(found)
    }

    fn __repr__(&self) -> String {
        format!("Detector(joints={})", JOINTS.len())
    }
}

#[doc = stub!("Detection")]
#[pyclass(name = "Detection", module = "voodoo", frozen)]
pub struct PyDetection {
    detection: Detection,
    size: [usize; 2],
    source: String,
}

/// Converts log odds to a probability.
fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

impl PyDetection {
    fn of_joints<'py, T: IntoPyObject<'py>>(
        &self,
        py: Python<'py>,
        value: impl Fn(&DetectedJoint) -> T,
    ) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, joint) in JOINTS.iter().zip(self.detection.joints.iter().flatten()) {
            dict.set_item(name, value(joint))?;
        }
        Ok(dict)
    }

    fn of_lengths<'py>(&self, py: Python<'py>, value: impl Fn([f64; 2]) -> f64) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, length) in LENGTHS.iter().zip(&self.detection.lengths) {
            dict.set_item(name, value(*length))?;
        }
        Ok(dict)
    }
}

#[pymethods]
impl PyDetection {
    #[doc = stub!("Detection.joints")]
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_joints(py, |joint| PyArray1::from_slice(py, &joint.position.to_array()))
    }

    #[doc = stub!("Detection.joint_sigma")]
    #[getter]
    fn joint_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_joints(py, |joint| joint.sigma)
    }

    #[doc = stub!("Detection.visible")]
    #[getter]
    fn visible<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_joints(py, |joint| joint.visible)
    }

    #[doc = stub!("Detection.lengths")]
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_lengths(py, |[length, _]| length)
    }

    #[doc = stub!("Detection.length_sigma")]
    #[getter]
    fn length_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_lengths(py, |[length, relative]| length * relative)
    }

    #[doc = stub!("Detection.stature")]
    #[getter]
    fn stature(&self) -> f64 {
        self.detection.lengths.last().map_or(f64::NAN, |length| length[0])
    }

    #[doc = stub!("Detection.facing")]
    #[getter]
    fn facing(&self) -> f64 {
        probability(self.detection.facing.unwrap_or(0.0))
    }

    #[doc = stub!("Detection.confidence")]
    #[getter]
    fn confidence(&self) -> f64 {
        probability(self.detection.person)
    }

    #[doc = stub!("Detection.source")]
    #[getter]
    fn source(&self) -> &str {
        &self.source
    }

    #[doc = stub!("Detection.mask")]
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let mut mask = vec![false; self.size[0] * self.size[1]];
        self.detection.pixels.iter().for_each(|pixel| mask[*pixel] = true);
        PyArray1::from_vec(py, mask).reshape(self.size)
    }

    #[doc = stub!("Detection.floor")]
    #[getter]
    fn floor(&self) -> Option<([f64; 3], f64)> {
        self.detection.floor.map(|floor| (floor.normal.to_array(), floor.offset))
    }

    fn __repr__(&self) -> String {
        let Detection { joints, .. } = &self.detection;
        let at = joints.get(2).copied().flatten().map_or([f64::NAN; 3], |root| root.position.to_array());
        format!(
            "Detection(source={:?}, confidence={:.2}, facing={:.2}, stature={:.2}, humanoid_root=({:.2}, {:.2}, {:.2}))",
            self.source,
            self.confidence(),
            self.facing(),
            self.stature(),
            at[0],
            at[1],
            at[2],
        )
    }
}

#[doc = stub!("PersonCandidate")]
#[pyclass(name = "PersonCandidate", module = "voodoo._core", frozen)]
pub(crate) struct PyCandidate {
    #[doc = stub!("PersonCandidate.crop")]
    #[pyo3(get)]
    crop: Py<PyArray3<f32>>,
    #[doc = stub!("PersonCandidate.mask")]
    #[pyo3(get)]
    mask: Py<PyArray2<bool>>,
    #[doc = stub!("PersonCandidate.middle")]
    #[pyo3(get)]
    middle: [f64; 3],
    #[doc = stub!("PersonCandidate.roll")]
    #[pyo3(get)]
    roll: f64,
    #[doc = stub!("PersonCandidate.area")]
    #[pyo3(get)]
    area: f64,
    #[doc = stub!("PersonCandidate.floor")]
    #[pyo3(get)]
    floor: Option<([f64; 3], f64)>,
}

#[doc = stub!("person_candidates")]
#[pyfunction]
#[pyo3(signature = (depth, *, camera, up=None, floor=None, most=8))]
pub(crate) fn person_candidates<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    camera: &Bound<'py, PyAny>,
    up: Option<[f64; 3]>,
    floor: Option<([f64; 3], f64)>,
    most: usize,
) -> PyResult<Vec<PyCandidate>> {
    let wrong = || wrong_argument(py, "depth", "an array of shape (height, width) and dtype float32", depth);
    let array = contiguous(depth).map_err(|_| wrong())?.cast_into::<PyArray2<f32>>().map_err(|_| wrong())?;
    let view = array.readonly();
    let camera = camera_of(camera)?;
    let [height, width] = [camera.height(), camera.width()];
    if view.as_array().dim() != (height, width) {
        return Err(wrong_argument(py, "depth", &format!("shape ({height}, {width}), as its camera has"), depth));
    }
    let image = DepthImage {
        pixels: DepthPixels::F32(view.as_slice()?),
        camera: &camera,
        meters_per_unit: 1.0,
        world_from_sensor: Pose::IDENTITY,
        weight: 1.0,
        source: 0,
    };
    let around = Surroundings {
        ground: floor.map(|(normal, offset)| Ground { normal: Vec3::from_array(normal), offset }),
        up: up.map(Vec3::from_array),
        ..Surroundings::default()
    };
    let mut segmentation = Segmentation::default();
    segmentation.find(&image, &around);
    let (mut found, mut pixels) = (Vec::new(), Vec::new());
    for candidate in segmentation.candidates().iter().take(most) {
        let Some(crop) = segmentation.crop(candidate) else { continue };
        let mut mask = vec![false; width * height];
        segmentation.mask(candidate, &mut pixels);
        pixels.iter().for_each(|pixel| mask[*pixel] = true);
        let channels: Vec<f32> = (0..2).flat_map(|c| crop.pixels.iter().map(move |pixel| pixel[c])).collect();
        found.push(PyCandidate {
            crop: PyArray1::from_vec(py, channels).reshape([2, SIZE, SIZE])?.unbind(),
            mask: PyArray1::from_vec(py, mask).reshape([height, width])?.unbind(),
            middle: crop.middle,
            roll: crop.roll,
            area: candidate.area,
            floor: segmentation.floor().map(|floor| (floor.normal.to_array(), floor.offset)),
        });
    }
    Ok(found)
}
