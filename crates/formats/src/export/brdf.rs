//! Surfaces: RGL tensor files, MERL tables, MDL measured BSDFs.

use super::error::ExportError;
use super::exported::{Exported, Summary};
use super::fits::{UPPER, has_colour, incoming, is_on, outgoing};
use super::measure::{AddedError, Draws, measure};
use super::options::{ExportOptions, check_size};
use super::subject::{Subject, wavelengths};
use super::writer::{Write, Writer};
use super::{read_back, resolution};
use crate::appearance::{Channels, Viewing};
use crate::domain::{Axis, Direction, Domain, Quantity, Unit};
use crate::evaluate::Material;
use crate::formats::{
    self, Acquisition, DirectionalFunction, FormatError, FormatErrorKind, Interpretation, MbsdfGrid, RglGrid, Samples,
    Written, write_mbsdf, write_merl, write_rgl,
};

const REFLECTED: Draws = Draws::Surface { above: true, below: false };
const SPECTRA: &str = "the spectrum";
const COLOURS: &str = "linear sRGB of the spectrum (D65, CIE 1931)";

/// Writer of RGL tensor files.
pub(super) const RGL: Writer = Writer {
    name: "rgl",
    other_names: &[],
    description: "RGL tensor file: a BRDF, spectral or RGB, isotropic or not",
    extension: "bsdf",
    media_type: "application/octet-stream",
    holds: "a brdf over the upper hemisphere",
    fits: reflects,
    whole: Some("rgl file"),
    options: &[
        ("side", "nodes along a side"),
        ("step", "degrees between incident directions"),
        ("rgb", "linear sRGB instead of spectra"),
    ],
    write: Write::Entry(rgl),
};

/// Writer of MERL tables.
pub(super) const MERL: Writer = Writer {
    name: "merl",
    other_names: &[],
    description: "MERL table: an isotropic BRDF in RGB",
    extension: "binary",
    media_type: "application/octet-stream",
    holds: "an isotropic brdf with a colour (400 to 700 nm)",
    fits: |material| reflects(material) && is_isotropic(material) && has_colour(material),
    whole: Some("MERL table"),
    options: &[],
    write: Write::Entry(merl),
};

/// Writer of MDL measured BSDFs.
pub(super) const MBSDF: Writer = Writer {
    name: "mbsdf",
    other_names: &[],
    description: "MDL measured BSDF: isotropic, RGB or scalar",
    extension: "mbsdf",
    media_type: "application/octet-stream",
    holds: "an isotropic brdf, btdf or bsdf with a colour (400 to 700 nm)",
    fits: |material| scatters(material) && is_isotropic(material) && has_colour(material),
    whole: Some("MDL measured BSDF"),
    options: &[("side", "polar angles")],
    write: Write::Entry(mbsdf),
};

fn reflects(material: &Material) -> bool {
    material.quantity() == Quantity::Brdf && is_on(incoming(material), UPPER) && is_on(outgoing(material), UPPER)
}

fn scatters(material: &Material) -> bool {
    let domains = match material.quantity() {
        Quantity::Brdf => UPPER,
        Quantity::Btdf => &[Domain::Lower, Domain::Sphere],
        Quantity::Bsdf => &[Domain::Sphere],
        _ => return false,
    };
    is_on(outgoing(material), domains)
}

fn is_isotropic(material: &Material) -> bool {
    matches!(incoming(material), Some(Axis::Elevation(_)))
}

fn rgl(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let spectral = wavelengths(material).filter(|_| !options.rgb).cloned();
    let subject =
        if spectral.is_some() { Subject::spectra(material, options) } else { Subject::rgb(material, options)? };
    let incident = resolution::incident(material, options, subject.channels())?;
    let directions = if incident.phi.is_empty() {
        format!("{} incident elevations", incident.theta.len())
    } else {
        format!("{} × {} incident directions", incident.phi.len(), incident.theta.len())
    };
    let grid = RglGrid {
        theta_i: incident.theta,
        phi_i: incident.phi,
        wavelengths: spectral,
        side: incident.side,
        description: description(material),
    };
    let written = write_rgl(&grid, &subject)?;
    let what = if grid.wavelengths.is_some() { SPECTRA } else { what_of(material) };
    let error = compare(&written, &subject, what, REFLECTED, None)?;
    let lost = if grid.wavelengths.is_some() { Vec::new() } else { lost_spectrum(material) };
    Ok(exported(RGL.name, format!("{directions}, {0} × {0} nodes", grid.side), lost, written, error))
}

fn merl(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let subject = Subject::rgb(material, options)?;
    check_size(Some(12 + 24 * 90 * 90 * 180), options, "every file of the format has this size")?;
    let written = write_merl(&subject)?;
    let error = compare(&written, &subject, what_of(material), REFLECTED, None)?;
    let resolution = "90 × 90 × 180 cells of half and difference angles".to_owned();
    Ok(exported(MERL.name, resolution, lost_spectrum(material), written, error))
}

