//! `TaperedEllipticCylinder`.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use voodoo_core::math::{Points, Pose};
use voodoo_core::{SurfaceBatch, TaperedEllipticCylinder};

use crate::arguments;
use crate::arrays::{PointView, Row, points, vector};
use crate::errors::{BodyError, MeasurementError, wrong_argument};

#[doc = stub!("TaperedEllipticCylinder")]
#[pyclass(name = "TaperedEllipticCylinder", module = "voodoo", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct PyShape(pub TaperedEllipticCylinder);

#[doc = stub!("ClosestPoints")]
#[pyclass(name = "ClosestPoints", module = "voodoo", frozen, get_all)]
pub(crate) struct PyClosestPoints {
    points: Py<PyArray2<f32>>,
    normals: Py<PyArray2<f32>>,
    signed_distance: Py<PyArray1<f32>>,
    region: Py<PyArray1<u8>>,
}

#[pymethods]
impl PyShape {
    #[new]
    fn new(
        #[pyo3(from_py_with = arguments::length)] length: f64,
        #[pyo3(from_py_with = arguments::a0)] a0: f64,
        #[pyo3(from_py_with = arguments::b0)] b0: f64,
        #[pyo3(from_py_with = arguments::a1)] a1: f64,
        #[pyo3(from_py_with = arguments::b1)] b1: f64,
    ) -> PyResult<Self> {
        let shape = TaperedEllipticCylinder::new(length, a0, b0, a1, b1);
        shape.map(Self).map_err(|error| BodyError::new_err(error.to_string()))
    }

    #[doc = stub!("TaperedEllipticCylinder.length")]
    #[getter]
    fn length(&self) -> f64 {
        self.0.length()
    }

    #[doc = stub!("TaperedEllipticCylinder.a0")]
    #[getter]
    fn a0(&self) -> f64 {
        self.0.a0()
    }

    #[doc = stub!("TaperedEllipticCylinder.b0")]
    #[getter]
    fn b0(&self) -> f64 {
        self.0.b0()
    }

    #[doc = stub!("TaperedEllipticCylinder.a1")]
    #[getter]
    fn a1(&self) -> f64 {
        self.0.a1()
    }

    #[doc = stub!("TaperedEllipticCylinder.b1")]
    #[getter]
    fn b1(&self) -> f64 {
        self.0.b1()
    }

    #[doc = stub!("TaperedEllipticCylinder.closest_point")]
    fn closest_point(&self, point: &Bound<'_, PyAny>) -> PyResult<(Row, Row, f64)> {
        let query = vector("point", point)?;
        if !query.is_finite() {
            return Err(wrong_argument("point", "finite meters", point));
        }
        let found = self.0.closest_point(query);
        Ok((Row(found.point), Row(found.normal), found.signed_distance))
    }

    #[doc = stub!("TaperedEllipticCylinder.closest_points")]
    fn closest_points(&self, py: Python<'_>, points: &Bound<'_, PyAny>) -> PyResult<PyClosestPoints> {
        let view: PointView = self::points("points", points)?.extract()?;
        let slice = view.points()?;
        if let Some(row) = (0..slice.len()).rfind(|row| !slice.get(*row).is_finite()) {
            let found = format!("points: expected finite meters, found {:?} in row {row}", slice.get(row).to_array());
            return Err(MeasurementError::new_err(found));
        }
        let batch = py.detach(|| {
            let (mut queries, mut batch) = (Points::default(), SurfaceBatch::default());
            for index in 0..slice.len() {
                queries.push(slice.get(index).as_vec3().to_array());
            }
            self.0.closest_points(&Pose::IDENTITY, &queries, &mut batch);
            batch
        });
        let interleave = |Points { x, y, z }: &Points| {
            let values = x.iter().zip(y).zip(z).flat_map(|((x, y), z)| [*x, *y, *z]).collect();
            PyArray1::from_vec(py, values).reshape([x.len(), 3]).map(Bound::unbind)
        };
        Ok(PyClosestPoints {
            points: interleave(&batch.points)?,
            normals: interleave(&batch.normals)?,
            signed_distance: PyArray1::from_vec(py, batch.signed_distance).unbind(),
            region: PyArray1::from_iter(py, batch.region.iter().map(|region| *region as u8)).unbind(),
        })
    }

    /// For pickle and copy.
    fn __getnewargs__(&self) -> (f64, f64, f64, f64, f64) {
        (self.0.length(), self.0.a0(), self.0.b0(), self.0.a1(), self.0.b1())
    }

    fn __repr__(&self) -> String {
        let (length, a0, b0, a1, b1) = self.__getnewargs__();
        format!("TaperedEllipticCylinder(length={length}, a0={a0}, b0={b0}, a1={a1}, b1={b1})")
    }

    /// Names of the values of `ClosestPoints.region`.
    #[classattr]
    #[pyo3(name = "REGIONS")]
    fn regions() -> [&'static str; 5] {
        // In the order of `voodoo_core::Region`.
        ["side", "proximal_cap", "distal_cap", "proximal_rim", "distal_rim"]
    }
}
