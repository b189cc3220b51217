//! Spectra of the files of spectrometers and light meters: the quantity that the user may ask for, remarks, and the
//! acquisition that they become.

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind, Position};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::spectral_table::table::Table;
use super::stated::{StatedQuantity, divide_by_pi};
use super::text::Source;
use super::turned::turned;
use crate::domain::{Axis, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
use crate::notes::SpectrumNote;

/// Ratio to the white reference above which reflectances are remarked upon. Raising it hides larger ones.
const LARGE: f32 = 1.5;

/// One spectrum or several on common wavelengths, as the reader of an instrument's file found them.
pub(super) struct Spectra {
    pub(super) format: &'static str,
    /// Place at which the values begin.
    pub(super) place: Position,
    pub(super) dialect: String,
    pub(super) quantity: StatedQuantity,
    pub(super) wavelengths: WavelengthGrid,
    /// Name of each spectrum; a single one needs none.
    pub(super) names: Vec<String>,
    /// Values of the spectra, `[spectrum, wavelength]`; NaN = missing. Reflectance factors are not yet divided by π.
    pub(super) values: Vec<f32>,
}

impl Spectra {
    /// Takes the spectra of a table whose rows are in order and whose wavelengths are in nm.
    pub(super) fn of_table(
        table: Table,
        source: &Source,
        format: &'static str,
        dialect: String,
        quantity: StatedQuantity,
    ) -> Result<Self, FormatError> {
        let (n, columns) = (table.wavelengths.len(), table.names.len());
        let start = table.wavelengths.first().map_or(0, |&(_, offset)| offset);
        let nanometres = table.wavelengths.iter().map(|&(nm, _)| nm).collect();
        let wavelengths = WavelengthGrid::listed(nanometres)
            .map_err(|error| source.malformed(start, format!("{error}, expected wavelengths in nm that rise")))?;
        let values = if columns == 1 { table.values } else { turned(&table.values, columns, n) };
        Ok(Self { format, place: source.position(start), dialect, quantity, wavelengths, names: table.names, values })
    }

    /// Makes the spectra an acquisition, with remarks on missing, negative and large values.
    pub(super) fn acquisition(
        mut self,
        how: &Interpretation,
        mut report: ParseReport,
    ) -> Result<Acquisition, FormatError> {
        let refused =
            |kind, message: String| FormatError { kind, format: self.format, position: Some(self.place), message };
        let missing = self.values.iter().filter(|value| value.is_nan()).count();
        if missing == self.values.len() {
            return Err(refused(FormatErrorKind::Malformed, "every value is missing, expected numbers".to_owned()));
        }
        if missing > 0 {
            report.note(SpectrumNote::MissingMasked { values: missing });
        }
        report.note_negative(&self.values);
        let largest = self.values.iter().copied().fold(0.0, f32::max);
        if self.quantity == StatedQuantity::Reflectance && largest > LARGE {
            report.note(SpectrumNote::LargeRatio { largest });
        }
        let unit = match (self.quantity, how.unit) {
            (StatedQuantity::ReflectanceFactor, None | Some(Unit::One | Unit::PerSteradian)) => Unit::PerSteradian,
            (StatedQuantity::ReflectanceFactor, Some(other)) => {
                let message = format!("unit {other} of reflectance factors, expected 1");
                return Err(refused(FormatErrorKind::NeedsOption, message));
            }
            (_, Some(unit)) => unit,
            (quantity, None) => quantity.quantity().default_unit(),
        };
        if self.quantity.is_factor() {
            divide_by_pi(&mut self.values);
        }
        let mut axes = vec![Axis::Wavelength(self.wavelengths)];
        if self.names.len() > 1 {
            axes.insert(0, Axis::Index { count: self.names.len(), labels: self.names });
        }
        let tensor = Tensor::new(axes, self.values)
            .map_err(|error| FormatError::new(FormatErrorKind::OverLimit, self.format, error.to_string()))?;
        Ok(Acquisition {
            format: self.format,
            dialect: self.dialect,
            quantity: self.quantity.quantity(),
            unit,
            samples: Samples::OnAxes { tensor, sampling: Sampling::default() },
            spectral_factor: None,
            instrument: Instrument::default(),
            report,
        })
    }
}

/// Returns the quantity of spectra of light: the one asked for, if it is a spectrum or a reflectance.
pub(super) fn of_light(
    how: &Interpretation,
    format: &'static str,
    report: &mut ParseReport,
) -> Result<StatedQuantity, FormatError> {
    match how.quantity {
        None | Some(StatedQuantity::Spectrum) => Ok(StatedQuantity::Spectrum),
        Some(StatedQuantity::Reflectance) => {
            let (asked, held) = (Quantity::Reflectance.to_string(), Quantity::Spectrum.to_string());
            report.note(SpectrumNote::QuantityAsAsked { asked, held });
            Ok(StatedQuantity::Reflectance)
        }
        Some(other) => Err(other_quantity(other, "spectrum or reflectance: the file holds one spectrum", format)),
    }
}

/// Returns the refusal of a quantity that the file cannot have; `expected` says which it can have.
pub(super) fn other_quantity(asked: StatedQuantity, expected: &str, format: &'static str) -> FormatError {
    let message = format!("quantity {asked} was asked for, expected {expected}");
    FormatError::new(FormatErrorKind::NeedsOption, format, message)
}
