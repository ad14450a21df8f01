//! The core's camera: what `voodoo.Camera` asks, what every function that takes one is given, and what it sees of a body.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use voodoo_core::math::{Affine3, Vec3};
use voodoo_core::{Camera, Lens, Rendering, Unexpected, Viewpoint};

use crate::arrays::{Array, array, limb_poses, pose, rows};
use crate::body::PyBody;
use crate::errors::{CameraError, raise, wrong_argument};

#[doc = stub!("Camera")]
#[pyclass(name = "Camera", module = "voodoo._core", frozen)]
pub struct PyCamera(Arc<Camera>);

#[pymethods]
impl PyCamera {
    #[new]
    fn new(width: usize, height: usize, intrinsics: [f64; 4], model: String, coefficients: Vec<f64>) -> PyResult<Self> {
        let camera = Lens::from_model(&model, &coefficients)
            .and_then(|lens| Camera::new(width, height, intrinsics, lens))
            .map_err(|error| CameraError::new_err(error.to_string()))?;
        Ok(Self(Arc::new(camera)))
    }

    fn __getnewargs__(&self) -> (usize, usize, [f64; 4], String, Vec<f64>) {
        let ([fx, fy], [cx, cy], lens) = (self.0.focal(), self.0.center(), self.0.lens());
        let coefficients = lens.coefficients().to_vec();
        (self.0.width(), self.0.height(), [fx, fy, cx, cy], lens.model().to_owned(), coefficients)
    }

    #[doc = stub!("Camera.project")]
    fn project<'py>(&self, points: PyReadonlyArray2<'py, f64>) -> PyResult<Array<'py>> {
        let pixel = |[x, y, z]: &[f64; 3]| {
            let before = x.is_finite() && y.is_finite() && z.is_finite() && *z > 0.0;
            before.then(|| self.0.pixel([x / z, y / z])).flatten().unwrap_or([f64::NAN; 2])
        };
        let rows = rows("points", &points)?;
        array(points.py(), rows.iter().flat_map(pixel).collect(), &[rows.len(), 2])
    }

    #[doc = stub!("Camera.undistorted")]
    fn undistorted<'py>(&self, pixels: PyReadonlyArray2<'py, f64>) -> PyResult<Array<'py>> {
        let ray = |pixel: &[f64; 2]| self.0.ray(*pixel).unwrap_or([f64::NAN; 2]);
        let rows = rows("pixels", &pixels)?;
        array(pixels.py(), rows.iter().flat_map(ray).collect(), &[rows.len(), 2])
    }

    #[doc = stub!("Camera.rays")]
    fn rays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let rays = py.detach(|| self.0.rays());
        PyArray1::from_slice(py, rays.as_flattened()).reshape([self.0.height(), self.0.width(), 2])
    }
}

/// The core's camera of a `voodoo.Camera`.
pub(crate) fn camera_of(camera: &Bound<'_, PyAny>) -> PyResult<Arc<Camera>> {
    let core = camera.getattr("core").ok().and_then(|core| core.cast_into::<PyCamera>().ok());
    core.map(|core| Arc::clone(&core.get().0)).ok_or_else(|| {
        let found = camera.get_type().name().map_or_else(|_| "something else".into(), |name| name.to_string());
        raise(Unexpected::new("camera", "a Camera, the calibration of the image", found))
    })
}

/// The transform of a 4x4 array.
pub(crate) fn affine(name: &str, value: &PyReadonlyArray2<'_, f64>) -> PyResult<Affine3> {
    if value.dims() != numpy::Ix2(4, 4) {
        return Err(wrong_argument(name, "an array of shape (4, 4)", value.as_any()));
    }
    let entries = value.as_array();
    let column = |column: usize| Vec3::new(entries[[0, column]], entries[[1, column]], entries[[2, column]]);
    Ok(Affine3::from_cols(column(0), column(1), column(2), column(3)))
}

type Images<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<i16>>);

#[doc = stub!("render_depth")]
#[pyfunction]
#[pyo3(signature = (body, world_from_limb, *, camera, world_from_sensor=None))]
pub(crate) fn render_depth<'py>(
    py: Python<'py>,
    body: &PyBody,
    world_from_limb: Vec<Bound<'py, PyAny>>,
    #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
    world_from_sensor: Option<&Bound<'py, PyAny>>,
) -> PyResult<Images<'py>> {
    let poses = limb_poses(&body.0, &world_from_limb)?;
    let world_from_sensor = pose("world_from_sensor", world_from_sensor)?;
    let view = Viewpoint { camera: &camera, world_from_sensor };
    let mut image = Rendering::default();
    py.detach(|| image.render(&body.0, &poses, &view)).map_err(raise)?;
    let size = [camera.height(), camera.width()];
    let depth = PyArray1::from_slice(py, image.depth()).reshape(size)?;
    // The mark of no limb, all ones, becomes -1; no body has 32768 limbs.
    let limb: Vec<i16> = image.limb().iter().map(|limb| *limb as i16).collect();
    Ok((depth, PyArray1::from_vec(py, limb).reshape(size)?))
}
