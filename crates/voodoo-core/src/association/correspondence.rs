//! Correspondences between measurements and the body: weighted pairs of a body point and a target. They are all that solvers
//! get.
//!
//! Everything is in the working frame: world axes, origin near the body.

use crate::math::{LANES, Mat3, Points, Vec3, vectorized};
use crate::observation::candidates::Candidates;
use crate::shape::SurfaceBatch;

/// Surface matches of one limb: measured points and their closest points. Rejected pairs are kept with weight zero.
#[derive(Debug, Default)]
pub(crate) struct LimbMatches {
    /// Index of each point among the candidates.
    pub candidate: Vec<u32>,
    /// Index among the candidates of every point that is not sampled, and the number of the sampled point that stands for it.
    pub left_out: Vec<[u32; 2]>,
    /// Measured points.
    pub measured: Points,
    /// Weights of the measurements, before any pair is rejected.
    pub base_weight: Vec<f32>,
    /// Weights, zero for rejected pairs.
    pub weight: Vec<f32>,
    /// Probability that each point shows the limb, by the detection of the frame; 1 without one. It weighs points in the fit
    /// only: poses are compared by what the sensors measure.
    pub own: Vec<f32>,
    /// Closest points, normals, signed distances.
    pub surface: SurfaceBatch,
    /// Variance of the limb's radius, square meters.
    pub radius_variance: f64,
}

/// A site with its target: a measured position, or the closest point of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SitePair {
    /// The limb that carries the site.
    pub limb: usize,
    /// The site in the limb's frame.
    pub local: Vec3,
    /// The site.
    pub x: Vec3,
    /// The target.
    pub p: Vec3,
    /// Scalar weight, as in the papers, reduced for the part of the distance within the bias.
    pub weight: f64,
    /// Scalar weight of the measurement, before the reduction for the bias.
    pub base_weight: f64,
    /// Bias, meters: the measurement may have a constant error of this size.
    pub bias: f64,
    /// Projection of the difference: the identity for a position, `I - d d^T` for a ray along `d`.
    pub across: Mat3,
    /// Index of the source.
    pub source: u16,
}

/// A joint of the body and where it was detected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DetectedPair {
    /// Index of the body's site.
    pub site: usize,
    /// Where it was detected.
    pub p: Vec3,
    /// Standard deviation along each axis, meters.
    pub sigma: f64,
    /// Information, 1/m^2.
    pub information: f64,
}

/// A point of a limb's rim and the edge that an image shows there: a distance along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EdgePair {
    /// The limb.
    pub limb: usize,
    /// The rim's point.
    pub x: Vec3,
    /// Direction outward in which the edge was searched for, unit length.
    pub normal: Vec3,
    /// Distance of the edge outward along the direction, meters; negative when the observed limb is narrower than the model.
    pub distance: f64,
    /// Information of the edge, 1/m^2.
    pub information: f64,
    /// Index of the source.
    pub source: u16,
}

/// Color evidence for and against a limb, from its lines: fractions of the lines that are informative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RegionSupport {
    /// Fraction of lines on which the limb's colors end at its contour, each line weighted by its distance from the proximal
    /// joint.
    pub own: f64,
    /// Fraction of lines on which the colors of the surroundings appear inside the contour, in the same way.
    pub against: f64,
    /// Informative lines, as a fraction of all.
    pub visible: f64,
    /// For limbs of arms and legs: image area that this limb explains, and that no limb of another arm or leg or of the trunk
    /// explains, patches.
    pub gained: f64,
    /// Its area in the images, occluded or not, patches.
    pub area: f64,
}

/// One end of an elastic band, which joins the same point of a joint on the parent and on the child (K07 4.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BandEnd {
    /// The limb that it pulls.
    pub limb: usize,
    /// The end on that limb.
    pub x: Vec3,
    /// The end on the other limb, the target.
    pub p: Vec3,
    /// Artificial weight, relative to the limb's measurements.
    pub weight: f64,
}

/// All correspondences of one ICP step.
#[derive(Debug, Default)]
pub(crate) struct Correspondences {
    /// Surface matches, one entry per limb.
    pub limbs: Vec<LimbMatches>,
    /// Sites with positions and rays.
    pub sites: Vec<SitePair>,
    /// Joints of a detection.
    pub detected: Vec<DetectedPair>,
    /// Rims of limbs and the depth contour of the body.
    pub contour: Vec<EdgePair>,
    /// Contours of limbs and color edges.
    pub regions: Vec<EdgePair>,
    /// Color evidence for each limb; empty without color images.
    pub region_support: Vec<RegionSupport>,
    /// Elastic bands, each with both of its ends.
    pub bands: Vec<BandEnd>,
}

impl LimbMatches {
    /// Reserves capacity for `len` pairs of `all` points.
    pub(crate) fn reserve(&mut self, len: usize, all: usize) {
        self.left_out.reserve(all.saturating_sub(self.left_out.len()));
        self.candidate.reserve(len.saturating_sub(self.candidate.len()));
        self.measured.reserve(len);
        self.base_weight.reserve(len.saturating_sub(self.base_weight.len()));
        self.weight.reserve(len.saturating_sub(self.weight.len()));
        self.own.reserve(len.saturating_sub(self.own.len()));
        self.surface.reserve(len);
    }

