//! 2-D keypoints, and points that go on with the limbs.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use voodoo_core::math::Vec3;
use voodoo_core::observation::body_view::Matrix;
use voodoo_core::observation::carried::Carrying;
use voodoo_core::observation::eye::Eye;
use voodoo_core::observation::keypoints::{Part, nearest_person};

use crate::body_view::rows_of;
use crate::errors::exception;
use crate::skin::pairs;

type Seen = ((f64, f64), f64);
type Sight<'py> = ((f64, f64), Bound<'py, PyArray1<f64>>, f64, f64, f64);

#[pyclass(name = "KeypointLayout", module = "voodoo._core", frozen)]
pub struct PyKeypointLayout(Vec<Part>);

/// Rows of three numbers.
fn rows<'a>(name: &str, array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<&'a [[f64; 3]]> {
    if array.dims()[1] == 3 {
        return Ok(array.as_slice()?.as_chunks().0);
    }
    let text = format!("{name}: expected shape (N, 3), found {:?}", array.shape());
    Err(exception(array.py(), "MeasurementError", text))
}

#[pymethods]
impl PyKeypointLayout {
    #[new]
    fn new(parts: Vec<(Vec<(usize, f64)>, f64)>) -> Self {
        Self(parts.into_iter().map(|(shares, spread)| Part { shares, spread }).collect())
    }

    /// Pixel and confidence of each part; none where it is not seen.
    fn pixels(&self, keypoints: PyReadonlyArray2<'_, f64>, least: f64) -> PyResult<Vec<Option<Seen>>> {
        let keypoints = rows("keypoints", &keypoints)?;
        let seen = self.0.iter().map(|part| part.pixel(keypoints, least));
        Ok(seen.map(|seen| seen.map(|seen| ((seen.pixel[0], seen.pixel[1]), seen.confidence))).collect())
    }

    /// Number of the person nearest to where the parts are expected.
    #[pyo3(signature = (people, places, *, world_from_sensor, intrinsics, project, least))]
    fn nearest<'py>(
        &self,
        people: Vec<PyReadonlyArray2<'py, f64>>,
        places: PyReadonlyArray2<'py, f64>,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        intrinsics: [f64; 4],
        project: Option<&Bound<'py, PyAny>>,
        least: f64,
    ) -> PyResult<Option<usize>> {
        let eye = Eye { world_from_sensor: rows_of("world_from_sensor", &world_from_sensor)?, intrinsics };
        let inside: Vec<[f64; 3]> =
            rows("places", &places)?.iter().map(|place| eye.in_sensor(Vec3::from_array(*place)).to_array()).collect();
        let expected = match project {
            Some(project) => pairs(project, &inside)?,
            None => inside
                .iter()
                .map(|place| if place[2] > 0.0 { eye.pixel(Vec3::from_array(*place)) } else { [f64::NAN; 2] })
                .collect(),
        };
        let people = people.iter().map(|keypoints| rows("keypoints", keypoints)).collect::<PyResult<Vec<_>>>()?;
        Ok(nearest_person(people.into_iter(), &self.0, &expected, least))
    }

    /// Of each part that is seen pixel, direction, expected depth, distance from there and standard deviation of its ray.
    #[pyo3(signature = (keypoints, places, *, world_from_sensor, intrinsics, lens, noise, least))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn sights<'py>(
        &self,
        py: Python<'py>,
        keypoints: PyReadonlyArray2<'py, f64>,
        places: PyReadonlyArray2<'py, f64>,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        intrinsics: [f64; 4],
        lens: Option<&Bound<'py, PyAny>>,
        noise: f64,
        least: f64,
    ) -> PyResult<Vec<Option<Sight<'py>>>> {
        let eye = Eye { world_from_sensor: rows_of("world_from_sensor", &world_from_sensor)?, intrinsics };
        let (keypoints, places) = (rows("keypoints", &keypoints)?, rows("places", &places)?);
        let seen: Vec<_> = self.0.iter().map(|part| part.pixel(keypoints, least)).collect();
        let pixels: Vec<[f64; 2]> = seen.iter().map(|seen| seen.map_or([f64::NAN; 2], |seen| seen.pixel)).collect();
        let flat = match lens {
            Some(lens) => pairs(lens, &pixels)?,
            None => pixels.iter().map(|pixel| eye.undistorted(*pixel)).collect(),
        };
        let told = seen.iter().zip(&self.0).zip(flat.iter().zip(places)).map(|((seen, part), (flat, place))| {
            let seen = (*seen)?;
            let sight = seen.sight(&eye, *flat, Vec3::from_array(*place), part.spread, noise);
            let direction = PyArray1::from_slice(py, &sight.direction.to_array());
            Some(((seen.pixel[0], seen.pixel[1]), direction, sight.depth, sight.away, sight.sigma))
        });
        Ok(told.collect())
    }
}

/// Points in the world that go on with the limb that they lie on, as `distances` tells.
#[pyfunction]
#[pyo3(signature = (points, poses, before, *, interval, elapsed, near, share, max_speed, distances))]
#[allow(clippy::too_many_arguments, reason = "keywords in Python")]
pub fn carried<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    poses: PyReadonlyArray3<'py, f64>,
    before: PyReadonlyArray3<'py, f64>,
    interval: f64,
    elapsed: f64,
    near: f64,
    share: f64,
    max_speed: f64,
    distances: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut moved = rows("points", &points)?.to_vec();
    let (poses, before) = (matrices(&poses)?, matrices(&before)?);
    let carrying = Carrying { poses: &poses, before: &before, interval, elapsed, near, share, max_speed };
    let around = carrying.around(&moved);
    if !around.is_empty() {
        let chosen: Vec<f64> = around.iter().flat_map(|index| moved[*index]).collect();
        let chosen = PyArray1::from_vec(py, chosen).reshape([around.len(), 3])?;
        let away: PyReadonlyArray2<'py, f32> = distances.call1((chosen,))?.extract()?;
        carrying.carry(&mut moved, &around, away.as_slice()?);
    }
    PyArray1::from_slice(py, moved.as_flattened()).reshape([moved.len(), 3])
}

fn matrices(array: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Matrix>> {
    if array.shape()[1..] != [4, 4] {
        let text = format!("poses: expected shape (N, 4, 4), found {:?}", array.shape());
        return Err(exception(array.py(), "MeasurementError", text));
    }
    let rows: &[[f64; 4]] = array.as_slice()?.as_chunks().0;
    Ok(rows.as_chunks::<4>().0.to_vec())
}
