//! Conversion of numbers and words from callers; an error names the argument.
//!
//! PyO3 converts arguments itself, but its TypeError is not an exception of `voodoo.errors`.

use pyo3::prelude::*;

use crate::errors::{BodyError, MeasurementError, wrong};

/// Functions for `from_py_with`, each named like its argument.
macro_rules! arguments {
    ($error:ident, $expected:literal, $type:ty: $($name:ident)*) => {
        $(pub(crate) fn $name(value: &Bound<'_, PyAny>) -> PyResult<$type> {
            value.extract().map_err(|_| $error::new_err(wrong(stringify!($name), $expected, value)))
        })*
    };
}

arguments!(MeasurementError, "a number", f64: stamp weight bias offset meters_per_unit log_odds);
arguments!(BodyError, "meters", f64: length a0 b0 a1 b1);
arguments!(MeasurementError, "a name", String: site);