    /// The surface for which a point stands, in patches: with the part of it by which the match is accepted, and with the points
    /// that are not sampled.
    pub(crate) fn area(&self, index: usize, candidates: &Candidates) -> f64 {
        let precision = self.base_weight[index] / candidates.area[self.candidate[index] as usize];
        let sampled = self.candidate.len() as f64 / (self.candidate.len() + self.left_out.len()) as f64;
        // A weight that is too small for single precision is zero.
        if precision > 0.0 { f64::from(self.weight[index] / precision) / sampled } else { 0.0 }
    }

    /// Sum of the weights, and weighted sum of the squared distances.
    pub(crate) fn weighed(&self) -> (f64, f64) {
        let square = |weight, distance| f64::from(weight) * f64::from(distance) * f64::from(distance);
        let (weight, distance) = (&self.weight, &self.surface.signed_distance);
        let both = |weight, distance| [f64::from(weight), square(weight, distance)];
        vectorized!(in_lanes(weight, distance, both)).into()
    }

    /// Number of accepted pairs.
    pub(crate) fn accepted(&self) -> usize {
        self.weight.iter().filter(|weight| **weight > 0.0).count()
    }
}

/// Sums `values` over two columns in several lanes: no addition waits for the one before, and the order is always the same.
#[inline(always)]
fn in_lanes<const N: usize>(first: &[f32], second: &[f32], values: impl Fn(f32, f32) -> [f64; N]) -> [f64; N] {
    let mut sums = [[0.0; LANES]; N];
    let ((first, first_rest), (second, second_rest)) = (first.as_chunks::<LANES>(), second.as_chunks::<LANES>());
    for (first, second) in first.iter().zip(second) {
        for l in 0..LANES {
            let values = values(first[l], second[l]);
            for (sum, value) in sums.iter_mut().zip(values) {
                sum[l] += value;
            }
        }
    }
    for (l, (first, second)) in first_rest.iter().zip(second_rest).enumerate() {
        for (sum, value) in sums.iter_mut().zip(values(*first, *second)) {
            sum[l] += value;
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

impl Correspondences {
    /// Reserves capacity for `points` surface matches of each limb, of `all` points, and as much for color edges as `other` has.
    pub(crate) fn reserve(&mut self, points: usize, all: usize, other: &Self) {
        // Exactly as much: each of two that are exchanged would otherwise grow beyond the other.
        self.regions.reserve_exact(other.regions.capacity().saturating_sub(self.regions.len()));
        self.region_support.reserve_exact(other.region_support.capacity().saturating_sub(self.region_support.len()));
        self.limbs.resize_with(other.limbs.len(), LimbMatches::default);
        self.limbs.iter_mut().for_each(|limb| limb.reserve(points, all));
    }

    /// Total weight of a limb's measurements: its points and its sites.
    pub(crate) fn measured_weight(&self, limb: usize) -> f64 {
        let sites: f64 = self.sites.iter().filter(|pair| pair.limb == limb).map(|pair| pair.weight).sum();
        self.limbs[limb].weighed().0 + sites
    }

    /// Mean squared distance of the surface points that fit, meters squared. Geman-McClure weights of `scale` suppress points
    /// that belong to something else.
    pub(crate) fn scatter(&self, scale: f64) -> Option<f64> {
        let inverse_square = 1.0 / (scale * scale);
        let fitting = |fraction, distance| {
            let square = f64::from(distance) * f64::from(distance);
            let falloff = 1.0 / (1.0 + square * inverse_square);
            let fits = f64::from(fraction) * (falloff * falloff);
            [fits, fits * square]
        };
        let weigh = |limb: &LimbMatches| vectorized!(in_lanes(&limb.weight, &limb.surface.signed_distance, fitting));
        weighted_mean(self.limbs.iter().map(|limb| weigh(limb).into()))
    }

    /// Weighted mean of the squared distances of all measured pairs (K06 III-B step 2), `None` without any.
    pub(crate) fn mean_squared_distance(&self) -> Option<f64> {
        let weigh = |pair: &SitePair| (pair.weight, pair.weight * (pair.x - pair.p).length_squared());
        weighted_mean(self.limbs.iter().map(LimbMatches::weighed).chain(self.sites.iter().map(weigh)))
    }

    /// Mean squared distance of the color edges, weighted by their information; `None` without any.
    pub(crate) fn mean_squared_edge(&self) -> Option<f64> {
        let weigh = |pair: &EdgePair| (pair.information, pair.information * pair.distance * pair.distance);
        weighted_mean(self.regions.iter().map(weigh))
    }
}

/// Mean of values, given as weights and weighted values; `None` without weight.
fn weighted_mean(values: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let (weight, sum) = values.fold((0.0, 0.0), |(weight, sum), (own, value)| (weight + own, sum + value));
    (weight > 0.0).then(|| sum / weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correspondences_that_are_exchanged_and_reserve_for_each_other_do_not_grow() {
        let with_room = |edges: usize| Correspondences {
            regions: Vec::with_capacity(edges),
            limbs: vec![LimbMatches { candidate: Vec::with_capacity(10 * edges), ..LimbMatches::default() }],
            ..Correspondences::default()
        };
        let (mut current, mut tried) = (with_room(7), with_room(10));
        for _ in 0..40 {
            tried.reserve(80, 80, &current);
            std::mem::swap(&mut current, &mut tried);
        }
        let limb = &current.limbs[0];
        let room = [current.regions.capacity(), limb.candidate.capacity(), limb.measured.x.capacity()];
        assert!(room[0] <= 20 && room[1] <= 160 && room[2] <= 160, "{room:?}");
    }
}
