//! Rotations of many frames and limbs at once.

use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use voodoo_core::math::{self, Mat3};

use crate::arrays::{Array, array};
use crate::errors::MeasurementError;

/// The leading axes of an array that ends with the given ones.
fn leading<'a>(array: &'a PyReadonlyArrayDyn<'_, f64>, last: &[usize]) -> PyResult<&'a [usize]> {
    array.shape().strip_suffix(last).ok_or_else(|| {
        let text = format!("rotations: expected shape (..., {last:?}), found {:?}", array.shape());
        MeasurementError::new_err(text)
    })
}

#[doc = stub!("quaternions")]
#[pyfunction]
pub(crate) fn quaternions<'py>(
    py: Python<'py>,
    rotations: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<(Array<'py>, bool)> {
    let shape = [leading(&rotations, &[3, 3])?, &[4]].concat();
    let (mut found, mut skewed) = (Vec::with_capacity(shape.iter().product()), false);
    for rows in rotations.as_slice()?.as_chunks::<9>().0 {
        let matrix = Mat3::from_cols_array(rows).transpose();
        found.extend(math::quaternion(&matrix));
        skewed |= math::is_skewed(&matrix);
    }
    Ok((array(py, found, &shape)?, skewed))
}

/// Whether Euler angles can be about these axes.
pub(crate) fn are_axes(order: [usize; 3]) -> bool {
    order[0] != order[1] && order[1] != order[2] && order.iter().all(|axis| *axis < 3)
}

#[doc = stub!("euler_angles")]
#[pyfunction]
pub(crate) fn euler_angles<'py>(
    py: Python<'py>,
    quaternions: PyReadonlyArrayDyn<'py, f64>,
    order: [usize; 3],
) -> PyResult<Array<'py>> {
    let shape = [leading(&quaternions, &[4])?, &[3]].concat();
    if !are_axes(order) {
        return Err(MeasurementError::new_err(format!("order: expected axes that differ, found {order:?}")));
    }
    let rows = quaternions.as_slice()?.as_chunks::<4>().0;
    let found = rows.iter().flat_map(|row| math::euler_angles(row, order)).collect();
    array(py, found, &shape)
}
