//! Depth measurements registered to the image of another camera.

use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use voodoo_sensors::registration;

use crate::arrays::rows;
use crate::errors::Raise;

#[doc = stub!("nearest_surface")]
#[pyfunction]
#[pyo3(signature = (pixels, depths, *, pixel, radius))]
pub(crate) fn nearest_surface(
    pixels: PyReadonlyArray2<'_, f64>,
    depths: PyReadonlyArray1<'_, f64>,
    pixel: [f64; 2],
    radius: f64,
) -> PyResult<Option<f64>> {
    let found = registration::nearest_surface(rows("pixels", &pixels)?, depths.as_slice()?, pixel, radius);
    found.map_err(Raise::raise)
}
