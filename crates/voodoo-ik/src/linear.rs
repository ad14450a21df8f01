//! Row-vector linear algebra: damped pseudo-inverse and null spaces, without heap allocation after the first use.

use voodoo_core::math::{dot, reset, solve_in_place};

/// A row whose remainder is below this fraction of the longest row depends linearly on the rows before it.
const RANK: f64 = 1e-9;

/// Orthonormal directions used by higher levels and by limits: `I - Q^T Q` projects into the null space.
#[derive(Clone, Debug, Default)]
pub(super) struct Taken {
    rows: Vec<f64>,
    n: usize,
}

impl Taken {
    pub(crate) fn clear(&mut self, n: usize) {
        self.rows.clear();
        self.n = n;
    }

    /// Projects `row` into the null space.
    pub(crate) fn project(&self, row: &mut [f64]) {
        orthogonalize(&self.rows, row);
    }

    /// Adds the row space of a matrix to the used directions.
    pub(crate) fn take(&mut self, rows: &[f64]) {
        let longest = rows.chunks_exact(self.n).map(|row| dot(row, row)).fold(0.0, f64::max).sqrt();
        for row in rows.chunks_exact(self.n) {
            self.rows.extend_from_slice(row);
            self.close(RANK * longest);
        }
    }

    /// Adds one unknown that is at its limit; returns false if it was already used.
    pub(crate) fn pin(&mut self, unknown: usize) -> bool {
        let start = self.rows.len();
        self.rows.resize(start + self.n, 0.0);
        self.rows[start + unknown] = 1.0;
        self.close(1e-7)
    }

    /// Orthonormalizes the last row against the others, or drops it if less than `least` remains.
    fn close(&mut self, least: f64) -> bool {
        let start = self.rows.len() - self.n;
        let (taken, new) = self.rows.split_at_mut(start);
        orthogonalize(taken, new);
        let length = dot(new, new).sqrt();
        if length > least && start < self.n * self.n {
            new.iter_mut().for_each(|value| *value /= length);
            return true;
        }
        self.rows.truncate(start);
        false
    }
}

/// Gram-Schmidt, applied twice: one pass leaves an error of the size of the cancellation.
fn orthogonalize(basis: &[f64], row: &mut [f64]) {
    for _ in 0..2 {
        for q in basis.chunks_exact(row.len()) {
            let along = dot(q, row);
            row.iter_mut().zip(q).for_each(|(value, q)| *value -= along * q);
        }
    }
}

pub(super) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}

/// The linear system of one level, and its solution.
#[derive(Clone, Debug, Default)]
pub(super) struct LinearSystem {
    pub(super) taken: Taken,
    pub(super) jacobian: Vec<f64>,
    pub(super) projected: Vec<f64>,
    pub(super) residual: Vec<f64>,
    pub(super) target: Vec<f64>,
    pub(super) part: Vec<f64>,
    h: Vec<f64>,
    z: Vec<f64>,
}

impl LinearSystem {
    /// Computes the part `x = A^T (A A^T + damping I)^-1 b = (A^T A + damping I)^-1 A^T b` of the projected Jacobian `A` and the
    /// target `b` with the smaller of the two systems; zero for a zero matrix.
    pub(super) fn solve(&mut self, mut damping: f64) {
        let Self { projected: a, target: b, part: x, h, z, .. } = self;
        let (rows, n) = (b.len(), x.len());
        let size = rows.min(n);
        x.fill(0.0);
        // Rounding can make a nearly singular matrix indefinite; more damping resolves that.
        for _ in 0..6 {
            reset(h, size * size, 0.0);
            z.clear();
            if rows <= n {
                for i in 0..rows {
                    let row = &a[i * n..(i + 1) * n];
                    for j in 0..=i {
                        h[i * size + j] = dot(row, &a[j * n..(j + 1) * n]);
                    }
                }
                z.extend_from_slice(b);
            } else {
                z.resize(n, 0.0);
                for (row, b) in a.chunks_exact(n).zip(&*b) {
                    for i in 0..n {
                        if row[i] != 0.0 {
                            h[i * n..=i * n + i].iter_mut().zip(row).for_each(|(h, value)| *h += row[i] * value);
                            z[i] += row[i] * b;
                        }
                    }
                }
            }
            let trace: f64 = (0..size).map(|i| h[i * size + i]).sum();
            if trace.is_nan() || trace <= 0.0 {
                return;
            }
            let floor = 1e-14 * trace;
            for i in 0..size {
                h[i * size + i] += damping.max(floor);
            }
            if solve_in_place(h, z, size) {
                if rows <= n {
                    for (row, z) in a.chunks_exact(n).zip(&*z) {
                        x.iter_mut().zip(row).for_each(|(x, value)| *x += z * value);
                    }
                } else {
                    x.copy_from_slice(z);
                }
                return;
            }
            damping = 100.0 * damping.max(floor);
        }
    }
}
