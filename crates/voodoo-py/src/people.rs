//! `People`.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::math::{Aabb, Vec3};
use voodoo_core::people::Options;
use voodoo_core::{Frame, People};

use crate::body::PyBody;
use crate::borrowed::ColorView;
use crate::config::config;
use crate::errors::IntoPy;
use crate::estimate::{Names, PyEstimate};
use crate::frame::PyFrame;

#[pyclass(name = "People", module = "voodoo._core")]
pub struct PyPeople {
    people: People,
    names: Arc<Names>,
}

#[pymethods]
impl PyPeople {
    #[new]
    #[pyo3(signature = (body, values, *, limit, forget_after, region))]
    fn new(
        body: &PyBody,
        values: &Bound<'_, PyDict>,
        limit: Option<usize>,
        forget_after: f64,
        region: Option<([f64; 3], [f64; 3])>,
    ) -> PyResult<Self> {
        let region = region.map(|(low, high)| Aabb::new(Vec3::from_array(low), Vec3::from_array(high)));
        let options = Options { limit, forget_after, region };
        let people =
            People::new(body.0.clone(), config(values)?, options).map_err(|error| error.into_py(values.py()))?;
        let names = Arc::new(Names::of(people.prototype()));
        Ok(Self { people, names })
    }

    /// One frame; releases the GIL. Number and estimate of everybody who is there.
    fn step(&mut self, py: Python<'_>, frame: &PyFrame) -> PyResult<Vec<(usize, PyEstimate)>> {
        let borrowed = frame.borrow_for(py, self.people.prototype())?;
        let (clouds, images) = (borrowed.clouds()?, borrowed.images()?);
        let views = frame.color_views(py);
        let colors = views.iter().map(ColorView::image).collect::<PyResult<Vec<_>>>()?;
        let input = Frame {
            stamp: frame.stamp,
            clouds: &clouds,
            images: &images,
            colors: &colors,
            positions: &borrowed.positions,
            rays: &borrowed.rays,
            ground: borrowed.ground,
            excluded: &frame.excluded,
        };
        let people = &mut self.people;
        py.detach(|| people.step(&input)).map_err(|error| error.into_py(py))?;
        let found = self.people.there().map(|(id, tracker)| {
            let (estimate, names) = (tracker.estimate().clone(), self.names.clone());
            (id, PyEstimate { estimate, names, sources: frame.sources.clone() })
        });
        Ok(found.collect())
    }

    /// The body of a person who is there, in their sizes.
    fn body(&self, id: usize) -> Option<PyBody> {
        self.people.there().find(|(there, _)| *there == id).map(|(_, tracker)| PyBody(tracker.body().clone()))
    }
}
