//! Girths of limbs. In the first frame the named joints fix the pose and the lengths, and the points around them determine each
//! limb's thickness and the offset of its surface from the line between its joints. Later frames show sides that were hidden
//! before, such as a trunk behind hanging arms. Two edges on opposite sides of a limb determine its width wherever the limb is; a
//! single edge does so only as precisely as the limb's axis is known.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::association::contour::DepthEdge;
use crate::association::correspondence::LimbMatches;
use crate::body::Body;
use crate::math::{Pose, Vec3};
use crate::shape::{Section, TaperedEllipticCylinder};

/// Gauss-Newton steps of the girth fit; points are matched to limbs anew in each.
pub(super) const GIRTH_STEPS: usize = 6;
/// Standard deviation of the shift of a limb's surface relative to its joints (meters), and of its relative girth: the variation
/// between persons, clothes and definitions of joint centers that anthropometry leaves.
const SHIFT_SIGMA: f64 = 0.03;
const GIRTH_SIGMA: f64 = 0.12;
/// Correlation of the relative girths of a limb and its counterpart on the other side.
const SYMMETRY: f64 = 0.9;
/// Standard deviation of a surface point about the model, meters, and the maximum number of independent points on a limb: errors
/// of neighbors are correlated.
const POINT_SIGMA: f64 = 0.015;
const INDEPENDENT: f64 = 30.0;
/// Share of a limb's shift that is the body's where the pose was found, not given: the error of a detected pose is as large.
pub(super) const FOUND_SHARE: f64 = 0.5;
/// Lateral standard deviation of a tracked limb's axis, across the line of sight, meters.
pub(super) const ASIDE_SIGMA: f64 = 0.01;
/// Number of successive frames that have the information of one, because their edge errors are correlated.
pub(crate) const ALIKE: f64 = 10.0;
/// Time constant of the girth estimate in frames: older information fades because clothes move.
const REMEMBERED: f64 = 100.0;
/// Minimum number of matched points for a girth step.
const ENOUGH: usize = 15;

/// Change of a limb's surface in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GirthFit {
    /// Shift perpendicular to the axis, meters; z is 0.
    pub shift: Vec3,
    /// Factors of the semi-axes along x, of those along y, and of both at the distal end. There are three, not four: both axes
    /// taper alike, so that the side of the limb stays nearly developable and its closest points are fast to compute.
    pub factors: [f64; 3],
}

impl Default for GirthFit {
    fn default() -> Self {
        Self { shift: Vec3::ZERO, factors: [1.0; 3] }
    }
}

/// Returns the derivatives of the surface displacement at `foot` along `n` (limb frame) with respect to the three relative girth
/// changes.
fn girth_row(shape: &TaperedEllipticCylinder, foot: Vec3, n: Vec3) -> Vector3<f64> {
    let t = (foot.z / shape.length()).clamp(0.0, 1.0);
    let distal = |near: f64, far: f64| t * far / ((1.0 - t) * near + t * far).max(1e-6);
    let (a, b) = (n.x * foot.x, n.y * foot.y);
    Vector3::new(a, b, a * distal(shape.a0(), shape.a1()) + b * distal(shape.b0(), shape.b1()))
}

/// Cauchy weight of a distance, meters.
pub(super) fn kernel(distance: f64) -> f64 {
    1.0 / (1.0 + (distance / (2.0 * POINT_SIGMA)).powi(2))
}

/// Normal equations of a limb's surface: its shift perpendicular to the axis, and the logarithms of its three factors.
///
/// A point at signed distance `d`, whose closest point lies at `(x, y, z)`, `t = z / length`, with the normal `n` (limb frame),
/// contributes the equation `d = n . shift + n_x x e0 + n_y y e1 + (n_x x t a1 / a(t) + n_y y t b1 / b(t)) e2`.
#[derive(Clone, Debug, Default)]
pub(super) struct GirthSystem {
    h: SMatrix<f64, 5, 5>,
    g: SVector<f64, 5>,
}

/// The same equations without the shift.
struct WithoutShift {
    information: Matrix3<f64>,
    pull: Vector3<f64>,
    /// The shift for no change of the factors, and its derivative with respect to them.
    shift: Vector2<f64>,
    shift_by_factors: Matrix2x3<f64>,
}

