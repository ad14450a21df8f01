//! Python bindings of voodoo-core: conversions and error translation, no method of their own.
#![allow(
    missing_docs,
    reason = "the documentation of the Python side stands in _core.pyi, that of what voodoo exports here, too: a test compares"
)]

mod arguments;
mod arrays;
mod body;
mod body_view;
mod borrowed;
mod camera;
mod chroma;
mod config;
mod detect;
mod errors;
mod estimate;
mod frame;
mod ik;
mod ik_view;
mod keypoints;
mod people;
mod registration;
mod render;
mod shape;
mod sites;
mod skin;
mod tracker;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    #[pymodule_export]
    use super::body::PyBody;
    #[pymodule_export]
    use super::body_view::{PyBodyView, PyStillDepth, body_view};
    #[pymodule_export]
    use super::camera::PyCamera;
    #[pymodule_export]
    use super::chroma::{color_bins, joined_mask, mask_regions, skin_mask};
    #[pymodule_export]
    use super::config::config_fields;
    #[pymodule_export]
    use super::detect::{PyCandidate, PyDetection, PyDetector, person_candidates};
    #[pymodule_export]
    use super::estimate::{_estimate, PyEstimate};
    #[pymodule_export]
    use super::frame::PyFrame;
    #[pymodule_export]
    use super::ik::PyChain;
    #[pymodule_export]
    use super::ik_view::PyView;
    #[pymodule_export]
    use super::keypoints::{PyKeypointLayout, carried};
    #[pymodule_export]
    use super::people::PyPeople;
    #[pymodule_export]
    use super::registration::{nearest_surface, points_within, shown};
    #[pymodule_export]
    use super::render::render_depth;
    #[pymodule_export]
    use super::shape::{PyClosestPoints, PyShape};
    #[pymodule_export]
    use super::sites::{PySiteGate, PySiteMotion, PySiteRay};
    #[pymodule_export]
    use super::skin::{PySkinCue, PySkinTeacher, skin_candidates};
    #[pymodule_export]
    use super::tracker::PyTracker;

    #[pymodule_init]
    fn init(module: &super::Bound<'_, super::PyModule>) -> super::PyResult<()> {
        use pyo3::types::PyModuleMethods;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
