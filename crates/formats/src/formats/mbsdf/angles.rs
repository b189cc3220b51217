//! The polar angles and azimuths of a table, which the format fixes by their number.

/// Polar angles of a table with `n` of them, in degrees.
pub(super) fn polar_angles(n: usize) -> impl DoubleEndedIterator<Item = f64> {
    (0..n).map(move |i| i as f64 * 90.0 / n as f64)
}

/// The azimuths between two directions; one stands for all of them.
pub(super) fn azimuths(m: usize) -> Vec<f64> {
    (0..m).map(|j| if m > 1 { j as f64 * 180.0 / (m - 1) as f64 } else { 0.0 }).collect()
}
