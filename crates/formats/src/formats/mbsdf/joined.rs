//! Combination of the reflection and transmission of one file into one table over both sides, at any resolutions.

use super::super::acquisition::{AngleGrid, Angles, AzimuthExtent, Azimuths};
use super::super::error::{FormatError, FormatErrorKind};
use super::about::NAME;
use super::angles::{azimuths, outside, polar_angles};
use super::blocks::Block;
use crate::domain::Axis;
use crate::domain::limits::MAX_SAMPLES;
use crate::numeric::bracket::Bracket;

/// Polar angle in degrees of the transmitted side's horizon. It differs from the reflected side's horizon at 90°, so
/// that both fit in one table.
pub(super) const BELOW_HORIZON: f64 = 90.000_001;

/// Joins the tables of reflection (upper side) and transmission (lower side) into one table over both sides.
///
/// The incoming angles and azimuths of the joined table are all those of both tables; each table is interpolated
/// linearly at those of the other. If only one table has RGB, the single values of the other are repeated in all three
/// channels. The outgoing polar angles are those of the reflection, one at the horizon for each side, and 180° minus
/// those of the transmission. Each horizon row repeats the row nearest to it.
pub(super) fn joined(above: &Block, below: &Block) -> Result<AngleGrid, FormatError> {
    let incoming = union(polar_angles(above.theta).collect(), polar_angles(below.theta).collect());
    let phi = union(azimuths(above.phi), azimuths(below.phi));
    let rgb = above.rgb || below.rgb;
    let channels = if rgb { 3 } else { 1 };
    let outgoing: Vec<f64> = polar_angles(above.theta)
        .chain([90.0, BELOW_HORIZON])
        .chain(polar_angles(below.theta).rev().map(|theta| 180.0 - theta))
        .collect();
    let shape = [incoming.len(), outgoing.len(), phi.len(), channels];
    let count = shape.into_iter().try_fold(1_usize, usize::checked_mul).filter(|&n| n <= MAX_SAMPLES);
    let Some(count) = count else {
        let message = format!(
            "reflection and transmission on the angles of both, {} × {} × {}, are more than {MAX_SAMPLES} values; ask for \
             brdf or btdf",
            incoming.len(),
            outgoing.len(),
            phi.len()
        );
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    };
    let rows_above = (0..above.theta).chain([above.theta - 1]).map(|row| (above, row));
    let rows_below = [below.theta - 1].into_iter().chain((0..below.theta).rev()).map(|row| (below, row));
    let rows: Vec<(&Block, usize)> = rows_above.chain(rows_below).collect();
    let around = |block: &Block| {
        let (theta, azimuth) = (polar_angles(block.theta).collect::<Vec<f64>>(), azimuths(block.phi));
        let places =
            |known: &[f64], wanted: &[f64]| wanted.iter().map(|&x| Bracket::held(known, x)).collect::<Vec<_>>();
        (places(&theta, &incoming), places(&azimuth, &phi))
    };
    let (of_above, of_below) = (around(above), around(below));
    let mut values = Vec::with_capacity(count);
    for i in 0..incoming.len() {
        for (o, &(block, row)) in rows.iter().enumerate() {
            let (thetas, phis) = if o <= above.theta { &of_above } else { &of_below };
            for &j in phis {
                values.extend((0..channels).map(|channel| block.at(thetas[i], row, j, channel)));
            }
        }
    }
    let columns = phi.len();
    let phi = (columns > 1).then_some(Azimuths { phi, extent: AzimuthExtent::Mirrored });
    Ok(AngleGrid {
        index: Vec::new(),
        incoming: Some(Angles { theta: incoming, covers: (0.0, 90.0), phi: None }),
        outgoing: Some(Angles { theta: outgoing, covers: (0.0, 180.0), phi }),
        spectral: rgb.then_some(Axis::Rgb),
        outside: outside(columns),
        values: values.into(),
        stated: None,
        sigma: None,
    })
}

/// Returns the union of two lists of angles in increasing order. Equal angles of both lists have equal bits, because
/// each is computed by a single division of whole numbers.
fn union(mut a: Vec<f64>, mut b: Vec<f64>) -> Vec<f64> {
    a.append(&mut b);
    a.sort_by(f64::total_cmp);
    a.dedup();
    a
}

impl Block {
    /// Returns the reflection or transmission value at outgoing polar angle number `row`, interpolated linearly in the
    /// incoming polar angle and the outgoing azimuth.
    fn at(&self, theta: Bracket, row: usize, phi: Bracket, channel: usize) -> f32 {
        let (channels, channel) = if self.rgb { (3, channel) } else { (1, 0) };
        let value =
            |i: usize, j: usize| f64::from(self.values[((i * self.theta + row) * self.phi + j) * channels + channel]);
        let mixed = |a: f64, b: f64, weight: f64| if weight == 0.0 { a } else { (1.0 - weight) * a + weight * b };
        let along = |i: usize| mixed(value(i, phi.below), value(i, phi.above), phi.t);
        mixed(along(theta.below), along(theta.above), theta.t) as f32
    }
}
