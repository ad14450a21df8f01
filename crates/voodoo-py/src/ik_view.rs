//! `View` of inverse kinematics: one silhouette with its camera.

use std::sync::Arc;

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use voodoo_core::Camera;
use voodoo_ik::SilhouetteView;

use crate::arrays::pose;
use crate::camera::camera_of;
use crate::errors::unless;

#[doc = stub!("View")]
#[pyclass(name = "View", module = "voodoo._core", frozen)]
pub struct PyView(pub SilhouetteView);

#[pymethods]
impl PyView {
    #[new]
    fn new(
        distance: PyReadonlyArray2<'_, f32>,
        thickness: PyReadonlyArray2<'_, f32>,
        depth: Option<PyReadonlyArray2<'_, f32>>,
        border: f64,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
        camera_from_world: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let [height, width] = [distance.shape()[0], distance.shape()[1]];
        let size = format_args!("{width} x {height}");
        unless(width >= 2 && height >= 2, "silhouette", "at least 2 x 2 pixels", size)?;
        Ok(Self(SilhouetteView {
            pixels: distance.as_slice()?.iter().zip(thickness.as_slice()?).map(|(d, t)| [*d, *t]).collect(),
            depth: depth.map_or(Ok(Vec::new()), |depth| depth.as_slice().map(<[f32]>::to_vec))?,
            border,
            camera: Camera::clone(&camera),
            camera_from_world: pose("camera_from_world", Some(camera_from_world))?,
        }))
    }
}
