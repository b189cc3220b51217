//! Tensor files (`.bsdf`) of the RGL material database (EPFL): BRDFs in the adaptive parameterisation, isotropic or
//! anisotropic, spectral or RGB.
//!
//! The file defines a function (Dupuy & Jakob 2018), not a grid of directions. It is read as a function and evaluated
//! at the directions that a projection needs. Its numbers, times D / 4σ if `jacobian` is 1, are f · cos θo; evaluation
//! returns f.

mod about;
mod assemble;
mod container;
mod limits;
mod model;
mod refusal;
#[cfg(test)]
mod tests;
mod warp;
mod write;

pub use write::{RglGrid, write_rgl};

use super::acquisition::{Acquisition, Angles, AzimuthExtent, Azimuths, Modelled, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::reader::{Reader, Sample};
use super::text::snippet;
use crate::domain::{Axis, Quantity, Unit};
use crate::notes::ScatteringNote;
use about::{ABOUT, NAME};
use assemble::model;
use container::Fields;
use limits::MAX_TEXT;
use model::Model;
use refusal::over_limit;
use std::sync::Arc;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &[],
    probe: |sample: &Sample<'_>| if sample.bytes.starts_with(b"tensor_file") { 100 } else { 0 },
    read,
};

/// Limits of the mean spacing of outgoing directions, in degrees, by which the subdivision level of triangles is
/// chosen: lower bound, value if the file does not determine it, and upper bound.
const SPACING: (f64, f64, f64) = (0.2, 5.0, 45.0);
/// Names of the fields of an RGL file that are read; other fields are listed in the report.
const KNOWN: [&str; 11] = [
    "description",
    "phi_i",
    "theta_i",
    "wavelengths",
    "ndf",
    "sigma",
    "vndf",
    "luminance",
    "spectra",
    "rgb",
    "jacobian",
];

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let fields = Fields::read(bytes)?;
    if fields.get("M").is_some() && fields.get("wvls").is_some() {
        let message = "this is a KAIST polarimetric pBRDF, which is not read: only RGL materials are";
        return Err(FormatError::new(FormatErrorKind::Unsupported, NAME, message));
    }
    let needs = |message: String| Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    if how.unit.is_some_and(|unit| unit != Unit::PerSteradian) {
        return needs("a unit was asked for that this format does not have, expected 1/sr".to_owned());
    }
    if let Some(quantity) = how.quantity().filter(|&quantity| quantity != Quantity::Brdf) {
        return needs(format!("quantity {quantity} was asked for, expected brdf, which the file holds"));
    }
    let mut report = ParseReport::default();
    describe(&fields, &mut report)?;
    let skipped: Vec<String> = fields.names().filter(|name| !KNOWN.contains(name)).map(snippet).collect();
    if !skipped.is_empty() {
        report.note(ScatteringNote::OtherFields { names: skipped.join(", ") });
    }
    let (model, spectral) = model(&fields, &mut report)?;
    let modelled = modelled(model, spectral, &mut report);
    Ok(Acquisition {
        format: NAME,
        dialect: dialect(&fields, &modelled),
        quantity: Quantity::Brdf,
        unit: Unit::PerSteradian,
        samples: Samples::Function(modelled),
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

fn describe(fields: &Fields<'_>, report: &mut ParseReport) -> Result<(), FormatError> {
    let field = fields.require("description")?;
    let text = field.bytes()?;
    if text.len() > MAX_TEXT {
        let message = format!("a description of {} bytes, expected at most {MAX_TEXT}", text.len());
        return Err(over_limit(field.entry, message));
    }
    let text = String::from_utf8_lossy(text).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned();
    report.metadata.push(("description".to_owned(), text));
    Ok(())
}

fn modelled(model: Model, spectral: Axis, report: &mut ParseReport) -> Modelled {
    let degrees = |radians: &f64| radians.to_degrees();
    // π/2 rounded to f32 slightly exceeds a right angle.
    let theta: Vec<f64> = model.theta.iter().map(|t| degrees(t).min(90.0)).collect();
    if let Some(&last) = theta.last().filter(|&&last| last < 90.0) {
        report.note(ScatteringNote::ElevationsHeld { last_degrees: libm::round(last * 100.0) / 100.0 });
    }
    let phi = (!model.isotropic).then(|| Azimuths {
        phi: model.phi.iter().map(|phi| degrees(phi).clamp(-180.0, 180.0)).collect(),
        extent: AzimuthExtent::Sector,
    });
    let spacing = model.spacing().map_or(SPACING.1, |degrees| degrees.clamp(SPACING.0, SPACING.2));
    Modelled {
        stated: None,
        incoming: Angles { theta, covers: (0.0, 90.0), phi },
        outgoing_spacing: spacing,
        spectral: Some(spectral),
        numbers: model.values.len(),
        missing: model.missing,
        function: Arc::new(model),
    }
}

fn dialect(fields: &Fields<'_>, modelled: &Modelled) -> String {
    let shape = |name: &str| fields.get(name).map_or(&[][..], |field| &field.shape);
    let side = shape("luminance").last().copied().unwrap_or_default();
    let incident = match &modelled.incoming.phi {
        None if modelled.incoming.theta.len() == 1 => "isotropic, 1 elevation".to_owned(),
        None => format!("isotropic, {} elevations", modelled.incoming.theta.len()),
        Some(azimuths) => format!("anisotropic, {} × {} incident", azimuths.phi.len(), modelled.incoming.theta.len()),
    };
    let channels = match &modelled.spectral {
        Some(Axis::Wavelength(grid)) => format!("{} wavelengths", grid.len()),
        _ => "RGB".to_owned(),
    };
    format!("{incident}, {side} × {side} outgoing, {channels}")
}
