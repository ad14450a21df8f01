//! Core errors become the exceptions of `voodoo.errors`.

use std::fmt::Display;

use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::import_exception;
use pyo3::prelude::*;

import_exception!(voodoo.errors, BodyError);
import_exception!(voodoo.errors, CameraError);
import_exception!(voodoo.errors, ConfigError);
import_exception!(voodoo.errors, MeasurementError);

/// Translation of a core error; a trait because both types are foreign here.
pub(crate) trait Raise: Display + Sized {
    /// Its exception.
    const NEW: fn(String) -> PyErr;

    fn raise(self) -> PyErr {
        Self::NEW(self.to_string())
    }
}

impl Raise for voodoo_core::BodyError {
    const NEW: fn(String) -> PyErr = BodyError::new_err;
}

impl Raise for voodoo_core::CameraError {
    const NEW: fn(String) -> PyErr = CameraError::new_err;
}

impl Raise for voodoo_core::ShapeError {
    const NEW: fn(String) -> PyErr = BodyError::new_err;
}

impl Raise for voodoo_core::ConfigError {
    const NEW: fn(String) -> PyErr = ConfigError::new_err;
}

impl Raise for voodoo_core::TrackError {
    const NEW: fn(String) -> PyErr = MeasurementError::new_err;

    fn raise(self) -> PyErr {
        if matches!(self, Self::Body(_)) { BodyError::new_err(self.to_string()) } else { Self::NEW(self.to_string()) }
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

pub(crate) fn wrong_argument(name: &str, expected: &str, found: &Bound<'_, PyAny>) -> PyErr {
    MeasurementError::new_err(wrong(name, expected, found))
}
