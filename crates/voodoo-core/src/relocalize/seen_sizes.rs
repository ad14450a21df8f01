//! The sizes of a person, as the detections of the first second together tell them.

use crate::detect::Detection;

/// Detections of one person err alike: no length is known better than this share of it by any of them.
const ALIKE: f64 = 0.02;

/// Sums of the logarithms of lengths, each weighted by how well a detection knows it.
#[derive(Debug, Default)]
pub(super) struct SeenSizes {
    /// Weighted sum and sum of weights, in the order of `LENGTHS`.
    sums: Vec<[f64; 2]>,
    count: usize,
}

impl SeenSizes {
    /// Another person.
    pub(super) fn clear(&mut self) {
        self.sums.clear();
        self.count = 0;
    }

    /// Takes a detection in.
    pub(super) fn add(&mut self, detection: &Detection) {
        let sizes = detection.sizes();
        self.sums.resize(sizes.len(), [0.0; 2]);
        for (index, ([sum, weights], size)) in self.sums.iter_mut().zip(sizes).enumerate() {
            let sigma = detection.lengths.get(index).map_or(1.0, |length| length[1].hypot(ALIKE));
            let weight = 1.0 / (sigma * sigma);
            *sum += weight * size.ln();
            *weights += weight;
        }
        self.count += 1;
    }

    /// The mean lengths of several detections, metres.
    pub(super) fn mean(&self) -> Option<Vec<f64>> {
        (self.count > 1).then(|| self.sums.iter().map(|[sum, weights]| (sum / weights).exp()).collect())
    }
}
