//! Everything that live outputs tell of a person, as one row of numbers.

use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use voodoo_core::math::{self, Mat3, Vec3};
use voodoo_core::{Body, Estimate};

use crate::arrays::{Array, array};
use crate::body::PyBody;
use crate::estimate::PyEstimate;
use crate::skeleton::{self, Given, Plan, angles, bones, cylinder, moved_covariance, parts, placed_frames, unplanned};

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
    /// Appends the row of a person whose pose is turned.
    fn append(&self, row: &mut Vec<f64>, estimate: &Estimate, body: &Body, (turn, shift): &(Mat3, Vec3)) -> Option<()> {
        let poses = estimate.world_from_limb.iter();
        let poses = poses.map(|pose| (*turn * Mat3::from_quat(pose.rotation), *turn * pose.translation + *shift));
        let poses: Vec<_> = poses.collect();
        let joints: Vec<_> = estimate.sites.iter().map(|place| *turn * *place + *shift).collect();
        let (turns, heads) = bones(body, &poses, &joints, &self.own)?;
        let (places, frames) = placed_frames(&turns, &[&heads[..], &joints].concat(), &self.frames)?;
        let limbs: Vec<_> = turns.iter().zip(&self.arms).map(|(turn, arm)| *turn * *arm).collect();
        let (_, limbs) = placed_frames(&limbs, &heads, &self.limbs)?;
        let unknown = [[f64::NAN; 6]; 6];
        let root = estimate.covariances.limbs.first().unwrap_or(&unknown);
        let root = moved_covariance(root, turn, *places.first()? - poses.first()?.1);
        row.extend_from_slice(frames.as_flattened());
        body.limbs().iter().zip(&poses).for_each(|(limb, pose)| row.extend(cylinder(limb, pose)));
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

    #[doc = stub!("Layout.rows")]
    fn rows<'py>(
        &self,
        py: Python<'py>,
        estimates: Vec<PyRef<'py, PyEstimate>>,
        bodies: Vec<PyRef<'py, PyBody>>,
        turn: Option<PyReadonlyArray2<'py, f64>>,
    ) -> PyResult<(Array<'py>, Vec<bool>)> {
        let turn = turn.as_ref().map(|turn| turn.as_slice()).transpose()?.and_then(|turn| turn.first_chunk());
        let turn = turn.map_or((Mat3::IDENTITY, Vec3::ZERO), parts);
        let mut rows = Vec::new();
        for (one, body) in estimates.iter().zip(&bodies) {
            self.append(&mut rows, &one.estimate, &body.0, &turn).ok_or_else(unplanned)?;
        }
        let sure = |one: &PyRef<'_, PyEstimate>| {
            one.estimate.covariances.limbs.first().is_some_and(|root| root[0][0].is_finite())
        };
        let (count, sure) = (estimates.len(), estimates.iter().map(sure).collect());
        let columns = rows.len() / count.max(1);
        Ok((array(py, rows, &[count, columns])?, sure))
    }
}
