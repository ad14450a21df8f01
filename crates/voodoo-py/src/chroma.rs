//! Colours of a picture as numbers of histogram bins, and regions of masks.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use voodoo_sensors::chroma;
use voodoo_sensors::mask_regions::{Region, SkinPicture, joined, regions};

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

type Mask<'py> = Bound<'py, PyArray2<bool>>;

fn mask_of<'py>(py: Python<'py>, pixels: Vec<u8>, size: [usize; 2]) -> PyResult<Mask<'py>> {
    let pixels: Vec<bool> = pixels.into_iter().map(|pixel| pixel != 0).collect();
    PyArray1::from_vec(py, pixels).reshape(size)
}

/// Where a picture has skin's colour, and where it is in the regions that may be the body's.
#[pyfunction]
#[pyo3(signature = (bins, table, *, longest, body=None, always=None, before=None))]
pub fn skin_mask<'py>(
    py: Python<'py>,
    bins: PyReadonlyArray2<'py, u16>,
    table: PyReadonlyArray1<'py, bool>,
    longest: f64,
    body: Option<PyReadonlyArray2<'py, bool>>,
    always: Option<PyReadonlyArray2<'py, f32>>,
    before: Option<PyReadonlyArray2<'py, bool>>,
) -> PyResult<(Mask<'py>, Mask<'py>)> {
    let size = [bins.dims()[0], bins.dims()[1]];
    let picture = SkinPicture {
        bins: bins.as_slice()?,
        width: size[1],
        table: table.as_slice()?,
        body: body.as_ref().map(|mask| mask.as_slice()).transpose()?,
        always: always.as_ref().map(|mask| mask.as_slice()).transpose()?,
        before: before.as_ref().map(|mask| mask.as_slice()).transpose()?,
    };
    let (mut seen, mut skin) = (Vec::new(), Vec::new());
    py.detach(|| picture.find(longest, &mut seen, &mut skin)).map_err(|error| error.into_py(py))?;
    Ok((mask_of(py, seen, size)?, mask_of(py, skin, size)?))
}

/// A mask with gaps of two pixels closed between regions no longer than `longest`.
#[pyfunction]
pub fn joined_mask<'py>(py: Python<'py>, mask: PyReadonlyArray2<'py, bool>, longest: f64) -> PyResult<Mask<'py>> {
    let (size, pixels) = ([mask.dims()[0], mask.dims()[1]], mask.as_slice()?);
    let pixels: Vec<u8> = pixels.iter().map(|pixel| u8::from(*pixel)).collect();
    mask_of(py, py.detach(|| joined(&pixels, size[1], longest)), size)
}

type Regions<'py> = (Bound<'py, PyArray2<i32>>, Vec<((usize, usize), (usize, usize), usize, (f64, f64))>);

/// The regions of a mask: their numbers in each pixel; and rows, columns, area and middle of each.
#[pyfunction]
pub fn mask_regions<'py>(py: Python<'py>, mask: PyReadonlyArray2<'py, bool>) -> PyResult<Regions<'py>> {
    let (size, pixels) = ([mask.dims()[0], mask.dims()[1]], mask.as_slice()?);
    let pixels: Vec<u8> = pixels.iter().map(|pixel| u8::from(*pixel)).collect();
    let (found, labels) = py.detach(|| regions(&pixels, size[1]));
    let middle = |sum: usize, area: usize| sum as f64 / area as f64;
    let told = |region: &Region| {
        let [u, v] = region.sums.map(|sum| middle(sum, region.area));
        (region.rows, region.columns, region.area, (u, v))
    };
    Ok((PyArray1::from_vec(py, labels).reshape(size)?, found.iter().map(told).collect()))
}
