//! `Body`: created by `voodoo.model.body` from validated parts.

use pyo3::prelude::*;
use pythonize::depythonize;
use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
use voodoo_core::{Body, Joint, Limb, Site};

use crate::arrays::{Array, frozen};
use crate::errors::{BodyError, raise, wrong};
use crate::shape::PyShape;

/// A rotation as Python represents it.
#[derive(FromPyObject, IntoPyObject)]
pub(crate) enum Rotation {
    /// Radians.
    Vector([f64; 3]),
    /// x, y, z, w; for copies, which have the same bits.
    Quaternion([f64; 4]),
}

/// Position and rotation of a joint's ellipse.
type JointFrame = ([f64; 3], Rotation);
/// name, ellipse on the parent, ellipse on the limb, semi-axes, weight, limits, motion
pub(crate) type JointParts = (String, JointFrame, JointFrame, [f64; 2], f64, Option<[[f64; 2]; 3]>, f64);
/// name, parent, shape, joint, match_caps
type LimbParts = (String, Option<String>, PyShape, Option<JointParts>, [bool; 2]);
/// name, limb, position
type SiteParts = (String, String, [f64; 3]);

#[doc = stub!("Body")]
#[pyclass(name = "Body", module = "voodoo._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct PyBody(pub Body);

fn pose((position, rotation): JointFrame) -> Pose {
    let rotation = match rotation {
        Rotation::Vector(vector) => Quat::from_scaled_axis(Vec3::from_array(vector)),
        Rotation::Quaternion(quaternion) => Quat::from_array(quaternion),
    };
    Pose::from_parts(Vec3::from_array(position), rotation)
}

fn readable(pose: &Pose) -> JointFrame {
    (pose.translation.to_array(), Rotation::Vector(pose.rotation.to_scaled_axis().to_array()))
}

fn exact(pose: &Pose) -> JointFrame {
    (pose.translation.to_array(), Rotation::Quaternion(pose.rotation.to_array()))
}

pub(crate) fn joint((name, on_parent, on_limb, semi_axes, weight, limits, motion): JointParts) -> Joint {
    Joint {
        name,
        parent_from_joint: pose(on_parent),
        limb_from_joint: pose(on_limb),
        semi_axes,
        weight,
        limits,
        motion,
    }
}

/// Of each limb its orientation when the body stands at rest, and where it is joined to its parent in its own frame.
pub(crate) fn at_rest(body: &Body) -> Vec<(Mat3, Vec3)> {
    let mut turns: Vec<Quat> = Vec::new();
    for limb in body.limbs() {
        turns.push(limb.parent.as_ref().map_or(Quat::IDENTITY, |(parent, joint)| {
            turns[*parent] * joint.parent_from_joint.rotation * joint.limb_from_joint.rotation.inverse()
        }));
    }
    let place = |limb: &Limb| limb.parent.as_ref().map_or(Vec3::ZERO, |(_, joint)| joint.limb_from_joint.translation);
    turns.into_iter().zip(body.limbs()).map(|(turn, limb)| (Mat3::from_quat(turn), place(limb))).collect()
}

#[pymethods]
impl PyBody {
    #[new]
    fn new(name: String, limbs: Vec<LimbParts>, sites: Vec<SiteParts>) -> PyResult<Self> {
        let names: Vec<String> = limbs.iter().map(|limb| limb.0.clone()).collect();
        let index = |key: String, name: &str| {
            names.iter().position(|known| known == name).ok_or_else(|| {
                BodyError::new_err(format!("{key}: expected one of {}, found {name:?}", names.join(", ")))
            })
        };
        let limbs = limbs
            .into_iter()
            .map(|(name, parent, shape, parts, match_caps)| {
                let parent = match (parent, parts) {
                    (Some(parent), Some(parts)) => {
                        Some((index(format!("limbs.{name}.parent"), &parent)?, joint(parts)))
                    }
                    (None, None) => None,
                    _ => {
                        return Err(BodyError::new_err(format!(
                            "limbs.{name}: expected both a parent and a joint, or neither for the root"
                        )));
                    }
                };
                Ok(Limb { name, shape: shape.0, parent, match_caps })
            })
            .collect::<PyResult<Vec<_>>>()?;
        let sites = sites
            .into_iter()
            .map(|(name, limb, position)| {
                Ok(Site {
                    limb: index(format!("sites.{name}.limb"), &limb)?,
                    name,
                    position: Vec3::from_array(position),
                })
            })
            .collect::<PyResult<Vec<_>>>()?;
        Body::new(name, limbs, sites).map(Self).map_err(raise)
    }

    #[staticmethod]
    fn human(stature: f64, model: &Bound<'_, PyAny>) -> PyResult<Self> {
        let expected = "\"measured\", \"full\" or \"papers\"";
        let model = depythonize(model).map_err(|_| BodyError::new_err(wrong("model", expected, model)))?;
        Body::human(stature, model).map(Self).map_err(raise)
    }

    fn scaled(&self, factor: f64) -> PyResult<Self> {
        self.0.scaled(factor).map(Self).map_err(raise)
    }

    /// The parts that `new` takes, rotations as vectors.
    fn parts(&self) -> (String, Vec<LimbParts>, Vec<SiteParts>) {
        self.parts_with(readable)
    }

    #[doc = stub!("Body.at_rest")]
    fn at_rest<'py>(&self, py: Python<'py>) -> PyResult<(Array<'py>, Array<'py>)> {
        let rest = at_rest(&self.0);
        let turned = rest.iter().flat_map(|(turn, _)| turn.transpose().to_cols_array()).collect();
        let places = rest.iter().flat_map(|(_, place)| place.to_array()).collect();
        Ok((frozen(py, turned, &[rest.len(), 3, 3])?, frozen(py, places, &[rest.len(), 3])?))
    }

    /// For pickle and copy.
    fn __getnewargs__(&self) -> (String, Vec<LimbParts>, Vec<SiteParts>) {
        self.parts_with(exact)
    }
}

impl PyBody {
    fn parts_with(&self, frame: fn(&Pose) -> JointFrame) -> (String, Vec<LimbParts>, Vec<SiteParts>) {
        let limbs = self.0.limbs();
        let limb_parts = limbs
            .iter()
            .map(|limb| {
                let (parent, joint) = limb
                    .parent
                    .as_ref()
                    .map(|(parent, joint)| {
                        let parts = (
                            joint.name.clone(),
                            frame(&joint.parent_from_joint),
                            frame(&joint.limb_from_joint),
                            joint.semi_axes,
                            joint.weight,
                            joint.limits,
                            joint.motion,
                        );
                        (limbs[*parent].name.clone(), parts)
                    })
                    .unzip();
                (limb.name.clone(), parent, PyShape(limb.shape), joint, limb.match_caps)
            })
            .collect();
        let sites = self
            .0
            .sites()
            .iter()
            .map(|site| (site.name.clone(), limbs[site.limb].name.clone(), site.position.to_array()))
            .collect();
        (self.0.name().to_owned(), limb_parts, sites)
    }
}
