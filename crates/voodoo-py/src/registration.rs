//! Depth measurements registered to the image of another camera.

use numpy::{PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use voodoo_sensors::registration::MeasuredPixels;

use crate::errors::{IntoPy, exception};

#[doc = stub!("nearest_surface")]
#[pyfunction]
#[pyo3(signature = (pixels, depths, *, pixel, radius))]
pub(crate) fn nearest_surface(
    pixels: PyReadonlyArray2<'_, f64>,
    depths: PyReadonlyArray1<'_, f64>,
    pixel: [f64; 2],
    radius: f64,
) -> PyResult<Option<f64>> {
    let (py, shape) = (pixels.py(), pixels.dims());
    if shape[1] != 2 {
        let text = format!("pixels: expected shape (N, 2), found ({}, {})", shape[0], shape[1]);
        return Err(exception(py, "MeasurementError", text));
    }
    let measured = MeasuredPixels { places: pixels.as_slice()?.as_chunks().0, depths: depths.as_slice()? };
    measured.nearest_surface(pixel, radius).map_err(|error| error.into_py(py))
}
