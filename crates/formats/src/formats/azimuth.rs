//! Extension of a list of azimuths to the full circle: closed or not, and one column per direction.

use super::acquisition::{AzimuthExtent, Azimuths, ParseReport};
use super::text::Brief;
use crate::notes::ScatteringNote;

/// Relation of the last listed azimuth to the first azimuth + 360°. Azimuths are in degrees, strictly increasing.
pub(super) enum Closing {
    /// The last azimuth equals the first + 360°: one direction is listed twice.
    Repeated,
    /// The step from the last azimuth to the first + 360° is like the other steps, so that the list covers the circle.
    Open,
    /// A larger gap than the other steps separates the last azimuth from the first + 360°.
    Gap,
}

/// Classifies the step from the last azimuth to the first + 360°: no step (one azimuth is listed twice), a step like
/// the others, or a larger gap.
pub(super) fn closing(phi: &[f64]) -> Closing {
    let &[first, .., last] = phi else { return Closing::Gap };
    if last - first == 360.0 {
        return Closing::Repeated;
    }
    let widest = phi.array_windows().map(|[a, b]| b - a).fold(0.0, f64::max);
    if phi.len() > 2 && first + 360.0 - last <= 1.5 * widest { Closing::Open } else { Closing::Gap }
}

/// Removes the column of the azimuth that repeats the first one from `values` (`[outer, phi, inner]`), after averaging
/// it into the first column. Returns the largest difference between the two columns relative to the larger value.
pub(super) fn merge_repeated(phi: &mut Vec<f64>, values: &mut Vec<f32>, inner: usize) -> f64 {
    let n = phi.len();
    phi.pop();
    let mut kept = Vec::with_capacity(values.len() / n * (n - 1));
    let mut largest = 0.0_f64;
    for block in values.chunks_exact(n * inner) {
        let (listed, last) = block.split_at((n - 1) * inner);
        let (first, rest) = listed.split_at(inner);
        for (&a, &b) in first.iter().zip(last) {
            kept.push(match (a.is_nan(), b.is_nan()) {
                (true, _) => b,
                (_, true) => a,
                _ if a == b => a,
                _ => {
                    let (a, b) = (f64::from(a), f64::from(b));
                    largest = largest.max((a - b).abs() / a.abs().max(b.abs()));
                    (0.5 * (a + b)) as f32
                }
            });
        }
        kept.extend_from_slice(rest);
    }
    *values = kept;
    largest
}

/// Returns listed azimuths (degrees, strictly increasing) with their extent on the circle: `stated`, or else derived
/// from their spacing. A repeated azimuth is averaged into the first one; `kept` receives the values before that.
/// `mirror` marks isotropic data, in which half a circle mirrors the other half. `values` are `[outer, phi, inner]`;
/// `what` names the azimuths in messages.
pub(super) fn extended(
    what: &str,
    mut phi: Vec<f64>,
    stated: Option<AzimuthExtent>,
    mirror: bool,
    (values, inner): (&mut Vec<f32>, usize),
    kept: &mut Option<Vec<f32>>,
    report: &mut ParseReport,
) -> Result<Azimuths, String> {
    let (first, last) = (phi[0], phi[phi.len() - 1]);
    let range = format!("{first}° to {last}°", first = Brief(first), last = Brief(last));
    if first < -360.0 || last > 720.0 || last - first > 360.0 {
        return Err(format!("{what}: azimuths from {range}, expected at most one turn"));
    }
    match (stated, closing(&phi)) {
        (None | Some(AzimuthExtent::Circle | AzimuthExtent::Sector), Closing::Repeated) => {
            kept.get_or_insert_with(|| values.clone());
            let difference = merge_repeated(&mut phi, values, inner);
            if difference > 0.0 {
                report.note_unfolding(ScatteringNote::RepeatedAzimuthDiffers {
                    angles: what.to_owned(),
                    first_degrees: Brief(first),
                    last_degrees: Brief(last),
                    difference_percent: 100.0 * difference,
                });
            }
            Ok(circle(phi))
        }
        (Some(AzimuthExtent::Circle), _) | (None, Closing::Open) => Ok(circle(phi)),
        (Some(AzimuthExtent::Mirrored), _) if first < 0.0 || last > 180.0 => {
            Err(format!("{what}: mirrored azimuths from {range}, expected 0° to 180°"))
        }
        (None, Closing::Gap) if mirror && first == 0.0 && last == 180.0 => {
            report.note(ScatteringNote::AzimuthsMirrored { angles: what.to_owned() });
            Ok(Azimuths { phi, extent: AzimuthExtent::Mirrored })
        }
        (None, Closing::Gap) => {
            report.note(ScatteringNote::AzimuthSector {
                angles: what.to_owned(),
                first_degrees: Brief(first),
                last_degrees: Brief(last),
            });
            Ok(Azimuths { phi, extent: AzimuthExtent::Sector })
        }
        (Some(extent), _) => Ok(Azimuths { phi, extent }),
    }
}

/// Returns the azimuths `phi` in degrees as a list that covers the full circle.
pub(super) fn circle(phi: Vec<f64>) -> Azimuths {
    Azimuths { phi, extent: AzimuthExtent::Circle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_column_is_averaged_into_the_first() {
        let mut phi = vec![0.0, 180.0, 360.0];
        let mut values = vec![1.0, 2.0, 1.0, 4.0, 5.0, 2.0, f32::NAN, 1.0, 7.0];
        assert!(matches!(closing(&phi), Closing::Repeated));
        let difference = merge_repeated(&mut phi, &mut values, 1);
        assert_eq!((phi, values), (vec![0.0, 180.0], vec![1.0, 2.0, 3.0, 5.0, 7.0, 1.0]));
        assert!((difference - 0.5).abs() < 1e-12);
    }

    #[test]
    fn circles_close_where_the_last_gap_is_like_the_others() {
        assert!(matches!(closing(&[0.0, 90.0, 180.0, 270.0]), Closing::Open));
        assert!(matches!(closing(&[0.0, 90.0, 180.0]), Closing::Gap));
        assert!(matches!(closing(&[0.0]), Closing::Gap));
    }
}
