//! Symmetric positive systems, solved by Cholesky decomposition.

use std::ops::IndexMut;

/// Solves the system `m` for `right` in place, reading the lower half of `m`. The squares of the pivots are at least
/// `least`, so that unknowns with zero weight stay 0.
pub(crate) fn solve<R: IndexMut<usize, Output = f64>>(m: &mut [R], right: &mut [f64], least: f64) {
    let n = right.len();
    for i in 0..n {
        for j in 0..=i {
            let sum = m[i][j] - (0..j).map(|k| m[i][k] * m[j][k]).sum::<f64>();
            m[i][j] = if i == j { sum.max(least).sqrt() } else { sum / m[j][j] };
        }
    }
    for i in 0..n {
        right[i] = (right[i] - (0..i).map(|k| m[i][k] * right[k]).sum::<f64>()) / m[i][i];
    }
    for i in (0..n).rev() {
        right[i] = (right[i] - (i + 1..n).map(|k| m[k][i] * right[k]).sum::<f64>()) / m[i][i];
    }
}
