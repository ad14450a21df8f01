//! 2-D keypoints, depth registered to their images, and points that are extrapolated with the limbs.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use voodoo_core::Camera;
use voodoo_core::math::Vec3;
use voodoo_sensors::eye::Eye;
use voodoo_sensors::keypoints::{Sensor, SiteKeypoints, SiteMeasurement, SiteObservation, nearest_person};

use crate::arrays::{PointView, Row, points, rows};
use crate::camera::{affine, camera_of};
use crate::errors::raise;
use crate::people::TrackedBody;
use crate::sites::{ALONG_SIGMA, PySiteGate, PySiteRay, places_of};

type PixelRow = ((f64, f64), f64);
/// Site, indices and weights of its keypoints, spread, and distance behind the surface.
type KeypointRow = (String, Vec<(usize, f64)>, f64, f64);
type Observed = (Vec<PySiteRay>, Vec<(String, Row, f64)>, Vec<String>, Vec<String>);

#[doc = stub!("KeypointLayout")]
#[pyclass(name = "KeypointLayout", module = "voodoo._core", frozen)]
pub struct PyKeypointLayout(Vec<SiteKeypoints>);

#[pymethods]
impl PyKeypointLayout {
    #[new]
    fn new(parts: Vec<KeypointRow>) -> Self {
        let part = |(site, weights, spread, behind)| SiteKeypoints { site, weights, spread, behind };
        Self(parts.into_iter().map(part).collect())
    }

    /// Pixel and confidence of each part; `None` where it is not detected.
    fn pixels(&self, keypoints: PyReadonlyArray2<'_, f64>, least: f64) -> PyResult<Vec<Option<PixelRow>>> {
        let keypoints = rows("keypoints", &keypoints)?;
        let found = self.0.iter().map(|part| part.pixel(keypoints, least));
        Ok(found.map(|found| found.map(|([u, v], confidence)| ((u, v), confidence))).collect())
    }

    /// Index of the person nearest to the predicted positions of the parts.
    #[pyo3(signature = (people, predicted, *, world_from_sensor, camera, least))]
    fn nearest<'py>(
        &self,
        people: Vec<PyReadonlyArray2<'py, f64>>,
        predicted: &Bound<'py, PyAny>,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
        least: f64,
    ) -> PyResult<Option<usize>> {
        let eye = Eye { world_from_sensor: affine("world_from_sensor", &world_from_sensor)?, camera: &camera };
        let places = places_of(predicted, self.0.iter().map(|part| &part.site))?.into_iter();
        let expected: Vec<_> = places.map(|place| eye.pixel(eye.in_sensor(place.unwrap_or(Vec3::NAN)))).collect();
        let people = people.iter().map(|keypoints| rows("keypoints", keypoints)).collect::<PyResult<Vec<_>>>()?;
        Ok(nearest_person(people.into_iter(), &self.0, &expected, least))
    }

    /// Rays; sites with positions and their standard deviations; names of those not detected, and of those rejected.
    #[pyo3(signature = (keypoints, predicted, *, stamp, source, world_from_sensor, camera, noise, place_sigma, least, gate, surface, before))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn observe<'py>(
        &self,
        keypoints: PyReadonlyArray2<'py, f64>,
        predicted: &Bound<'py, PyAny>,
        stamp: f64,
        source: &str,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
        noise: f64,
        place_sigma: f64,
        least: f64,
        gate: Option<PyRefMut<'py, PySiteGate>>,
        surface: Option<&Bound<'py, PyAny>>,
        before: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Observed> {
        let eye = Eye { world_from_sensor: affine("world_from_sensor", &world_from_sensor)?, camera: &camera };
        let (sensor, keypoints) = (Sensor { eye, source, noise, place_sigma, stamp }, rows("keypoints", &keypoints)?);
        let (places, mut gate) = (places_of(predicted, self.0.iter().map(|part| &part.site))?, gate);
        let (mut rays, mut points, mut unseen, mut dropped) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (part, place) in self.0.iter().zip(places) {
            let Some((pixel, confidence)) = part.pixel(keypoints, least) else {
                unseen.push(part.site.clone());
                continue;
            };
            let Some(expected) = place else { continue };
            let surface: Option<f64> =
                surface.map_or(Ok(None), |surface| surface.call1(((pixel[0], pixel[1]),))?.extract())?;
            let hidden = before.map_or(Ok(None), |before| before.call_method1("get", (&part.site,))?.extract())?;
            let observation = SiteObservation { pixel, confidence, expected, hidden: hidden.unwrap_or(0.0), surface };
            match part.measurement(&observation, &sensor, gate.as_mut().map(|gate| &mut gate.0)) {
                SiteMeasurement::Ray(direction, sigma) => rays.push(PySiteRay {
                    site: part.site.clone(),
                    origin: Row(eye.origin()),
                    direction: Row(direction),
                    sigma,
                    source: source.to_owned(),
                    trust: 1.0,
                    bias: 0.0,
                    place: None,
                    place_sigma: ALONG_SIGMA,
                }),
                SiteMeasurement::Place(place, sigma) => points.push((part.site.clone(), Row(place), sigma)),
                SiteMeasurement::Dropped => dropped.push(part.site.clone()),
            }
        }
        Ok((rays, points, unseen, dropped))
    }
}

#[doc = stub!("linear_sum_assignment")]
#[pyfunction]
pub(crate) fn linear_sum_assignment(costs: PyReadonlyArray2<'_, f64>) -> Vec<(usize, usize)> {
    let costs = costs.as_array();
    voodoo_core::math::linear_sum_assignment(costs.nrows(), costs.ncols(), &|row, column| costs[[row, column]])
}

#[doc = stub!("carried")]
#[pyfunction]
#[pyo3(signature = (points, tracker, *, elapsed, world_from_sensor=None))]
pub(crate) fn carried<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    tracker: TrackedBody<'py>,
    elapsed: f64,
    world_from_sensor: Option<PyReadonlyArray2<'py, f64>>,
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    let pose = world_from_sensor.as_ref().map(|pose| affine("world_from_sensor", pose)).transpose()?;
    let view: PointView = self::points("points", points)?.extract()?;
    let moved = voodoo_sensors::carried::carried(view.points()?, tracker.tracker()?, elapsed, pose.as_ref());
    let moved = moved.map_err(raise)?;
    let array =
        |moved: Vec<Vec3>| PyArray1::from_iter(py, moved.iter().flat_map(Vec3::to_array)).reshape([moved.len(), 3]);
    moved.map(array).transpose()
}

#[doc = stub!("nearest_surface")]
#[pyfunction]
#[pyo3(signature = (pixels, depths, *, pixel, radius))]
pub(crate) fn nearest_surface(
    pixels: PyReadonlyArray2<'_, f64>,
    depths: PyReadonlyArray1<'_, f64>,
    pixel: [f64; 2],
    radius: f64,
) -> PyResult<Option<f64>> {
    let found =
        voodoo_sensors::registration::nearest_surface(rows("pixels", &pixels)?, depths.as_slice()?, pixel, radius);
    found.map_err(raise)
}
