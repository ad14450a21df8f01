//! Weighted points.

use super::{Points, Vec3};

/// Points in single precision, each with a weight. Meters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct WeightedPoints {
    /// Positions.
    pub points: Points,
    /// Weights.
    pub weights: Vec<f64>,
}

impl WeightedPoints {
    /// Removes all points and keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.points.clear();
        self.weights.clear();
    }

    /// Removes all points and makes room for `len`.
    pub(crate) fn make_room(&mut self, len: usize) {
        self.clear();
        self.points.reserve(len);
        self.weights.reserve(len);
    }

    /// Appends a point.
    pub(crate) fn push(&mut self, point: [f32; 3], weight: f64) {
        self.points.push(point);
        self.weights.push(weight);
    }

    /// Appends points with their weights.
    pub(crate) fn extend<W: Copy + Into<f64>>(&mut self, points: &Points, weights: &[W]) {
        self.points.x.extend_from_slice(&points.x);
        self.points.y.extend_from_slice(&points.y);
        self.points.z.extend_from_slice(&points.z);
        self.weights.extend(weights.iter().map(|weight| (*weight).into()));
    }

    /// Sum of the weights.
    pub(crate) fn total(&self) -> f64 {
        self.weights.iter().sum()
    }

    /// Point and weight at `index`.
    pub(crate) fn get(&self, index: usize) -> (Vec3, f64) {
        (self.points.get(index), self.weights[index])
    }

    /// Reduces the points to approximately `most`, evenly, and keeps their total weight.
    pub(crate) fn subsample(&mut self, most: usize) {
        let count = self.weights.len();
        if count <= most {
            return;
        }
        let Self { points, weights } = self;
        let scale = count as f64 / most as f64;
        for kept in 0..most {
            let from = (kept as f64 * scale) as usize;
            points.set(kept, [points.x[from], points.y[from], points.z[from]]);
            weights[kept] = weights[from] * scale;
        }
        points.resize(most);
        weights.truncate(most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subsample_is_even_and_keeps_the_weight() {
        let mut all = WeightedPoints::default();
        (0..1000).for_each(|index| all.push([index as f32, 0.0, 0.0], 2.0));
        all.subsample(70);
        assert_eq!(all.weights.len(), 70);
        assert!((all.total() - 2000.0).abs() < 1e-9);
        for index in 1..70 {
            let step = all.get(index).0.x - all.get(index - 1).0.x;
            assert!((14.0..=15.0).contains(&step), "{step}");
        }
        let before = all.clone();
        all.subsample(70);
        assert_eq!(all, before);
    }

    #[test]
    fn a_copy_of_candidates_is_exact() {
        let mut points = Points::default();
        points.push([0.1, 0.2, 0.3]);
        let mut copy = WeightedPoints::default();
        copy.extend(&points, &[0.7_f32]);
        copy.extend(&points, &[0.7_f32]);
        assert_eq!(copy.weights.len(), 2);
        assert_eq!((copy.points.x[1], copy.weights[1]), (0.1, f64::from(0.7_f32)));
    }
}
