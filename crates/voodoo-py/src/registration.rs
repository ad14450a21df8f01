//! A depth camera's points in the picture of another camera.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use voodoo_core::error::TrackError;
use voodoo_sensors::registration::{MeasuredPixels, ProjectedPoints};
use voodoo_sensors::window::Window;

use crate::camera::camera_of;
use crate::errors::{IntoPy, exception};

type Points<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<isize>>);

/// Points of a depth image (metres) within a box, in another camera's frame, and the index of each one's pixel.
#[pyfunction]
#[pyo3(signature = (depth, camera, *, step, rows, columns, low, high, world_from_sensor, other_from_sensor))]
#[allow(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn points_within<'py>(
    py: Python<'py>,
    depth: PyReadonlyArray2<'py, f32>,
    camera: &Bound<'py, PyAny>,
    step: usize,
    rows: (usize, usize),
    columns: (usize, usize),
    low: [f64; 3],
    high: [f64; 3],
    world_from_sensor: [[f64; 4]; 4],
    other_from_sensor: [[f64; 4]; 4],
) -> PyResult<Points<'py>> {
    let (size, camera) = (depth.dims(), camera_of(camera)?);
    let window = Window {
        depth: depth.as_slice()?,
        size: [size[0], size[1]],
        camera: &camera,
        step,
        rows: rows.0..rows.1,
        columns: columns.0..columns.1,
    };
    let found = py.detach(|| window.within(low, high, &world_from_sensor, &other_from_sensor));
    let (points, pixels) = found.map_err(|error| error.into_py(py))?;
    let count = points.len();
    let points = PyArray1::from_vec(py, points.into_flattened()).reshape([count, 3])?;
    Ok((points, PyArray1::from_vec(py, pixels)))
}

type Marks<'py> = Bound<'py, PyArray2<bool>>;
type Shown<'py> = (Marks<'py>, Option<Marks<'py>>, Bound<'py, PyArray1<isize>>);

/// Where something was seen in a picture; where something marked; and which points are inside.
#[pyfunction]
#[pyo3(signature = (pixels, points, marks, *, beyond, reach))]
pub fn shown<'py>(
    py: Python<'py>,
    pixels: PyReadonlyArray2<'py, f64>,
    points: PyReadonlyArray2<'py, f64>,
    marks: Option<PyReadonlyArray1<'py, bool>>,
    beyond: PyReadonlyArray2<'py, bool>,
    reach: usize,
) -> PyResult<Shown<'py>> {
    columns(py, "pixels", &pixels, 2)?;
    columns(py, "points", &points, 3)?;
    let (places, points) = (pixels.as_slice()?.as_chunks().0, points.as_slice()?.as_chunks().0);
    let marks = marks.as_ref().map(|marks| marks.as_slice()).transpose()?;
    let (size, beyond) = ([beyond.dims()[0], beyond.dims()[1]], beyond.as_slice()?);
    let found = py.detach(|| {
        let found = ProjectedPoints::new(places, points, marks, size)?;
        let (mask, before) = found.shown(beyond, reach, size)?;
        Ok((mask, before, found.inside))
    });
    let (mask, before, inside) = found.map_err(|error: TrackError| error.into_py(py))?;
    let before = before.map(|before| PyArray1::from_vec(py, before).reshape(size)).transpose()?;
    Ok((PyArray1::from_vec(py, mask).reshape(size)?, before, PyArray1::from_vec(py, inside)))
}

/// Depth of the nearest surface around a place in a picture and whether most of it is still; none with too few points.
#[pyfunction]
#[pyo3(signature = (pixels, depths, still, *, pixel, radius, among=None))]
pub fn nearest_surface<'py>(
    py: Python<'py>,
    pixels: PyReadonlyArray2<'py, f64>,
    depths: PyReadonlyArray1<'py, f64>,
    still: Option<PyReadonlyArray1<'py, bool>>,
    pixel: [f64; 2],
    radius: f64,
    among: Option<PyReadonlyArray1<'py, bool>>,
) -> PyResult<Option<(f64, bool)>> {
    columns(py, "pixels", &pixels, 2)?;
    let still = still.as_ref().map(|marks| marks.as_slice()).transpose()?;
    let among = among.as_ref().map(|marks| marks.as_slice()).transpose()?;
    let measured = MeasuredPixels { places: pixels.as_slice()?.as_chunks().0, depths: depths.as_slice()?, still };
    measured.nearest_surface(pixel, radius, among).map_err(|error| error.into_py(py))
}

fn columns(py: Python<'_>, name: &str, array: &PyReadonlyArray2<'_, f64>, count: usize) -> PyResult<()> {
    let shape = array.dims();
    if shape[1] == count {
        return Ok(());
    }
    let text = format!("{name}: expected shape (N, {count}), found ({}, {})", shape[0], shape[1]);
    Err(exception(py, "MeasurementError", text))
}
