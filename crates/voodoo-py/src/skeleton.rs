//! Rotations and poses of many frames, or of persons of one instant, as files and live outputs need them, and everything that
//! these tell of a person as one row of numbers.

use numpy::{PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::f64::consts::PI;
use voodoo_core::math::{self, Mat3, Vec3};
use voodoo_core::{Body, Limb, Unexpected};

use crate::arrays::{Array, array};
use crate::body::{PyBody, at_rest};
use crate::errors::{MeasurementError, raise, unless};
use crate::estimate::PyEstimate;

type Given<'py> = PyReadonlyArrayDyn<'py, f64>;
/// A table of numbers, which is read faster than tuples.
type Plan<'py> = PyReadonlyArray2<'py, i64>;

/// Rows of `N` numbers of each frame of an array (F, K, ...).
fn frames<'a, const N: usize>(name: &str, array: &'a PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<&'a [[f64; N]]>> {
    let shape = array.shape();
    let valid = shape.len() >= 2 && shape[2..].iter().product::<usize>() == N && array.is_c_contiguous();
    let expected = format_args!("contiguous frames of rows of {N} numbers");
    unless(valid, name, expected, format_args!("shape {shape:?}"))?;
    let rows = array.as_slice()?.as_chunks::<N>().0;
    Ok((0..shape[0]).map(|frame| rows.get(frame * shape[1]..(frame + 1) * shape[1]).unwrap_or_default()).collect())
}

/// Rows of a plan.
fn plan<'a, const N: usize>(plan: &'a Plan<'_>) -> PyResult<&'a [[i64; N]]> {
    let columns = plan.shape()[1];
    unless(columns == N && plan.is_c_contiguous(), "plan", format_args!("{N} columns"), columns)?;
    Ok(plan.as_slice()?.as_chunks().0)
}

/// The entry with a number of a plan.
fn entry<T>(entries: &[T], number: i64) -> Option<&T> {
    entries.get(usize::try_from(number).ok()?)
}

fn unplanned() -> PyErr {
    let expected = "numbers of limbs, joints and frames that are there, and axes that differ";
    MeasurementError::new_err(format!("plan: expected {expected}"))
}

fn rotation(rows: &[f64; 9]) -> Mat3 {
    Mat3::from_cols_array(rows).transpose()
}

fn poses_of(rows: &[[f64; 16]]) -> Vec<(Mat3, Vec3)> {
    rows.iter().map(parts).collect()
}

fn points_of(rows: &[[f64; 3]]) -> Vec<Vec3> {
    rows.iter().copied().map(Vec3::from_array).collect()
}

/// Rotation and translation of a 4x4 matrix.
fn parts(m: &[f64; 16]) -> (Mat3, Vec3) {
    (rotation(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]), Vec3::new(m[3], m[7], m[11]))
}

/// Rotations of the bones of a posed body, and where they are joined to their parents.
fn bones(body: &Body, poses: &[(Mat3, Vec3)], joints: &[Vec3], own: &[[i64; 2]]) -> Option<(Vec<Mat3>, Vec<Vec3>)> {
    let found = at_rest(body).into_iter().zip(poses);
    let found = found.map(|((rest, place), &(limb, at))| (limb * rest.transpose(), limb * place + at));
    let (turns, mut heads): (Vec<_>, Vec<_>) = found.unzip();
    for &[limb, joint] in own {
        *heads.get_mut(usize::try_from(limb).ok()?)? = *entry(joints, joint)?;
    }
    (turns.len() == body.limbs().len() && poses.len() == turns.len()).then_some((turns, heads))
}

