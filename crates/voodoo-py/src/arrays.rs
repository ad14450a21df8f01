//! Conversion from and to NumPy arrays.

use std::convert::Infallible;

use numpy::{
    PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::type_object::PyTypeInfo;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3, matrix};
use voodoo_core::{Body, ColorPixels, DepthPixels, Limb, PointSlice};

use crate::errors::{unless, wrong_argument};

/// A borrow of points `(N, 3)`, contiguous and aligned.
#[derive(FromPyObject)]
pub(crate) enum PointView<'py> {
    Single(PyReadonlyArray2<'py, f32>),
    Double(PyReadonlyArray2<'py, f64>),
}

/// What is expected of an array for a [`DepthView`].
pub(crate) const DEPTH_ARRAY: &str = "an array of shape (height, width) and dtype uint16 or float32";

/// A borrow of a depth image `(height, width)`, contiguous and aligned.
#[derive(FromPyObject)]
pub(crate) enum DepthView<'py> {
    Units(PyReadonlyArray2<'py, u16>),
    Float(PyReadonlyArray2<'py, f32>),
}

/// A borrow of an image `(height, width, 3)` or `(height, width)`, contiguous and aligned.
#[derive(FromPyObject)]
pub(crate) enum ColorView<'py> {
    Color(PyReadonlyArray3<'py, u8>),
    Gray(PyReadonlyArray2<'py, u8>),
}

impl PointView<'_> {
    pub(crate) fn points(&self) -> PyResult<PointSlice<'_>> {
        Ok(match self {
            Self::Single(view) => PointSlice::F32(view.as_slice()?.as_chunks().0),
            Self::Double(view) => PointSlice::F64(view.as_slice()?.as_chunks().0),
        })
    }
}

impl DepthView<'_> {
    pub(crate) fn pixels(&self) -> PyResult<DepthPixels<'_>> {
        Ok(match self {
            Self::Units(view) => DepthPixels::U16(view.as_slice()?),
            Self::Float(view) => DepthPixels::F32(view.as_slice()?),
        })
    }
}

impl ColorView<'_> {
    pub(crate) fn pixels(&self) -> PyResult<ColorPixels<'_>> {
        Ok(match self {
            Self::Color(view) => ColorPixels::Color(view.as_slice()?.as_chunks().0),
            Self::Gray(view) => ColorPixels::Gray(view.as_slice()?),
        })
    }
}

/// The array, copied only where it is not contiguous and aligned. None where `View` is no borrow of it.
pub(crate) fn viewable<'py, View>(value: &Bound<'py, PyAny>) -> Option<Bound<'py, PyAny>>
where
    View: for<'a> FromPyObject<'a, 'py>,
{
    contiguous(value).ok().filter(|array| array.extract::<View>().is_ok())
}

/// An `(N, 3)` array of float32 or float64 without a mask, for a [`PointView`].
pub(crate) fn points<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let expected = "an array of shape (N, 3) and dtype float32 or float64";
    let wrong = |found: &Bound<'_, PyAny>| wrong_argument(name, expected, found);
    let array = value.cast::<PyUntypedArray>().map_err(|_| wrong(&value.get_type()))?;
    if array.ndim() != 2 || array.shape()[1] != 3 {
        return Err(wrong(value));
    }
    unmasked(name, value, "leave the masked rows out: points.data[~numpy.ma.getmaskarray(points).any(axis=1)]")?;
    viewable::<PointView>(value).ok_or_else(|| wrong(value))
}

/// An image of dtype uint8, for a [`ColorView`], and its height and width.
pub(crate) fn picture<'py>(image: &Bound<'py, PyAny>) -> Option<(Bound<'py, PyAny>, [usize; 2])> {
    let shape = image.cast::<PyUntypedArray>().ok()?.shape();
    let ([height, width] | [height, width, 3]) = *shape else { return None };
    Some((viewable::<ColorView>(image)?, [height, width]))
}

