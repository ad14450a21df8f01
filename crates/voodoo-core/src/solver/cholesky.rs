//! Dense Cholesky of a small symmetric system, in place and without heap.

/// Solves `h x = b` for the symmetric `h` (row-major, lower triangle given); `b` becomes `x`. False, and `b` undefined, when
/// `h` is not positive definite.
pub fn solve_in_place(h: &mut [f64], b: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        let (above, rest) = h.split_at_mut(i * n);
        let row = &mut rest[..=i];
        for j in 0..i {
            let other = &above[j * n..=j * n + j];
            let dot: f64 = row[..j].iter().zip(&other[..j]).map(|(a, b)| a * b).sum();
            row[j] = (row[j] - dot) / other[j];
        }
        let square = row[i] - row[..i].iter().map(|value| value * value).sum::<f64>();
        if square.is_nan() || square <= 0.0 {
            return false;
        }
        row[i] = square.sqrt();
    }
    for i in 0..n {
        let row = &h[i * n..=i * n + i];
        let dot: f64 = row[..i].iter().zip(&b[..i]).map(|(a, b)| a * b).sum();
        b[i] = (b[i] - dot) / row[i];
    }
    for i in (0..n).rev() {
        b[i] /= h[i * n + i];
        for j in 0..i {
            b[j] -= h[i * n + j] * b[i];
        }
    }
    b[..n].iter().all(|value| value.is_finite())
}
