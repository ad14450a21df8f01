//! Python bindings of voodoo-core: conversions and error translation, no method of their own.
#![allow(missing_docs, reason = "the documentation of the Python side is that of _core.pyi")]

/// The docstring that a class, a member of one or a function has in `_core.pyi`; see build.rs.
macro_rules! stub {
    ($name:literal) => {
        include_str!(concat!(env!("OUT_DIR"), "/", $name))
    };
}

mod arguments;
mod arrays;
mod body;
mod borrowed;
mod camera;
mod config;
#[cfg(feature = "detect")]
mod detect;
mod detector;
mod errors;
mod estimate;
mod frame;
mod ik;
mod ik_view;
mod keypoints;
mod people;
mod registration;
mod render;
mod rotations;
mod shape;
mod sites;
mod skeleton;
mod skin;
mod template;
mod tracker;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    #[pymodule_export]
    use super::body::PyBody;
    #[pymodule_export]
    use super::camera::PyCamera;
    #[pymodule_export]
    use super::config::config_fields;
    #[cfg(feature = "detect")]
    #[pymodule_export]
    use super::detect::{PyCandidate, PyDetection, PyDetector, person_candidates};
    #[pymodule_export]
    use super::estimate::{_estimate, _nobody, PyEstimate};
    #[pymodule_export]
    use super::frame::PyFrame;
    #[pymodule_export]
    use super::ik::PyChain;
    #[pymodule_export]
    use super::ik_view::PyView;
    #[pymodule_export]
    use super::keypoints::{PyKeypointLayout, carried, linear_sum_assignment};
    #[pymodule_export]
    use super::people::PyPeople;
    #[pymodule_export]
    use super::registration::nearest_surface;
    #[pymodule_export]
    use super::render::render_depth;
    #[pymodule_export]
    use super::rotations::{euler_angles, quaternions};
    #[pymodule_export]
    use super::shape::{PyClosestPoints, PyShape};
    #[pymodule_export]
    use super::sites::{PySiteGate, PySiteRay, expected_sites};
    #[pymodule_export]
    use super::skeleton::{cylinders, joint_angles, moved_covariances, placed, skeleton};
    #[pymodule_export]
    use super::skin::PySkinCue;
    #[pymodule_export]
    use super::template::{Template, with_numbers};
    #[pymodule_export]
    use super::tracker::{PyTracker, body_before};

    #[pymodule_init]
    fn init(module: &super::Bound<'_, super::PyModule>) -> super::PyResult<()> {
        use pyo3::types::PyModuleMethods;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
