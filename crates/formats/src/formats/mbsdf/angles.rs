//! Polar angles and azimuths of a table, which the format derives from their number.

use super::super::acquisition::Outside;

/// Returns the polar angles `i · 90°/n` of an MBSDF file, in degrees, for i from 0 to n − 1. Incoming and outgoing
/// directions have the same angles, and the file states their number `n`.
pub(super) fn polar_angles(n: usize) -> impl DoubleEndedIterator<Item = f64> {
    (0..n).map(move |i| i as f64 * 90.0 / n as f64)
}

/// Returns the `m` azimuths of a measured BSDF file: degrees from 0 to 180 between incoming and outgoing direction. A
/// single one represents all azimuths.
pub(super) fn azimuths(m: usize) -> Vec<f64> {
    (0..m).map(|j| if m > 1 { j as f64 * 180.0 / (m - 1) as f64 } else { 0.0 }).collect()
}

/// Returns the value outside the angles of a file with `m` azimuths. The format defines the values between any two
/// azimuths; [`Outside::Zero`] says so where they would be too far apart in a scan.
pub(super) fn outside(m: usize) -> Outside {
    if m > 2 { Outside::Masked } else { Outside::Zero }
}
