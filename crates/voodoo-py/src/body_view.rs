//! Registers the depth measurements near the body to the image of a color camera.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use voodoo_core::DepthPixels;
use voodoo_sensors::body_view::{BodyView, DepthBesideColor, Matrix, StillDepth};

use crate::arrays::contiguous;
use crate::camera::camera_of;
use crate::errors::{IntoPy, exception, wrong_argument};

type Marks<'py> = Bound<'py, PyArray2<bool>>;

/// The rows of a 4x4 array.
pub(crate) fn rows_of(name: &str, value: &PyReadonlyArray2<'_, f64>) -> PyResult<Matrix> {
    let entries: Option<[f64; 16]> = (value.dims() == numpy::Ix2(4, 4)).then(|| {
        let mut entries = value.as_array().iter().copied().collect::<Vec<_>>();
        entries.resize(16, 0.0);
        <[f64; 16]>::try_from(entries).unwrap_or_default()
    });
    match entries {
        Some(entries) => Ok([0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| entries[4 * row + column]))),
        None => Err(wrong_argument(value.py(), name, "an array of shape (4, 4)", value.as_any())),
    }
}

#[doc = stub!("BodyView")]
#[pyclass(name = "BodyView", module = "voodoo._core", frozen)]
pub struct PyBodyView(pub Arc<BodyView>);

#[pymethods]
impl PyBodyView {
    #[new]
    #[pyo3(signature = (mask, pixels, depths, still=None, before=None))]
    fn new(
        mask: PyReadonlyArray2<'_, bool>,
        pixels: PyReadonlyArray2<'_, f64>,
        depths: PyReadonlyArray1<'_, f64>,
        still: Option<PyReadonlyArray1<'_, bool>>,
        before: Option<PyReadonlyArray2<'_, bool>>,
    ) -> PyResult<Self> {
        let (size, shape) = ([mask.dims()[0], mask.dims()[1]], pixels.dims());
        if shape[1] != 2 || shape[0] != depths.len() || before.as_ref().is_some_and(|other| other.dims() != mask.dims())
        {
            let text = format!("pixels: expected shape (N, 2), and a depth each, found {:?}", pixels.shape());
            return Err(exception(mask.py(), "MeasurementError", text));
        }
        Ok(Self(Arc::new(BodyView {
            size,
            mask: mask.as_array().iter().copied().collect(),
            pixels: pixels.as_array().rows().into_iter().map(|row| [row[0], row[1]]).collect(),
            depths: depths.as_array().to_vec(),
            still: still.map(|marks| marks.as_array().to_vec()),
            before: before.map(|marks| marks.as_array().iter().copied().collect()),
        })))
    }

    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Marks<'py>> {
        PyArray1::from_slice(py, &self.0.mask).reshape(self.0.size)
    }

    #[getter]
    fn pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        PyArray1::from_slice(py, self.0.pixels.as_flattened()).reshape([self.0.pixels.len(), 2])
    }

    #[getter]
    fn depths<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.depths)
    }

    #[getter]
    fn still<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<bool>>> {
        self.0.still.as_ref().map(|marks| PyArray1::from_slice(py, marks))
    }

    #[getter]
    fn before<'py>(&self, py: Python<'py>) -> PyResult<Option<Marks<'py>>> {
        let before = self.0.before.as_ref();
        before.map(|marks| PyArray1::from_slice(py, marks).reshape(self.0.size)).transpose()
    }
}

#[doc = stub!("StillDepth")]
#[pyclass(name = "StillDepth", module = "voodoo._core")]
#[derive(Default)]
pub struct PyStillDepth(StillDepth);

#[pymethods]
impl PyStillDepth {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    fn __copy__(&self) -> Self {
        Self(self.0.twin())
    }
}

#[doc = stub!("body_view")]
#[pyfunction]
#[pyo3(signature = (depth, camera, joints, *, meters_per_unit, world_from_depth, color_from_depth, color_camera, beyond, reach, step, margin, scene))]
#[allow(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn body_view<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    camera: &Bound<'py, PyAny>,
    joints: PyReadonlyArray2<'py, f64>,
    meters_per_unit: f64,
    world_from_depth: PyReadonlyArray2<'py, f64>,
    color_from_depth: PyReadonlyArray2<'py, f64>,
    color_camera: &Bound<'py, PyAny>,
    beyond: &Bound<'py, PyAny>,
    reach: usize,
    step: usize,
    margin: f64,
    mut scene: Option<PyRefMut<'py, PyStillDepth>>,
) -> PyResult<PyBodyView> {
    let wrong = || wrong_argument(py, "depth", "an array of shape (height, width) and dtype uint16 or float32", depth);
    let array = contiguous(depth).map_err(|_| wrong())?;
    let (units, meters) = (array.cast::<PyArray2<u16>>(), array.cast::<PyArray2<f32>>());
    let (units, meters) = (units.ok().map(|array| array.readonly()), meters.ok().map(|array| array.readonly()));
    let image = match (&units, &meters) {
        (Some(units), _) => DepthPixels::U16(units.as_slice()?),
        (_, Some(meters)) => DepthPixels::F32(meters.as_slice()?),
        _ => return Err(wrong()),
    };
    columns(py, "joints", &joints, 3)?;
    let (camera, color_camera) = (camera_of(camera)?, camera_of(color_camera)?);
    let beside = DepthBesideColor {
        image,
        meters_per_unit,
        camera: &camera,
        world_from_depth: rows_of("world_from_depth", &world_from_depth)?,
        color_from_depth: rows_of("color_from_depth", &color_from_depth)?,
        step,
        margin,
        joints: joints.as_slice()?.as_chunks().0,
    };
    let scene = scene.as_mut().map(|scene| &mut scene.0);
    let found = py.detach(|| beside.points_near_body(scene));
    let nearby = found.map_err(|error| error.into_py(py))?;
    let pixels = nearby.projected(&color_camera);
    let beyond: PyReadonlyArray2<'py, bool> = beyond.call1((beside.body_depth(),))?.extract()?;
    let (size, mask) = ([beyond.dims()[0], beyond.dims()[1]], beyond.as_slice()?);
    let view = py.detach(|| nearby.view(pixels, mask, reach, size)).map_err(|error| error.into_py(py))?;
    Ok(PyBodyView(Arc::new(view)))
}

fn columns(py: Python<'_>, name: &str, array: &PyReadonlyArray2<'_, f64>, count: usize) -> PyResult<()> {
    let shape = array.dims();
    if shape[1] == count {
        return Ok(());
    }
    let text = format!("{name}: expected shape (N, {count}), found ({}, {})", shape[0], shape[1]);
    Err(exception(py, "MeasurementError", text))
}
