//! What a list of azimuths says about the full circle: whether it closes, and one column for one direction.

use super::acquisition::{AzimuthExtent, Azimuths};

/// Azimuths before it is known what they stand for, degrees, strictly increasing.
pub(super) enum Closing {
    /// The last is the first + 360°: one direction listed twice.
    Repeated,
    /// The way from the last to the first + 360° is like the steps between the others.
    Open,
    /// A gap remains.
    Gap,
}

/// How the listed azimuths meet after a full turn.
pub(super) fn closing(phi: &[f64]) -> Closing {
    let &[first, .., last] = phi else { return Closing::Gap };
    if last - first == 360.0 {
        return Closing::Repeated;
    }
    let widest = phi.array_windows().map(|[a, b]| b - a).fold(0.0, f64::max);
    if phi.len() > 2 && first + 360.0 - last <= 1.5 * widest { Closing::Open } else { Closing::Gap }
}

/// Removes the column of the repeated azimuth from `values` (`[outer, phi, inner]`), its values averaged with those of
/// the first; returns the largest difference between the two relative to the larger one.
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

/// Azimuths that go all the way round.
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
