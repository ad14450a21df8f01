//! The table of configuration entries, and a core configuration from plain values.

use std::collections::BTreeMap;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::{depythonize, pythonize};
use voodoo_core::{Config, Field, Value};

use crate::errors::ConfigError;

/// One row an entry: name, documentation, unit, default, (least, greatest) or None, words to choose from.
type FieldRow<'py> =
    (&'static str, &'static str, &'static str, Bound<'py, PyAny>, Option<(f64, f64)>, Vec<&'static str>);

#[doc = stub!("config_fields")]
#[pyfunction]
pub(crate) fn config_fields(py: Python<'_>) -> PyResult<Vec<FieldRow<'_>>> {
    let defaults = pythonize(py, &Config::default())?;
    let row = |Field { name, doc, unit, range, words }: &Field| {
        Ok((*name, *doc, *unit, defaults.get_item(name)?, *range, words.to_vec()))
    };
    Config::FIELDS.iter().map(row).collect()
}

/// A configuration from the values of a dictionary.
pub(crate) fn config(values: &Bound<'_, PyDict>) -> PyResult<Config> {
    let refused = |error: String| ConfigError::new_err(error);
    let values: BTreeMap<String, Value> = depythonize(values).map_err(|error| refused(error.to_string()))?;
    let mut config = Config::default();
    for (key, value) in values {
        config.set(&key, value).map_err(|error| refused(error.to_string()))?;
    }
    Ok(config)
}