impl GirthSystem {
    /// Adds a point at a signed distance from its closest point `foot` with the normal `n`.
    pub(super) fn add(&mut self, shape: &TaperedEllipticCylinder, foot: Vec3, n: Vec3, distance: f64, weight: f64) {
        let girth = girth_row(shape, foot, n);
        let row = SVector::from([n.x, n.y, girth.x, girth.y, girth.z]);
        self.h += weight * row * row.transpose();
        self.g += weight * distance * row;
    }

    /// Adds an edge of the depth contour, which has this standard deviation, meters.
    fn add_edge(&mut self, shape: &TaperedEllipticCylinder, edge: &DepthEdge, sigma: f64) {
        let wider = edge.reach - edge.rim;
        self.add(shape, edge.foot, edge.side, wider, edge.weight * kernel(wider) / (sigma * sigma));
    }

    /// Eliminates the shift, which is `so_far` from its mean and has the standard deviation `sigma`, meters. `None` if nothing was
    /// added.
    fn without_shift(&self, sigma: f64, so_far: Vector2<f64>) -> Option<WithoutShift> {
        if self.h.trace() <= 0.0 {
            return None;
        }
        let loose = 1.0 / (sigma * sigma);
        let inverse = (self.h.fixed_view::<2, 2>(0, 0) + Matrix2::identity() * loose).try_inverse()?;
        let mixed = self.h.fixed_view::<3, 2>(2, 0);
        let shift = inverse * (self.g.fixed_rows::<2>(0) - so_far * loose);
        Some(WithoutShift {
            information: self.h.fixed_view::<3, 3>(2, 2) - mixed * inverse * mixed.transpose(),
            pull: self.g.fixed_rows::<3>(2) - mixed * shift,
            shift,
            shift_by_factors: -inverse * mixed.transpose(),
        })
    }
}

/// Prior of a limb's girth: mean and information of the logarithms of the three factors.
#[derive(Clone, Copy, Debug)]
pub(super) struct GirthPrior {
    mean: Vector3<f64>,
    information: Matrix3<f64>,
}

impl GirthPrior {
    /// The prior of a limb given what was measured of its counterpart on the other side, if it has one. Both limbs have the standard
    /// deviation `GIRTH_SIGMA` and the correlation `SYMMETRY`. `None` if the measurements are no numbers.
    fn given(counterpart: Option<&Girth>) -> Option<Self> {
        let alone = Self { mean: Vector3::zeros(), information: Matrix3::identity() / (GIRTH_SIGMA * GIRTH_SIGMA) };
        let Some(counterpart) = counterpart else { return Some(alone) };
        let own = (1.0 - SYMMETRY * SYMMETRY) * GIRTH_SIGMA * GIRTH_SIGMA;
        let known = (counterpart.information + alone.information).try_inverse()?;
        let covariance = known * (SYMMETRY * SYMMETRY) + Matrix3::identity() * own;
        Some(Self { mean: SYMMETRY * (known * counterpart.measured), information: covariance.try_inverse()? })
    }

    /// The prior of a limb among the girths of all limbs.
    pub(super) fn of(body: &Body, limb: usize, girths: &[Girth]) -> Option<Self> {
        Self::given(body.roles().counterpart(limb).and_then(|other| girths.get(other)))
    }
}

/// Estimate of the girth of one limb: what frames measured of the logarithms of its factors, and the factors that were applied.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Girth {
    /// Information of the measurements, and its product with their mean.
    information: Matrix3<f64>,
    measured: Vector3<f64>,
    total: GirthFit,
}

/// Takes over what the first frame measured of one of `girths`, see [`Girth::start`], into the body, and moves the limb's pose along.
pub(super) fn start_girth(
    girths: &mut [Girth],
    limb: usize,
    system: &GirthSystem,
    share: f64,
    body: &mut Body,
    pose: &mut Pose,
) {
    let Some(prior) = GirthPrior::of(body, limb, girths) else { return };
    let Some(step) = girths[limb].start(system, &prior, share) else { return };
    if body.change_girth(limb, step.shift, step.axes()) {
        pose.translation += pose.rotation * step.shift;
    }
}

