//! Messages of live outputs, in which only numbers change.

use numpy::{PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedStr;
use pyo3::types::PyBytes;

use crate::errors::MeasurementError;

#[doc = stub!("Template")]
#[pyclass(module = "voodoo._core", frozen)]
pub(crate) struct Template {
    messages: Vec<u8>,
    ends: Vec<usize>,
    /// Where each number begins.
    places: Vec<usize>,
    stamps: Vec<usize>,
    /// Single precision with the most significant byte first, instead of double precision with the least.
    single: bool,
}

fn found(messages: &[u8], bytes: &[u8]) -> impl Iterator<Item = usize> {
    let starts = messages.windows(bytes.len().max(1)).enumerate();
    starts.filter(move |(_, window)| *window == bytes).map(|(at, _)| at)
}

fn put(messages: &mut [u8], at: usize, bytes: &[u8]) {
    if let Some(place) = messages.get_mut(at..at + bytes.len()) {
        place.copy_from_slice(bytes);
    }
}

fn put_number(messages: &mut [u8], at: usize, number: f64, single: bool) {
    if single {
        put(messages, at, &(number as f32).to_be_bytes());
    } else {
        put(messages, at, &number.to_le_bytes());
    }
}

/// So many numbers of arrays in their order, however they are stored.
fn all<'a>(parts: &'a [PyReadonlyArrayDyn<'_, f64>], expected: usize) -> PyResult<impl Iterator<Item = &'a f64>> {
    let found: usize = parts.iter().map(|part| part.len()).sum();
    if found != expected {
        return Err(MeasurementError::new_err(format!("numbers: expected {expected}, found {found}")));
    }
    Ok(parts.iter().flat_map(|part| part.as_array().into_iter()))
}

#[pymethods]
impl Template {
    #[new]
    fn new(
        messages: Vec<Bound<'_, PyBytes>>,
        numbers: PyReadonlyArray1<'_, f64>,
        single: bool,
        stamp: &[u8],
    ) -> PyResult<Self> {
        let ends = messages.iter().scan(0, |end, message| {
            *end += message.as_bytes().len();
            Some(*end)
        });
        let ends = ends.collect();
        let messages: Vec<u8> = messages.iter().flat_map(|message| message.as_bytes()).copied().collect();
        let mut last = 0;
        let place = |number: &f64| {
            let (mut bytes, width) = ([0; 8], if single { 4 } else { 8 });
            put_number(&mut bytes, 0, *number, single);
            // Most numbers are in their order.
            let next = found(messages.get(last..)?, bytes.get(..width)?).next().map(|at| last + at);
            last = next.or_else(|| found(&messages, bytes.get(..width)?).next())?;
            Some(last)
        };
        let places: Option<Vec<usize>> = numbers.as_slice()?.iter().map(place).collect();
        let places = places
            .ok_or_else(|| MeasurementError::new_err("numbers: expected those in the messages, found another"))?;
        let stamps = found(&messages, stamp).collect();
        Ok(Self { messages, ends, places, stamps, single })
    }

    #[doc = stub!("Template.filled")]
    fn filled<'py>(
        &self,
        py: Python<'py>,
        numbers: Vec<PyReadonlyArrayDyn<'py, f64>>,
        stamp: &[u8],
    ) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let mut messages = self.messages.clone();
        for (place, number) in self.places.iter().zip(all(&numbers, self.places.len())?) {
            put_number(&mut messages, *place, *number, self.single);
        }
        for at in &self.stamps {
            put(&mut messages, *at, stamp);
        }
        let starts = std::iter::once(&0).chain(&self.ends);
        let slices = starts.zip(&self.ends).filter_map(|(start, end)| messages.get(*start..*end));
        Ok(slices.map(|slice| PyBytes::new(py, slice)).collect())
    }
}

#[doc = stub!("with_values")]
#[pyfunction]
pub(crate) fn with_values(
    text: &str,
    numbers: Vec<PyReadonlyArrayDyn<'_, f64>>,
    words: Vec<PyBackedStr>,
) -> PyResult<String> {
    let mut numbers = all(&numbers, text.matches('\0').count())?;
    let expected = text.matches('\u{1}').count();
    if words.len() != expected {
        return Err(MeasurementError::new_err(format!("words: expected {expected}, found {}", words.len())));
    }
    let (mut written, mut words) = (String::with_capacity(2 * text.len()), words.iter());
    for part in text.split_inclusive(['\0', '\u{1}']) {
        written.push_str(part.trim_end_matches(['\0', '\u{1}']));
        if part.ends_with('\0') {
            let number = numbers.next().map_or(0.0, |number| number.round_ties_even()) as i64;
            written.push_str(&number.to_string());
        } else if part.ends_with('\u{1}') {
            written.push_str(words.next().map_or("", |word| word));
        }
    }
    Ok(written)
}