/// Place and quaternion of each frame of a plan on its parent.
fn placed_frames(turns: &[Mat3], points: &[Vec3], plan: &[[i64; 4]]) -> Option<Vec<[f64; 7]>> {
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

fn angles(turns: &[Mat3], plan: &[[i64; 8]]) -> Option<Vec<f64>> {
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
fn moved_covariance(covariance: &[[f64; 6]; 6], turn: &Mat3, across: Vec3) -> [[f64; 6]; 6] {
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
fn cylinder(Limb { shape, .. }: &Limb, &(turn, at): &(Mat3, Vec3)) -> [f64; 12] {
    let ([x, y, z], [i, j, k, w]) = ((at + turn.z_axis * (shape.length() / 2.0)).to_array(), math::quaternion(&turn));
    let (a, b) = (shape.a0() + shape.a1(), shape.b0() + shape.b1());
    let low = shape.a0() / a + shape.b0() / b;
    [x, y, z, i, j, k, w, a, b, shape.length(), low, 2.0 - low]
}

#[doc = stub!("Layout")]
#[pyclass(module = "voodoo._core", frozen)]
pub(crate) struct Layout {
    own: Vec<[i64; 2]>,
    frames: Vec<[i64; 4]>,
    angles: Vec<[i64; 8]>,
    arms: Vec<Mat3>,
    limbs: Vec<[i64; 4]>,
}

impl Layout {
    /// Appends the row of a pose. The covariance is that of the first limb's pose, and is still to be turned.
    fn append(
        &self,
        row: &mut Vec<f64>,
        body: &Body,
        poses: &[(Mat3, Vec3)],
        joints: &[Vec3],
        (covariance, turn): (&[[f64; 6]; 6], &Mat3),
    ) -> Option<()> {
        let (turns, heads) = bones(body, poses, joints, &self.own)?;
        let frames = placed_frames(&turns, &[&heads[..], joints].concat(), &self.frames)?;
        let limbs: Vec<_> = turns.iter().zip(&self.arms).map(|(turn, arm)| *turn * *arm).collect();
        let limbs = placed_frames(&limbs, &heads, &self.limbs)?;
        let &[x, y, z, ..] = frames.first()?;
        let root = moved_covariance(covariance, turn, Vec3::new(x, y, z) - poses.first()?.1);
        row.extend_from_slice(frames.as_flattened());
        body.limbs().iter().zip(poses).for_each(|(limb, pose)| row.extend(cylinder(limb, pose)));
        joints.iter().for_each(|place| row.extend(place.to_array()));
        for (turn, head) in turns.iter().zip(&heads) {
            row.extend(head.to_array());
            row.extend(math::quaternion(turn));
        }
        row.extend(angles(&turns, &self.angles)?);
        row.extend_from_slice(root.as_flattened());
        limbs.iter().for_each(|[x, y, z, i, j, k, w]| row.extend([-y, *z, *x, *j, -k, -i, *w]));
        Some(())
    }
}

#[pymethods]
impl Layout {
    #[new]
    fn new(own: Plan<'_>, frames: Plan<'_>, angles: Plan<'_>, arms: Given<'_>, limbs: Plan<'_>) -> PyResult<Self> {
        let arms = self::frames("arms", &arms)?.concat().iter().map(rotation).collect();
        let (own, frames) = (plan(&own)?.to_vec(), plan(&frames)?.to_vec());
        let (angles, limbs) = (plan(&angles)?.to_vec(), plan(&limbs)?.to_vec());
        Ok(Self { own, frames, angles, arms, limbs })
    }

    #[doc = stub!("Layout.rows_of_frames")]
    fn rows_of_frames<'py>(
        &self,
        py: Python<'py>,
        body: &PyBody,
        poses: Given<'py>,
        joints: Given<'py>,
        covariances: Given<'py>,
    ) -> PyResult<Array<'py>> {
        let (poses, joints) = (frames("poses", &poses)?, frames("joints", &joints)?);
        let covariances = frames("covariances", &covariances)?;
        let mut rows = Vec::new();
        for ((poses, joints), covariance) in poses.iter().zip(&joints).zip(&covariances) {
            let covariance = (covariance.first_chunk().ok_or_else(unplanned)?, &Mat3::IDENTITY);
            let row = self.append(&mut rows, &body.0, &poses_of(poses), &points_of(joints), covariance);
            row.ok_or_else(unplanned)?;
        }
        let columns = rows.len() / poses.len().max(1);
        array(py, rows, &[poses.len(), columns])
    }

    #[doc = stub!("Layout.rows")]
    fn rows<'py>(
        &self,
        py: Python<'py>,
        estimates: Vec<PyRef<'py, PyEstimate>>,
        bodies: Vec<PyRef<'py, PyBody>>,
        turn: Option<PyReadonlyArray2<'py, f64>>,
    ) -> PyResult<Array<'py>> {
        let turn = turn.as_ref().map(|turn| turn.as_slice()).transpose()?.and_then(|turn| turn.first_chunk());
        let (turn, shift) = turn.map_or((Mat3::IDENTITY, Vec3::ZERO), parts);
        let (mut rows, unknown) = (Vec::new(), [[f64::NAN; 6]; 6]);
        for (PyEstimate { estimate, .. }, body) in estimates.iter().map(|one| &**one).zip(&bodies) {
            let poses = estimate.world_from_limb.iter();
            let poses = poses.map(|pose| (turn * Mat3::from_quat(pose.rotation), turn * pose.translation + shift));
            let joints: Vec<_> = estimate.sites.iter().map(|place| turn * *place + shift).collect();
            let covariance = estimate.covariances.limbs.first().unwrap_or(&unknown);
            let row = self.append(&mut rows, &body.0, &poses.collect::<Vec<_>>(), &joints, (covariance, &turn));
            row.ok_or_else(unplanned)?;
        }
        let (count, columns) = (estimates.len(), rows.len() / estimates.len().max(1));
        array(py, rows, &[count, columns])
    }
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
