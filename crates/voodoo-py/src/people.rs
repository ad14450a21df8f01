//! `People`.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::math::{Aabb, Vec3};
use voodoo_core::observation::frame::{Cloud, PositionRelation, RayRelation};
use voodoo_core::people::Options;
use voodoo_core::{Frame, People};

use crate::arrays::PointArray;
use crate::body::PyBody;
use crate::borrowed::Borrowed;
use crate::config::config;
use crate::errors::IntoPy;
use crate::estimate::{Names, PyEstimate};
use crate::frame::PyFrame;
use crate::tracker::{places, site_positions};

#[pyclass(name = "People", module = "voodoo._core")]
pub struct PyPeople {
    people: People,
    names: Arc<Names>,
}

#[pymethods]
impl PyPeople {
    #[new]
    #[pyo3(signature = (body, values, *, limit, nearest, forget_after, region))]
    fn new(
        body: &PyBody,
        values: &Bound<'_, PyDict>,
        limit: Option<usize>,
        nearest: bool,
        forget_after: f64,
        region: Option<([f64; 3], [f64; 3])>,
    ) -> PyResult<Self> {
        let region = region.map(|(low, high)| Aabb::new(Vec3::from_array(low), Vec3::from_array(high)));
        let mut options = Options::default();
        (options.limit, options.nearest, options.forget_after, options.region) = (limit, nearest, forget_after, region);
        let people =
            People::new(body.0.clone(), config(values)?, options).map_err(|error| error.into_py(values.py()))?;
        let names = Arc::new(Names::of(people.prototype()));
        Ok(Self { people, names })
    }

    /// One frame, and what was measured of some persons alone; releases the GIL. Number and estimate of everybody who is there.
    fn step(
        &mut self,
        py: Python<'_>,
        frame: &PyFrame,
        own: Vec<(usize, PyRef<'_, PyFrame>)>,
    ) -> PyResult<Vec<(usize, PyEstimate)>> {
        let body = self.people.prototype();
        let all = frame.borrow_for(py, body)?;
        let (clouds, images) = (all.clouds()?, all.images()?);
        let views = frame.color_views(py);
        let numbered = views.iter().zip(0..);
        let colors = numbered.map(|(view, camera)| view.image(camera)).collect::<PyResult<Vec<_>>>()?;
        let input = Frame::empty(frame.stamp)
            .with_clouds(&clouds)
            .with_images(&images)
            .with_colors(&colors)
            .with_positions(&all.positions)
            .with_rays(&all.rays)
            .with_ground(all.ground)
            .with_excluded(&frame.excluded);
        // A person's own measurements come after what all have in common; their sources are numbered on.
        let owned = own.iter().map(|(_, frame)| frame.borrow_for(py, body)).collect::<PyResult<Vec<_>>>()?;
        let parts =
            owned.iter().map(|own| Parts::of(&input, own, frame.sources.len() as u16)).collect::<PyResult<Vec<_>>>()?;
        let frames: Vec<(usize, Frame)> =
            own.iter().zip(&parts).map(|((id, own), parts)| (*id, parts.frame(&input, own.stamp))).collect();
        let people = &mut self.people;
        py.detach(|| people.step(&input, &frames)).map_err(|error| error.into_py(py))?;
        let found = self.people.there().map(|(id, tracker)| {
            let (estimate, names) = (tracker.estimate().clone(), self.names.clone());
            let own = own.iter().filter(|(of, _)| *of == id).flat_map(|(_, own)| &own.sources);
            let sources = frame.sources.iter().chain(own).cloned().collect();
            (id, PyEstimate { estimate, names, sources })
        });
        Ok(found.collect())
    }

    /// Somebody is where these positions say; their number.
    fn add(&mut self, joints: &Bound<'_, PyDict>, fit_sizes: bool) -> PyResult<usize> {
        let positions = site_positions(self.people.prototype(), joints)?;
        self.people.add(&positions, fit_sizes).map_err(|error| error.into_py(joints.py()))
    }

    /// Whether colour pictures would tell something in the next frame.
    fn wants_colors(&self) -> bool {
        self.people.wants_colors()
    }

    /// Follows these numbers alone; None: everybody.
    fn only(&mut self, ids: Option<Vec<usize>>) {
        self.people.only(ids);
    }

    /// Signed distances of world points `(N, 3)` to every limb of a person who is there, limb by limb; None: they are not there.
    fn limb_distances<'py>(
        &self,
        py: Python<'py>,
        id: usize,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let array = PointArray::new("points", points)?;
        let view = array.view(py);
        let Some((_, tracker)) = self.people.there().find(|(there, _)| *there == id) else { return Ok(None) };
        let distances = tracker.limb_distances(view.slice()?).map_err(|error| error.into_py(py))?;
        PyArray2::from_vec2(py, &distances).map(Some).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Length of body of a person who is there between each of some places and a camera's focal point, metres.
    fn body_before<'py>(
        &self,
        id: usize,
        sites: PyReadonlyArray2<'py, f64>,
        camera: [f64; 3],
    ) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let (py, places) = (sites.py(), places(&sites)?);
        let Some((_, tracker)) = self.people.there().find(|(there, _)| *there == id) else { return Ok(None) };
        let found = tracker.body_before(&places, Vec3::from_array(camera)).map_err(|error| error.into_py(py))?;
        Ok(Some(PyArray1::from_vec(py, found)))
    }

    /// The last estimate of a person who is there.
    fn estimate(&self, id: usize) -> Option<PyEstimate> {
        let (_, tracker) = self.people.there().find(|(there, _)| *there == id)?;
        Some(PyEstimate { estimate: tracker.estimate().clone(), names: self.names.clone(), sources: Vec::new() })
    }

    /// The body of a person who is there, in their sizes.
    fn body(&self, id: usize) -> Option<PyBody> {
        self.people.there().find(|(there, _)| *there == id).map(|(_, tracker)| PyBody(tracker.body().clone()))
    }
}

/// What was measured of a person, with what all have in common.
struct Parts<'a> {
    clouds: Vec<Cloud<'a>>,
    positions: Vec<PositionRelation>,
    rays: Vec<RayRelation>,
}

impl<'a> Parts<'a> {
    /// `first` is the number of the first source of the person's own.
    fn of(all: &Frame<'a>, own: &'a Borrowed<'_>, first: u16) -> PyResult<Self> {
        let clouds = own.clouds()?.into_iter().map(|cloud| Cloud { source: cloud.source + first, ..cloud });
        let positions = own.positions.iter().map(|seen| PositionRelation { source: seen.source + first, ..*seen });
        let rays = own.rays.iter().map(|seen| RayRelation { source: seen.source + first, ..*seen });
        Ok(Self {
            clouds: all.clouds.iter().copied().chain(clouds).collect(),
            positions: all.positions.iter().copied().chain(positions).collect(),
            rays: all.rays.iter().copied().chain(rays).collect(),
        })
    }

    fn frame<'b>(&'b self, all: &Frame<'b>, stamp: f64) -> Frame<'b> {
        let mut frame = all.with_clouds(&self.clouds).with_positions(&self.positions).with_rays(&self.rays);
        frame.stamp = stamp;
        frame
    }
}
