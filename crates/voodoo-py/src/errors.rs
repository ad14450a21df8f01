//! Core errors become the exceptions of `voodoo.errors`.

use pyo3::prelude::*;
use voodoo_core::shape::ShapeError;
use voodoo_core::{BodyError, CameraError, ConfigError, TrackError};

/// An exception of `voodoo.errors` by its class name.
pub fn exception(py: Python<'_>, class: &str, message: String) -> PyErr {
    match py.import("voodoo.errors").and_then(|module| module.getattr(class)).and_then(|class| class.call1((message,)))
    {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

/// Translation of a core error; a trait because both types are foreign here.
pub trait IntoPy {
    fn into_py(self, py: Python<'_>) -> PyErr;
}

impl IntoPy for BodyError {
    fn into_py(self, py: Python<'_>) -> PyErr {
        exception(py, "BodyError", self.to_string())
    }
}

impl IntoPy for CameraError {
    fn into_py(self, py: Python<'_>) -> PyErr {
        exception(py, "CameraError", self.to_string())
    }
}

impl IntoPy for ShapeError {
    fn into_py(self, py: Python<'_>) -> PyErr {
        exception(py, "BodyError", self.to_string())
    }
}

impl IntoPy for ConfigError {
    fn into_py(self, py: Python<'_>) -> PyErr {
        exception(py, "ConfigError", self.to_string())
    }
}

impl IntoPy for TrackError {
    fn into_py(self, py: Python<'_>) -> PyErr {
        let class = match self {
            Self::Body(_) => "BodyError",
            _ => "MeasurementError",
        };
        exception(py, class, self.to_string())
    }
}

/// What was expected of an argument and what it is.
pub fn wrong_argument(py: Python<'_>, name: &str, expected: &str, found: &Bound<'_, PyAny>) -> PyErr {
    let mut found = found.repr().map_or_else(|_| "something without a repr".into(), |text| text.to_string());
    if found.chars().count() > 120 {
        found = found.chars().take(120).chain("...".chars()).collect();
    }
    exception(py, "MeasurementError", format!("{name}: expected {expected}, found {found}"))
}
