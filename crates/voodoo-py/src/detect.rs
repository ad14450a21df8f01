//! Finding people in depth images.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use voodoo_core::detect::Surroundings;
use voodoo_core::detect::crop::SIZE;
use voodoo_core::detect::segmentation::Segmentation;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::observation::frame::{DepthImage, DepthPixels, Ground};

use crate::arrays::contiguous;
use crate::errors::wrong_argument;

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
    let mut found = Vec::new();
    for candidate in segmentation.candidates().iter().take(most) {
        let Some(crop) = segmentation.crop(candidate) else { continue };
        let mut mask = vec![false; width * height];
        segmentation.pixels(candidate).for_each(|(index, _)| mask[index] = true);
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
