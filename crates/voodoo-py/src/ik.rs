//! `Chain` of inverse kinematics, and `View`, one silhouette with its camera; `voodoo.ik` validates and names what they take and
//! return.

use std::sync::Arc;

use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use voodoo_core::math::Vec3;
use voodoo_core::{Body, Camera};
use voodoo_ik::{
    self, Aim, Bone, ChainModel, Criterion, Goal, IkProblem, IkSolver, Kinematics, SilhouetteView, SolverOptions, Trunk,
};

use crate::arrays::{Array, frozen, limb_poses, matrices, pose};
use crate::body::PyBody;
use crate::camera::camera_of;
use crate::errors::{BodyError, raise, unless};

/// Angles `(N, n)`; sites `(N, S, 3)`; h, steps, postures tried, those compared with images, and converged as 0 or 1, `(5, N)`; and of
/// the last posture, poses `(P, 4, 4)` and the residual of every goal.
type Solved<'py> = (Array<'py>, Array<'py>, Array<'py>, Array<'py>, Bound<'py, PyTuple>);
/// site, "position" or "line", position or (direction, moment), weight, level
type GoalParts = (String, String, [f64; 6], f64, usize);
/// site, site, radius
type SegmentParts = (String, String, f64);
/// steps, tolerance, still, gain, caution, largest turn
type OptionParts = (usize, f64, f64, f64, f64, f64);

#[doc = stub!("Chain")]
#[pyclass(name = "Chain", module = "voodoo._core", frozen)]
pub struct PyChain {
    body: Body,
    model: ChainModel,
}

impl PyChain {
    fn site(&self, name: &str) -> PyResult<(usize, Vec3)> {
        let index = self.body.site_index(name).map_err(raise)?;
        let site = &self.body.sites()[index];
        self.model.link_of(site.limb).map(|link| (link, site.position)).ok_or_else(|| {
            let known = self.site_links().map(|(name, _, _)| name).collect::<Vec<_>>().join(", ");
            BodyError::new_err(format!("site: expected one on the chain ({known}), found {name:?}"))
        })
    }

    fn goals(&self, parts: &[GoalParts]) -> PyResult<Vec<Goal>> {
        parts
            .iter()
            .map(|(site, kind, v, weight, level)| {
                let (link, point) = self.site(site)?;
                let (first, second) = (Vec3::new(v[0], v[1], v[2]), Vec3::new(v[3], v[4], v[5]));
                let aim = if kind == "line" { Aim::Line { n: first, m: second } } else { Aim::Position(first) };
                Ok(Goal { link, point, aim, weight: *weight, level: *level })
            })
            .collect()
    }

    fn bones(&self, parts: Option<Vec<SegmentParts>>, margin: f64) -> PyResult<Vec<Bone>> {
        let Some(parts) = parts else { return Ok(voodoo_ik::bones(&self.body, &self.model, margin)) };
        let bone = |(a, b, radius): &SegmentParts| {
            Ok(Bone { ends: [self.site(a)?, self.site(b)?], radius: [*radius; 2], apart: 1.0 })
        };
        parts.iter().map(bone).collect()
    }

    /// The trunk, and limbs of the body beside the chain with their world poses.
    fn trunk(&self, base: &Bound<'_, PyAny>, others: &[(String, Bound<'_, PyAny>)]) -> PyResult<Vec<Trunk>> {
        let mut found = voodoo_ik::trunk(&self.body, &self.model, &pose("world_from_base", Some(base))?);
        for (name, world_from_limb) in others {
            let limb = self.body.limb_index(name).map_err(raise)?;
            if self.model.link_of(limb).is_some() {
                let message = format!("others: expected limbs that are not on the chain, found {name:?}");
                return Err(BodyError::new_err(message));
            }
            let pose = pose("others", Some(world_from_limb))?;
            found.push(Trunk { link: None, pose, shape: self.body.limbs()[limb].shape });
        }
        Ok(found)
    }

    fn checked(&self, angles: &[f64]) -> PyResult<()> {
        let valid = angles.len() == self.model.freedoms() && angles.iter().all(|angle| angle.is_finite());
        let expected = format_args!("{} finite numbers", self.model.freedoms());
        unless(valid, "angles", expected, format_args!("{:.120}", format!("{angles:?}")))
    }

    fn place(&self, base: &Bound<'_, PyAny>, angles: &[f64]) -> PyResult<Kinematics> {
        self.checked(angles)?;
        let mut at = Kinematics::default();
        self.model.place(&pose("world_from_base", Some(base))?, angles, &mut at);
        Ok(at)
    }

    fn site_links(&self) -> impl Iterator<Item = (&str, usize, Vec3)> {
        self.body
            .sites()
            .iter()
            .filter_map(|site| self.model.link_of(site.limb).map(|link| (site.name.as_str(), link, site.position)))
    }
}

