//! Check that a format can hold a material; a refusal lists the formats that can.

use super::error::{ExportError, OptionError, UnfitError, setting};
use super::options::{ExportOptions, STEPS};
use super::resolution::cell_axes;
use super::writer::{Write, Writer};
use crate::domain::{Axis, Domain, Quantity};
use crate::evaluate::{EvaluateError, Material};

/// Domains that contain the directions above the surface: the upper hemisphere and the sphere.
pub(super) const UPPER: &[Domain] = &[Domain::Hemisphere, Domain::Sphere];

/// Refuses a format that cannot hold the material, and options that are invalid or have no effect. The error for an
/// unsuitable format names those of `writers` that can hold the material.
pub(super) fn check(
    material: &Material,
    writer: &Writer,
    options: &ExportOptions,
    writers: impl Iterator<Item = &'static Writer>,
) -> Result<(), ExportError> {
    if !(writer.fits)(material) {
        let fitting = writers.filter(|other| (other.fits)(material)).map(|other| other.name).collect();
        let (format, holds, found) = (writer.name, writer.holds, describe(material));
        return Err(UnfitError::Material { format, holds, found, fitting }.into());
    }
    is_whole(material, writer)?;
    unused(writer.name, options, writer.options)?;
    if let Some(found) = options.step.filter(|step| !STEPS.allow(*step)) {
        return setting(OptionError::Step { found, limits: STEPS });
    }
    index(material, writer, options)
}

/// Refuses a file that defines values in all directions for a material of which too few were measured.
pub(super) fn is_whole(material: &Material, writer: &Writer) -> Result<(), EvaluateError> {
    writer.whole.map_or(Ok(()), |file| material.needs_whole(file))
}

/// Refuses export options other than `index` and `strict` that have no effect in `format`; `known` names those that it
/// accepts.
pub(super) fn unused(
    format: &'static str,
    options: &ExportOptions,
    known: &[(&'static str, &'static str)],
) -> Result<(), ExportError> {
    // The check of the index has messages of its own, and every format can be strict.
    let mut stated = options.stated().filter(|option| !matches!(*option, "index" | "strict"));
    match stated.find(|option| known.iter().all(|(name, _)| name != option)) {
        Some(option) => setting(OptionError::Unused { option, format }),
        None => Ok(()),
    }
}

/// Checks the entry of the index axes (axes of numbered entries) that the export options request. Without a request, a
/// format that holds one entry needs index axes of length 1.
fn index(material: &Material, writer: &Writer, options: &ExportOptions) -> Result<(), ExportError> {
    let axes = &material.axes()[..material.layout().indices];
    match &options.index {
        Some(index) => Ok(material.entry(index).map(|_| ())?),
        None if axes.iter().all(|axis| axis.len() == 1) || !matches!(writer.write, Write::Entry(_)) => Ok(()),
        None => setting(OptionError::MissingIndex { shape: axes.iter().map(Axis::len).collect(), format: writer.name }),
    }
}

/// Describes the kind of material in a few words, for a message.
fn describe(material: &Material) -> String {
    let axes = material.axes();
    let layout = material.layout();
    let quantity = material.quantity();
    let directions = match layout.incoming.map(|axis| &axes[axis]) {
        Some(Axis::Elevation(_)) => "isotropic ",
        Some(_) if quantity.has_cosine() => "anisotropic ",
        _ if layout.outgoing.is_none() && layout.incoming.is_none() && quantity.directions() > 0 => "undirected ",
        _ => "",
    };
    let article = if directions.starts_with(['a', 'i', 'u']) || (directions.is_empty() && quantity == Quantity::Edf) {
        "an"
    } else {
        "a"
    };
    let spectral = match axes.last() {
        Some(Axis::Wavelength(_)) => "with wavelengths",
        Some(Axis::Rgb) => "in RGB",
        _ => "without wavelengths",
    };
    format!("{article} {directions}{quantity} {spectral} in {}", material.unit())
}

/// Returns the axis of incoming directions of a material. For samples on a grid of angles it is the axis of the
/// triangles over which they are averaged.
pub(super) fn incoming(material: &Material) -> Option<&Axis> {
    material.layout().incoming.map(|axis| &cell_axes(material)[axis])
}

/// Returns the axis of outgoing directions of a material. For samples on a grid of angles it is the axis of the
/// triangles over which they are averaged.
pub(super) fn outgoing(material: &Material) -> Option<&Axis> {
    material.layout().outgoing.map(|axis| &cell_axes(material)[axis])
}

/// Returns true if the directions of an axis cover one of `domains`: the upper or lower hemisphere, or the whole
/// sphere.
pub(super) fn is_on(axis: Option<&Axis>, domains: &[Domain]) -> bool {
    match axis {
        Some(Axis::Triangles(mesh)) => domains.contains(&mesh.domain()),
        Some(Axis::Elevation(_)) => domains.contains(&Domain::Hemisphere),
        _ => false,
    }
}

/// Returns true if the material's spectra can be converted to RGB, or are RGB or monochromatic already.
pub(super) fn has_colour(material: &Material) -> bool {
    match material.axes().last() {
        Some(Axis::Wavelength(_)) => super::subject::colours(material).is_some(),
        _ => true,
    }
}
