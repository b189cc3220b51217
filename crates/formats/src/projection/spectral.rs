//! Spectral axis of a projection: kept, resampled to the requested wavelengths, or created from a joined spectrum.

use super::bands::Bands;
use super::error::SpectralError;
use super::resampling::Channels;
use crate::domain::{Axis, Note, WavelengthGrid};
use crate::formats::SpectralFactor;
use crate::notes::ProjectionNote;

/// Spectral axis of the tensor, the resampling that leads to it, and notes for the user.
pub(super) struct Spectral {
    pub(super) axis: Option<Axis>,
    pub(super) channels: Channels,
    pub(super) notes: Vec<Note>,
}

/// Plans the spectral axis of a tensor. `own` is the spectral axis of the samples, `factor` a spectrum to multiply them
/// by, `wanted` the requested wavelengths.
pub(super) fn plan(
    own: Option<&Axis>,
    factor: Option<&SpectralFactor>,
    wanted: Option<&WavelengthGrid>,
) -> Result<Spectral, SpectralError> {
    match (own, factor) {
        (Some(own), Some(_)) => Err(SpectralError::OwnAxis { axis: Box::new(own.clone()) }),
        (None, Some(factor)) => {
            if factor.factors.len() != factor.grid.len() {
                let (found, expected) = (factor.factors.len(), factor.grid.len());
                return Err(SpectralError::Factors { found, expected });
            }
            match wanted.filter(|wanted| !same(wanted, &factor.grid)) {
                None => Ok(Spectral {
                    axis: Some(Axis::Wavelength(factor.grid.clone())),
                    channels: Channels::Multiplied(factor.factors.clone()),
                    notes: Vec::new(),
                }),
                Some(wanted) => {
                    let (bands, notes) = resample(&factor.grid, wanted)?;
                    let factors = (0..bands.len()).map(|i| bands.average(&factor.factors, i)).collect();
                    let channels = Channels::Multiplied(factors);
                    Ok(Spectral { axis: Some(Axis::Wavelength(wanted.clone())), channels, notes })
                }
            }
        }
        (Some(Axis::Wavelength(own)), None) => match wanted.filter(|wanted| !same(wanted, own)) {
            None => Ok(kept(Some(Axis::Wavelength(own.clone())))),
            Some(wanted) => {
                let (bands, notes) = resample(own, wanted)?;
                let channels = Channels::Banded { from: own.len(), bands };
                Ok(Spectral { axis: Some(Axis::Wavelength(wanted.clone())), channels, notes })
            }
        },
        (own, None) => match (wanted, own) {
            (None, own) => Ok(kept(own.cloned())),
            (Some(_), Some(own)) => Err(SpectralError::Channels { axis: Box::new(own.clone()) }),
            (Some(_), None) => Err(SpectralError::NoWavelengths),
        },
    }
}

/// Returns true if two wavelength grids have equal wavelengths, however they are represented.
pub(super) fn same(a: &WavelengthGrid, b: &WavelengthGrid) -> bool {
    a.len() == b.len() && (0..a.len()).all(|i| a.at(i) == b.at(i))
}

fn kept(axis: Option<Axis>) -> Spectral {
    let channels = Channels::Kept(axis.as_ref().map_or(1, Axis::len));
    Spectral { axis, channels, notes: Vec::new() }
}

fn resample(from: &WavelengthGrid, to: &WavelengthGrid) -> Result<(Bands, Vec<Note>), SpectralError> {
    let bands = Bands::new(from, to);
    let ((first, last), (low, high)) = (from.range(), to.range());
    if bands.outside() == bands.len() {
        return Err(SpectralError::Outside { requested: (low, high), measured: (first, last) });
    }
    let resampled = ProjectionNote::WavelengthsResampled {
        wavelengths: to.len(),
        first_nm: low,
        last_nm: high,
        samples: from.len(),
        measured_first_nm: first,
        measured_last_nm: last,
    };
    let mut notes = vec![resampled.into()];
    if bands.outside() > 0 {
        notes.push(ProjectionNote::WavelengthsOutside { wavelengths: bands.outside() }.into());
    }
    Ok((bands, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(range: &str) -> WavelengthGrid {
        WavelengthGrid::parse_range(range).unwrap()
    }

    fn refusal(own: Option<&Axis>, factor: Option<&SpectralFactor>, wanted: &str) -> String {
        match plan(own, factor, Some(&grid(wanted))) {
            Err(error) => error.to_string(),
            other => panic!("{:?}", other.map(|spectral| spectral.axis)),
        }
    }

    #[test]
    fn the_same_wavelengths_stay_as_they_are() {
        let own = Axis::Wavelength(WavelengthGrid::Uneven(vec![400.0, 410.0, 420.0]));
        let spectral = plan(Some(&own), None, Some(&grid("400:420:10"))).unwrap();
        assert!(matches!(spectral.channels, Channels::Kept(3)));
    }

    #[test]
    fn a_spectrum_makes_an_axis_and_is_resampled_conservatively() {
        let factor = SpectralFactor { grid: grid("400:402:1"), factors: vec![1.0, 3.0, 1.0] };
        let spectral = plan(None, Some(&factor), None).unwrap();
        assert!(matches!(&spectral.channels, Channels::Multiplied(f) if *f == [1.0, 3.0, 1.0]));
        let spectral = plan(None, Some(&factor), Some(&grid("400:404:2"))).unwrap();
        let Channels::Multiplied(factors) = spectral.channels else { panic!() };
        assert!((factors[0] - 2.0).abs() < 1e-12 && (factors[1] - 2.0).abs() < 1e-12 && factors[2].is_nan());
        assert_eq!((spectral.axis.unwrap().len(), spectral.notes.len()), (3, 2));
    }

    #[test]
    fn wavelengths_that_cannot_be_made_are_refused() {
        let lambda = Axis::Wavelength(grid("400:700:10"));
        let factor = SpectralFactor { grid: grid("400:402:1"), factors: vec![1.0; 3] };
        assert!(refusal(Some(&Axis::Rgb), None, "400:700:10").contains("colour channels"));
        assert!(refusal(None, None, "400:700:10").contains("no wavelengths to resample"));
        assert_eq!(
            refusal(Some(&lambda), None, "800:900:10"),
            "wavelengths: 800 to 900 nm requested, measured 400 to 700 nm"
        );
        assert!(refusal(Some(&lambda), Some(&factor), "400:700:10").contains("already have the spectral axis"));
        let short = SpectralFactor { grid: grid("400:402:1"), factors: vec![1.0; 2] };
        assert_eq!(
            refusal(None, Some(&short), "400:700:10"),
            "spectrum: found 2 factors for 3 wavelengths, expected one for each"
        );
    }
}