/// A vector that becomes an array (3,).
#[derive(Clone, Copy)]
pub(crate) struct Row(pub(crate) Vec3);

impl<'py> IntoPyObject<'py> for Row {
    type Target = PyArray1<f64>;
    type Output = Bound<'py, PyArray1<f64>>;
    type Error = Infallible;

    fn into_pyobject(self, py: Python<'py>) -> Result<Self::Output, Infallible> {
        Ok(PyArray1::from_slice(py, &self.0.to_array()))
    }
}

pub(crate) type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// Rejects NumPy's masked arrays: masked entries are ordinary numbers and would count as measured.
pub(crate) fn unmasked(name: &str, value: &Bound<'_, PyAny>, instead: &str) -> PyResult<()> {
    unless(!value.hasattr("mask")?, name, "an array without a mask", format_args!("a masked one; {instead}"))
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
    let (expected, found) = (format_args!("shape (N, {N})"), format_args!("{:?}", array.shape()));
    unless(array.dims()[1] == N, name, expected, found)?;
    unless(array.is_c_contiguous(), name, "C-contiguous memory", "another order")?;
    Ok(array.as_slice()?.as_chunks().0)
}

/// Rows of vectors.
pub(crate) fn vectors(name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Vec3>> {
    Ok(rows(name, array)?.iter().map(|place| Vec3::from_array(*place)).collect())
}

/// The entries of a C-contiguous array of double precision with the given shape; `None` for anything else, including masked
/// arrays.
///
/// Sequences are converted number by number, which takes many times as long.
fn entries<const N: usize>(value: &Bound<'_, PyAny>, shape: &[usize]) -> Option<[f64; N]> {
    let array = value.cast::<PyArrayDyn<f64>>().ok()?;
    let is_plain = value.get_type().is(PyUntypedArray::type_object(value.py()));
    let view = if is_plain && array.shape() == shape && array.is_c_contiguous() {
        array.try_readonly().ok()?
    } else {
        return None;
    };
    view.as_slice().ok()?.try_into().ok()
}

/// A vector from anything with three numbers.
pub(crate) fn vector(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec3> {
    if let Some(numbers) = entries(value, &[3]) {
        return Ok(Vec3::from_array(numbers));
    }
    value.extract::<[f64; 3]>().map(Vec3::from_array).map_err(|_| wrong_argument(name, "three numbers", value))
}

/// A pose from a rigid 4x4 matrix; the identity without one.
pub(crate) fn pose(name: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Pose> {
    let Some(value) = value else { return Ok(Pose::IDENTITY) };
    let wrong = || wrong_argument(name, "a rigid 4x4 transform", value);
    let rows: [[f64; 4]; 4] = match entries::<16>(value, &[4, 4]) {
        Some(numbers) => [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| numbers[4 * row + column])),
        None => value.extract().map_err(|_| wrong())?,
    };
    let rotation =
        Mat3::from_cols_array_2d(&[0, 1, 2].map(|row| [0, 1, 2].map(|column| rows[row][column]))).transpose();
    let errors = (rotation * rotation.transpose() - Mat3::IDENTITY).to_cols_array();
    let error = errors.iter().fold(0.0_f64, |worst, entry| worst.max(entry.abs()));
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

/// The 4x4 matrices of poses, read-only.
pub(crate) fn matrices<'py>(py: Python<'py>, poses: &[Pose]) -> PyResult<Array<'py>> {
    frozen(py, poses.iter().flat_map(matrix).flatten().collect(), &[poses.len(), 4, 4])
}

/// An array of a given shape.
pub(crate) fn array<'py>(py: Python<'py>, values: Vec<f64>, shape: &[usize]) -> PyResult<Array<'py>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

/// A read-only array of a given shape.
pub(crate) fn frozen<'py>(py: Python<'py>, values: Vec<f64>, shape: &[usize]) -> PyResult<Array<'py>> {
    let array = array(py, values, shape)?;
    array.try_readwrite()?.make_nonwriteable();
    Ok(array)
}
