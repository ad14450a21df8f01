//! Measured surface points: robust point-to-plane distance with a small point-to-point part (method section 1).
//!
//! The radius of a limb is uncertain, so that all distances on it share one unknown error of known variance. It is eliminated from the
//! limb's system by its Schur complement.

use super::{PATCH, Term};
use crate::association::correspondence::{Correspondences, LimbMatches};
use crate::body::Body;
use crate::math::{LANES, Mat3, Pose, load, vectorized};
use crate::observation::candidates::Candidates;
use crate::terms::normal_equations::{LimbBlock, NormalEquations};
use crate::visibility::EXPLAINED;

/// `W = w (n n^T + tangential_weight (I - n n^T))` under the Geman-McClure kernel of the signed distance.
#[derive(Debug)]
pub(crate) struct Surface<'a> {
    /// The matches.
    pub correspondences: &'a Correspondences,
    /// Information of a point of weight one, 1/m^2.
    pub information: f64,
    /// Tangential information as a fraction of the normal information: it prevents sliding.
    pub tangential_weight: f64,
    /// Scale of the kernel, meters.
    pub scale: f64,
}

/// Weight under Geman-McClure's kernel `rho(r) = r^2 / (1 + r^2 / c^2)`: `rho'(r) / (2 r) = 1 / (1 + r^2 / c^2)^2`.
pub(super) fn geman_mcclure(r: f64, scale: f64) -> f64 {
    let denominator = 1.0 + r * r / (scale * scale);
    1.0 / (denominator * denominator)
}

impl Term for Surface<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut NormalEquations) {
        for (matches, block) in self.correspondences.limbs.iter().zip(&mut normal.limbs) {
            let sums = vectorized!(self.sum(matches));
            sums.add_to(block, matches.radius_variance);
        }
    }
}

/// The cost of the points matched to a limb less that of unexplained points, at the poses where they were matched, nats. It counts
/// the surface for which pixels stand, however precise they are.
pub(crate) fn cost_of_points(matches: &LimbMatches, candidates: &Candidates) -> f64 {
    let distances = matches.surface.signed_distance.iter().enumerate();
    distances
        .map(|(index, distance)| matches.area(index, candidates) * (unexplained(f64::from(*distance)) - PATCH))
        .sum()
}

/// Cost of a point of weight one at this distance from the surface, nats.
pub(crate) fn unexplained(distance: f64) -> f64 {
    PATCH * (distance / EXPLAINED).powi(2).min(1.0)
}

type SurfaceLanes = [f32; LANES];

/// Sums over the points of a limb, each split into lanes. The sums are in single precision, as are the points, which lie near
/// the working frame's origin.
#[derive(Default)]
struct Sums {
    /// Lower triangle of the point-to-plane information, row by row.
    plane: [SurfaceLanes; 21],
    gradient: [SurfaceLanes; 6],
    /// Weights and weighted residuals, and the information that each unknown shares with the radius.
    radius: [SurfaceLanes; 2],
    shared: [SurfaceLanes; 6],
    /// The isotropic part: w, w x, w x x^T (upper triangle).
    iso: [SurfaceLanes; 10],
}

