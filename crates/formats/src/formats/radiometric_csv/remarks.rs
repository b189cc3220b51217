//! Notes on defaults assumed for missing header keys, and on changes made to the values.

use super::columns::Columns;
use super::header::Header;
use crate::formats::acquisition::{NoteKind, ParseReport};

/// Adds notes on assumptions and changes to the report.
pub(super) fn remarks(header: &Header, columns: &Columns, grazing: usize, report: &mut ParseReport) {
    if header.wavelength_unit_assumed && (columns.is_wide() || columns.has_wavelength) {
        report.note(NoteKind::Assumed, "`wavelength_unit` is not stated, taken as nm");
    }
    if header.radians && columns.angles.iter().any(Option::is_some) {
        report.note(NoteKind::Assumed, "angles in radians are rounded to 0.0001 degrees");
    }
    if header.cosine_included {
        report.note(NoteKind::Assumed, "values hold the cosine, as the header says: divided by |cos theta_o|");
    }
    if header.is_factor {
        report.note(NoteKind::Assumed, "reflectance factors, divided by π: a BRDF in 1/sr");
    }
    if grazing > 0 {
        let message = format!("{grazing} values at theta_o of 90 degrees hold a cosine of 0: masked");
        report.note(NoteKind::Warning, message);
    }
    let no_phi_i = columns.angles[0].is_some() && columns.angles[1].is_none();
    if header.quantity.directions() == 2 && no_phi_i && !header.isotropic {
        report.note(NoteKind::Assumed, "no column phi_i: isotropic, phi_o is relative to the incoming azimuth");
    }
}
