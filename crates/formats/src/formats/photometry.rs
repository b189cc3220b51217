//! Luminaires of any format: their quantity, and their combination with a lamp spectrum, by which intensity by
//! direction becomes spectral intensity.

use super::acquisition::{Acquisition, Samples, SpectralFactor};
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::text::Brief;
use crate::domain::colour::Observer;
use crate::domain::{Axis, Quantity, Unit, WavelengthGrid};
use crate::notes::SpectrumNote;
use crate::numeric::bracket::polyline;

/// Luminous efficacy of monochromatic radiation at the maximum of V(λ), lm/W (CIE 018:2019, 683 lm/W at 540 THz).
const LUMENS_PER_WATT: f64 = 683.002;

/// Refuses a quantity other than an emission distribution, which is what a luminaire file holds.
pub(super) fn check_emission(format: &'static str, how: &Interpretation) -> Result<(), FormatError> {
    match how.quantity().filter(|&quantity| quantity != Quantity::Edf) {
        None => Ok(()),
        Some(other) => Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            format,
            format!("quantity {other} was asked for, expected edf: a luminaire is an emission distribution"),
        )),
    }
}

/// Joins a luminaire with the spectrum of its lamp: `spectrum` has one column of wavelengths and values.
///
/// A radiometric or relative intensity is distributed over the spectrum S: factor = S(λ) / ∫S dλ, in nm⁻¹. Candela are
/// converted through V(λ): factor = S(λ) / (683.002 · ∫S·V dλ), in W·sr⁻¹·nm⁻¹ per cd. Integrals are trapezoidal; the
/// one with V uses the union of both grids.
pub fn attach_spectrum(acquisition: &mut Acquisition, spectrum: &Acquisition) -> Result<(), FormatError> {
    check_luminaire(acquisition)?;
    let (lambda, values) = column(spectrum)?;
    let masked = values.iter().filter(|v| v.is_nan()).count();
    let (lambda, values): (Vec<f64>, Vec<f64>) =
        lambda.values().into_iter().zip(values).filter(|(_, v)| !v.is_nan()).map(|(l, &v)| (l, f64::from(v))).unzip();
    if values.len() < 2 {
        return Err(refused(spectrum, format!("{} values, expected a spectrum of at least two", values.len())));
    }
    let (unit, denominator) = match (acquisition.unit, acquisition.unit.per_nanometre()) {
        (_, Some(unit)) => {
            let total = integral(&lambda, &values);
            if total <= 0.0 {
                return Err(refused(
                    spectrum,
                    format!("the spectrum integrates to {total}, expected more than 0", total = Brief(total)),
                ));
            }
            (unit, total)
        }
        (Unit::Candela, _) => {
            let luminous = luminous_integral(&lambda, &values);
            if luminous <= 0.0 {
                return Err(refused(
                    spectrum,
                    format!(
                        "the spectrum weighted by V(lambda) integrates to {luminous}, expected more than 0 for values in candela",
                        luminous = Brief(luminous)
                    ),
                ));
            }
            (Unit::WattPerSteradianNanometre, LUMENS_PER_WATT * luminous)
        }
        (unit, _) => {
            return Err(FormatError::new(
                FormatErrorKind::NeedsOption,
                acquisition.format,
                format!("values in {unit} take no spectrum, expected cd, W/sr, mW/sr, uW/sr, umol/s/sr or relative"),
            ));
        }
    };
    let factors: Vec<f64> = values.iter().map(|value| value / denominator).collect();
    if let Some(bad) = factors.iter().find(|factor| !factor.is_finite()) {
        return Err(refused(
            spectrum,
            format!("a spectral factor of {bad}, expected finite numbers", bad = Brief(*bad)),
        ));
    }
    let grid = WavelengthGrid::listed(lambda.clone()).map_err(|e| refused(spectrum, e.to_string()))?;
    let report = &mut acquisition.report;
    for note in &spectrum.report.notes {
        report.note(note.clone().about("spectrum"));
    }
    if masked > 0 {
        report.note(SpectrumNote::JoinedMaskedBridged { wavelengths: masked });
    }
    let negative = values.iter().filter(|v| **v < 0.0).count();
    if negative > 0 {
        report.note(SpectrumNote::JoinedNegative { values: negative });
    }
    let (first, last) = grid.range();
    if acquisition.unit == Unit::Candela && (first > 400.0 || last < 700.0) {
        report.note(SpectrumNote::JoinedRangeNarrow { first_nm: Brief(first), last_nm: Brief(last) });
    }
    acquisition.unit = unit;
    acquisition.spectral_factor = Some(SpectralFactor { grid, factors });
    Ok(())
}