fn mbsdf(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let rgb = material.axes().last().is_some_and(Axis::is_spectral);
    let subject = if rgb { Subject::rgb(material, options)? } else { Subject::spectra(material, options) };
    let theta = resolution::side(material, options)?;
    let quantity = material.quantity();
    let (above, below) = (quantity != Quantity::Btdf, quantity != Quantity::Brdf);
    let phi = 2 * theta + 1;
    let sides = usize::from(above) + usize::from(below);
    let bytes = [4, sides, subject.channels(), phi, theta].into_iter().try_fold(theta, usize::checked_mul);
    check_size(bytes, options, "ask for a smaller side")?;
    let grid = MbsdfGrid {
        theta,
        phi,
        rgb,
        reflection: above,
        transmission: below,
        metadata: vec![format!("description=\"{}\"", description(material))],
    };
    let symmetric = Symmetric(&subject);
    let written = write_mbsdf(&grid, &symmetric)?;
    let what = if rgb { what_of(material) } else { "the values" };
    let error = compare(&written, &subject, what, Draws::Surface { above, below }, Some(quantity))?;
    let side = match (above, below) {
        (true, true) => "reflection and transmission",
        (true, false) => "reflection",
        _ => "transmission",
    };
    let resolution = format!("{side}, {theta} × {theta} polar angles, {phi} azimuths");
    Ok(exported(MBSDF.name, resolution, lost_spectrum(material), written, error))
}

fn what_of(material: &Material) -> &'static str {
    match material.axes().last() {
        Some(Axis::Wavelength(_)) => COLOURS,
        Some(Axis::Rgb) => "the three channels",
        _ => "the values as grey",
    }
}

fn lost_spectrum(material: &Material) -> Vec<String> {
    let Some(grid) = wavelengths(material) else { return Vec::new() };
    let mut lost = vec![format!("the spectrum: only linear sRGB of {} wavelengths is kept", grid.len())];
    let channels = Channels::of(material, &Viewing::default()).ok();
    lost.extend(channels.and_then(|channels| channels.remark(grid)));
    lost
}

/// Returns a one-line description of a material for the header of an exported file: quantity, axes and, if known,
/// compression error.
fn description(material: &Material) -> String {
    let axes: Vec<String> = material.axes().iter().map(Axis::describe).collect();
    let error = material.summary().map_or_else(String::new, |summary| {
        format!(", compressed ({}) with er(L2) {:.4}", summary.policy.name(), summary.errors.er_l2)
    });
    format!("wavelume: {} of {}{error}", material.quantity(), axes.join(", "))
}

/// BRDF made symmetric about the plane of incidence: the mean of the values at azimuths φ and −φ from it.
#[derive(Debug)]
struct Symmetric<'a, 'b>(&'b Subject<'a>);

impl DirectionalFunction for Symmetric<'_, '_> {
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
        let [x, y, z] = wo.xyz();
        self.0.at(Some(wi), wo, values);
        // Isotropic: `wi` has azimuth 0.
        let mut other = vec![0.0; values.len()];
        self.0.at(Some(wi), Direction::from_unit([x, -y, z]), &mut other);
        for (value, other) in values.iter_mut().zip(other) {
            if value.is_nan() {
                *value = other;
            } else if !other.is_nan() {
                *value = 0.5 * (*value + other);
            }
        }
    }
}

/// Reads the written BRDF file back and measures its error against the material.
fn compare(
    written: &Written,
    subject: &Subject<'_>,
    what: &'static str,
    draws: Draws,
    quantity: Option<Quantity>,
) -> Result<AddedError, FormatError> {
    let how = Interpretation { quantity: quantity.map(Into::into), ..Interpretation::default() };
    let Acquisition { samples, format, .. } = formats::read(&written.bytes, &how)?;
    let material = |wi: Option<Direction>, wo: Direction, values: &mut [f64]| subject.at(wi, wo, values);
    let channels = subject.channels();
    match &samples {
        Samples::Function(modelled) => {
            let file = |wi: Option<Direction>, wo: Direction, values: &mut [f64]| match wi {
                Some(wi) => modelled.function.evaluate(wi, wo, values),
                None => values.fill(f64::NAN),
            };
            Ok(measure(what, draws, channels, &material, &file))
        }
        Samples::Grid(grid) => {
            let file = |wi: Option<Direction>, wo: Direction, values: &mut [f64]| {
                read_back::evaluate(grid, wi, wo, values);
            };
            Ok(measure(what, draws, channels, &material, &file))
        }
        _ => Err(FormatError {
            kind: FormatErrorKind::Malformed,
            format,
            position: None,
            message: "the written file does not read back as a BSDF, a bug of wavelume".to_owned(),
        }),
    }
}

fn exported(
    format: &'static str,
    resolution: String,
    lost: Vec<String>,
    written: Written,
    error: AddedError,
) -> Exported {
    let Written { bytes, filled, clipped } = written;
    let unit = Unit::PerSteradian.to_string();
    Exported {
        bytes,
        about: Summary {
            warning: None,
            format,
            resolution,
            unit,
            lost,
            filled,
            clipped,
            flux_error: None,
            lamp: None,
            error,
        },
    }
}
