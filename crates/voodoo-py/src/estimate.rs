//! `Estimate`: a frozen copy of the result of a step, with names.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyMappingProxy, PyTuple};
use pythonize::{depythonize, pythonize};
use voodoo_core::math::{Mat3, Vec3};
use voodoo_core::{Body, Estimate, Limb, Status};

use crate::arrays::{Array, frozen, matrices};
use crate::errors::MeasurementError;

/// The names for the numbers of an estimate, as Python objects that every frame reads; shared by all estimates of one body.
pub struct Names {
    pub limbs: Py<PyTuple>,
    pub sites: Py<PyTuple>,
    /// Name of the joint of each limb; None for the root.
    pub joints: Py<PyTuple>,
}

impl Names {
    pub fn from_body(py: Python<'_>, body: &Body) -> PyResult<Self> {
        let joint = |limb: &Limb| limb.parent.as_ref().map(|(_, joint)| joint.name.clone());
        Ok(Self {
            limbs: PyTuple::new(py, body.limbs().iter().map(|limb| &limb.name))?.unbind(),
            sites: PyTuple::new(py, body.sites().iter().map(|site| &site.name))?.unbind(),
            joints: PyTuple::new(py, body.limbs().iter().map(joint))?.unbind(),
        })
    }
}

#[doc = stub!("Estimate")]
#[pyclass(name = "Estimate", module = "voodoo", frozen)]
pub struct PyEstimate {
    pub estimate: Estimate,
    pub names: Arc<Names>,
    pub sources: Vec<String>,
}

impl PyEstimate {
    /// Values by name; none of what has no name. Without a pose it is empty, and a name that is looked up is told so.
    fn mapping<'py, T: IntoPyObject<'py>>(
        &self,
        py: Python<'py>,
        names: &Py<PyTuple>,
        values: impl IntoIterator<Item = T>,
    ) -> PyResult<Bound<'py, PyMappingProxy>> {
        if self.estimate.status == Status::Searching {
            return Ok(PyMappingProxy::new(py, py.import("voodoo.errors")?.getattr("NO_POSE")?.cast()?));
        }
        let named = names.bind(py).iter().zip(values).filter(|(name, _)| !name.is_none());
        Ok(PyMappingProxy::new(py, named.into_py_dict(py)?.as_mapping()))
    }

    /// The rows of one array by name, as views, which are cheaper than separate arrays.
    fn rows<'py>(&self, names: &Py<PyTuple>, all: &Array<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(all.py(), names, all.try_iter()?.collect::<PyResult<Vec<_>>>()?)
    }
}

/// The arguments of [`_estimate`]: the estimate as plain Python, and the names of limbs, sites, joints and sources.
type Plain<'py> = (Bound<'py, PyAny>, Py<PyTuple>, Py<PyTuple>, Py<PyTuple>, Vec<String>);

#[doc = stub!("_estimate")]
#[pyfunction]
pub(crate) fn _estimate(
    found: &Bound<'_, PyAny>,
    limbs: Py<PyTuple>,
    sites: Py<PyTuple>,
    joints: Py<PyTuple>,
    sources: Vec<String>,
) -> PyResult<PyEstimate> {
    let estimate = depythonize(found)
        .map_err(|error| MeasurementError::new_err(format!("estimate: expected a pickled one, {error}")))?;
    Ok(PyEstimate { estimate, names: Arc::new(Names { limbs, sites, joints }), sources })
}

#[pymethods]
impl PyEstimate {
    #[doc = stub!("Estimate.stamp")]
    #[getter]
    fn stamp(&self) -> f64 {
        self.estimate.stamp
    }

