//! `Estimate`: a frozen copy of the result of a step, with names.

use std::sync::Arc;

use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyMappingProxy, PyTuple};
use pythonize::{depythonize, pythonize};
use voodoo_core::Body;
use voodoo_core::Estimate;
use voodoo_core::math::{Mat3, Vec3};

use crate::arrays::{frozen, matrices};
use crate::errors::MeasurementError;

/// The names for the numbers of an estimate; shared by all estimates of one body.
pub struct Names {
    pub limbs: Vec<String>,
    pub sites: Vec<String>,
    /// Name of the joint of each limb; `None` for the root.
    pub joints: Vec<Option<String>>,
    /// The sites as Python objects, since every frame reads them.
    site_tuple: PyOnceLock<Py<PyTuple>>,
}

impl Names {
    pub fn from_body(body: &Body) -> Self {
        Self::new(
            body.limbs().iter().map(|limb| limb.name.clone()).collect(),
            body.sites().iter().map(|site| site.name.clone()).collect(),
            body.limbs().iter().map(|limb| limb.parent.as_ref().map(|(_, joint)| joint.name.clone())).collect(),
        )
    }

    fn new(limbs: Vec<String>, sites: Vec<String>, joints: Vec<Option<String>>) -> Self {
        Self { limbs, sites, joints, site_tuple: PyOnceLock::new() }
    }
}

#[doc = stub!("Estimate")]
#[pyclass(name = "Estimate", module = "voodoo", frozen)]
pub struct PyEstimate {
    pub estimate: Estimate,
    pub names: Arc<Names>,
    pub sources: Vec<String>,
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

fn mapping<'py, 'a, T: IntoPyObject<'py>>(
    py: Python<'py>,
    items: impl Iterator<Item = (&'a String, T)>,
) -> PyResult<Bound<'py, PyMappingProxy>> {
    let dict = PyDict::new(py);
    for (name, value) in items {
        dict.set_item(name, value)?;
    }
    Ok(PyMappingProxy::new(py, dict.as_mapping()))
}

/// The rows of one array by name, as views, which are cheaper than separate arrays.
fn rows<'py, 'a>(
    names: impl IntoIterator<Item = &'a String>,
    all: &Array<'py>,
) -> PyResult<Bound<'py, PyMappingProxy>> {
    let dict = PyDict::new(all.py());
    for (name, row) in names.into_iter().zip(0..all.shape()[0]) {
        dict.set_item(name, all.get_item(row)?)?;
    }
    Ok(PyMappingProxy::new(all.py(), dict.as_mapping()))
}

/// The arguments of [`_estimate`]: the estimate as plain Python, and the names of limbs, sites, joints and sources.
type Plain<'py> = (Bound<'py, PyAny>, Vec<String>, Vec<String>, Vec<Option<String>>, Vec<String>);

#[doc = stub!("_estimate")]
#[pyfunction]
pub(crate) fn _estimate(
    found: &Bound<'_, PyAny>,
    limbs: Vec<String>,
    sites: Vec<String>,
    joints: Vec<Option<String>>,
    sources: Vec<String>,
) -> PyResult<PyEstimate> {
    let estimate = depythonize(found)
        .map_err(|error| MeasurementError::new_err(format!("estimate: expected a pickled one, {error}")))?;
    Ok(PyEstimate { estimate, names: Arc::new(Names::new(limbs, sites, joints)), sources })
}

#[doc = stub!("_nobody")]
#[pyfunction]
pub(crate) fn _nobody(stamp: f64) -> PyEstimate {
    let mut estimate = Estimate::default();
    estimate.stamp = stamp;
    PyEstimate { estimate, names: Arc::new(Names::new(Vec::new(), Vec::new(), Vec::new())), sources: Vec::new() }
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
        mapping(py, self.names.limbs.iter().zip(self.estimate.limb_status.iter().map(|status| status.name())))
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
    fn joint_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let made = || PyTuple::new(py, &self.names.sites).map(Bound::unbind);
        self.names.site_tuple.get_or_try_init(py, made).map(|names| names.bind(py).clone())
    }

    #[doc = stub!("Estimate.limb_names")]
    #[getter]
    fn limb_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.names.limbs)
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
        rows(&self.names.sites, &self.joint_positions(py)?)
    }

    #[doc = stub!("Estimate.world_from_limb")]
    #[getter]
    fn world_from_limb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        rows(&self.names.limbs, &self.limb_poses(py)?)
    }

    #[doc = stub!("Estimate.covariance")]
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        rows(&self.names.sites, &self.joint_covariances(py)?)
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
        rows(&self.names.sites, &frozen(py, sigma.collect(), &[sites.len(), 3])?)
    }

    #[doc = stub!("Estimate.limb_covariance")]
    #[getter]
    fn limb_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let limbs = &self.estimate.covariances.limbs;
        let all = limbs.iter().flatten().flatten().copied().collect();
        rows(&self.names.limbs, &frozen(py, all, &[limbs.len(), 6, 6])?)
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
        let turns = self.names.joints.iter().zip(&self.estimate.covariances.turns);
        let (names, turns): (Vec<_>, Vec<_>) = turns.filter_map(|(name, turn)| Some((name.as_ref()?, turn))).unzip();
        // Symmetric: columns are rows.
        let all = turns.iter().flat_map(|turn: &&Mat3| turn.to_cols_array()).collect();
        rows(names, &frozen(py, all, &[turns.len(), 3, 3])?)
    }

    #[doc = stub!("Estimate.length_sigma")]
    #[getter]
    fn length_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        mapping(py, self.names.limbs.iter().zip(self.estimate.covariances.lengths.iter().copied()))
    }

    #[doc = stub!("Estimate.girth_sigma")]
    #[getter]
    fn girth_sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        mapping(py, self.names.limbs.iter().zip(self.estimate.covariances.girths.iter().copied()))
    }

    #[doc = stub!("Estimate.limb_points")]
    #[getter]
    fn limb_points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        mapping(py, self.names.limbs.iter().zip(self.estimate.limb_points.iter().copied()))
    }

    #[doc = stub!("Estimate.limb_residual")]
    #[getter]
    fn limb_residual<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        mapping(py, self.names.limbs.iter().zip(self.estimate.limb_residual.iter().copied()))
    }

    #[doc = stub!("Estimate.joint_gaps")]
    #[getter]
    fn joint_gaps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let gaps = self.names.joints.iter().zip(&self.estimate.joint_gaps);
        mapping(py, gaps.filter_map(|(name, gap)| Some((name.as_ref()?, *gap))))
    }

    #[doc = stub!("Estimate.sources")]
    #[getter]
    fn sources<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let reports = self.sources.iter().enumerate().map(|(index, name)| {
            let report = self.estimate.sources.get(index).copied().unwrap_or_default();
            let residual = if report.inliers > 0 { report.residual } else { f64::NAN };
            (name, (report.count, report.inliers, residual))
        });
        mapping(py, reports)
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Plain<'py>)> {
        let Names { limbs, sites, joints, .. } = &*self.names;
        let found = pythonize(py, &self.estimate)?;
        let plain = (found, limbs.clone(), sites.clone(), joints.clone(), self.sources.clone());
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
