//! The one currency between measurements and solvers: weighted pairs of a body point and a target.
//!
//! Everything is in the working frame: world axes, origin near the body.

use crate::math::{LANES, Mat3, Points, Vec3, widest};
use crate::shape::SurfaceBatch;

/// Surface matches of one limb: measured points and their closest points. Rejected pairs stay with weight zero.
#[derive(Debug, Default)]
pub(crate) struct LimbMatches {
    /// Index of each point among the candidates.
    pub candidate: Vec<u32>,
    /// Measured points.
    pub measured: Points,
    /// Weights of the measurements, before any pair is rejected.
    pub base_weight: Vec<f32>,
    /// Weights.
    pub weight: Vec<f32>,
    /// Closest points, normals, signed distances.
    pub surface: SurfaceBatch,
}

/// A site with a target: a measured position, or the closest point of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SitePair {
    /// The limb that carries the site.
    pub limb: usize,
    /// The site.
    pub x: Vec3,
    /// The target.
    pub p: Vec3,
    /// Scalar weight, as the papers use it, of what is beyond the bias.
    pub weight: f64,
    /// Scalar weight of the measurement, before its bias is taken off.
    pub base_weight: f64,
    /// The measurement may always be this far off, meters.
    pub bias: f64,
    /// What of a difference counts: the identity for a position, `I - d d^T` for a ray along `d`.
    pub across: Mat3,
    /// Weight times the identity for a position, times `I - d d^T` for a ray along `d` (method: every datum has an information).
    pub information: Mat3,
    /// Number of the source.
    pub source: u16,
}

/// A point of a limb's rim and the edge that an image shows there: a distance along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContourPair {
    /// The limb.
    pub limb: usize,
    /// The rim's point.
    pub x: Vec3,
    /// Direction across the limb and the line of sight.
    pub normal: Vec3,
    /// The edge lies so far out along it, meters; negative when the image shows less than the model.
    pub distance: f64,
}

/// A point of a limb's contour and the edge of its colors in a picture: a distance along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RegionPair {
    /// The limb.
    pub limb: usize,
    /// The contour's point.
    pub x: Vec3,
    /// Direction in which the point is seen to move across the contour, outward, length one.
    pub normal: Vec3,
    /// The edge lies so far out along it, meters.
    pub distance: f64,
    /// What the colors say of it, 1/m^2.
    pub information: f64,
    /// Number of the source.
    pub source: u16,
}

/// What pictures say of a limb, by its lines: shares of those that can tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RegionSupport {
    /// Its colors end at its contour: of the whole limb, each line weighted with its distance from the proximal joint, and of
    /// its outer part.
    pub own: [f64; 2],
    /// The colors of its surroundings are seen within it, likewise.
    pub against: [f64; 2],
    /// Lines that can tell, as a share of all.
    pub visible: f64,
    /// Number of lines.
    pub lines: f64,
    /// What a limb of an arm or leg explains of the pictures, and no limb of another one or of the trunk, patches.
    pub gained: f64,
    /// Its area in the pictures, hidden or not, patches.
    pub area: f64,
}

/// One elastic band: the same point of a joint on the parent and on the child (K07 4.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Band {
    /// Parent limb.
    pub parent: usize,
    /// Child limb.
    pub child: usize,
    /// End on the parent.
    pub on_parent: Vec3,
    /// End on the child.
    pub on_child: Vec3,
    /// Artificial weight towards the parent's own measurements.
    pub parent_weight: f64,
    /// Artificial weight towards the child's own measurements.
    pub child_weight: f64,
}

/// All correspondences of one ICP step.
#[derive(Debug, Default)]
pub(crate) struct Correspondences {
    /// Surface matches, limb by limb.
    pub limbs: Vec<LimbMatches>,
    /// Sites with positions and rays.
    pub sites: Vec<SitePair>,
    /// Rims of limbs and the contour of the body in depth images.
    pub contour: Vec<ContourPair>,
    /// Contours of limbs and edges of colors.
    pub regions: Vec<RegionPair>,
    /// What they say of each limb; empty without pictures.
    pub region_support: Vec<RegionSupport>,
    /// Elastic bands.
    pub bands: Vec<Band>,
}

