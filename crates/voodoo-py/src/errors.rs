//! Core errors become the exceptions of `voodoo.errors`.

use std::fmt::Display;

use pyo3::prelude::*;
use voodoo_core::ShapeError;
use voodoo_core::{BodyError, CameraError, ConfigError, TrackError};

/// An exception of `voodoo.errors` by its class name.
pub(crate) fn exception(py: Python<'_>, class: &str, message: String) -> PyErr {
    match py.import("voodoo.errors").and_then(|module| module.getattr(class)).and_then(|class| class.call1((message,)))
    {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

/// Translation of a core error; a trait because both types are foreign here.
pub(crate) trait IntoPy: Display + Sized {
    /// Its class in `voodoo.errors`.
    const CLASS: &'static str;

    fn class(&self) -> &'static str {
        Self::CLASS
    }

    fn into_py(self, py: Python<'_>) -> PyErr {
        exception(py, self.class(), self.to_string())
    }
}

impl IntoPy for BodyError {
    const CLASS: &'static str = "BodyError";
}

impl IntoPy for CameraError {
    const CLASS: &'static str = "CameraError";
}

impl IntoPy for ShapeError {
    const CLASS: &'static str = "BodyError";
}

impl IntoPy for ConfigError {
    const CLASS: &'static str = "ConfigError";
}

impl IntoPy for TrackError {
    const CLASS: &'static str = "MeasurementError";

    fn class(&self) -> &'static str {
        if matches!(self, Self::Body(_)) { BodyError::CLASS } else { Self::CLASS }
    }
}

/// What was expected of an argument and what it is.
pub(crate) fn wrong_argument(py: Python<'_>, name: &str, expected: &str, found: &Bound<'_, PyAny>) -> PyErr {
    let mut found = found.repr().map_or_else(|_| "something without a repr".into(), |text| text.to_string());
    if found.chars().count() > 120 {
        found = found.chars().take(120).chain("...".chars()).collect();
    }
    exception(py, "MeasurementError", format!("{name}: expected {expected}, found {found}"))
}