#[pymethods]
impl PyChain {
    #[new]
    fn new(body: &PyBody, limbs: Vec<String>, free_root: bool) -> PyResult<Self> {
        let indices = limbs.iter().map(|name| body.0.limb_index(name)).collect::<Result<Vec<_>, _>>().map_err(raise)?;
        let model = ChainModel::new(&body.0, &indices, free_root).map_err(raise)?;
        Ok(Self { body: body.0.clone(), model })
    }

    /// Names and limits of the angles, names of the limbs, and names of the sites.
    fn parts(&self) -> (Vec<String>, Vec<[f64; 2]>, Vec<String>, Vec<String>) {
        let limbs = self.model.links().iter().map(|link| self.body.limbs()[link.limb].name.clone());
        let sites = self.site_links().map(|(name, _, _)| name.to_owned());
        (self.model.names().to_vec(), self.model.limits().to_vec(), limbs.collect(), sites.collect())
    }

    /// Poses `(P, 4, 4)` of the limbs and positions `(S, 3)` of the sites.
    fn forward<'py>(&self, base: &Bound<'py, PyAny>, angles: Vec<f64>) -> PyResult<(Array<'py>, Array<'py>)> {
        let py = base.py();
        let at = self.place(base, &angles)?;
        let sites: Vec<f64> =
            self.site_links().flat_map(|(_, link, x)| at.poses[link].transform_point(x).to_array()).collect();
        let count = sites.len() / 3;
        Ok((matrices(py, &at.poses)?, frozen(py, sites, &[count, 3])?))
    }

    /// Derivative `(3, n)` of the position of a site.
    fn jacobian<'py>(&self, base: &Bound<'py, PyAny>, angles: Vec<f64>, site: &str) -> PyResult<Array<'py>> {
        let py = base.py();
        let at = self.place(base, &angles)?;
        let (link, point) = self.site(site)?;
        let goal = Goal { link, point, aim: Aim::Position(Vec3::ZERO), weight: 1.0, level: 0 };
        let (mut rows, mut residual) = (Vec::new(), Vec::new());
        voodoo_ik::level_rows(&self.model, &[goal], &at, &mut rows, &mut residual);
        frozen(py, rows, &[3, self.model.freedoms()])
    }

    /// Value and gradient `(n,)` of the image criterion.
    fn criterion<'py>(
        &self,
        base: &Bound<'py, PyAny>,
        angles: Vec<f64>,
        segments: Option<Vec<SegmentParts>>,
        depth: (f64, f64),
        views: Vec<PyRef<'py, PyView>>,
        others: Vec<(String, Bound<'py, PyAny>)>,
    ) -> PyResult<(f64, Array<'py>)> {
        let py = base.py();
        let at = self.place(base, &angles)?;
        let segments = self.bones(segments, depth.0)?;
        let views: Vec<&SilhouetteView> = views.iter().map(|view| &view.0).collect();
        let trunk = self.trunk(base, &others)?;
        let mut gradient = vec![0.0; self.model.freedoms()];
        let criterion = Criterion { views: &views, segments: &segments, thin: depth.1, trunk: &trunk };
        let h = criterion.evaluate(&self.model, &at, &mut gradient);
        Ok((h, frozen(py, gradient, &[self.model.freedoms()])?))
    }

    /// Angles of the poses `(4, 4)` of all limbs of the body; `closest`: of the closed chain nearest to them.
    fn project(
        &self,
        base: &Bound<'_, PyAny>,
        world_from_limb: Vec<Bound<'_, PyAny>>,
        closest: bool,
    ) -> PyResult<Vec<f64>> {
        let (base, poses) = (pose("world_from_base", Some(base))?, limb_poses(&self.body, &world_from_limb)?);
        let mut angles = Vec::new();
        if closest {
            voodoo_ik::project(&self.body, &self.model, &base, &poses, &mut angles);
        } else {
            voodoo_ik::read(&self.body, &self.model, &base, &poses, &mut angles);
        }
        Ok(angles)
    }

    /// Postures that share sites, images and options, from starts `(N, n)`; with positions `(N, K, 3)` of the goals, or all with
    /// the same. Releases the GIL.
    #[allow(clippy::too_many_arguments, reason = "called by voodoo.ik only")]
    fn solve<'py>(
        &self,
        base: &Bound<'py, PyAny>,
        starts: PyReadonlyArray2<'py, f64>,
        goals: Vec<GoalParts>,
        positions: Option<PyReadonlyArray3<'py, f64>>,
        segments: Option<Vec<SegmentParts>>,
        depth: (f64, f64),
        views: Vec<PyRef<'py, PyView>>,
        others: Vec<(String, Bound<'py, PyAny>)>,
        how: OptionParts,
        rest: Vec<(usize, f64)>,
    ) -> PyResult<Solved<'py>> {
        let py = base.py();
        let [count, n] = [starts.shape()[0], starts.shape()[1]];
        let mut angles = starts.as_slice()?.to_vec();
        (0..count).try_for_each(|index| self.checked(&angles[index * n..(index + 1) * n]))?;
        let mut goals = self.goals(&goals)?;
        let segments = if views.is_empty() { Vec::new() } else { self.bones(segments, depth.0)? };
        let views: Vec<&SilhouetteView> = views.iter().map(|view| &view.0).collect();
        let trunk = self.trunk(base, &others)?;
        let criterion = Criterion { views: &views, segments: &segments, thin: depth.1, trunk: &trunk };
        let positions = positions.as_ref().map(|positions| positions.as_slice()).transpose()?;
        let sites: Vec<(usize, Vec3)> = self.site_links().map(|(_, link, x)| (link, x)).collect();
        let world_from_base = pose("world_from_base", Some(base))?;
        let (steps, tolerance, still, gain, caution, largest_turn) = how;
        let options = SolverOptions { steps, tolerance, still, gain, caution, largest_turn };
        let mut points = Vec::with_capacity(3 * sites.len() * count);
        let mut numbers = vec![0.0; 5 * count];
        let (mut solver, mut ordered) = (IkSolver::default(), Vec::new());
        py.detach(|| {
            let width = 3 * goals.len();
            for index in 0..count {
                let rows = positions.map_or(&[][..], |all| all[index * width..(index + 1) * width].as_chunks::<3>().0);
                for (goal, position) in goals.iter_mut().zip(rows) {
                    goal.aim = Aim::Position(Vec3::from_array(*position));
                }
                ordered.clone_from(&goals);
                ordered.sort_by_key(|goal: &Goal| goal.level);
                let row = &mut angles[index * n..(index + 1) * n];
                let (model, base, goals, criterion) = (&self.model, world_from_base, &ordered, Some(&criterion));
                let report = solver.solve(&IkProblem { model, base, goals, criterion, rest: &rest, options }, row);
                let at = solver.kinematics();
                points.extend(sites.iter().flat_map(|(link, x)| at.poses[*link].transform_point(*x).to_array()));
                let counts = [report.steps, report.tried, report.compared, usize::from(report.converged)];
                let [steps, tried, compared, converged] = counts.map(|count| count as f64);
                let found = [report.h, steps, tried, compared, converged];
                (0..5).for_each(|kind| numbers[kind * count + index] = found[kind]);
            }
        });
        let at = solver.kinematics();
        let residuals: Vec<f64> = goals.iter().filter(|_| count > 0).map(|goal| goal.residual(at).length()).collect();
        Ok((
            frozen(py, angles, &[count, n])?,
            frozen(py, points, &[count, sites.len(), 3])?,
            frozen(py, numbers, &[5, count])?,
            matrices(py, &at.poses)?,
            PyTuple::new(py, residuals)?,
        ))
    }
}

#[doc = stub!("View")]
#[pyclass(name = "View", module = "voodoo._core", frozen)]
pub struct PyView(pub SilhouetteView);

#[pymethods]
impl PyView {
    #[new]
    fn new(
        distance: PyReadonlyArray2<'_, f32>,
        thickness: PyReadonlyArray2<'_, f32>,
        depth: Option<PyReadonlyArray2<'_, f32>>,
        border: f64,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
        camera_from_world: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let [height, width] = [distance.shape()[0], distance.shape()[1]];
        let size = format_args!("{width} x {height}");
        unless(width >= 2 && height >= 2, "silhouette", "at least 2 x 2 pixels", size)?;
        Ok(Self(SilhouetteView {
            pixels: distance.as_slice()?.iter().zip(thickness.as_slice()?).map(|(d, t)| [*d, *t]).collect(),
            depth: depth.map_or(Ok(Vec::new()), |depth| depth.as_slice().map(<[f32]>::to_vec))?,
            border,
            camera: Camera::clone(&camera),
            camera_from_world: pose("camera_from_world", Some(camera_from_world))?,
        }))
    }
}
