//! Dense Cholesky of a small symmetric system, in place and without heap allocation.

use super::simd::vectorized;

/// Solves `h x = b` for the symmetric `h` (row-major, lower triangle given); `b` becomes `x`. Returns false, with `b` undefined,
/// when `h` is not positive definite.
///
/// Factors `h = L^T L` from the last unknown to the first. In a tree whose parents come first this causes no fill-in
/// (Featherstone, "Rigid Body Dynamics Algorithms", 2008, section 6.5), so entries between unknowns on different branches stay
/// zero and are skipped.
pub fn solve_in_place(h: &mut [f64], b: &mut [f64], n: usize) -> bool {
    factor(h, n)
        && vectorized!({
            half_substitute(h, b, n);
            for k in 0..n {
                let (known, rest) = b.split_at_mut(k);
                let dot: f64 = known.iter().zip(&h[k * n..]).map(|(b, factor)| b * factor).sum();
                rest[0] = (rest[0] - dot) / h[k * n + k];
            }
            b[..n].iter().all(|value| value.is_finite())
        })
}

/// The first half of [`solve_in_place`], to be used with several right-hand sides: `h` becomes `L`.
pub(crate) fn factor(h: &mut [f64], n: usize) -> bool {
    vectorized!({
        for k in (0..n).rev() {
            let (before, rest) = h.split_at_mut(k * n);
            let row = &mut rest[..=k];
            let square = row[k];
            if square.is_nan() || square <= 0.0 {
                return false;
            }
            let root = square.sqrt();
            row[k] = root;
            let row = &mut row[..k];
            row.iter_mut().for_each(|value| *value /= root);
            for i in 0..k {
                let factor = row[i];
                if factor != 0.0 {
                    for (value, other) in before[i * n..=i * n + i].iter_mut().zip(&*row) {
                        *value -= factor * other;
                    }
                }
            }
        }
        true
    })
}

/// The first of the two substitutions, for every right-hand side: `b` becomes `y` with `L^T y = b`, where `l` is the result of
/// [`factor`]. For two right-hand sides, `y_1^T y_2 = b_1^T h^-1 b_2`.
#[inline(always)]
pub(crate) fn half_substitute(l: &[f64], b: &mut [f64], n: usize) {
    for k in (0..n).rev() {
        let value = b[k] / l[k * n + k];
        b[k] = value;
        for (b, factor) in b[..k].iter_mut().zip(&l[k * n..]) {
            *b -= factor * value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_it_should_and_refuses_the_rest() {
        let n = 7;
        let l: Vec<f64> =
            (0..n * n).map(|k| (k * k % 11) as f64 - 4.0 + 8.0 * f64::from(u8::from(k % (n + 1) == 0))).collect();
        let mut h = vec![0.0; n * n];
        for (i, j, k) in (0..n * n * n).map(|index| (index / n / n, index / n % n, index % n)) {
            h[i * n + j] += l[i * n + k] * l[j * n + k];
        }
        let x: Vec<f64> = (0..n).map(|k| k as f64 - 2.5).collect();
        let mut b: Vec<f64> = (0..n).map(|i| (0..n).map(|j| h[i * n + j] * x[j]).sum()).collect();
        let mut copy = h.clone();
        assert!(solve_in_place(&mut copy, &mut b, n));
        for (found, expected) in b.iter().zip(&x) {
            assert!((found - expected).abs() < 1e-8, "{b:?}");
        }
        // Computes `x^T h^-1 x` from one substitution.
        let [mut whole, mut half] = [x.clone(), x.clone()];
        assert!(solve_in_place(&mut h.clone(), &mut whole, n));
        half_substitute(&copy, &mut half, n);
        let expected: f64 = whole.iter().zip(&x).map(|(a, b)| a * b).sum();
        let found: f64 = half.iter().map(|y| y * y).sum();
        assert!((found - expected).abs() < 1e-9 * expected, "{found} for {expected}");
        h[3 * n + 3] = -1.0;
        assert!(!solve_in_place(&mut h, &mut b, n));
    }
}
