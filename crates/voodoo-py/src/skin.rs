//! The skin cue of one camera: learned colors, and regions as candidates for head and hands.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use voodoo_core::Camera;
use voodoo_core::math::Vec3;
use voodoo_sensors::eye::Eye;
use voodoo_sensors::skin::cue::{Expected, SkinCue, SkinInput, SkinSettings};
use voodoo_sensors::skin::depth::DepthBeside;

use crate::arrays::{DEPTH_ARRAY, DepthView, Row, contiguous, vectors};
use crate::camera::{affine, camera_of};
use crate::errors::{raise, wrong_argument};
use crate::people::TrackedBody;
use crate::sites::places_of;

/// Index of a site, direction of its ray, its position, and its predicted depth.
type Ray = (usize, Row, Option<Row>, f64);
/// Image, meters per unit, camera and pose of a depth camera.
type DepthArguments<'py> = (Bound<'py, PyAny>, f64, Bound<'py, PyAny>, PyReadonlyArray2<'py, f64>);

#[doc = stub!("SkinCue")]
#[pyclass(name = "SkinCue", module = "voodoo._core")]
#[derive(Clone)]
pub struct PySkinCue(SkinCue);

#[pymethods]
impl PySkinCue {
    #[new]
    #[pyo3(signature = (sites, *, gate, growth, lost_gate, widest_gate))]
    fn new(sites: Vec<String>, gate: f64, growth: f64, lost_gate: f64, widest_gate: f64) -> Self {
        Self(SkinCue::new(SkinSettings { sites, gate, growth, lost_gate, widest_gate }))
    }

    fn __copy__(&self) -> Self {
        self.clone()
    }

    #[getter]
    fn learned(&self) -> u32 {
        self.0.colors.learned
    }

    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let SkinCue { size, mask: ([rows, columns], skin), .. } = &self.0;
        let mut mask = vec![false; size[0] * size[1]];
        for (row, skin) in rows.clone().zip(skin.chunks_exact(columns.len().max(1))) {
            let line = &mut mask[row * size[1]..][columns.clone()];
            line.iter_mut().zip(skin).for_each(|(mask, skin)| *mask = *skin != 0);
        }
        PyArray1::from_vec(py, mask).reshape(*size)
    }

    #[getter]
    fn candidates(&self) -> Vec<(f64, f64)> {
        self.0.candidates.iter().map(|item| item.pixel.into()).collect()
    }

    #[getter]
    fn assigned(&self) -> Vec<(usize, usize)> {
        self.0.assigned.clone()
    }

    #[doc = stub!("SkinCue.observe")]
    #[pyo3(signature = (image, predicted, *, stamp, world_from_sensor, camera, depth, tracker, others))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn observe<'py>(
        &mut self,
        py: Python<'py>,
        image: PyReadonlyArray3<'py, u8>,
        predicted: &Bound<'py, PyAny>,
        stamp: f64,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
        depth: Option<DepthArguments<'py>>,
        tracker: Option<TrackedBody<'py>>,
        others: Vec<TrackedBody<'py>>,
    ) -> PyResult<Vec<Ray>> {
        let eye = Eye { world_from_sensor: affine("world_from_sensor", &world_from_sensor)?, camera: &camera };
        let mut expected = Vec::new();
        for (site, name) in self.0.settings.sites.iter().enumerate() {
            let elbow = format!("{}_elbow", name.chars().take(1).collect::<String>());
            let places = places_of(predicted, [name, &elbow])?;
            let [place, elbow] = [0, 1].map(|index| places[index].filter(|place| !place.is_nan()));
            expected.extend(place.map(|place| Expected { site, place, elbow }));
        }
        let names: Vec<String> =
            predicted.call_method0("keys")?.try_iter()?.map(|name| name?.extract()).collect::<PyResult<_>>()?;
        let joints: Vec<Vec3> = places_of(predicted, &names)?.into_iter().flatten().collect();
        let depth = depth.map(|(image, per_unit, camera, pose)| {
            let view = contiguous(&image).and_then(|array| array.extract::<DepthView>());
            let view = view.map_err(|_| wrong_argument("depth", DEPTH_ARRAY, &image))?;
            Ok::<_, PyErr>((view, per_unit, camera_of(&camera)?, affine("world_from_depth", &pose)?))
        });
        let depth = depth.transpose()?;
        let beside = depth.as_ref().map(|(view, per_unit, camera, pose)| {
            let eye = Eye { world_from_sensor: *pose, camera };
            Ok::<_, PyErr>(DepthBeside { image: view.pixels()?, meters_per_unit: *per_unit, eye })
        });
        let others = others.iter().map(TrackedBody::tracker).collect::<PyResult<Vec<_>>>()?;
        let input = SkinInput {
            image: image.as_slice()?.as_chunks().0,
            stamp,
            eye,
            depth: beside.transpose()?,
            joints: &joints,
            expected: &expected,
            tracker: tracker.as_ref().map(TrackedBody::tracker).transpose()?,
            others: &others,
        };
        let cue = &mut self.0;
        let found = py.detach(|| cue.observe(&input)).map_err(raise)?;
        Ok(found.iter().map(|site| (site.site, Row(site.direction), site.place.map(Row), site.depth)).collect())
    }

    #[doc = stub!("SkinCue.learn")]
    #[pyo3(signature = (image, joints, sites, *, world_from_sensor, camera))]
    fn learn<'py>(
        &mut self,
        py: Python<'py>,
        image: PyReadonlyArray3<'py, u8>,
        joints: PyReadonlyArray2<'py, f64>,
        sites: PyReadonlyArray2<'py, f64>,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
    ) -> PyResult<()> {
        let eye = Eye { world_from_sensor: affine("world_from_sensor", &world_from_sensor)?, camera: &camera };
        let (image, joints, sites) =
            (image.as_slice()?.as_chunks().0, vectors("joints", &joints)?, vectors("sites", &sites)?);
        let cue = &mut self.0;
        py.detach(|| cue.learn(image, &eye, &joints, &sites)).map_err(raise)
    }
}