    #[doc = stub!("Estimate.status")]
    #[getter]
    fn status(&self) -> &'static str {
        self.estimate.status.name()
    }

    #[doc = stub!("Estimate.limb_status")]
    #[getter]
    fn limb_status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(py, &self.names.limbs, self.estimate.limb_status.iter().map(|status| status.name()))
    }

    #[doc = stub!("Estimate.limb_probability")]
    #[getter]
    fn limb_probability<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(py, &self.names.limbs, self.estimate.limb_probability.iter())
    }

    #[doc = stub!("Estimate.steps")]
    #[getter]
    fn steps(&self) -> usize {
        self.estimate.steps
    }

    #[doc = stub!("Estimate.mean_squared_distance")]
    #[getter]
    fn mean_squared_distance(&self) -> f64 {
        self.estimate.mean_squared_distance
    }

    #[doc = stub!("Estimate.residual")]
    #[getter]
    fn residual(&self) -> f64 {
        self.estimate.mean_squared_distance.sqrt()
    }

    #[doc = stub!("Estimate.joint_names")]
    #[getter]
    fn joint_names(&self) -> &Py<PyTuple> {
        &self.names.sites
    }

    #[doc = stub!("Estimate.limb_names")]
    #[getter]
    fn limb_names(&self) -> &Py<PyTuple> {
        &self.names.limbs
    }

    #[doc = stub!("Estimate.joint_positions")]
    #[getter]
    fn joint_positions<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let sites = &self.estimate.sites;
        frozen(py, sites.iter().flat_map(Vec3::to_array).collect(), &[sites.len(), 3])
    }

    #[doc = stub!("Estimate.limb_poses")]
    #[getter]
    fn limb_poses<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        matrices(py, &self.estimate.world_from_limb)
    }

    #[doc = stub!("Estimate.joints")]
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.rows(&self.names.sites, &self.joint_positions(py)?)
    }

    #[doc = stub!("Estimate.world_from_limb")]
    #[getter]
    fn world_from_limb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.rows(&self.names.limbs, &self.limb_poses(py)?)
    }

    #[doc = stub!("Estimate.covariance")]
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.rows(&self.names.sites, &self.joint_covariances(py)?)
    }

    #[doc = stub!("Estimate.joint_covariances")]
    #[getter]
    fn joint_covariances<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let sites = &self.estimate.covariances.sites;
        frozen(py, sites.iter().flat_map(Mat3::to_cols_array).collect(), &[sites.len(), 3, 3])
    }

    #[doc = stub!("Estimate.joint_sigma")]
    #[getter]
    fn joint_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let sites = &self.estimate.covariances.sites;
        let sigma = sites.iter().flat_map(|covariance| (0..3).map(|axis| covariance.col(axis)[axis].sqrt()));
        self.rows(&self.names.sites, &frozen(py, sigma.collect(), &[sites.len(), 3])?)
    }

    #[doc = stub!("Estimate.limb_covariance")]
    #[getter]
    fn limb_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let limbs = &self.estimate.covariances.limbs;
        let all = limbs.iter().flatten().flatten().copied().collect();
        self.rows(&self.names.limbs, &frozen(py, all, &[limbs.len(), 6, 6])?)
    }

    #[doc = stub!("Estimate.root_covariance")]
    #[getter]
    fn root_covariance<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let root = self.estimate.covariances.limbs.first().copied().unwrap_or([[f64::NAN; 6]; 6]);
        frozen(py, root.into_iter().flatten().collect(), &[6, 6])
    }

    #[doc = stub!("Estimate.angle_covariance")]
    #[getter]
    fn angle_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let turns = &self.estimate.covariances.turns;
        // Symmetric: columns are rows.
        let all = turns.iter().flat_map(Mat3::to_cols_array).collect();
        self.rows(&self.names.joints, &frozen(py, all, &[turns.len(), 3, 3])?)
    }

    #[doc = stub!("Estimate.length_sigma")]
    #[getter]
    fn length_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(py, &self.names.limbs, self.estimate.covariances.lengths.iter().copied())
    }

    #[doc = stub!("Estimate.girth_sigma")]
    #[getter]
    fn girth_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(py, &self.names.limbs, self.estimate.covariances.girths.iter().copied())
    }

    #[doc = stub!("Estimate.limb_points")]
    #[getter]
    fn limb_points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(py, &self.names.limbs, self.estimate.limb_points.iter().copied())
    }

    #[doc = stub!("Estimate.limb_residual")]
    #[getter]
    fn limb_residual<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(py, &self.names.limbs, self.estimate.limb_residual.iter().copied())
    }

    #[doc = stub!("Estimate.joint_gaps")]
    #[getter]
    fn joint_gaps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        self.mapping(py, &self.names.joints, self.estimate.joint_gaps.iter().copied())
    }

    #[doc = stub!("Estimate.sources")]
    #[getter]
    fn sources<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let report = |index: usize| {
            let report = self.estimate.sources.get(index).copied().unwrap_or_default();
            (report.count, report.inliers, if report.inliers > 0 { report.residual } else { f64::NAN })
        };
        let reports = self.sources.iter().enumerate().map(|(index, name)| (name, report(index)));
        Ok(PyMappingProxy::new(py, reports.into_py_dict(py)?.as_mapping()))
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Plain<'py>)> {
        let [limbs, sites, joints] =
            [&self.names.limbs, &self.names.sites, &self.names.joints].map(|n| n.clone_ref(py));
        let plain = (pythonize(py, &self.estimate)?, limbs, sites, joints, self.sources.clone());
        Ok((py.import("voodoo._core")?.getattr("_estimate")?, plain))
    }

    pub fn __repr__(&self) -> String {
        format!(
            "Estimate(stamp={}, status={:?}, residual={:.4} m, steps={}, points={})",
            self.estimate.stamp,
            self.estimate.status.name(),
            self.residual(),
            self.estimate.steps,
            self.estimate.limb_points.iter().sum::<usize>()
        )
    }
}