/// Adds what a later frame measured of one of `girths`, see [`Girth::follow`], to the body.
pub(super) fn follow_girth(
    girths: &mut [Girth],
    limb: usize,
    system: &GirthSystem,
    (axis_sigma, frames): (f64, f64),
    kept: Matrix3<f64>,
    body: &mut Body,
) {
    let Some(prior) = GirthPrior::of(body, limb, girths) else { return };
    if let Some(axes) = girths[limb].follow(system, axis_sigma, frames, kept, &prior) {
        body.change_girth(limb, Vec3::ZERO, axes);
    }
}

/// Normal equations of a limb of known pose in the first frame, from its matches and edges; `None` with too few points. Weights are
/// robust (Cauchy).
pub(super) fn first_system(
    shape: &TaperedEllipticCylinder,
    matches: &LimbMatches,
    working_from_limb: &Pose,
    edges: &[DepthEdge],
    edge_sigma: f64,
) -> Option<GirthSystem> {
    let points = matches.accepted();
    if points < ENOUGH {
        return None;
    }
    let mut system = GirthSystem::default();
    for index in (0..matches.weight.len()).filter(|index| matches.weight[*index] > 0.0) {
        let distance = f64::from(matches.surface.signed_distance[index]);
        let foot = working_from_limb.inverse_transform_point(matches.surface.points.get(index));
        let n = working_from_limb.rotation.inverse() * matches.surface.normals.get(index);
        system.add(shape, foot, n, distance, kernel(distance));
    }
    let information = (INDEPENDENT / points as f64).min(1.0) / (POINT_SIGMA * POINT_SIGMA);
    system = GirthSystem { h: system.h * information, g: system.g * information };
    edges.iter().for_each(|edge| system.add_edge(shape, edge, edge_sigma));
    Some(system)
}

/// Normal equations of a limb from the edges on its sides, and the information that keeps its thickness along the line of sight:
/// the surface there was already measured.
pub(super) fn side_system(
    shape: &TaperedEllipticCylinder,
    edges: impl Iterator<Item = DepthEdge>,
    edge_sigma: f64,
) -> (GirthSystem, Matrix3<f64>) {
    let (mut system, mut thickness) = (GirthSystem::default(), Vector3::zeros());
    for edge in edges {
        system.add_edge(shape, &edge, edge_sigma);
        let ahead = Vec3::new(-edge.side.y, edge.side.x, 0.0);
        let Section { a, b, .. } = shape.section(edge.foot.z / shape.length());
        let depth = (a * ahead.x).hypot(b * ahead.y);
        let front = Vec3::new(a * a * ahead.x / depth, b * b * ahead.y / depth, edge.foot.z);
        thickness += 0.5 * girth_row(shape, front, ahead);
    }
    (system, thickness * thickness.transpose() / (edge_sigma * edge_sigma))
}

impl Girth {
    /// Takes over what the first frame measured of a limb: one Gauss-Newton step for shift and semi-axes. `share` of the distance
    /// between its axis and its surface is the body's shift, the rest is the error of its pose. Returns the change since the last
    /// step.
    pub(super) fn start(&mut self, system: &GirthSystem, prior: &GirthPrior, share: f64) -> Option<GirthFit> {
        let so_far = Vector2::new(self.total.shift.x, self.total.shift.y);
        let own = system.without_shift(SHIFT_SIGMA, so_far)?;
        let before = self.changes();
        self.information = own.information;
        self.measured = own.information * before + own.pull;
        let girths = self.most_likely(prior)? - before;
        let shift = own.shift + own.shift_by_factors * girths;
        self.change(shift - (1.0 - share) * (so_far + shift), girths)
    }

