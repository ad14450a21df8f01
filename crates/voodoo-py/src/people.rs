//! `People`.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::math::{Aabb, Vec3};
use voodoo_core::{BodyTracker, Frame, People, PeopleOptions};

use crate::body::PyBody;
use crate::borrowed::Borrowed;
use crate::config::config;
use crate::detector::{detector, warn_of_detector};
use crate::errors::{BodyError, raise};
use crate::estimate::{Names, PyEstimate};
use crate::frame::PyFrame;
use crate::tracker::{PyTracker, SitePositions, site_positions};

#[doc = stub!("People")]
#[pyclass(name = "People", module = "voodoo._core")]
pub struct PyPeople {
    people: People,
    names: Arc<Names>,
    /// Number of steps in which a detector failed.
    detector_failures: usize,
}

/// A tracker, or one of several persons by id.
#[derive(FromPyObject)]
pub(crate) enum TrackedBody<'py> {
    Alone(PyRef<'py, PyTracker>),
    Person(PyRef<'py, PyPeople>, usize),
}

impl TrackedBody<'_> {
    /// The tracker of the body.
    pub(crate) fn tracker(&self) -> PyResult<&BodyTracker> {
        match self {
            Self::Alone(tracker) => Ok(&tracker.tracker),
            Self::Person(people, id) => people.person(*id),
        }
    }
}

impl PyPeople {
    /// The tracker of a present person.
    fn person(&self, id: usize) -> PyResult<&BodyTracker> {
        let found = self.people.present().find(|(there, _)| *there == id).map(|(_, tracker)| tracker);
        found.ok_or_else(|| {
            let there: Vec<String> = self.present().iter().map(usize::to_string).collect();
            let there = if there.is_empty() { "nobody".to_owned() } else { there.join(", ") };
            BodyError::new_err(format!("person: expected one of those who are there ({there}), found {id}"))
        })
    }
}

#[pymethods]
impl PyPeople {
    #[new]
    #[pyo3(signature = (body, values, detector, *, limit, nearest, forget_after, region))]
    fn new(
        body: &PyBody,
        values: &Bound<'_, PyDict>,
        detector: &Bound<'_, PyAny>,
        limit: Option<usize>,
        nearest: bool,
        forget_after: f64,
        region: Option<([f64; 3], [f64; 3])>,
    ) -> PyResult<Self> {
        let region = region.map(|(low, high)| Aabb::new(Vec3::from_array(low), Vec3::from_array(high)));
        let mut options = PeopleOptions::default();
        (options.limit, options.nearest, options.forget_after, options.region) = (limit, nearest, forget_after, region);
        let mut people = People::new(body.0.clone(), config(values)?, options).map_err(raise)?;
        if let Some(found) = self::detector(detector)? {
            people = people.with_detector(found);
        }
        let names = Arc::new(Names::from_body(values.py(), people.prototype())?);
        Ok(Self { people, names, detector_failures: 0 })
    }

    /// Processes one frame, and the measurements of individual persons; releases the GIL. Returns id and estimate of all present
    /// persons.
    fn step(
        &mut self,
        py: Python<'_>,
        frame: &PyFrame,
        own: Vec<(usize, PyRef<'_, PyFrame>)>,
    ) -> PyResult<Vec<(usize, PyEstimate)>> {
        let body = self.people.prototype();
        let all = Borrowed::new(py, frame, body, 0)?;
        // A person's own measurements follow the common ones; their sources are numbered consecutively.
        let first = frame.sources.len();
        let owned = own.iter().map(|(_, frame)| Borrowed::new(py, frame, body, first)).collect::<PyResult<Vec<_>>>()?;
        let cameras: Vec<u16> = (0..).take(frame.colors.len()).collect();
        let clouds = owned.iter().map(Borrowed::clouds).collect::<PyResult<Vec<_>>>()?;
        let measured = own.iter().zip(&owned).zip(&clouds).map(|(((id, frame), own), clouds)| {
            let (positions, rays) = (own.positions.as_slice(), own.rays.as_slice());
            (*id, Frame { clouds, positions, rays, ..Frame::empty(frame.stamp) })
        });
        let measured: Vec<(usize, Frame)> = measured.collect();
        let people = &mut self.people;
        all.with_frame(&cameras, |input| py.detach(|| people.step(input, &measured)).map_err(raise))?;
        warn_of_detector(py, self.people.detector_error(), &mut self.detector_failures)?;
        let found = self.people.present().map(|(id, tracker)| {
            let (estimate, names) = (tracker.estimate().clone(), self.names.clone());
            let own = own.iter().filter(|(of, _)| *of == id).flat_map(|(_, own)| &own.sources);
            let sources = frame.sources.iter().chain(own).cloned().collect();
            (id, PyEstimate { estimate, names, sources })
        });
        Ok(found.collect())
    }

    #[getter]
    fn detector_failures(&self) -> usize {
        self.detector_failures
    }

    /// Adds a person at these positions; returns their id.
    fn add(&mut self, joints: SitePositions, fit_sizes: bool) -> PyResult<usize> {
        let positions = site_positions(self.people.prototype(), &joints)?;
        self.people.add(&positions, fit_sizes).map_err(raise)
    }

    /// Why a detected person is not tracked.
    #[getter]
    fn refusal(&self) -> Option<String> {
        self.people.refusal().map(|refusal| refusal.to_string())
    }

    /// Ids of the present persons.
    fn present(&self) -> Vec<usize> {
        self.people.present().map(|(id, _)| id).collect()
    }

    /// Whether color images would be used in the next frame.
    fn needs_colors(&self) -> bool {
        self.people.needs_colors()
    }

    /// Tracks only the persons with these ids; `None`: all.
    fn only(&mut self, ids: Option<Vec<usize>>) {
        self.people.restrict_to(ids);
    }

    /// The last estimate of a present person.
    fn estimate(&self, id: usize) -> PyResult<PyEstimate> {
        let estimate = self.person(id)?.estimate().clone();
        Ok(PyEstimate { estimate, names: self.names.clone(), sources: Vec::new() })
    }

    /// The body of a present person, in their sizes.
    fn body(&self, id: usize) -> PyResult<PyBody> {
        Ok(PyBody(self.person(id)?.body().clone()))
    }
}
