//! `Estimate`: a frozen copy of what a step found, with names.

use std::sync::Arc;

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMappingProxy, PyTuple};
use voodoo_core::estimate::{Estimate, LimbStatus, Status};
use voodoo_core::{Body, geometry::Vec3};

use crate::arrays::{frozen, matrix};

/// The names that the numbers of an estimate belong to; shared by all estimates of one body.
pub struct Names {
    pub limbs: Vec<String>,
    pub sites: Vec<String>,
    /// Name of the joint of each limb; `None` for the root.
    pub joints: Vec<Option<String>>,
}

impl Names {
    pub fn of(body: &Body) -> Self {
        Self {
            limbs: body.limbs().iter().map(|limb| limb.name.clone()).collect(),
            sites: body.sites().iter().map(|site| site.name.clone()).collect(),
            joints: body.limbs().iter().map(|limb| limb.parent.as_ref().map(|(_, joint)| joint.name.clone())).collect(),
        }
    }
}

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

pub fn status_word(status: Status) -> &'static str {
    match status {
        Status::Tracking => "tracking",
        Status::Degraded => "degraded",
        Status::Lost => "lost",
    }
}

fn limb_status_word(status: LimbStatus) -> &'static str {
    match status {
        LimbStatus::Measured => "measured",
        LimbStatus::Inferred => "inferred",
        LimbStatus::Lost => "lost",
    }
}

#[pymethods]
impl PyEstimate {
    #[getter]
    fn stamp(&self) -> f64 {
        self.estimate.stamp
    }

    #[getter]
    fn status(&self) -> &'static str {
        status_word(self.estimate.status)
    }

    #[getter]
    fn limb_status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        mapping(py, self.names.limbs.iter().zip(self.estimate.limb_status.iter().copied().map(limb_status_word)))
    }

    #[getter]
    fn steps(&self) -> usize {
        self.estimate.steps
    }

    #[getter]
    fn mean_squared_distance(&self) -> f64 {
        self.estimate.mean_squared_distance
    }

    #[getter]
    fn residual(&self) -> f64 {
        self.estimate.mean_squared_distance.sqrt()
    }

    #[getter]
    fn joint_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.names.sites)
    }

    #[getter]
    fn limb_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.names.limbs)
    }

    #[getter]
    fn joint_positions<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let sites = &self.estimate.sites;
        frozen(py, sites.iter().flat_map(Vec3::to_array).collect(), &[sites.len(), 3])
    }

    #[getter]
    fn limb_poses<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let poses = &self.estimate.world_from_limb;
        frozen(py, poses.iter().flat_map(|pose| matrix(pose).into_iter().flatten()).collect(), &[poses.len(), 4, 4])
    }

    #[getter]
    fn joints<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let (py, this) = (slf.py(), slf.get());
        let dict = PyDict::new(py);
        for (name, site) in this.names.sites.iter().zip(&this.estimate.sites) {
            dict.set_item(name, frozen(py, site.to_array().to_vec(), &[3])?)?;
        }
        Ok(PyMappingProxy::new(py, dict.as_mapping()))
    }

    #[getter]
    fn world_from_limb<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let (py, this) = (slf.py(), slf.get());
        let dict = PyDict::new(py);
        for (name, pose) in this.names.limbs.iter().zip(&this.estimate.world_from_limb) {
            dict.set_item(name, frozen(py, matrix(pose).into_iter().flatten().collect(), &[4, 4])?)?;
        }
        Ok(PyMappingProxy::new(py, dict.as_mapping()))
    }

    #[getter]
    fn limb_points<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let this = slf.get();
        mapping(slf.py(), this.names.limbs.iter().zip(this.estimate.limb_points.iter().copied()))
    }

    #[getter]
    fn limb_residual<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let this = slf.get();
        mapping(slf.py(), this.names.limbs.iter().zip(this.estimate.limb_residual.iter().copied()))
    }

    #[getter]
    fn joint_gaps<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let this = slf.get();
        let gaps = this.names.joints.iter().zip(&this.estimate.joint_gaps);
        mapping(slf.py(), gaps.filter_map(|(name, gap)| Some((name.as_ref()?, *gap))))
    }

    /// Source name -> (count, inliers, residual in metres).
    #[getter]
    fn sources<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyMappingProxy>> {
        let this = slf.get();
        let reports = this.sources.iter().enumerate().map(|(index, name)| {
            let report = this.estimate.sources.get(index).copied().unwrap_or_default();
            let residual = if report.inliers > 0 { report.residual } else { f64::NAN };
            (name, (report.count, report.inliers, residual))
        });
        mapping(slf.py(), reports)
    }

    pub fn __repr__(&self) -> String {
        format!(
            "Estimate(stamp={}, status={:?}, residual={:.4} m, steps={}, points={})",
            self.estimate.stamp,
            status_word(self.estimate.status),
            self.residual(),
            self.estimate.steps,
            self.estimate.limb_points.iter().sum::<usize>()
        )
    }
}
