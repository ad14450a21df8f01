//! The table of configuration entries, and a core configuration from plain values.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::{depythonize, pythonize};
use voodoo_core::{Config, Value};

use crate::errors::ConfigError;

/// One row an entry: name, documentation, unit, default, (least, greatest) or None, words to choose from.
type FieldRow<'py> = (&'static str, String, &'static str, Bound<'py, PyAny>, Option<(f64, f64)>, Vec<&'static str>);

#[doc = stub!("config_fields")]
#[pyfunction]
pub(crate) fn config_fields(py: Python<'_>) -> PyResult<Vec<FieldRow<'_>>> {
    Config::default()
        .fields()
        .into_iter()
        .map(|field| {
            let default = pythonize(py, &field.default)?;
            Ok((field.name, field.doc, field.unit, default, field.range, field.words.to_vec()))
        })
        .collect()
}

/// A configuration from the values of a dictionary.
pub(crate) fn config(values: &Bound<'_, PyDict>) -> PyResult<Config> {
    let mut config = Config::default();
    for (key, value) in values.iter() {
        let key: String = key.extract()?;
        let wrong = |_| ConfigError::new_err(format!("{key}: expected a number, a switch or a word, found {value}"));
        let found: Value = depythonize(&value).map_err(wrong)?;
        config.set(&key, &found).map_err(|error| ConfigError::new_err(error.to_string()))?;
    }
    Ok(config)
}
