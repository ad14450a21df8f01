//! Detection of people in depth images.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;
use voodoo_core::math::{Pose, Vec3, probability};
use voodoo_core::{
    Body, Camera, DepthImage, DepthPixels, Detect, DetectError, Detection, DetectionQuery, Frame, Ground, HumanModel,
    Surroundings,
};
use voodoo_detect::crop::SIZE;
use voodoo_detect::segmentation::Segmentation;
use voodoo_detect::{Detector, JOINTS, LENGTHS};

use crate::arrays::{Row, contiguous, vector};
use crate::borrowed::depth_images;
use crate::camera::camera_of;
use crate::errors::{ConfigError, MeasurementError, raise, unless, wrong_argument};
use crate::frame::PyFrame;

#[doc = stub!("Detector")]
#[pyclass(name = "Detector", module = "voodoo")]
pub struct PyDetector(pub Detector);

#[pymethods]
impl PyDetector {
    #[new]
    #[pyo3(signature = (*, weights=None, stature=None, stature_sigma=0.02))]
    fn new(weights: Option<PathBuf>, stature: Option<f64>, stature_sigma: f64) -> PyResult<Self> {
        let detector = weights.map_or_else(|| Ok(Detector::new()), with_weights)?;
        let Some(stature) = stature else { return Ok(Self(detector)) };
        if !((0.3..=3.0).contains(&stature) && stature_sigma > 0.0 && stature_sigma.is_finite()) {
            let expected = "meters from 0.3 to 3.0, and a relative standard deviation above 0";
            let text = format!("stature: expected {expected}, found {stature} and {stature_sigma}");
            return Err(ConfigError::new_err(text));
        }
        Ok(Self(detector.with_stature(stature, stature_sigma)))
    }

    #[doc = stub!("Detector.detect")]
    #[pyo3(signature = (frame, *, up=None))]
    fn detect<'py>(
        &mut self,
        py: Python<'py>,
        frame: &PyFrame,
        up: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let any = Body::human(1.75, HumanModel::Full).map_err(raise)?;
        let views = frame.depth_views(py)?;
        let images = depth_images(&views)?;
        let input =
            Frame { images: &images, ground: frame.ground, excluded: &frame.excluded, ..Frame::empty(frame.stamp) };
        input.check(&any, None).map_err(raise)?;
        let direction = |up: &Bound<'_, PyAny>| {
            let wrong = || wrong_argument("up", "a vector that is not zero", up);
            vector("up", up)?.try_normalize().ok_or_else(wrong)
        };
        let up = up.map(direction).transpose()?;
        let detector = &mut self.0;
        let found = py.detach(|| {
            let mut found: Vec<(Detection, &DepthImage)> = Vec::new();
            for image in &images {
                let around =
                    Surroundings { ground: input.ground, up, excluded: input.excluded, ..Surroundings::default() };
                let persons = detector.detect(image, &around, DetectionQuery::All)?;
                found.extend(persons.into_iter().map(|detection| (detection, image)));
            }
            Ok::<_, DetectError>(found)
        });
        let mut found = found.map_err(|error| MeasurementError::new_err(error.to_string()))?;
        found.sort_by(|(a, _), (b, _)| b.person.total_cmp(&a.person));
        let source = |image: &DepthImage| frame.sources.get(usize::from(image.source)).cloned().unwrap_or_default();
        found.iter().map(|(detection, image)| self::detection(py, detection, image, source(image))).collect()
    }

    fn __repr__(&self) -> String {
        format!("Detector(joints={})", JOINTS.len())
    }
}

/// A detector with the network of a file.
fn with_weights(path: PathBuf) -> PyResult<Detector> {
    let refused = |found: String| MeasurementError::new_err(format!("{}: {found}", path.display()));
    let bytes = std::fs::read(&path).map_err(|error| refused(format!("expected a readable file, found {error}")))?;
    Detector::with_weights(&bytes).map_err(|error| refused(error.to_string()))
}

/// An image of the pixels with these indices, as a mask.
fn mask<'py>(py: Python<'py>, camera: &Camera, pixels: &[usize]) -> PyResult<Bound<'py, PyArray2<bool>>> {
    let mut mask = vec![false; camera.pixels()];
    pixels.iter().for_each(|pixel| mask[*pixel] = true);
    PyArray1::from_vec(py, mask).reshape([camera.height(), camera.width()])
}

/// A `voodoo.Detection`.
fn detection<'py>(
    py: Python<'py>,
    found: &Detection,
    image: &DepthImage,
    source: String,
) -> PyResult<Bound<'py, PyAny>> {
    let joints = || JOINTS.iter().zip(found.joints.iter().flatten());
    let lengths = || LENGTHS.iter().zip(&found.lengths);
    let fields = (
        joints().map(|(name, joint)| (name, Row(joint.position))).into_py_dict(py)?,
        joints().map(|(name, joint)| (name, joint.sigma)).into_py_dict(py)?,
        joints().map(|(name, joint)| (name, joint.visible)).into_py_dict(py)?,
        lengths().map(|(name, [length, _])| (name, *length)).into_py_dict(py)?,
        lengths().map(|(name, [length, part])| (name, length * part)).into_py_dict(py)?,
        found.lengths.last().map_or(f64::NAN, |length| length[0]),
        probability(found.facing.unwrap_or(0.0)),
        probability(found.person),
        source,
        mask(py, image.camera, &found.pixels)?,
        found.floor.map(|floor| (floor.normal.to_array(), floor.offset)),
    );
    py.import("voodoo.detectors.base")?.getattr("Detection")?.call1(fields)
}

#[doc = stub!("person_candidates")]
#[pyfunction]
#[pyo3(signature = (depth, *, camera, up=None, floor=None, most=8, enlarged=1.0))]
pub(crate) fn person_candidates<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
    up: Option<[f64; 3]>,
    floor: Option<([f64; 3], f64)>,
    most: usize,
    enlarged: f64,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let wrong = || wrong_argument("depth", "an array of shape (height, width) and dtype float32", depth);
    let array = contiguous(depth).map_err(|_| wrong())?.cast_into::<PyArray2<f32>>().map_err(|_| wrong())?;
    let view = array.readonly();
    let [height, width] = [camera.height(), camera.width()];
    if view.as_array().dim() != (height, width) {
        return Err(wrong_argument("depth", &format!("shape ({height}, {width}), as its camera has"), depth));
    }
    unless(enlarged > 0.0 && enlarged.is_finite(), "enlarged", "a finite factor above 0", enlarged)?;
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
    let class = py.import("voodoo.detectors.base")?.getattr("PersonCandidate")?;
    let mut found = Vec::new();
    for candidate in segmentation.candidates.iter().take(most) {
        let Some(crop) = segmentation.crop(candidate, enlarged) else { continue };
        let channels: Vec<f32> = (0..2).flat_map(|c| crop.pixels.iter().map(move |pixel| pixel[c])).collect();
        let picture = PyArray1::from_vec(py, channels).reshape([2, SIZE, SIZE])?;
        let floor = segmentation.floor.map(|floor| (floor.normal.to_array(), floor.offset));
        let pixels = mask(py, &camera, &segmentation.mask(candidate))?;
        found.push(class.call1((picture, pixels, crop.middle, crop.roll, floor))?);
    }
    Ok(found)
}
