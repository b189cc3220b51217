//! Unit of a column of wavelengths: from the option, else the header, else the range of the numbers.

use super::about::NAME;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::text::{Brief, snippet};
use crate::notes::SpectrumNote;

/// Unit of the wavelengths in the first column of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::formats) enum WavelengthUnit {
    Nanometre,
    Micrometre,
    Angstrom,
    /// Wavenumbers in cm⁻¹.
    Wavenumber,
}

impl WavelengthUnit {
    pub(in crate::formats) const ALL: [Self; 4] = [Self::Nanometre, Self::Micrometre, Self::Angstrom, Self::Wavenumber];

    pub(in crate::formats) fn name(self) -> &'static str {
        match self {
            Self::Nanometre => "nm",
            Self::Micrometre => "um",
            Self::Angstrom => "angstrom",
            Self::Wavenumber => "1/cm",
        }
    }

    pub(in crate::formats) fn to_nanometres(self, value: f64) -> f64 {
        match self {
            Self::Nanometre => value,
            // Rounded, because 0.55 um is 550 nm, not 550.0000000000001.
            Self::Micrometre => {
                let product = value * 1000.0;
                let rounded = (product * 1e6).round() / 1e6;
                if (rounded - product).abs() <= 1e-12 * product { rounded } else { product }
            }
            Self::Angstrom => value / 10.0,
            Self::Wavenumber => 1e7 / value,
        }
    }

    pub(in crate::formats) fn of_name(name: &str) -> Option<Self> {
        match name.trim().to_lowercase().replace(['µ', 'μ'], "u").as_str() {
            "nm" | "nanometer" | "nanometers" | "nanometre" | "nanometres" | "nanomètre" | "nanomètres"
            | "nanómetros" | "nanometri" => Some(Self::Nanometre),
            "um" | "mum" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre" | "micrometres"
            | "mikrometer" | "mikron" | "micromètre" | "micromètres" | "micrómetros" | "micrometri" => {
                Some(Self::Micrometre)
            }
            "angstrom" | "angstroms" | "å" | "ångström" => Some(Self::Angstrom),
            "1/cm" | "cm-1" | "cm^-1" | "cm⁻¹" | "wavenumber" | "wavenumbers" => Some(Self::Wavenumber),
            _ => None,
        }
    }

    /// Returns the unit in a column name such as `Wavelength (nm)`, `lambda_um` or `wavenumber [cm-1]`.
    pub(in crate::formats) fn of_header(name: &str) -> Option<Self> {
        let separators =
            |c: char| c.is_whitespace() || matches!(c, '(' | ')' | '[' | ']' | '_' | ',' | ':' | '{' | '}');
        name.split(separators).filter(|word| !word.is_empty()).rev().find_map(Self::of_name)
    }
}

/// Returns the bracketed word at the end of a column name, which is meant as a unit: `Wavelength (furlongs)`.
fn bracketed(name: &str) -> Option<&str> {
    let open = name.trim_end().strip_suffix([')', ']'])?;
    let unit = open.rsplit(['(', '[']).next()?.trim();
    (unit.len() < open.len() && !unit.is_empty() && unit.chars().all(char::is_alphabetic)).then_some(unit)
}

/// Returns the unit of the wavelengths `values`; `name` is the name of their column, and `is_named` is true if it says
/// wavelengths.
pub(super) fn of(
    values: &[f64],
    name: Option<&str>,
    is_named: bool,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<WavelengthUnit, FormatError> {
    let known = || WavelengthUnit::ALL.map(WavelengthUnit::name).join(", ");
    let needs = |message: String| FormatError::new(FormatErrorKind::NeedsOption, NAME, message);
    if let Some(asked) = &how.wavelength_unit {
        return WavelengthUnit::of_name(asked)
            .ok_or_else(|| needs(format!("wavelength unit {}, expected one of {}", snippet(asked), known())));
    }
    if let Some(unit) = name.and_then(WavelengthUnit::of_header) {
        return Ok(unit);
    }
    if let Some(unit) = name.and_then(bracketed) {
        return Err(needs(format!("wavelengths in {}, expected one of {}", snippet(unit), known())));
    }
    let (first, last) = (values[0], values[values.len() - 1]);
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), &value| (low.min(value), high.max(value)));
    let within = |a: f64, b: f64| a <= low && high <= b;
    let falls = first > last;
    let unit = if within(0.2, 25.0) {
        WavelengthUnit::Micrometre
    } else if within(150.0, 3000.0)
        || is_named && within(100.0, 30_000.0) && low < 1500.0
        || is_light_of_the_sun(low, high)
    {
        WavelengthUnit::Nanometre
    } else if is_named && within(0.1, 100.0) {
        WavelengthUnit::Micrometre
    } else if within(1500.0, 30_000.0) && !falls {
        WavelengthUnit::Angstrom
    } else if within(400.0, 50_000.0) && falls {
        // Spectrometers list wavenumbers in decreasing order, so that wavelengths increase.
        WavelengthUnit::Wavenumber
    } else {
        return Err(needs(format!(
            "wavelengths from {} to {} fit no unit, expected the option wavelength_unit: {}",
            Brief(first),
            Brief(last),
            known()
        )));
    };
    report.note(SpectrumNote::WavelengthUnitGuessed { first: Brief(first), last: Brief(last), unit: unit.name() });
    Ok(unit)
}

/// Returns true for a range from the ultraviolet to beyond 3000, as tables of sunlight have it in nm. Wavenumbers of
/// instruments begin at 400 or above.
fn is_light_of_the_sun(low: f64, high: f64) -> bool {
    (150.0..400.0).contains(&low) && high <= 4500.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inferred(values: &[f64], name: Option<&str>) -> Option<WavelengthUnit> {
        let is_named = name.is_some_and(|name| name.starts_with(['w', 'W']));
        of(values, name, is_named, &Interpretation::default(), &mut ParseReport::default()).ok()
    }

    #[test]
    fn units_are_read_or_inferred() {
        use WavelengthUnit::{Angstrom, Micrometre, Nanometre, Wavenumber};
        assert_eq!(inferred(&[0.35, 2.5], None), Some(Micrometre));
        assert_eq!(inferred(&[780.0, 380.0], None), Some(Nanometre));
        assert_eq!(inferred(&[3800.0, 7800.0], None), Some(Angstrom));
        assert_eq!(inferred(&[26000.0, 12800.0], None), Some(Wavenumber));
        assert_eq!(inferred(&[1.0, 1000.0], None), None);
        assert_eq!(inferred(&[4000.0, 7000.0], Some("Wavenumber [cm-1]")), Some(Wavenumber));
        assert_eq!(inferred(&[1.0, 2.0], Some("Wavelength (nm)")), Some(Nanometre));
        assert_eq!(inferred(&[1.0, 2.0], Some("lambda_um")), Some(Micrometre));
        assert_eq!(inferred(&[1.0, 1000.0], Some("wavelength")), None);
        assert_eq!(inferred(&[280.0, 4000.0], Some("wavelength")), Some(Nanometre));
        assert_eq!(inferred(&[280.0, 4000.0], None), Some(Nanometre));
        assert_eq!(inferred(&[400.0, 4000.0], None), None);
        assert_eq!(inferred(&[120.0, 400.0], Some("wavelength")), Some(Nanometre));
        assert_eq!(inferred(&[2.5, 40.0], Some("wavelength")), Some(Micrometre));
    }
}
