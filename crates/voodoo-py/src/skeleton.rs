//! Rotations and poses of many frames, or of persons of one instant, as files and live outputs need them.

use numpy::{PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::f64::consts::PI;
use voodoo_core::math::{self, Mat3, Vec3};
use voodoo_core::{Body, Limb, Unexpected};

use crate::arrays::{Array, array};
use crate::body::{PyBody, at_rest};
use crate::errors::{MeasurementError, raise, unless};

pub(crate) type Given<'py> = PyReadonlyArrayDyn<'py, f64>;
/// A table of numbers, which is read faster than tuples.
pub(crate) type Plan<'py> = PyReadonlyArray2<'py, i64>;

/// Rows of `N` numbers of each frame of an array (F, K, ...).
pub(crate) fn frames<'a, const N: usize>(
    name: &str,
    array: &'a PyReadonlyArrayDyn<'_, f64>,
) -> PyResult<Vec<&'a [[f64; N]]>> {
    let shape = array.shape();
    let valid = shape.len() >= 2 && shape[2..].iter().product::<usize>() == N && array.is_c_contiguous();
    let expected = format_args!("contiguous frames of rows of {N} numbers");
    unless(valid, name, expected, format_args!("shape {shape:?}"))?;
    let rows = array.as_slice()?.as_chunks::<N>().0;
    Ok((0..shape[0]).map(|frame| rows.get(frame * shape[1]..(frame + 1) * shape[1]).unwrap_or_default()).collect())
}

/// Rows of a plan.
pub(crate) fn plan<'a, const N: usize>(plan: &'a Plan<'_>) -> PyResult<&'a [[i64; N]]> {
    let columns = plan.shape()[1];
    unless(columns == N && plan.is_c_contiguous(), "plan", format_args!("{N} columns"), columns)?;
    Ok(plan.as_slice()?.as_chunks().0)
}

/// The entry with a number of a plan.
fn entry<T>(entries: &[T], number: i64) -> Option<&T> {
    entries.get(usize::try_from(number).ok()?)
}

fn wrong(name: &str, expected: &str) -> PyErr {
    MeasurementError::new_err(format!("{name}: expected {expected}"))
}

pub(crate) fn unplanned() -> PyErr {
    wrong("plan", "numbers of limbs, joints and frames that are there, and axes that differ")
}

pub(crate) fn rotation(rows: &[f64; 9]) -> Mat3 {
    Mat3::from_cols_array(rows).transpose()
}

pub(crate) fn poses_of(rows: &[[f64; 16]]) -> Vec<(Mat3, Vec3)> {
    rows.iter().map(parts).collect()
}

pub(crate) fn points_of(rows: &[[f64; 3]]) -> Vec<Vec3> {
    rows.iter().copied().map(Vec3::from_array).collect()
}

/// Rotation and translation of a 4x4 matrix.
pub(crate) fn parts(m: &[f64; 16]) -> (Mat3, Vec3) {
    (rotation(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]), Vec3::new(m[3], m[7], m[11]))
}

/// Rotations of the bones of a posed body, and where they are joined to their parents.
pub(crate) fn bones(
    body: &Body,
    poses: &[(Mat3, Vec3)],
    joints: &[Vec3],
    own: &[[i64; 2]],
) -> Option<(Vec<Mat3>, Vec<Vec3>)> {
    let found = at_rest(body).into_iter().zip(poses);
    let found = found.map(|((rest, place), &(limb, at))| (limb * rest.transpose(), limb * place + at));
    let (turns, mut heads): (Vec<_>, Vec<_>) = found.unzip();
    for &[limb, joint] in own {
        *heads.get_mut(usize::try_from(limb).ok()?)? = *entry(joints, joint)?;
    }
    (turns.len() == body.limbs().len() && poses.len() == turns.len()).then_some((turns, heads))
}

/// Place and quaternion of each frame of a plan on its parent.
pub(crate) fn placed_frames(turns: &[Mat3], points: &[Vec3], plan: &[[i64; 4]]) -> Option<Vec<[f64; 7]>> {
    let there = |&[limb, first, second, _]: &[i64; 4]| {
        Some((*entry(turns, limb)?, (*entry(points, first)? + *entry(points, second)?) / 2.0))
    };
    let found = plan.iter().map(there).collect::<Option<Vec<_>>>()?;
    let on_parent = |((turn, place), &[.., parent]): (&(Mat3, Vec3), &[i64; 4])| {
        let (turn, place) = entry(&found, parent).map_or((*turn, *place), |(above, origin)| {
            (above.transpose() * *turn, above.transpose() * (*place - *origin))
        });
        let ([x, y, z], [a, b, c, d]) = (place.to_array(), math::quaternion(&turn));
        [x, y, z, a, b, c, d]
    };
    Some(found.iter().zip(plan).map(on_parent).collect())
}

