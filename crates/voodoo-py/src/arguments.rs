//! Conversion of numbers and words from callers; an error names the argument.
//!
//! PyO3 converts arguments itself, but its TypeError is not an exception of `voodoo.errors`.

use pyo3::prelude::*;

use crate::errors::{BodyError, wrong_argument};

/// Functions for `from_py_with`, each named like its argument.
macro_rules! arguments {
    ($convert:ident, $type:ty: $($name:ident)*) => {
        $(pub(crate) fn $name(value: &Bound<'_, PyAny>) -> PyResult<$type> {
            $convert(stringify!($name), value)
        })*
    };
}

arguments!(number, f64: stamp weight bias offset meters_per_unit log_odds);
arguments!(dimension, f64: length a0 b0 a1 b1);
arguments!(word, String: site);

fn number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    value.extract().map_err(|_| wrong_argument(name, "a number", value))
}

fn dimension(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    value.extract().map_err(|_| {
        let text = wrong_argument(name, "meters", value).value(value.py()).to_string();
        BodyError::new_err(text)
    })
}

fn word(name: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.extract().map_err(|_| wrong_argument(name, "a name", value))
}
