//! Notes on defaults assumed for missing header keys, and on changes made to the values.

use super::columns::Columns;
use super::header::Header;
use crate::formats::acquisition::ParseReport;
use crate::notes::{ScatteringNote, ValueNote};

/// Adds notes on assumptions and conversions to the report of the parser.
pub(super) fn remarks(header: &Header, columns: &Columns, grazing: usize, report: &mut ParseReport) {
    if header.wavelength_unit_assumed && (columns.is_wide() || columns.has_wavelength) {
        report.note(ValueNote::WavelengthUnitNotStated);
    }
    if columns.angles.iter().flatten().any(|angle| angle.radians) {
        report.note(ValueNote::AnglesRounded { stored_as: "radians" });
    }
    if header.cosine_included {
        report.note(ScatteringNote::CosineDivided { source: "header" });
    }
    if header.is_percent {
        report.note(ValueNote::PercentDivided);
    }
    if header.is_factor {
        report.note(ScatteringNote::ReflectanceFactors);
    }
    if grazing > 0 {
        report.note(ScatteringNote::GrazingMasked { values: grazing });
    }
    let no_phi_i = columns.angles[0].is_some() && columns.angles[1].is_none();
    if header.quantity.directions() == 2 && no_phi_i && !header.isotropic {
        report.note(ScatteringNote::IsotropicWithoutAzimuth);
    }
}
