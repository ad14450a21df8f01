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
mod keypoints;
mod people;
mod shape;
mod sites;
mod skeleton;
mod skin;
mod template;
mod tracker;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    #[cfg(feature = "detect")]
    #[pymodule_export]
    use super::detect::{PyDetector, person_candidates};
    #[pymodule_export]
    use super::{
        body::PyBody,
        camera::{PyCamera, render_depth},
        config::config_fields,
        estimate::{_estimate, PyEstimate},
        frame::{PyFrame, implausible_depth},
        ik::{PyChain, PyView},
        keypoints::{PyKeypointLayout, carried, linear_sum_assignment, nearest_surface},
        people::PyPeople,
        shape::{PyClosestPoints, PyShape},
        sites::{PySiteGate, PySiteRay, expected_sites},
        skeleton::{Layout, euler_angles, quaternions, skeleton},
        skin::PySkinCue,
        template::{Template, people_text},
        tracker::{PyTracker, body_before},
    };

    #[pymodule_init]
    fn init(module: &super::Bound<'_, super::PyModule>) -> super::PyResult<()> {
        use pyo3::types::PyModuleMethods;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