    /// Adds what later frames measured, by a Kalman filter, and returns the change of the semi-axes. The lateral offset of the axis
    /// in these frames, of standard deviation `axis_sigma`, is eliminated, so edges on both sides give the most information.
    ///
    /// `frames` is the number of frames since the last update, and `kept` information for the girths that the limb has.
    pub(super) fn follow(
        &mut self,
        system: &GirthSystem,
        axis_sigma: f64,
        frames: f64,
        kept: Matrix3<f64>,
        prior: &GirthPrior,
    ) -> Option<[f64; 4]> {
        let own = system.without_shift(axis_sigma, Vector2::zeros())?;
        let (alike, remembered, before) = (ALIKE / frames, 1.0 - frames / REMEMBERED, self.changes());
        let information = (own.information + kept) / alike;
        self.information = self.information * remembered + information;
        self.measured = self.measured * remembered + information * before + own.pull / alike;
        let girths = self.most_likely(prior)? - before;
        self.change(Vector2::zeros(), girths).map(|done| done.axes())
    }

    /// Reduces the information of the first frame to that of any other. The errors of successive frames are correlated; those of a
    /// first frame are not, if its pose was set exactly.
    pub(super) fn discount(&mut self) {
        self.information /= ALIKE;
        self.measured /= ALIKE;
    }

    /// Standard deviation of the mean radius of a limb of this shape, meters.
    pub(super) fn sigma(&self, shape: &TaperedEllipticCylinder, prior: &GirthPrior) -> f64 {
        let radii = 0.25 * Vector3::new(shape.a0() + shape.a1(), shape.b0() + shape.b1(), shape.a1() + shape.b1());
        let known = (self.information + prior.information).cholesky().map(|factor| factor.solve(&radii));
        known.map_or(f64::NAN, |known| radii.dot(&known).max(0.0).sqrt())
    }

    /// The logarithms of the factors applied so far.
    fn changes(&self) -> Vector3<f64> {
        Vector3::from(self.total.factors.map(f64::ln))
    }

    /// The most likely logarithms of the factors.
    fn most_likely(&self, prior: &GirthPrior) -> Option<Vector3<f64>> {
        let factor = (self.information + prior.information).cholesky()?;
        Some(factor.solve(&(self.measured + prior.information * prior.mean)))
    }

    /// Applies a shift and logarithms of factors, limited to plausible variation between persons. Returns the part of them that was
    /// applied.
    fn change(&mut self, shift: Vector2<f64>, girths: Vector3<f64>) -> Option<GirthFit> {
        if !shift.iter().chain(girths.iter()).all(|value| value.is_finite()) {
            return None;
        }
        let mut step = GirthFit { shift: Vec3::new(shift.x, shift.y, 0.0), factors: girths.map(f64::exp).into() };
        self.total.shift += step.shift;
        for (total, factor) in self.total.factors.iter_mut().zip(&mut step.factors) {
            let before = *total;
            *total = (before * *factor).clamp(0.6, 1.6);
            *factor = *total / before;
        }
        Some(step)
    }
}

