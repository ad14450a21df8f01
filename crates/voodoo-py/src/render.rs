//! Renders depth images of a posed body.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use voodoo_core::Camera;
use voodoo_core::{Rendering, Viewpoint};

use crate::arrays::{limb_poses, pose};
use crate::body::PyBody;
use crate::camera::camera_of;
use crate::errors::Raise;

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
    py.detach(|| image.render(&body.0, &poses, &view, None)).map_err(Raise::raise)?;
    let size = [camera.height(), camera.width()];
    let depth = PyArray1::from_slice(py, image.depth()).reshape(size)?;
    // The mark of no limb, all ones, becomes -1; no body has 32768 limbs.
    let limb: Vec<i16> = image.limb().iter().map(|limb| *limb as i16).collect();
    Ok((depth, PyArray1::from_vec(py, limb).reshape(size)?))
}
