//! Depth images that a camera should see of a posed body.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use voodoo_core::visibility::render::{Rendering, Viewpoint};

use crate::arrays::{contiguous, limb_poses, pose};
use crate::body::PyBody;
use crate::errors::{IntoPy, wrong_argument};

type Images<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<i16>>);

#[doc = stub!("render_depth")]
#[pyfunction]
#[pyo3(signature = (body, world_from_limb, *, width, height, intrinsics, rays=None, world_from_sensor=None))]
#[allow(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn render_depth<'py>(
    py: Python<'py>,
    body: &PyBody,
    world_from_limb: Vec<Bound<'py, PyAny>>,
    width: usize,
    height: usize,
    intrinsics: [f64; 4],
    rays: Option<&Bound<'py, PyAny>>,
    world_from_sensor: Option<&Bound<'py, PyAny>>,
) -> PyResult<Images<'py>> {
    let poses = limb_poses(&body.0, &world_from_limb)?;
    let world_from_sensor = pose("world_from_sensor", world_from_sensor)?;
    let rays = match rays {
        Some(rays) => {
            let wrong = || wrong_argument(py, "rays", "an array of shape (height, width, 2) and dtype float32", rays);
            let array = contiguous(rays).map_err(|_| wrong())?;
            let array = array.cast_into::<PyArray3<f32>>().map_err(|_| wrong())?;
            if array.shape() != [height, width, 2] {
                return Err(wrong());
            }
            Some(array.readonly())
        }
        None => None,
    };
    let rays = match &rays {
        Some(view) => Some(view.as_slice()?.as_chunks().0),
        None => None,
    };
    let view = Viewpoint { width, height, intrinsics, rays, world_from_sensor };
    let mut image = Rendering::default();
    py.detach(|| image.render(&body.0, &poses, &view, None)).map_err(|error| error.into_py(py))?;
    let depth = PyArray1::from_slice(py, image.depth()).reshape([height, width])?;
    // The mark of no limb, all ones, is -1; no body has 32768 limbs.
    let limb: Vec<i16> = image.limb().iter().map(|limb| *limb as i16).collect();
    Ok((depth, PyArray1::from_vec(py, limb).reshape([height, width])?))
}
