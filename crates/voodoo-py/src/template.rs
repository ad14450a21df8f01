//! Messages of live outputs, in which only numbers change.

use std::borrow::Cow;

use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTupleMethods};

use crate::errors::{MeasurementError, unless};
use crate::estimate::PyEstimate;

#[doc = stub!("Template")]
#[pyclass(module = "voodoo._core", frozen)]
pub(crate) struct Template {
    messages: Vec<Message>,
    count: usize,
    /// Single precision with the most significant byte first, instead of double precision with the least.
    single: bool,
}

struct Message {
    bytes: Vec<u8>,
    /// Where numbers begin, and which they are.
    numbers: Vec<(usize, usize)>,
    stamps: Vec<usize>,
}

fn put(message: &mut [u8], at: usize, bytes: &[u8]) {
    if let Some(place) = message.get_mut(at..at + bytes.len()) {
        place.copy_from_slice(bytes);
    }
}

/// The numbers of arrays in their order, however they are stored.
fn all(parts: &[PyReadonlyArrayDyn<'_, f64>]) -> Vec<f64> {
    let mut all = Vec::with_capacity(parts.iter().map(|part| part.len()).sum());
    for part in parts {
        part.as_array().rows().into_iter().for_each(|row| match row.as_slice() {
            Some(row) => all.extend_from_slice(row),
            None => all.extend(row),
        });
    }
    all
}

#[pymethods]
impl Template {
    #[new]
    fn new(messages: Vec<Bound<'_, PyBytes>>, first: f64, count: usize, single: bool, stamp: &[u8]) -> PyResult<Self> {
        let number = |bytes: &[u8]| {
            let number = match single {
                true => f64::from(f32::from_be_bytes(*bytes.first_chunk()?)),
                false => f64::from_le_bytes(*bytes.first_chunk()?),
            } - first;
            (number >= 0.0 && number < count as f64 && number.fract() == 0.0).then_some(number as usize)
        };
        let message = |message: &Bound<'_, PyBytes>| {
            let bytes = message.as_bytes();
            let numbers = (0..bytes.len()).filter_map(|at| Some((at, number(&bytes[at..])?))).collect();
            let stamps = (0..bytes.len()).filter(|at| !stamp.is_empty() && bytes[*at..].starts_with(stamp)).collect();
            Message { bytes: bytes.to_vec(), numbers, stamps }
        };
        let messages: Vec<Message> = messages.iter().map(message).collect();
        let found = messages.iter().any(|message| !message.numbers.is_empty());
        unless(found || count == 0, "numbers", "some in the messages", "none")?;
        Ok(Self { messages, count, single })
    }

    #[doc = stub!("Template.filled")]
    fn filled<'py>(
        &self,
        py: Python<'py>,
        numbers: Vec<PyReadonlyArrayDyn<'py, f64>>,
        stamp: &[u8],
    ) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let all = all(&numbers);
        unless(all.len() == self.count, "numbers", self.count, all.len())?;
        let filled = |message: &Message| {
            let mut bytes = message.bytes.clone();
            for &(at, number) in &message.numbers {
                if self.single {
                    put(&mut bytes, at, &(all[number] as f32).to_be_bytes());
                } else {
                    put(&mut bytes, at, &all[number].to_le_bytes());
                }
            }
            message.stamps.iter().for_each(|at| put(&mut bytes, *at, stamp));
            PyBytes::new(py, &bytes)
        };
        Ok(self.messages.iter().map(filled).collect())
    }
}

/// The words of a person in a text: status, residual, and status of the limbs.
fn words<'a>(py: Python<'_>, one: &'a PyEstimate) -> impl Iterator<Item = Cow<'static, str>> + use<'a> {
    let limbs = &one.estimate.limb_status;
    let unknown = one.names.limbs.bind(py).len().saturating_sub(limbs.len());
    let limbs = limbs.iter().map(|status| status.name()).chain(std::iter::repeat_n("", unknown));
    let residual = one.estimate.mean_squared_distance.sqrt();
    let residual = if residual.is_finite() { format!("{residual:?}").into() } else { "null".into() };
    [one.estimate.status.name().into(), residual].into_iter().chain(limbs.map(Cow::Borrowed))
}

#[doc = stub!("people_text")]
#[pyfunction]
pub(crate) fn people_text<'py>(
    py: Python<'py>,
    text: &[u8],
    numbers: Vec<PyReadonlyArrayDyn<'py, f64>>,
    stamp: f64,
    estimates: Vec<PyRef<'py, PyEstimate>>,
) -> PyResult<Bound<'py, PyBytes>> {
    let wrong = || MeasurementError::new_err("text: expected places for all numbers and words, found fewer or more");
    let mut numbers = all(&numbers).into_iter();
    let mut words = std::iter::once(format!("{stamp:?}").into()).chain(estimates.iter().flat_map(|one| words(py, one)));
    let (mut written, mut digits) = (Vec::with_capacity(2 * text.len()), itoa::Buffer::new());
    for part in text.split_inclusive(|&byte| byte <= 2) {
        let (&last, before) = part.split_last().unwrap_or((&b' ', part));
        written.extend_from_slice(if last <= 2 { before } else { part });
        if last == 1 {
            written.extend_from_slice(words.next().ok_or_else(wrong)?.as_bytes());
        } else if last <= 2 {
            let number = numbers.next().ok_or_else(wrong)? * if last == 0 { 1e5 } else { 1e6 };
            written.extend_from_slice(digits.format(number.round_ties_even() as i64).as_bytes());
        }
    }
    if words.next().is_some() || numbers.next().is_some() {
        return Err(wrong());
    }
    Ok(PyBytes::new(py, &written))
}