impl Surface<'_> {
    #[inline(always)]
    fn sum(&self, matches: &LimbMatches) -> Sums {
        let mut sums = Sums::default();
        let (points, normals) = (&matches.surface.points, &matches.surface.normals);
        let columns = [
            &points.x,
            &points.y,
            &points.z,
            &normals.x,
            &normals.y,
            &normals.z,
            &matches.surface.signed_distance,
            &matches.weight,
            &matches.own,
        ];
        let count = matches.weight.len() / LANES;
        let [x, y, z, nx, ny, nz, distance, weight, own] =
            columns.map(|column| &column.as_chunks::<LANES>().0[..count]);
        // Written out, because an array's `map` within the loop is not inlined.
        for i in 0..count {
            self.sum_block([x[i], y[i], z[i], nx[i], ny[i], nz[i], distance[i], weight[i], own[i]], &mut sums);
        }
        if count * LANES < matches.weight.len() {
            // Empty lanes have weight zero.
            let last = columns.map(|column| {
                let mut lanes = [0.0; LANES];
                load(&mut lanes, &column[count * LANES..]);
                lanes
            });
            self.sum_block(last, &mut sums);
        }
        sums
    }

    #[inline(always)]
    fn sum_block(&self, [x, y, z, nx, ny, nz, distance, weight, own]: [SurfaceLanes; 9], sums: &mut Sums) {
        let (information, tangential) = (self.information as f32, self.tangential_weight as f32);
        let inverse_square = (1.0 / (self.scale * self.scale)) as f32;
        let (mut pull, mut plane, mut iso) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let mut all = [0.0; LANES];
        let mut row = [[0.0; LANES], [0.0; LANES], [0.0; LANES], nx, ny, nz];
        for l in 0..LANES {
            let square = distance[l] * distance[l];
            let falloff = 1.0 / (1.0 + square * inverse_square);
            let weight = weight[l] * own[l] * information * falloff * falloff;
            // The residual n . (x - p) is the negative signed distance of the measured point.
            pull[l] = -weight * distance[l];
            all[l] = weight;
            plane[l] = weight * (1.0 - tangential);
            iso[l] = weight * tangential;
            row[0][l] = y[l] * nz[l] - z[l] * ny[l];
            row[1][l] = z[l] * nx[l] - x[l] * nz[l];
            row[2][l] = x[l] * ny[l] - y[l] * nx[l];
        }
        for (sum, values) in sums.radius.iter_mut().zip([&all, &pull]) {
            for l in 0..LANES {
                sum[l] += values[l];
            }
        }
        for (sum, row) in sums.shared.iter_mut().zip(&row) {
            add_product(sum, &all, row);
        }
        // One row at a time: loops of one length each are fully unrolled.
        sums.add_row::<0>(&row, &plane, &pull);
        sums.add_row::<1>(&row, &plane, &pull);
        sums.add_row::<2>(&row, &plane, &pull);
        sums.add_row::<3>(&row, &plane, &pull);
        sums.add_row::<4>(&row, &plane, &pull);
        sums.add_row::<5>(&row, &plane, &pull);
        let (wx, wy, wz) = (product(&iso, &x), product(&iso, &y), product(&iso, &z));
        for (sum, values) in sums.iso.iter_mut().zip([&iso, &wx, &wy, &wz]) {
            for l in 0..LANES {
                sum[l] += values[l];
            }
        }
        let squares = [(&wx, &x), (&wx, &y), (&wx, &z), (&wy, &y), (&wy, &z), (&wz, &z)];
        for (index, (left, right)) in (4..).zip(squares) {
            add_product(&mut sums.iso[index], left, right);
        }
    }
}

#[inline(always)]
fn product(left: &SurfaceLanes, right: &SurfaceLanes) -> SurfaceLanes {
    let mut found = [0.0; LANES];
    for l in 0..LANES {
        found[l] = left[l] * right[l];
    }
    found
}

#[inline(always)]
fn add_product(sum: &mut SurfaceLanes, left: &SurfaceLanes, right: &SurfaceLanes) {
    for l in 0..LANES {
        sum[l] += left[l] * right[l];
    }
}

impl Sums {
    /// Adds the contribution of a block of points to row `I` of the information and of the gradient.
    #[inline(always)]
    fn add_row<const I: usize>(&mut self, row: &[SurfaceLanes; 6], plane: &SurfaceLanes, pull: &SurfaceLanes) {
        add_product(&mut self.gradient[I], pull, &row[I]);
        let scaled = product(plane, &row[I]);
        let first = I * (I + 1) / 2;
        for j in 0..6 {
            if j <= I {
                add_product(&mut self.plane[first + j], &scaled, &row[j]);
            }
        }
    }

    /// Adds the sums to a limb's normal equations, without its radius.
    fn add_to(&self, block: &mut LimbBlock, radius_variance: f64) {
        let total = |lanes: &SurfaceLanes| lanes.iter().map(|value| f64::from(*value)).sum::<f64>();
        let mut entry = 0;
        for i in 0..6 {
            block.g[i] += total(&self.gradient[i]);
            for j in 0..=i {
                let value = total(&self.plane[entry]);
                block.h[(i, j)] += value;
                if i != j {
                    block.h[(j, i)] += value;
                }
                entry += 1;
            }
        }
        add_isotropic(block, &self.iso.map(|lanes| total(&lanes)));
        let ([weight, pull], shared) = (self.radius.map(|lanes| total(&lanes)), self.shared.map(|lanes| total(&lanes)));
        let variance = radius_variance / (1.0 + radius_variance * weight);
        for i in 0..6 {
            block.g[i] -= variance * pull * shared[i];
            for j in 0..6 {
                block.h[(i, j)] -= variance * shared[i] * shared[j];
            }
        }
    }
}

