//! Selection of the formats that can hold a material; a refusal lists the ones that can.

use super::error::{ExportError, OptionError, UnfitError, setting};
use super::format::ExportFormat;
use super::options::ExportOptions;
use super::resolution::cell_axes;
use crate::domain::{Axis, Domain, Quantity};
use crate::evaluate::Material;

/// The formats that `material` can be written as.
pub fn fitting(material: &Material) -> Vec<ExportFormat> {
    ExportFormat::ALL.iter().copied().filter(|&format| why_not(material, format).is_none()).collect()
}

/// Refuses a format that cannot hold the material, and options that are invalid or have no effect.
pub(super) fn check(material: &Material, format: ExportFormat, options: &ExportOptions) -> Result<(), ExportError> {
    if let Some(holds) = why_not(material, format) {
        let (found, fitting) = (describe(material), fitting(material));
        return Err(UnfitError::Material { format, holds, found, fitting }.into());
    }
    unused(format.name(), options, |formats| formats.contains(&format))?;
    if let Some(found) = options.step.filter(|step| !(0.1..=45.0).contains(step)) {
        return setting(OptionError::Step { found });
    }
    index(material, format, options)
}

/// Refuses options that have no effect. `knows` returns true if the format is among those that the option applies to.
pub(super) fn unused(
    format: &'static str,
    options: &ExportOptions,
    knows: impl Fn(&[ExportFormat]) -> bool,
) -> Result<(), ExportError> {
    use ExportFormat::{Eulumdat, Lm63, Mbsdf, Rgl, Tabphase};
    let given: [(&'static str, bool, &[ExportFormat]); 4] = [
        ("side", options.side.is_some(), &[Rgl, Mbsdf, Tabphase]),
        ("step", options.step.is_some(), &[Rgl, Lm63, Eulumdat]),
        ("rgb", options.rgb, &[Rgl]),
        ("wavelength", options.wavelength.is_some(), &[Tabphase]),
    ];
    match given.into_iter().find(|(_, given, formats)| *given && !knows(formats)) {
        Some((option, ..)) => setting(OptionError::Unused { option, format }),
        None => Ok(()),
    }
}

/// Checks the requested entry; the index must be empty if the material has no index axes.
fn index(material: &Material, format: ExportFormat, options: &ExportOptions) -> Result<(), ExportError> {
    let axes = &material.axes()[..material.layout().indices];
    match &options.index {
        Some(index) => Ok(material.entry(index).map(|_| ())?),
        None if axes.iter().all(|axis| axis.len() == 1) || matches!(format, ExportFormat::Csv | ExportFormat::Npy) => {
            Ok(())
        }
        None => setting(OptionError::MissingIndex { shape: axes.iter().map(Axis::len).collect(), format }),
    }
}

/// Describes the material in a few words.
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

/// Returns `None` if the format can hold the material, else a description of what the format holds.
fn why_not(material: &Material, format: ExportFormat) -> Option<&'static str> {
    let (axes, layout, quantity) = (cell_axes(material), material.layout(), material.quantity());
    let incoming = layout.incoming.map(|axis| &axes[axis]);
    let outgoing = layout.outgoing.map(|axis| &axes[axis]);
    let has_wavelengths = matches!(axes.last(), Some(Axis::Wavelength(_)));
    let isotropic = matches!(incoming, Some(Axis::Elevation(_)));
    let on = |axis: Option<&Axis>, domains: &[Domain]| match axis {
        Some(Axis::Triangles(mesh)) => domains.contains(&mesh.domain()),
        Some(Axis::Elevation(_)) => domains.contains(&Domain::Hemisphere),
        _ => false,
    };
    let upper = &[Domain::Hemisphere, Domain::Sphere];
    let reflects = quantity == Quantity::Brdf && on(incoming, upper) && on(outgoing, upper);
    let (fits, holds) = match format {
        ExportFormat::Rgl => (reflects, "a brdf over the upper hemisphere"),
        ExportFormat::Merl => {
            (reflects && isotropic && has_colour(material), "an isotropic brdf with a colour (400 to 700 nm)")
        }
        ExportFormat::Mbsdf => {
            let scatters = match quantity {
                Quantity::Brdf => on(outgoing, upper),
                Quantity::Btdf => on(outgoing, &[Domain::Lower, Domain::Sphere]),
                Quantity::Bsdf => on(outgoing, &[Domain::Sphere]),
                _ => false,
            };
            (
                scatters && isotropic && has_colour(material),
                "an isotropic brdf, btdf or bsdf with a colour (400 to 700 nm)",
            )
        }
        ExportFormat::Lm63 => (
            super::luminaire::Photometry::of(material).is_some(),
            "a luminaire (edf) of one value, or a density over wavelength, by direction",
        ),
        ExportFormat::Eulumdat => {
            let seen = super::luminaire::Photometry::of(material).is_some_and(|photometry| photometry.is_luminous());
            (seen, "a luminaire (edf) in cd, cd/klm or visible watts by wavelength")
        }
        ExportFormat::Spd | ExportFormat::Csv => {
            let table = matches!(quantity, Quantity::Spectrum | Quantity::Reflectance);
            (table && incoming.is_none() && has_wavelengths, "spectra without directions")
        }
        ExportFormat::Tabphase => (
            quantity == Quantity::Phase
                && incoming.is_some()
                && on(outgoing, &[Domain::Sphere])
                && !matches!(axes.last(), Some(Axis::Rgb)),
            "a phase function over the whole sphere",
        ),
        ExportFormat::Npy => (true, "everything"),
    };
    (!fits).then_some(holds)
}

/// Returns true if the values can be converted to RGB.
fn has_colour(material: &Material) -> bool {
    match material.axes().last() {
        Some(Axis::Wavelength(_)) => super::subject::colours(material).is_some(),
        _ => true,
    }
}
