//! Export of measurements on the grid of their source file, in its format, with its angles, keywords, header and
//! multipliers.

use super::as_planes::as_planes;
use super::origin::Origin;
use super::relabelled::relabelled;
use crate::compress::Numbers;
use crate::domain::{Axis, ErrorAccumulator, ErrorReport, Measurement, Quantity, Unit};
use crate::export::{ExportError, ExportFormat, LampErrors, UnfitError};
use crate::formats::{
    self, Acquisition, Digits, FormatError, Interpretation, Restatement, restate_eulumdat, restate_lm63, restate_mbsdf,
};
use crate::projection::{self, AxesRequest, DirectionDomain};

/// A file written from a measurement at the angles of its source file.
#[derive(Clone, Debug)]
pub struct Restated {
    /// Content of the file written at the angles of the measurement's source file.
    pub bytes: Vec<u8>,
    /// Format of the written file.
    pub format: ExportFormat,
    /// Number of masked samples, written as 0 because the format has no mask.
    pub filled: usize,
    /// Errors of the written file, read back, at every sample of the measurement.
    pub errors: ErrorReport,
    /// Photometric errors of the written file; `None` unless the measurement is a luminaire.
    pub lamp: Option<LampErrors>,
    /// Contents of the measurement that the written file cannot hold, one phrase each.
    pub lost: Vec<String>,
}

/// Writes `measurement` in the format of its source file, reads the file back, and compares angles and samples.
///
/// Refuses measurements whose axes are not those of the source, and formats without such a writer. Use
/// [`crate::export::export`] to resample instead.
pub fn restate(measurement: &Measurement, origin: &Origin<'_>, digits: Digits) -> Result<Restated, ExportError> {
    let format = ExportFormat::of_name(origin.format).ok();
    let Some(format) = format.filter(|format| FORMATS.contains(format)) else {
        return Err(UnfitError::NoGridWriter { format: origin.format.to_owned() }.into());
    };
    restate_as(measurement, None, origin, format, digits)
}

/// Writes `measurement` at the angles of its source file, but in the given format. `numbers` are the numbers of the
/// source file before multiplication by their common factor.
pub(super) fn restate_as(
    measurement: &Measurement,
    numbers: Option<Numbers<'_>>,
    origin: &Origin<'_>,
    format: ExportFormat,
    digits: Digits,
) -> Result<Restated, ExportError> {
    let planes = as_planes(measurement, format);
    let (measurement, numbers) = planes.as_ref().map_or((measurement, numbers), |planes| (planes, None));
    if ExportFormat::of_name(origin.format) == Ok(format) || origin.metadata.is_empty() {
        return restate_own(measurement, numbers, origin, format, digits);
    }
    let nothing = Origin { format: format.name(), dialect: "", metadata: &[] };
    match relabelled(measurement, origin, format) {
        Some(made) => {
            let origin = Origin { metadata: &made.metadata, ..nothing };
            let restated = restate_own(&made.measurement, None, &origin, format, digits)?;
            Ok(Restated { lost: [made.lost, restated.lost].concat(), ..restated })
        }
        None => restate_own(measurement, None, &nothing, format, digits),
    }
}

/// Writes a measurement in `format`; the header fields in `origin` already have the names that this format uses.
fn restate_own(
    measurement: &Measurement,
    numbers: Option<Numbers<'_>>,
    origin: &Origin<'_>,
    format: ExportFormat,
    digits: Digits,
) -> Result<Restated, ExportError> {
    let off_grid = || ExportError::from(UnfitError::OffGrid { format: format.name() });
    let is_luminaire = measurement.quantity == Quantity::Edf;
    let bytes = match (format, measurement.tensor.axes()) {
        (ExportFormat::Mbsdf, _) if measurement.unit == Unit::PerSteradian => {
            restate_mbsdf(&measurement.tensor, origin.metadata)?
        }
        (ExportFormat::Lm63 | ExportFormat::Eulumdat, [Axis::Grid(directions)]) if is_luminaire => {
            let values = measurement.tensor.samples();
            let (dialect, metadata, unit) = (origin.dialect, origin.metadata, measurement.unit);
            let numbers = numbers.map(|found| (found.values, found.factor));
            let numbers = numbers.filter(|(found, _)| found.len() == values.len());
            let grid = Restatement { directions, values, numbers, unit, dialect, metadata, digits };
            if format == ExportFormat::Eulumdat {
                restate_eulumdat(&grid)?
            } else {
                let bytes = restate_lm63(&grid, false)?;
                // The keywords do not hold a unit given by the user.
                if read_again(&bytes, measurement, format)?.unit == unit { bytes } else { restate_lm63(&grid, true)? }
            }
        }
        _ => return Err(off_grid()),
    };
    let found = read_again(&bytes, measurement, format)?;
    let request = AxesRequest { domain: Some(DirectionDomain::Grid), ..AxesRequest::default() };
    let found = projection::project(&found, &request).map_err(|_| off_grid())?.measurement;
    if found.unit != measurement.unit || !are_same(found.tensor.axes(), measurement.tensor.axes()) {
        return Err(off_grid());
    }
    let mut errors = ErrorAccumulator::default();
    let filled = measurement.tensor.masked();
    errors.add(measurement.tensor.samples(), found.tensor.samples(), 0.0);
    let (stated, again) = (measurement.tensor.samples(), found.tensor.samples());
    let lamp = match measurement.tensor.axes() {
        [Axis::Grid(directions)] => LampErrors::of(directions, stated, again),
        _ => None,
    };
    let lost = match format {
        ExportFormat::Mbsdf => Vec::new(),
        _ => formats::changed_in_windows(origin.metadata.iter().map(|(_, text)| text.as_str())),
    };
    Ok(Restated { bytes, format, filled, errors: errors.finish(), lamp, lost })
}

/// Returns true if both lists of axes have equal angles. Values outside the grid are defined by the format and not
/// compared.
fn are_same(axes: &[Axis], others: &[Axis]) -> bool {
    let is_same = |(axis, other): (&Axis, &Axis)| match (axis, other) {
        (Axis::Grid(a), Axis::Grid(b)) => {
            (a.frame(), a.polar(), a.azimuths()) == (b.frame(), b.polar(), b.azimuths())
                && a.is_polar_mirrored() == b.is_polar_mirrored()
        }
        _ => axis == other,
    };
    axes.len() == others.len() && axes.iter().zip(others).all(is_same)
}

/// Formats that can be written at the angles of the source file.
pub(super) const FORMATS: [ExportFormat; 3] = [ExportFormat::Lm63, ExportFormat::Eulumdat, ExportFormat::Mbsdf];

/// Reads the written file back, with the unit and quantity of the measurement if the parser accepts them.
fn read_again(bytes: &[u8], measurement: &Measurement, format: ExportFormat) -> Result<Acquisition, FormatError> {
    let how = Interpretation {
        unit: (format == ExportFormat::Eulumdat).then_some(measurement.unit),
        quantity: Some(measurement.quantity.into()),
        ..Interpretation::default()
    };
    formats::read(bytes, &how)
}