fn refused(spectrum: &Acquisition, message: impl Into<String>) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, spectrum.format, message)
}

/// Refuses a measurement that cannot be joined with a spectrum: any but a luminaire without a spectral axis.
fn check_luminaire(acquisition: &Acquisition) -> Result<(), FormatError> {
    let spectral = acquisition.spectral_factor.is_some()
        || match &acquisition.samples {
            Samples::OnAxes { tensor, .. } => tensor.axes().iter().any(Axis::is_spectral),
            Samples::Grid(grid) => grid.spectral.is_some(),
            Samples::Scattered(scattered) => scattered.spectral.is_some(),
            Samples::Function(modelled) => modelled.spectral.is_some(),
        };
    let reason = if acquisition.quantity != Quantity::Edf {
        format!("quantity {}, expected an emission distribution (edf), which a spectrum joins", acquisition.quantity)
    } else if spectral {
        "the distribution has a spectrum already, expected one without".to_owned()
    } else {
        return Ok(());
    };
    Err(FormatError::new(FormatErrorKind::NeedsOption, acquisition.format, reason))
}

/// Returns the wavelengths and values of a file with the spectrum of a lamp; refuses files with several spectra.
fn column(spectrum: &Acquisition) -> Result<(&WavelengthGrid, &[f32]), FormatError> {
    if spectrum.quantity != Quantity::Spectrum {
        return Err(refused(spectrum, format!("quantity {}, expected the spectrum of a lamp", spectrum.quantity)));
    }
    let Samples::OnAxes { tensor, .. } = &spectrum.samples else {
        return Err(refused(spectrum, "samples by direction, expected one column of wavelengths and values"));
    };
    match tensor.axes() {
        [Axis::Wavelength(grid)] => Ok((grid, tensor.samples())),
        [Axis::Index { labels, count }, Axis::Wavelength(_)] => {
            const SHOWN: usize = 8;
            let names: Vec<String> = labels.iter().take(SHOWN).map(|label| super::text::snippet(label)).collect();
            let more = if *count > SHOWN { ", …" } else { "" };
            let names = names.join(", ");
            Err(refused(
                spectrum,
                format!("{count} spectra ({names}{more}), expected one: keep one column in the file"),
            ))
        }
        _ => Err(refused(spectrum, "no wavelengths and values, expected one column of each")),
    }
}

/// Returns the integral of a spectrum, `∫ S dλ`, by the trapezoidal rule, exact for straight lines between the values.
fn integral(lambda: &[f64], values: &[f64]) -> f64 {
    lambda.array_windows().zip(values.array_windows()).map(|([a, b], [s, t])| 0.5 * (b - a) * (s + t)).sum()
}

/// Returns the luminous integral of a spectrum, `∫ S·V dλ`, by the trapezoidal rule. The rule uses the wavelengths of
/// both S and V, so that no narrow line and no part of V is missed.
fn luminous_integral(lambda: &[f64], values: &[f64]) -> f64 {
    let (v_lambda, v) = luminous_efficiency();
    let (first, last) = (lambda[0], lambda[lambda.len() - 1]);
    let mut union: Vec<f64> = v_lambda.iter().copied().filter(|l| (first..=last).contains(l)).collect();
    union.extend_from_slice(lambda);
    union.sort_by(f64::total_cmp);
    union.dedup();
    let product: Vec<f64> = union.iter().map(|&l| polyline(lambda, values, l) * polyline(v_lambda, v, l)).collect();
    integral(&union, &product)
}

/// Returns the luminous efficiency V(λ), the second colour matching function of the CIE 1931 observer, as wavelengths
/// in nm and values.
fn luminous_efficiency() -> (&'static [f64], &'static [f64]) {
    let v = &Observer::cie_1931().y;
    (v.lambdas(), v.values())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_efficiency_curve_is_whole() {
        let (lambda, v) = luminous_efficiency();
        assert_eq!((lambda.len(), lambda[0], lambda[470]), (471, 360.0, 830.0));
        assert_eq!(polyline(lambda, v, 555.0), 1.0);
        assert!((integral(lambda, v) - 106.856_895).abs() < 1e-3, "{}", integral(lambda, v));
    }

    #[test]
    fn a_narrow_line_is_weighted_by_its_efficiency() {
        let (lambda, values) = ([549.9, 550.0, 550.1], [0.0, 1.0, 0.0]);
        let (grid, v) = luminous_efficiency();
        let ratio = luminous_integral(&lambda, &values) / integral(&lambda, &values);
        assert!((ratio - polyline(grid, v, 550.0)).abs() < 1e-3, "{ratio}");
    }
}
