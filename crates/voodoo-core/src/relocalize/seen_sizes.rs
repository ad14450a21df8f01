//! The sizes of a person, as the detections of the first second together tell them.

use crate::detect::Detection;

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
        for ([sum, weights], [size, sigma]) in self.sums.iter_mut().zip(sizes) {
            let weight = 1.0 / (sigma * sigma);
            *sum += weight * size.ln();
            *weights += weight;
        }
        self.count += 1;
    }

    /// The mean sizes of several detections, and how well these know them: detections of one person err alike.
    pub(super) fn mean(&self) -> Option<Vec<[f64; 2]>> {
        let mean = |[sum, weights]: &[f64; 2]| [(sum / weights).exp(), (self.count as f64 / weights).sqrt()];
        (self.count > 1).then(|| self.sums.iter().map(mean).collect())
    }
}
