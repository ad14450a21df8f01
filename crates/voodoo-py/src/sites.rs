//! Named sites: predicted positions, gates around them, and rays on which they were detected.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::math::Vec3;
use voodoo_sensors::sites::{SiteGate, SiteRay};

use crate::arrays::vector;
use crate::errors::{MeasurementError, Raise};
use crate::people::TrackedBody;

type Row<'py> = Bound<'py, PyArray1<f64>>;

fn row(py: Python<'_>, place: Vec3) -> Row<'_> {
    PyArray1::from_slice(py, &place.to_array())
}

/// Predicted positions of some sites, from a mapping of names to positions; `None` for missing ones.
pub(crate) fn places_of<'a>(
    places: &Bound<'_, PyAny>,
    sites: impl Iterator<Item = &'a str>,
) -> PyResult<Vec<Option<Vec3>>> {
    let dict = places.cast::<PyDict>().ok();
    sites
        .map(|site| {
            let place = match dict {
                Some(dict) => dict.get_item(site)?,
                None => Some(places.call_method1("get", (site,))?).filter(|place| !place.is_none()),
            };
            place.map(|place| vector(site, &place)).transpose()
        })
        .collect()
}

#[doc = stub!("expected_sites")]
#[pyfunction]
pub(crate) fn expected_sites<'py>(
    py: Python<'py>,
    tracker: TrackedBody<'py>,
    stamp: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let tracker = tracker.tracker()?;
    let places = tracker.expected_sites(stamp).map_err(Raise::raise)?;
    let dict = PyDict::new(py);
    for (site, place) in tracker.body().sites().iter().zip(places) {
        dict.set_item(&site.name, row(py, place))?;
    }
    Ok(dict)
}

#[doc = stub!("SiteGate")]
#[pyclass(name = "SiteGate", module = "voodoo._core")]
pub struct PySiteGate(pub SiteGate);

#[pymethods]
impl PySiteGate {
    #[new]
    #[pyo3(signature = (radius=0.15, growth=0.5, widest=0.40))]
    fn new(radius: f64, growth: f64, widest: f64) -> PyResult<Self> {
        if !(radius > 0.0 && growth >= 0.0 && widest >= radius) {
            let found = format!("found radius {radius:?}, growth {growth:?}, widest {widest:?}");
            let text = format!("gate: expected 0 < radius <= widest and growth >= 0, {found}");
            return Err(MeasurementError::new_err(text));
        }
        Ok(Self(SiteGate::new(radius, growth, widest)))
    }

    fn __copy__(&self) -> Self {
        Self(self.0.clone())
    }

    #[doc = stub!("SiteGate.limit")]
    fn limit(&mut self, site: &str, source: &str, stamp: f64) -> f64 {
        self.0.limit(site, source, stamp)
    }

    #[doc = stub!("SiteGate.accepts")]
    fn accepts(&mut self, site: &str, distance: f64, stamp: f64, source: &str) -> bool {
        self.0.accepts(site, distance, stamp, source)
    }
}

#[doc = stub!("SiteRay")]
#[pyclass(name = "SiteRay", module = "voodoo._core", frozen)]
pub struct PySiteRay(pub SiteRay);

#[pymethods]
impl PySiteRay {
    #[new]
    #[pyo3(signature = (site, origin, direction, sigma, source, trust=1.0, bias=0.0, place=None, place_sigma=0.04))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        site: String,
        origin: &Bound<'_, PyAny>,
        direction: &Bound<'_, PyAny>,
        sigma: f64,
        source: String,
        trust: f64,
        bias: f64,
        place: Option<&Bound<'_, PyAny>>,
        place_sigma: f64,
    ) -> PyResult<Self> {
        let (origin, direction) = (vector("origin", origin)?, vector("direction", direction)?);
        let place = place.map(|place| vector("place", place)).transpose()?;
        Ok(Self(SiteRay { site, origin, direction, sigma, source, trust, bias, place, place_sigma }))
    }

    #[doc = stub!("SiteRay.site")]
    #[getter]
    fn site(&self) -> &str {
        &self.0.site
    }

    #[doc = stub!("SiteRay.origin")]
    #[getter]
    fn origin<'py>(&self, py: Python<'py>) -> Row<'py> {
        row(py, self.0.origin)
    }

    #[doc = stub!("SiteRay.direction")]
    #[getter]
    fn direction<'py>(&self, py: Python<'py>) -> Row<'py> {
        row(py, self.0.direction)
    }

    #[doc = stub!("SiteRay.sigma")]
    #[getter]
    fn sigma(&self) -> f64 {
        self.0.sigma
    }

    #[doc = stub!("SiteRay.source")]
    #[getter]
    fn source(&self) -> &str {
        &self.0.source
    }

    #[doc = stub!("SiteRay.trust")]
    #[getter]
    fn trust(&self) -> f64 {
        self.0.trust
    }

    #[doc = stub!("SiteRay.bias")]
    #[getter]
    fn bias(&self) -> f64 {
        self.0.bias
    }

    #[doc = stub!("SiteRay.place")]
    #[getter]
    fn place<'py>(&self, py: Python<'py>) -> Option<Row<'py>> {
        self.0.place.map(|place| row(py, place))
    }

    #[doc = stub!("SiteRay.place_sigma")]
    #[getter]
    fn place_sigma(&self) -> f64 {
        self.0.place_sigma
    }

    #[doc = stub!("SiteRay.moved")]
    fn moved(&self, shift: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (shift, ray) = (vector("shift", shift)?, &self.0);
        let place = ray.place.map(|place| place + shift);
        Ok(Self(SiteRay { origin: ray.origin + shift, place, ..ray.clone() }))
    }

    #[doc = stub!("SiteRay.trusted")]
    fn trusted(&self, trust: f64) -> Self {
        Self(SiteRay { trust, ..self.0.clone() })
    }

    fn __repr__(&self) -> String {
        let SiteRay { site, origin, direction, sigma, source, trust, .. } = &self.0;
        let (origin, direction) = (origin.to_array(), direction.to_array());
        format!(
            "SiteRay({site:?}, origin={origin:.3?}, direction={direction:.3?}, sigma={sigma:.4}, source={source:?}, trust={trust})"
        )
    }
}