impl LimbMatches {
    /// Makes room for `len` pairs in all.
    pub(crate) fn reserve(&mut self, len: usize) {
        self.candidate.reserve(len.saturating_sub(self.candidate.len()));
        self.measured.reserve(len);
        self.base_weight.reserve(len.saturating_sub(self.base_weight.len()));
        self.weight.reserve(len.saturating_sub(self.weight.len()));
        self.surface.reserve(len);
    }

    /// Sum of the weights, and weighted sum of the squared distances.
    pub(crate) fn weighed(&self) -> (f64, f64) {
        let square = |weight, distance| f64::from(weight) * f64::from(distance) * f64::from(distance);
        let (weight, distance) = (&self.weight, &self.surface.signed_distance);
        let both = |weight, distance| [f64::from(weight), square(weight, distance)];
        widest(
            #[inline(always)]
            || in_lanes(weight, distance, both),
        )
        .into()
    }

    /// Sum of the weights.
    pub(crate) fn total_weight(&self) -> f64 {
        let [total] = widest(
            #[inline(always)]
            || in_lanes(&self.weight, &self.weight, |weight, _| [f64::from(weight)]),
        );
        total
    }

    /// Number of accepted pairs and weighted sum of their squared distances.
    pub(crate) fn accepted(&self) -> (usize, f64) {
        (self.weight.iter().filter(|weight| **weight > 0.0).count(), self.weighed().1)
    }
}

/// Sums of `values` over two columns in several lanes: no addition waits for the one before, and the order is always the same.
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
    /// Makes as much room for surface matches and edges as `other` has.
    pub(crate) fn reserve_as(&mut self, other: &Self) {
        self.regions.reserve(other.regions.capacity().saturating_sub(self.regions.len()));
        self.region_support.reserve(other.region_support.capacity().saturating_sub(self.region_support.len()));
        self.limbs.resize_with(other.limbs.len(), LimbMatches::default);
        for (own, other) in self.limbs.iter_mut().zip(&other.limbs) {
            own.reserve(other.candidate.capacity());
        }
    }

    /// Measured weight of a limb: its points and its sites.
    pub(crate) fn measured_weight(&self, limb: usize) -> f64 {
        let sites: f64 = self.sites.iter().filter(|pair| pair.limb == limb).map(|pair| pair.weight).sum();
        self.limbs[limb].total_weight() + sites
    }

    /// Mean squared distance of the surface points that fit, meters squared: Geman-McClure's weights of `scale` leave out those
    /// that belong to something else.
    pub(crate) fn scatter(&self, scale: f64) -> Option<f64> {
        let (mut weight, mut sum) = (0.0, 0.0);
        let inverse_square = 1.0 / (scale * scale);
        for limb in &self.limbs {
            let fitting = |fraction, distance| {
                let square = f64::from(distance) * f64::from(distance);
                let falloff = 1.0 / (1.0 + square * inverse_square);
                let fits = f64::from(fraction) * (falloff * falloff);
                [fits, fits * square]
            };
            let [fits, squares] = widest(
                #[inline(always)]
                || in_lanes(&limb.weight, &limb.surface.signed_distance, fitting),
            );
            weight += fits;
            sum += squares;
        }
        (weight > 0.0).then(|| sum / weight)
    }

    /// Weighted mean of the squared distances of all measured pairs (K06 III-B step 2), `None` without any.
    pub(crate) fn mean_squared_distance(&self) -> Option<f64> {
        let (mut weight, mut sum) = (0.0, 0.0);
        for limb in &self.limbs {
            let (total, squares) = limb.weighed();
            weight += total;
            sum += squares;
        }
        for pair in &self.sites {
            weight += pair.weight;
            sum += pair.weight * (pair.x - pair.p).length_squared();
        }
        (weight > 0.0).then(|| sum / weight)
    }

    /// Mean of the squared distances of the edges of color regions by what they tell, `None` without any.
    pub(crate) fn mean_squared_edge(&self) -> Option<f64> {
        let weight: f64 = self.regions.iter().map(|pair| pair.information).sum();
        let sum: f64 = self.regions.iter().map(|pair| pair.information * pair.distance * pair.distance).sum();
        (weight > 0.0).then(|| sum / weight)
    }
}
