//! Named sites: predicted positions, gates around them, and rays on which they were detected.

use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use voodoo_core::math::Vec3;
use voodoo_sensors::sites::SiteGate;

use crate::arrays::{Row, vector};
use crate::errors::{raise, unless};
use crate::people::TrackedBody;

/// Predicted positions of some sites, from a mapping of names to positions; `None` for missing ones.
pub(crate) fn places_of<'a>(
    places: &Bound<'_, PyAny>,
    sites: impl IntoIterator<Item = &'a String>,
) -> PyResult<Vec<Option<Vec3>>> {
    let place = |site: &String| {
        let place = places.call_method1("get", (site,))?;
        if place.is_none() { Ok(None) } else { vector(site, &place).map(Some) }
    };
    sites.into_iter().map(place).collect()
}

#[doc = stub!("expected_sites")]
#[pyfunction]
pub(crate) fn expected_sites<'py>(
    py: Python<'py>,
    tracker: TrackedBody<'py>,
    stamp: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let tracker = tracker.tracker()?;
    let places = tracker.expected_sites(stamp).map_err(raise)?;
    let named = tracker.body().sites().iter().zip(places).map(|(site, place)| (&site.name, Row(place)));
    named.into_py_dict(py)
}

#[doc = stub!("SiteGate")]
#[pyclass(name = "SiteGate", module = "voodoo._core")]
pub struct PySiteGate(pub SiteGate);

#[pymethods]
impl PySiteGate {
    #[new]
    #[pyo3(signature = (radius=0.15, growth=0.5, widest=0.40))]
    fn new(radius: f64, growth: f64, widest: f64) -> PyResult<Self> {
        let valid = radius > 0.0 && growth >= 0.0 && widest >= radius;
        let found = format_args!("radius {radius:?}, growth {growth:?}, widest {widest:?}");
        unless(valid, "gate", "0 < radius <= widest and growth >= 0", found)?;
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
#[pyclass(name = "SiteRay", module = "voodoo._core", frozen, get_all)]
#[derive(Clone)]
pub(crate) struct PySiteRay {
    #[doc = stub!("SiteRay.site")]
    pub(crate) site: String,
    #[doc = stub!("SiteRay.origin")]
    pub(crate) origin: Row,
    #[doc = stub!("SiteRay.direction")]
    pub(crate) direction: Row,
    #[doc = stub!("SiteRay.sigma")]
    pub(crate) sigma: f64,
    #[doc = stub!("SiteRay.source")]
    pub(crate) source: String,
    #[doc = stub!("SiteRay.trust")]
    pub(crate) trust: f64,
    #[doc = stub!("SiteRay.bias")]
    pub(crate) bias: f64,
    #[doc = stub!("SiteRay.place")]
    pub(crate) place: Option<Row>,
    #[doc = stub!("SiteRay.place_sigma")]
    pub(crate) place_sigma: f64,
}

/// Standard deviation of a position along its ray where none is given, as in the signature, meters.
pub(crate) const ALONG_SIGMA: f64 = 0.04;

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
        let (origin, direction) = (Row(vector("origin", origin)?), Row(vector("direction", direction)?));
        let place = place.map(|place| vector("place", place).map(Row)).transpose()?;
        Ok(Self { site, origin, direction, sigma, source, trust, bias, place, place_sigma })
    }

    #[doc = stub!("SiteRay.moved")]
    fn moved(&self, shift: &Bound<'_, PyAny>) -> PyResult<Self> {
        let shift = vector("shift", shift)?;
        let moved = |place: Row| Row(place.0 + shift);
        Ok(Self { origin: moved(self.origin), place: self.place.map(moved), ..self.clone() })
    }

    #[doc = stub!("SiteRay.trusted")]
    fn trusted(&self, trust: f64) -> Self {
        Self { trust, ..self.clone() }
    }

    fn __repr__(&self) -> String {
        let Self { site, origin, direction, sigma, source, trust, .. } = self;
        let (origin, direction) = (origin.0.to_array(), direction.0.to_array());
        format!(
            "SiteRay({site:?}, origin={origin:.3?}, direction={direction:.3?}, sigma={sigma:.4}, source={source:?}, trust={trust})"
        )
    }
}
