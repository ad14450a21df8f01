//! Colours of a picture as numbers of histogram bins.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use voodoo_core::observation::chroma;

use crate::errors::{IntoPy, exception};

type Image<'py, T> = PyResult<Bound<'py, PyArray2<T>>>;

/// The bin of every pixel of a picture (height, width, 3).
#[pyfunction]
pub fn color_bins<'py>(py: Python<'py>, image: PyReadonlyArray3<'py, u8>) -> Image<'py, u16> {
    let size = image.dims();
    let (height, width) = (size[0], size[1]);
    if size[2] != 3 {
        let text = format!("image: expected shape (height, width, 3), found {:?}", image.shape());
        return Err(exception(py, "MeasurementError", text));
    }
    let pixels = image.as_slice()?.as_chunks().0;
    PyArray1::from_vec(py, py.detach(|| chroma::bins(pixels))).reshape([height, width])
}

/// 1 where a pixel's bin is one of a table's.
#[pyfunction]
pub fn bins_among<'py>(
    py: Python<'py>,
    bins: PyReadonlyArray2<'py, u16>,
    table: PyReadonlyArray1<'py, bool>,
) -> Image<'py, u8> {
    let (pixels, table) = (bins.as_slice()?, table.as_slice()?);
    let found = py.detach(|| chroma::among(pixels, table)).map_err(|error| error.into_py(py))?;
    PyArray1::from_vec(py, found).reshape(bins.dims())
}

/// How many pixels of a mask are of each bin.
#[pyfunction]
pub fn bin_counts<'py>(
    py: Python<'py>,
    bins: PyReadonlyArray2<'py, u16>,
    mask: PyReadonlyArray2<'py, u8>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let (pixels, mask) = (bins.as_slice()?, mask.as_slice()?);
    let found = py.detach(|| chroma::counts(pixels, mask)).map_err(|error| error.into_py(py))?;
    Ok(PyArray1::from_vec(py, found))
}
