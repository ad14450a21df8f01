//! Measured surface points: robust point-to-plane with a little point-to-point (method section 1).

use super::Term;
use crate::body::Body;
use crate::correspondence::{Correspondences, LimbMatches};
use crate::geometry::{Mat3, Pose};
use crate::normal::{LimbBlock, Normal};

/// `W = w (n n^T + slide (I - n n^T))` under the Geman-McClure kernel of the signed distance.
#[derive(Debug)]
pub struct Surface<'a> {
    /// The matches.
    pub correspondences: &'a Correspondences,
    /// Information of a point of weight one, 1/m^2.
    pub information: f64,
    /// Share of the information across the normal: it stops sliding.
    pub slide: f64,
    /// Scale of the kernel, metres.
    pub scale: f64,
}

/// Geman-McClure: `rho(r) = r^2 / (1 + r^2 / c^2)`, weight `rho'(r) / (2 r) = 1 / (1 + r^2 / c^2)^2`.
pub fn geman_mcclure(r: f64, scale: f64) -> (f64, f64) {
    let square = r * r;
    let denominator = 1.0 + square / (scale * scale);
    (square / denominator, 1.0 / (denominator * denominator))
}

impl Term for Surface<'_> {
    fn add(&self, _body: &Body, _poses: &[Pose], normal: &mut Normal) {
        for (matches, block) in self.correspondences.limbs.iter().zip(&mut normal.limbs) {
            normal.cost += self.add_limb(matches, block);
        }
    }
}

impl Surface<'_> {
    fn add_limb(&self, matches: &LimbMatches, block: &mut LimbBlock) -> f64 {
        let mut cost = 0.0;
        let mut lower = [0.0_f64; 21];
        let mut gradient = [0.0_f64; 6];
        // Sums of the isotropic part: w, w x, w x x^T (upper).
        let mut iso = [0.0_f64; 10];
        for index in 0..matches.weight.len() {
            let weight = f64::from(matches.weight[index]) * self.information;
            if weight <= 0.0 {
                continue;
            }
            let distance = f64::from(matches.surface.signed_distance[index]);
            let (rho, kernel) = geman_mcclure(distance, self.scale);
            cost += weight * rho;
            let weight = weight * kernel;
            let x = matches.surface.points.get(index);
            let n = matches.surface.normals.get(index);
            let m = x.cross(n);
            let row = [m.x, m.y, m.z, n.x, n.y, n.z];
            // The residual n . (x - p) is the negative signed distance of the measured point.
            let pull = -weight * distance;
            let plane = weight * (1.0 - self.slide);
            let mut entry = 0;
            for i in 0..6 {
                gradient[i] += pull * row[i];
                let scaled = plane * row[i];
                for value in &row[..=i] {
                    lower[entry] += scaled * value;
                    entry += 1;
                }
            }
            let weight = weight * self.slide;
            let sums = [1.0, x.x, x.y, x.z, x.x * x.x, x.x * x.y, x.x * x.z, x.y * x.y, x.y * x.z, x.z * x.z];
            for (sum, value) in iso.iter_mut().zip(sums) {
                *sum += weight * value;
            }
        }
        let mut entry = 0;
        for i in 0..6 {
            block.g[i] += gradient[i];
            for j in 0..=i {
                block.h[(i, j)] += lower[entry];
                if i != j {
                    block.h[(j, i)] += lower[entry];
                }
                entry += 1;
            }
        }
        add_isotropic(block, &iso);
        cost
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
