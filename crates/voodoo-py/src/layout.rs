//! Everything that live outputs and files tell of a person, as one row of numbers.

use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use voodoo_core::Body;
use voodoo_core::math::{self, Mat3, Vec3};

use crate::arrays::{Array, array};
use crate::body::PyBody;
use crate::estimate::PyEstimate;
use crate::skeleton::{
    self, Given, Plan, angles, bones, cylinder, moved_covariance, parts, placed_frames, points_of, poses_of, unplanned,
};

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
        let arms = skeleton::frames("arms", &arms)?.concat().iter().map(skeleton::rotation).collect();
        let (own, frames) = (skeleton::plan(&own)?.to_vec(), skeleton::plan(&frames)?.to_vec());
        let (angles, limbs) = (skeleton::plan(&angles)?.to_vec(), skeleton::plan(&limbs)?.to_vec());
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
        let (poses, joints) = (skeleton::frames("poses", &poses)?, skeleton::frames("joints", &joints)?);
        let covariances = skeleton::frames("covariances", &covariances)?;
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