/// `sum w J^T J` with `J = [-[x]x, I]`: `[[sum w (|x|^2 I - x x^T), [sum w x]x], [.., sum w I]]`.
fn add_isotropic(block: &mut LimbBlock, iso: &[f64; 10]) {
    let [w, x, y, z, xx, xy, xz, yy, yz, zz] = *iso;
    let inertia = Mat3::from_cols_array(&[yy + zz, -xy, -xz, -xy, xx + zz, -yz, -xz, -yz, xx + yy]);
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    for i in 0..3 {
        for j in 0..3 {
            block.h[(i, j)] += inertia.col(j)[i];
            block.h[(i, 3 + j)] += cross[i][j];
            block.h[(3 + j, i)] += cross[i][j];
        }
        block.h[(3 + i, 3 + i)] += w;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

    use super::*;
    use crate::body::HumanModel;
    use crate::math::Vec3;
    use crate::terms::normal_equations::line;

    /// Points around a limb as (foot, normal, signed distance, weight).
    fn points(shift: Vec3) -> Vec<(Vec3, Vec3, f64, f64)> {
        (0..21)
            .map(|index| {
                let (turn, height) = (0.4 * f64::from(index), 0.02 * f64::from(index));
                let normal = Vec3::new(turn.cos(), turn.sin(), 0.0);
                let foot = 0.1 * normal + height * Vec3::Z;
                (foot, normal, normal.dot(shift) + 0.004 * (3.0 * turn).sin(), 1.0 + f64::from(index % 3))
            })
            .filter(|(_, normal, ..)| normal.x > -0.3)
            .collect()
    }

    fn block(points: &[(Vec3, Vec3, f64, f64)], radius_variance: f64) -> LimbBlock {
        let mut matches = LimbMatches { radius_variance, ..LimbMatches::default() };
        for (foot, normal, distance, weight) in points {
            let f32s = |v: &Vec3| v.as_vec3().to_array();
            // Half of them are the limb's own.
            matches.weight.push(2.0 * *weight as f32);
            matches.own.push(0.5);
            matches.surface.points.push(f32s(foot));
            matches.surface.normals.push(f32s(normal));
            matches.surface.signed_distance.push(*distance as f32);
        }
        let correspondences = Correspondences { limbs: vec![matches], ..Correspondences::default() };
        let body = Body::human(1.75, HumanModel::Measured).unwrap();
        let mut normal = NormalEquations::default();
        normal.clear(1);
        Surface { correspondences: &correspondences, information: 1e3, tangential_weight: 0.0, scale: 1e3 }.add(
            &body,
            &[],
            &mut normal,
        );
        normal.limbs[0]
    }

    #[test]
    fn an_uncertain_radius_is_eliminated_like_any_other_unknown() {
        let damping = 10.0;
        for sigma in [0.002, 0.01, 0.1] {
            let points = points(Vec3::new(0.02, -0.01, 0.0));
            // The system of the twist and the radius, of which the solution's first six elements are the twist.
            let (mut h, mut g) = (SMatrix::<f64, 7, 7>::identity() * damping, SVector::<f64, 7>::zeros());
            h[(6, 6)] = 1.0 / (sigma * sigma);
            for (foot, normal, distance, weight) in &points {
                let row = line(*foot, *normal).push(1.0);
                h += 1e3 * weight * row * row.transpose();
                g -= 1e3 * weight * *distance * row;
            }
            let expected = h.cholesky().unwrap().solve(&g);
            let found = block(&points, sigma * sigma);
            let twist = (found.h + Matrix6::identity() * damping).cholesky().unwrap().solve(&found.g);
            assert!((expected.fixed_rows::<6>(0) - twist).norm() < 1e-4 * twist.norm(), "{expected} {twist}");
        }
    }

    #[test]
    fn points_on_one_side_tell_less_of_the_distance_the_less_the_radius_is_known() {
        let [known, uncertain, unknown] = [0.0, 1e-4, 1e3].map(|variance| block(&points(Vec3::X), variance).h);
        let ahead = Vector6::ith(3, 1.0);
        let information = |h: Matrix6<f64>| ahead.dot(&(h * ahead));
        assert!(information(known) > 1.5 * information(uncertain));
        assert!(information(uncertain) > information(unknown) && information(unknown) > 0.0);
    }
}
