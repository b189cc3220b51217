//! Conversion of measured surfaces to reciprocal ones: each value becomes its mean with that of the exchanged
//! directions.

use super::error::{ProjectionError, ReciprocalError};
use crate::domain::{Axis, AzimuthExtent, DirectionGrid, Frame, Measurement, Quantity, Tensor};

/// A measurement made reciprocal, and the deviation of the original from reciprocity.
#[derive(Clone, Debug)]
pub struct Reciprocal {
    /// Measurement on the axes of the original in which each value f(ωi, ωo) is replaced by the mean of f(ωi, ωo) and
    /// f(ωo, ωi).
    pub measurement: Measurement,
    /// Median of |f(ωi, ωo) − f(ωo, ωi)|, each divided by the mean of both values, in the measurement before they are
    /// averaged. `None` if no pair of directions ωi and ωo has two measured values with a positive mean.
    pub difference: Option<f64>,
}

/// Makes a BRDF on a grid reciprocal: f(ωi, ωo) becomes the mean of f(ωi, ωo) and f(ωo, ωi), or whichever of them was
/// measured. The grid must hold every exchanged pair: its outgoing directions are its incoming ones, as in an MBSDF
/// file.
pub fn reciprocal(measurement: &Measurement) -> Result<Reciprocal, ProjectionError> {
    if measurement.quantity != Quantity::Brdf {
        return Err(ReciprocalError::Quantity { found: measurement.quantity }.into());
    }
    let axes = measurement.tensor.axes();
    let exchange = match axes {
        [Axis::Elevation(incoming), Axis::Grid(outgoing), rest @ ..] if rest.len() < 2 => {
            let fits = incoming == outgoing.polar() && is_even(outgoing);
            fits.then(|| Exchange::Isotropic { count: incoming.len(), azimuths: outgoing.shape()[1] })
        }
        [Axis::Grid(incoming), Axis::Grid(outgoing), rest @ ..] if rest.len() < 2 => {
            let is_same = incoming.frame() == outgoing.frame()
                && incoming.polar() == outgoing.polar()
                && incoming.azimuths() == outgoing.azimuths();
            is_same.then(|| Exchange::Anisotropic { count: incoming.len() })
        }
        _ => None,
    };
    let Some(exchange) = exchange else { return Err(ReciprocalError::Grid.into()) };
    let lanes = axes[2..].iter().map(Axis::len).product::<usize>();
    let samples = measurement.tensor.samples();
    let mut differences: Vec<f32> = Vec::new();
    let mut mean = |at: usize| {
        let exchanged = exchange.of(at / lanes) * lanes + at % lanes;
        let (own, other) = (samples[at], samples[exchanged]);
        if own.is_nan() {
            return other;
        }
        if other.is_nan() {
            return own;
        }
        let mean = 0.5 * (f64::from(own) + f64::from(other));
        if mean > 0.0 && at < exchanged {
            differences.push(((f64::from(own) - f64::from(other)).abs() / mean) as f32);
        }
        mean as f32
    };
    let values = (0..samples.len()).map(&mut mean).collect();
    let tensor = Tensor::new(axes.to_vec(), values)?;
    let middle = differences.len() / 2;
    let difference =
        (!differences.is_empty()).then(|| f64::from(*differences.select_nth_unstable_by(middle, f32::total_cmp).1));
    Ok(Reciprocal { measurement: Measurement { tensor, ..measurement.clone() }, difference })
}

/// Index arithmetic that finds the position of f(ωo, ωi) from that of f(ωi, ωo) in an array.
#[derive(Clone, Copy)]
enum Exchange {
    /// Array `[incoming polar angle, outgoing polar angle, azimuth between them]` of the reflectance of an isotropic
    /// surface, which does not depend on the sign of the azimuth.
    Isotropic { count: usize, azimuths: usize },
    /// Array `[incoming direction, outgoing direction]` of the reflectance of an anisotropic surface.
    Anisotropic { count: usize },
}