impl GirthFit {
    /// Factors of the semi-axes a0, b0, a1, b1.
    pub(crate) fn axes(&self) -> [f64; 4] {
        let [a, b, distal] = self.factors;
        [a, b, a * distal, b * distal]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The factors of the semi-axes after a frame with these edges.
    fn followed(
        girth: &mut Girth,
        shape: &TaperedEllipticCylinder,
        edges: impl Iterator<Item = DepthEdge>,
    ) -> Option<[f64; 4]> {
        let (system, thickness) = side_system(shape, edges, 0.01);
        girth.follow(&system, ASIDE_SIGMA, 1.0, thickness, &GirthPrior::given(None)?)
    }

    /// Edges of a limb viewed along x, whose rims lie `wider` outside the shape's and whose axis has a lateral offset of `aside`.
    fn sides(shape: &TaperedEllipticCylinder, wider: f64, aside: f64) -> Vec<[DepthEdge; 2]> {
        let edge = |t: f64, sign: f64| {
            let rim = shape.b0() + t * (shape.b1() - shape.b0());
            let foot = Vec3::new(0.0, sign * rim, t * shape.length());
            DepthEdge {
                side: Vec3::Y * sign,
                rim,
                foot,
                reach: rim + wider + sign * aside,
                place: Vec3::ZERO,
                weight: 1.0,
            }
        };
        [0.2, 0.35, 0.5, 0.65, 0.8].map(|t| [edge(t, 1.0), edge(t, -1.0)]).to_vec()
    }

    #[test]
    fn girths_follow_the_contour_and_keep_their_thickness() {
        let truth = 0.20;
        let mut shape = TaperedEllipticCylinder::new(0.3, 0.1, 0.16, 0.1, 0.16).unwrap();
        let mut girth = Girth::default();
        let mut after_one = 0.0;
        for frame in 0..60 {
            let found = sides(&shape, truth - 0.5 * (shape.b0() + shape.b1()), 0.02);
            let [fa0, fb0, fa1, fb1] = followed(&mut girth, &shape, found.into_iter().flatten()).unwrap();
            let (a0, b0, a1, b1) = (shape.a0() * fa0, shape.b0() * fb0, shape.a1() * fa1, shape.b1() * fb1);
            shape = TaperedEllipticCylinder::new(0.3, a0, b0, a1, b1).unwrap();
            if frame == 0 {
                after_one = 0.5 * (shape.b0() + shape.b1());
            }
        }
        assert!(after_one < 0.199, "one frame does not decide: {after_one}");
        let (a, b) = (0.5 * (shape.a0() + shape.a1()), 0.5 * (shape.b0() + shape.b1()));
        assert!((b - truth).abs() < 0.003, "width {b}");
        assert!((a - 0.1).abs() < 0.003, "thickness {a}");
    }

    #[test]
    fn a_found_pose_takes_half_of_a_shift_and_an_exact_one_none() {
        let shape = TaperedEllipticCylinder::new(0.3, 0.08, 0.08, 0.08, 0.08).unwrap();
        let (aside, prior) = (Vec3::new(0.03, -0.04, 0.0), GirthPrior::given(None).unwrap());
        for share in [1.0, FOUND_SHARE] {
            let mut girth = Girth::default();
            for _ in 0..GIRTH_STEPS {
                let mut system = GirthSystem::default();
                for turn in (0..24).map(f64::from) {
                    let n = Vec3::new((0.4 * turn).cos(), (0.4 * turn).sin(), 0.0);
                    let foot = 0.08 * n + 0.01 * turn * Vec3::Z;
                    system.add(&shape, foot, n, n.dot(aside - girth.total.shift), 1e4);
                }
                girth.start(&system, &prior, share).unwrap();
            }
            let found = girth.total.shift;
            assert!(found.distance(share * aside) < 0.05 * aside.length(), "{share}: {found:?}");
            assert!(girth.total.factors.iter().all(|factor| (factor - 1.0).abs() < 0.01), "{:?}", girth.total.factors);
        }
    }

    #[test]
    fn edges_on_one_side_report_as_far_as_the_axis_is_known() {
        let mut shape = TaperedEllipticCylinder::new(0.3, 0.1, 0.16, 0.1, 0.16).unwrap();
        let mut girth = Girth::default();
        let both = followed(&mut Girth::default(), &shape, sides(&shape, 0.02, 0.0).into_iter().flatten()).unwrap();
        let one = |shape: &_| sides(shape, 0.02, 0.0).into_iter().map(|[left, _]| left).collect::<Vec<_>>();
        let [_, after_one, ..] = followed(&mut girth, &shape, one(&shape).into_iter()).unwrap();
        assert!(1.0 < after_one && after_one < both[1], "one side tells less: {after_one}, both {}", both[1]);
        for _ in 0..100 {
            let wider = 0.2 - 0.5 * (shape.b0() + shape.b1());
            let found = sides(&shape, wider, 0.0).into_iter().map(|[left, _]| left);
            let [fa0, fb0, fa1, fb1] = followed(&mut girth, &shape, found).unwrap();
            let (a0, b0, a1, b1) = (shape.a0() * fa0, shape.b0() * fb0, shape.a1() * fa1, shape.b1() * fb1);
            shape = TaperedEllipticCylinder::new(0.3, a0, b0, a1, b1).unwrap();
        }
        let b = 0.5 * (shape.b0() + shape.b1());
        assert!(b > 0.19, "width {b}");
    }

    #[test]
    fn girths_without_edges_stay() {
        let shape = TaperedEllipticCylinder::new(0.3, 0.1, 0.16, 0.1, 0.16).unwrap();
        assert_eq!(followed(&mut Girth::default(), &shape, std::iter::empty()), None);
    }
}
