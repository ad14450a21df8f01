//! Core errors become the exceptions of `voodoo.errors`.

use std::ffi::CString;
use std::fmt::Display;

use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::import_exception;
use pyo3::prelude::*;
use voodoo_core::TrackError;

import_exception!(voodoo.errors, BodyError);
import_exception!(voodoo.errors, CameraError);
import_exception!(voodoo.errors, ConfigError);
import_exception!(voodoo.errors, MeasurementError);

/// The exception for an error of the core: of its body, or of a measurement.
pub(crate) fn raise(error: impl Into<TrackError>) -> PyErr {
    match error.into() {
        TrackError::Body(error) => BodyError::new_err(error.to_string()),
        error => MeasurementError::new_err(error.to_string()),
    }
}

/// What was expected of an argument and what it is: of an array its shape and type.
pub(crate) fn wrong(name: &str, expected: &str, found: &Bound<'_, PyAny>) -> String {
    let found = match found.cast::<PyUntypedArray>() {
        Ok(array) => format!("shape {:?}, dtype {}", array.shape(), array.dtype()),
        Err(_) => found.repr().map_or_else(|_| "something without a repr".into(), |text| text.to_string()),
    };
    let more = if found.chars().count() > 120 { "..." } else { "" };
    format!("{name}: expected {expected}, found {found:.120}{more}")
}

/// Rejects a measurement that is not valid; the text is made only then.
pub(crate) fn unless(valid: bool, name: impl Display, expected: impl Display, found: impl Display) -> PyResult<()> {
    if valid { Ok(()) } else { Err(MeasurementError::new_err(format!("{name}: expected {expected}, found {found}"))) }
}

pub(crate) fn wrong_argument(name: &str, expected: &str, found: &Bound<'_, PyAny>) -> PyErr {
    MeasurementError::new_err(wrong(name, expected, found))
}

/// Warns by a category of voodoo.errors of what the caller so many stack frames above did.
pub(crate) fn warn(py: Python<'_>, category: &str, text: String, level: i32) -> PyResult<()> {
    let category = py.import("voodoo.errors")?.getattr(category)?;
    PyErr::warn(py, &category, &CString::new(text.replace('\0', ""))?, level)
}
