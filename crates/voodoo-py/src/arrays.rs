//! Conversion from and to NumPy arrays.

use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::type_object::PyTypeInfo;
use voodoo_core::Body;
use voodoo_core::Limb;
use voodoo_core::PointSlice;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3};

use crate::errors::{exception, wrong_argument};

/// Points as passed by the caller: single or double precision, contiguous.
pub(crate) enum PointArray {
    F32(Py<PyArray2<f32>>),
    F64(Py<PyArray2<f64>>),
}

/// A borrow of a [`PointArray`].
pub(crate) enum PointView<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

impl PointArray {
    /// Takes an `(N, 3)` array of float32 or float64; copies only what is not contiguous and aligned.
    pub(crate) fn new(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = value.py();
        let wrong = || {
            let found = match value.cast::<PyUntypedArray>() {
                Ok(array) => format!("shape {:?}, dtype {}", array.shape(), array.dtype()),
                Err(_) => value.get_type().to_string(),
            };
            exception(
                py,
                "MeasurementError",
                format!("{name}: expected an array of shape (N, 3) and dtype float32 or float64, found {found}"),
            )
        };
        let array = value.cast::<PyUntypedArray>().map_err(|_| wrong())?;
        if array.ndim() != 2 || array.shape()[1] != 3 {
            return Err(wrong());
        }
        unmasked(name, value, "leave the masked rows out: points.data[~numpy.ma.getmaskarray(points).any(axis=1)]")?;
        let contiguous = contiguous(value)?;
        if let Ok(array) = contiguous.cast::<PyArray2<f32>>() {
            Ok(Self::F32(array.clone().unbind()))
        } else if let Ok(array) = contiguous.cast::<PyArray2<f64>>() {
            Ok(Self::F64(array.clone().unbind()))
        } else {
            Err(wrong())
        }
    }

    pub(crate) fn view<'py>(&self, py: Python<'py>) -> PointView<'py> {
        match self {
            Self::F32(array) => PointView::F32(array.bind(py).readonly()),
            Self::F64(array) => PointView::F64(array.bind(py).readonly()),
        }
    }
}

impl PointView<'_> {
    pub(crate) fn slice(&self) -> PyResult<PointSlice<'_>> {
        Ok(match self {
            Self::F32(view) => PointSlice::F32(view.as_slice()?.as_chunks().0),
            Self::F64(view) => PointSlice::F64(view.as_slice()?.as_chunks().0),
        })
    }
}

/// Rejects NumPy's masked arrays: masked entries are ordinary numbers and would count as measured.
pub(crate) fn unmasked(name: &str, value: &Bound<'_, PyAny>, instead: &str) -> PyResult<()> {
    if value.hasattr("mask")? {
        let text = format!("{name}: expected an array without a mask, found a masked one; {instead}");
        return Err(exception(value.py(), "MeasurementError", text));
    }
    Ok(())
}

/// The array itself or a copy, C-contiguous and aligned.
pub(crate) fn contiguous<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let array = value.cast::<PyUntypedArray>()?;
    if array.is_c_contiguous() && value.getattr("flags")?.getattr("aligned")?.is_truthy()? {
        return Ok(value.clone());
    }
    let (py, expected) = (value.py(), ["C", "A", "E"]);
    py.import("numpy")?.call_method1("require", (value, py.None(), expected))
}

/// Rows of three numbers.
pub(crate) fn rows<'a, const N: usize>(name: &str, array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<&'a [[f64; N]]> {
    if array.dims()[1] == N {
        return Ok(array.as_slice()?.as_chunks().0);
    }
    let text = format!("{name}: expected shape (N, {N}), found {:?}", array.shape());
    Err(exception(array.py(), "MeasurementError", text))
}

/// The entries of a C-contiguous array of double precision with the given shape; `None` for anything else, including masked
/// arrays.
///
/// Sequences are converted number by number, which takes many times as long.
fn entries<const N: usize>(value: &Bound<'_, PyAny>, shape: &[usize]) -> Option<[f64; N]> {
    let array = value.cast::<PyArrayDyn<f64>>().ok()?;
    let plain = value.get_type().is(PyUntypedArray::type_object(value.py())) && array.shape() == shape;
    let view = if plain { array.try_readonly().ok()? } else { return None };
    view.as_slice().ok()?.try_into().ok()
}

/// A vector from anything with three numbers.
pub(crate) fn vector(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec3> {
    if let Some(numbers) = entries(value, &[3]) {
        return Ok(Vec3::from_array(numbers));
    }
    value
        .extract::<[f64; 3]>()
        .map(Vec3::from_array)
        .map_err(|_| wrong_argument(value.py(), name, "three numbers", value))
}

/// A pose from a rigid 4x4 matrix; the identity without one.
pub(crate) fn pose(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Pose> {
    let Some(value) = value else { return Ok(Pose::IDENTITY) };
    let wrong = || wrong_argument(value.py(), name, "a rigid 4x4 transform", value);
    let rows: [[f64; 4]; 4] = match entries::<16>(value, &[4, 4]) {
        Some(numbers) => [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| numbers[4 * row + column])),
        None => value.extract().map_err(|_| wrong())?,
    };
    let rotation = Mat3::from_cols_array_2d(&[
        [rows[0][0], rows[0][1], rows[0][2]],
        [rows[1][0], rows[1][1], rows[1][2]],
        [rows[2][0], rows[2][1], rows[2][2]],
    ])
    .transpose();
    let error = (rotation * rotation.transpose() - Mat3::IDENTITY)
        .to_cols_array()
        .iter()
        .fold(0.0_f64, |worst, entry| worst.max(entry.abs()));
    let translation = Vec3::new(rows[0][3], rows[1][3], rows[2][3]);
    // NaN fails every comparison, so each comparison is written to be true for valid values only.
    if !(error < 1e-4 && rotation.determinant() > 0.0 && translation.is_finite() && rows[3] == [0.0, 0.0, 0.0, 1.0]) {
        return Err(wrong());
    }
    Ok(Pose::from_parts(translation, Quat::from_mat3(&rotation).normalize()))
}

/// Poses of all limbs of a body, in their order; the error for a pose that is not rigid names its limb.
pub(crate) fn limb_poses(body: &Body, values: &[Bound<'_, PyAny>]) -> PyResult<Vec<Pose>> {
    let named = |(index, value): (usize, &Bound<'_, PyAny>)| {
        let name = body.limbs().get(index).map_or("?", |limb: &Limb| limb.name.as_str());
        pose(&format!("world_from_limb[{name}]"), Some(value))
    };
    values.iter().enumerate().map(named).collect()
}

/// A read-only array of a given shape.
pub(crate) fn frozen<'py>(py: Python<'py>, values: Vec<f64>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let array = PyArray1::from_vec(py, values).reshape(shape)?;
    array.try_readwrite()?.make_nonwriteable();
    Ok(array)
}