impl Exchange {
    fn of(self, pair: usize) -> usize {
        match self {
            Self::Isotropic { count, azimuths } => {
                let (i, rest) = (pair / (count * azimuths), pair % (count * azimuths));
                let (o, azimuth) = (rest / azimuths, rest % azimuths);
                (o * count + i) * azimuths + azimuth
            }
            Self::Anisotropic { count } => pair % count * count + pair / count,
        }
    }
}

/// Returns true if the values of a grid do not depend on the sign of the azimuth. Exchanging the directions of an
/// isotropic surface reverses the azimuth between them.
fn is_even(grid: &DirectionGrid) -> bool {
    grid.frame() == Frame::Surface && grid.azimuths().is_none_or(|azimuths| azimuths.extent == AzimuthExtent::Mirrored)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Azimuths, Sampling, Unit};

    fn brdf(axes: Vec<Axis>, samples: Vec<f32>) -> Measurement {
        let tensor = Tensor::new(axes, samples).unwrap();
        Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Point, tensor).unwrap()
    }

    fn grid(polar: &[f64], extent: AzimuthExtent) -> Axis {
        let azimuths = Azimuths { angles: vec![0.0, 180.0], extent };
        Axis::Grid(DirectionGrid::new(Frame::Surface, polar.to_vec(), Some(azimuths)).unwrap())
    }

    #[test]
    fn an_isotropic_table_becomes_the_mean_with_its_exchanged_one() {
        let axes = vec![Axis::Elevation(vec![0.0, 45.0]), grid(&[0.0, 45.0], AzimuthExtent::Mirrored)];
        let made = reciprocal(&brdf(axes, vec![1.0, 1.0, 2.0, 4.0, 4.0, f32::NAN, 5.0, 6.0])).unwrap();
        assert_eq!(made.measurement.tensor.samples(), [1.0, 1.0, 3.0, 4.0, 3.0, 4.0, 5.0, 6.0]);
        // One pair differs: 2 and 4.
        assert!((made.difference.unwrap() - 2.0 / 3.0).abs() < 1e-6, "{:?}", made.difference);
    }

    #[test]
    fn an_anisotropic_grid_is_transposed_channel_by_channel() {
        let side = grid(&[0.0, 60.0], AzimuthExtent::Circle);
        let samples: Vec<f32> = (0..48).map(|i| 1.0 + i as f32).collect();
        let made = reciprocal(&brdf(vec![side.clone(), side, Axis::Rgb], samples.clone())).unwrap();
        let found = made.measurement.tensor.samples();
        for (i, o, lane) in [(0, 1, 0), (3, 1, 2), (2, 2, 1)] {
            let [a, b] = [(i * 4 + o) * 3 + lane, (o * 4 + i) * 3 + lane];
            assert_eq!((found[a], found[b]), (0.5 * (samples[a] + samples[b]), found[a]));
        }
    }

    #[test]
    fn grids_without_every_exchanged_pair_are_refused() {
        let refused = |measurement: &Measurement| reciprocal(measurement).unwrap_err().to_string();
        let other = vec![Axis::Elevation(vec![0.0, 45.0]), grid(&[0.0, 50.0], AzimuthExtent::Mirrored)];
        assert!(refused(&brdf(other, vec![1.0; 8])).contains("exchanged"));
        let open = vec![Axis::Elevation(vec![0.0, 45.0]), grid(&[0.0, 45.0], AzimuthExtent::Circle)];
        assert!(refused(&brdf(open, vec![1.0; 8])).contains("exchanged"));
        let axes = vec![Axis::Elevation(vec![0.0]), grid(&[0.0], AzimuthExtent::Mirrored)];
        let through = Measurement { quantity: Quantity::Bsdf, ..brdf(axes, vec![1.0; 2]) };
        assert!(refused(&through).contains("bsdf"));
    }
}