pub(crate) fn angles(turns: &[Mat3], plan: &[[i64; 8]]) -> Option<Vec<f64>> {
    let wrapped = |angle: f64| (angle + PI).rem_euclid(2.0 * PI) - PI;
    let mut last: Option<(&[i64], [f64; 3])> = None;
    let angle = |row| {
        let &[above, limb, first, second, third, which, sign, shifted] = row;
        // Angles of the same joint follow each other.
        let (joint, _) = row.split_at(5);
        let found = match last {
            Some((same, found)) if same == joint => found,
            _ => {
                let quaternion = math::quaternion(&(entry(turns, above)?.transpose() * *entry(turns, limb)?));
                if first < 0 {
                    [wrapped(2.0 * quaternion[1].atan2(quaternion[3])); 3]
                } else {
                    let order = [first, second, third].map(|axis| usize::try_from(axis).unwrap_or(usize::MAX));
                    are_axes(order).then(|| math::euler_angles(&quaternion, order))?
                }
            }
        };
        last = Some((joint, found));
        let found = *entry(&found, which)?;
        let found = if shifted != 0 { wrapped(found + PI) } else { found };
        Some(if sign < 0 { -found } else { found })
    };
    plan.iter().map(angle).collect()
}

/// The covariance of a pose, place before turn, of another point, which is away from its point; turned before.
pub(crate) fn moved_covariance(covariance: &[[f64; 6]; 6], turn: &Mat3, across: Vec3) -> [[f64; 6]; 6] {
    let [x, y, z] = across.to_array();
    let lever = Mat3::from_cols(Vec3::new(0.0, -z, y), Vec3::new(z, 0.0, -x), Vec3::new(-y, x, 0.0));
    let moved = |column: [f64; 6]| {
        let [a, b, c, d, e, f] = column;
        let (place, angle) = (*turn * Vec3::new(a, b, c), *turn * Vec3::new(d, e, f));
        let ([a, b, c], [d, e, f]) = ((place + lever * angle).to_array(), angle.to_array());
        [a, b, c, d, e, f]
    };
    let transposed =
        |rows: &[[f64; 6]; 6]| [0, 1, 2, 3, 4, 5].map(|at: usize| std::array::from_fn(|row| rows[row][at]));
    let half: [[f64; 6]; 6] = transposed(covariance).map(moved);
    transposed(&half).map(moved)
}

/// Middle, rotation x, y, z, w, both diameters, length, and scales of both ends of a limb's cylinder.
pub(crate) fn cylinder(Limb { shape, .. }: &Limb, &(turn, at): &(Mat3, Vec3)) -> [f64; 12] {
    let ([x, y, z], [i, j, k, w]) = ((at + turn.z_axis * (shape.length() / 2.0)).to_array(), math::quaternion(&turn));
    let (a, b) = (shape.a0() + shape.a1(), shape.b0() + shape.b1());
    let low = shape.a0() / a + shape.b0() / b;
    [x, y, z, i, j, k, w, a, b, shape.length(), low, 2.0 - low]
}

#[doc = stub!("skeleton")]
#[pyfunction]
pub(crate) fn skeleton<'py>(
    py: Python<'py>,
    body: &PyBody,
    poses: Given<'py>,
    joints: Given<'py>,
    own: Plan<'py>,
) -> PyResult<(Array<'py>, Array<'py>)> {
    let (poses, joints, own) = (frames("poses", &poses)?, frames("joints", &joints)?, plan(&own)?);
    let (mut turns, mut heads) = (Vec::new(), Vec::new());
    for (poses, joints) in poses.iter().zip(&joints) {
        let (poses, joints) = (poses_of(poses), points_of(joints));
        let found = bones(&body.0, &poses, &joints, own).ok_or_else(unplanned)?;
        turns.extend(found.0.iter().flat_map(|turn| turn.transpose().to_cols_array()));
        heads.extend(found.1.iter().flat_map(Vec3::to_array));
    }
    let (count, limbs) = (poses.len(), body.0.limbs().len());
    Ok((array(py, turns, &[count, limbs, 3, 3])?, array(py, heads, &[count, limbs, 3])?))
}

/// The leading axes of an array that ends with the given ones.
fn leading<'a>(array: &'a PyReadonlyArrayDyn<'_, f64>, last: &[usize]) -> PyResult<&'a [usize]> {
    let (expected, found) = (format_args!("shape (..., {last:?})"), format_args!("{:?}", array.shape()));
    array.shape().strip_suffix(last).ok_or_else(|| raise(Unexpected::new("rotations", expected, found)))
}

#[doc = stub!("quaternions")]
#[pyfunction]
pub(crate) fn quaternions<'py>(py: Python<'py>, rotations: Given<'py>) -> PyResult<(Array<'py>, bool)> {
    let shape = [leading(&rotations, &[3, 3])?, &[4]].concat();
    let (mut found, mut skewed) = (Vec::with_capacity(shape.iter().product()), false);
    for rows in rotations.as_slice()?.as_chunks::<9>().0 {
        let matrix = rotation(rows);
        found.extend(math::quaternion(&matrix));
        skewed |= math::is_skewed(&matrix);
    }
    Ok((array(py, found, &shape)?, skewed))
}

/// Whether Euler angles can be about these axes.
fn are_axes(order: [usize; 3]) -> bool {
    order[0] != order[1] && order[1] != order[2] && order.iter().all(|axis| *axis < 3)
}

#[doc = stub!("euler_angles")]
#[pyfunction]
pub(crate) fn euler_angles<'py>(py: Python<'py>, quaternions: Given<'py>, order: [usize; 3]) -> PyResult<Array<'py>> {
    let shape = [leading(&quaternions, &[4])?, &[3]].concat();
    unless(are_axes(order), "order", "axes that differ", format_args!("{order:?}"))?;
    let rows = quaternions.as_slice()?.as_chunks::<4>().0;
    let found = rows.iter().flat_map(|row| math::euler_angles(row, order)).collect();
    array(py, found, &shape)
}
