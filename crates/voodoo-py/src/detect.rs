//! Finding people in depth images.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::body::HumanModel;
use voodoo_core::detect::crop::SIZE;
use voodoo_core::detect::segmentation::Segmentation;
use voodoo_core::detect::{Detection, Detector, JOINTS, LENGTHS, Surroundings, Wanted};
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::observation::frame::{DepthImage, DepthPixels, Ground};
use voodoo_core::{Body, Frame};

use crate::arrays::{contiguous, vector};
use crate::errors::{IntoPy, exception, wrong_argument};
use crate::frame::PyFrame;

/// Finds people in depth images, with a small network that comes with the library.
///
/// Args:
///     weights: path of another network's weights, as training/ exports them; None means those that come with the library.
///
/// Raises:
///     MeasurementError: a file that holds no such weights.
#[pyclass(name = "Detector", module = "voodoo")]
pub struct PyDetector(Detector);

#[pymethods]
impl PyDetector {
    #[new]
    #[pyo3(signature = (*, weights=None))]
    fn new(py: Python<'_>, weights: Option<PathBuf>) -> PyResult<Self> {
        let refused = |message: String| exception(py, "MeasurementError", message);
        let detector = match weights {
            None => Detector::new().map_err(|error| error.to_string()),
            Some(path) => std::fs::read(&path)
                .map_err(|error| format!("{}: expected a readable file, found {error}", path.display()))
                .and_then(|bytes| {
                    Detector::with_weights(&bytes).map_err(|error| format!("{}: {error}", path.display()))
                }),
        };
        detector.map(Self).map_err(refused)
    }

    /// The people in the depth images of a frame, the surest first.
    ///
    /// Floor and boxes to leave out are those of the frame; what else it holds is not looked at. Releases the GIL.
    ///
    /// Args:
    ///     frame: with at least one depth image.
    ///     up: (3,) unit vector upwards in the world, where the frame tells no floor; None means upwards in the image.
    ///
    /// Raises:
    ///     MeasurementError: a measurement that cannot be used.
    #[pyo3(signature = (frame, *, up=None))]
    fn detect(&mut self, py: Python<'_>, frame: &PyFrame, up: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<PyDetection>> {
        let any = Body::human(1.75, HumanModel::Full).map_err(|error| error.into_py(py))?;
        let borrowed = frame.borrow_images(py, &any)?;
        let images = borrowed.images()?;
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
        let mut found = py.detach(|| {
            let mut found = Vec::new();
            for image in &images {
                let around =
                    Surroundings { ground: input.ground, up, excluded: input.excluded, ..Surroundings::default() };
                for detection in detector.detect(image, &around, Wanted::All).to_vec() {
                    let mut pixels = Vec::new();
                    detector.mask(&detection, &mut pixels);
                    let source = frame.sources.get(usize::from(image.source)).cloned().unwrap_or_default();
                    found.push(PyDetection { detection, pixels, size: [image.height, image.width], source });
                }
            }
            found
        });
        found.sort_by(|a, b| b.detection.person.total_cmp(&a.detection.person));
        Ok(found)
    }

    fn __repr__(&self) -> String {
        format!("Detector(joints={})", JOINTS.len())
    }
}

/// A person in a depth image. World frame, metres.
#[pyclass(name = "Detection", module = "voodoo", frozen)]
pub struct PyDetection {
    detection: Detection,
    pixels: Vec<usize>,
    size: [usize; 2],
    source: String,
}

/// Probability of log odds.
fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

impl PyDetection {
    fn of_joints<'py, T: IntoPyObject<'py>>(
        &self,
        py: Python<'py>,
        value: impl Fn(&voodoo_core::detect::DetectedJoint) -> T,
    ) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, joint) in JOINTS.iter().zip(&self.detection.joints) {
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
    /// Joint name -> position (3,) [m]; `l_` and `r_` are the person's own.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_joints(py, |joint| PyArray1::from_slice(py, &joint.position.to_array()))
    }

    /// Joint name -> standard deviation along each axis [m].
    #[getter]
    fn joint_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_joints(py, |joint| joint.sigma)
    }

    /// Joint name -> probability that it is in the image and not hidden.
    #[getter]
    fn visible<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_joints(py, |joint| joint.visible)
    }

    /// Upper arm, forearm, thigh, shank, shoulder and hip width, trunk, neck and stature [m].
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_lengths(py, |[length, _]| length)
    }

    /// The same names -> standard deviation [m].
    #[getter]
    fn length_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.of_lengths(py, |[length, relative]| length * relative)
    }

    /// Height of the person when standing upright [m].
    #[getter]
    fn stature(&self) -> f64 {
        self.detection.lengths.last().map_or(f64::NAN, |length| length[0])
    }

    /// Probability that the front of the trunk shows.
    #[getter]
    fn facing(&self) -> f64 {
        probability(self.detection.facing)
    }

    /// Probability that it is a person.
    #[getter]
    fn confidence(&self) -> f64 {
        probability(self.detection.person)
    }

    /// The depth image it was found in.
    #[getter]
    fn source(&self) -> &str {
        &self.source
    }

    /// The pixels (H, W) of that image that show it.
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let mut mask = vec![false; self.size[0] * self.size[1]];
        self.pixels.iter().for_each(|pixel| mask[*pixel] = true);
        PyArray1::from_vec(py, mask).reshape(self.size)
    }

    fn __repr__(&self) -> String {
        let Detection { joints, .. } = &self.detection;
        let at = joints.get(2).map_or([f64::NAN; 3], |root| root.position.to_array());
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

/// What may be a person in a depth image, with the network's picture of it.
#[pyclass(name = "PersonCandidate", module = "voodoo._core", frozen)]
pub struct PyCandidate {
    crop: Py<PyArray3<f32>>,
    mask: Py<PyArray2<bool>>,
    #[pyo3(get)]
    middle: [f64; 3],
    #[pyo3(get)]
    roll: f64,
    #[pyo3(get)]
    area: f64,
    #[pyo3(get)]
    floor: Option<([f64; 3], f64)>,
}

#[pymethods]
impl PyCandidate {
    #[getter]
    fn crop(&self, py: Python<'_>) -> Py<PyArray3<f32>> {
        self.crop.clone_ref(py)
    }

    #[getter]
    fn mask(&self, py: Python<'_>) -> Py<PyArray2<bool>> {
        self.mask.clone_ref(py)
    }
}

/// Candidates in a depth image `(H, W)` float32, metres; `up` and `floor` (normal, offset) in the camera's optical frame.
#[pyfunction]
#[pyo3(signature = (depth, *, intrinsics, up=None, floor=None, most=8))]
pub fn person_candidates<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    intrinsics: [f64; 4],
    up: Option<[f64; 3]>,
    floor: Option<([f64; 3], f64)>,
    most: usize,
) -> PyResult<Vec<PyCandidate>> {
    let wrong = || wrong_argument(py, "depth", "an array of shape (height, width) and dtype float32", depth);
    let array = contiguous(depth).map_err(|_| wrong())?.cast_into::<PyArray2<f32>>().map_err(|_| wrong())?;
    let view = array.readonly();
    let [height, width] = [view.as_array().nrows(), view.as_array().ncols()];
    let image = DepthImage {
        pixels: DepthPixels::F32(view.as_slice()?),
        width,
        height,
        metres_per_unit: 1.0,
        intrinsics,
        rays: None,
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
