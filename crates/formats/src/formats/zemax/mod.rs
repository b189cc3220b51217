//! Zemax tabular BSDF files (`.bsdf`, text): a BRDF or BTDF on angles about the specular ray.
//!
//! Values are `[sample rotation, incidence, azimuth, radial]` in 1/sr without the cosine. The radial angle is counted
//! from the specular ray, or from the ray straight through, the azimuth about it (R. Rykowski, "BSDF Data Interchange
//! File Format Specification", Zemax knowledge base, 2008). Angles mean what they mean in `SpecularCoordinateSystem` of
//! libbsdf, the azimuth of the light is the sample rotation. Directions below the surface are left out. Files of
//! `LightTools`, which begin alike, are refused by name.

mod about;
mod blocks;
mod geometry;
mod header;
#[cfg(test)]
mod tests;
mod words;

use super::acquisition::{Acquisition, ParseReport};
use super::error::{FormatError, FormatErrorKind};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::radiometric_csv;
use super::reader::{Reader, Sample};
use super::text::{Brief, Source, listed, snippet};
use crate::domain::{Quantity, Unit};
use crate::notes::ScatteringNote;
use about::{ABOUT, NAME};
use blocks::Channel;
use geometry::{Incidence, pair};
use header::{Header, Symmetry};
use words::Words;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &["column"],
    probe: |sample: &Sample<'_>| if header::is_header(&sample.head) { 95 } else { 0 },
    read,
};

/// Largest factor between the integral of the values and the total integrated scatter that is not warned of; tables
/// are coarse about the specular ray. Raising it warns of fewer files.
const SCATTER_TOLERANCE: f64 = 1.5;

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let mut words = Words::new(&source);
    let header = header::read(&mut words, &source, &mut report)?;
    check_options(&header, how)?;
    let channel = chosen(blocks::read(&mut words, &header)?, how)?;
    report.metadata.push(("TIS".to_owned(), listed(&channel.tis)));
    if let Some(factor) = channel.farthest_factor(&header)
        && !(1.0 / SCATTER_TOLERANCE..=SCATTER_TOLERANCE).contains(&factor)
    {
        report.note(ScatteringNote::TotalScatterDiffers { percent: 100.0 * factor });
    }
    let is_rotated = header.symmetry == Symmetry::Rotated && header.rotations.len() > 1;
    if is_rotated {
        report.note(ScatteringNote::RotationIsAzimuth);
    } else if header.symmetry == Symmetry::Rotated {
        report.note(ScatteringNote::OneRotation { rotation_degrees: Brief(header.rotations[0]) });
    }
    if header.quantity == Quantity::Btdf {
        report.note(ScatteringNote::ThroughAtIncidence);
    }
    if header.symmetry != Symmetry::Plane {
        report.note(ScatteringNote::AzimuthsAgainstRay);
    }
    let (pairs, values) = pairs(&header, &channel, is_rotated, &mut report);
    if pairs.is_empty() {
        return Err(source.malformed(source.text().len(), "no direction above the surface, expected one or more"));
    }
    let samples = radiometric_csv::of_pairs(pairs, !is_rotated, values, None, &mut report)
        .map_err(|error| FormatError { format: NAME, ..error })?;
    let Header { rotations, incidences, azimuths, radials, .. } = &header;
    let rotations = if is_rotated { format!("{} rotations × ", rotations.len()) } else { String::new() };
    Ok(Acquisition {
        format: NAME,
        dialect: format!(
            "{}, {}, {rotations}{} incidences × {} azimuths × {} radial angles",
            header.symmetry.name(),
            channel.name,
            incidences.len(),
            azimuths.len(),
            radials.len()
        ),
        quantity: header.quantity,
        unit: Unit::PerSteradian,
        samples,
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

fn check_options(header: &Header, how: &Interpretation) -> Result<(), FormatError> {
    let held = header.quantity;
    if let Some(other) = how.quantity().filter(|&quantity| quantity != held) {
        return Err(needs(format!("quantity {other} was asked for, expected {held}, which the file holds")));
    }
    if let Some(other) = how.unit.filter(|&unit| unit != Unit::PerSteradian) {
        return Err(needs(format!("unit {other} was asked for, expected 1/sr, which the file holds")));
    }
    Ok(())
}

fn needs(message: String) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
}

/// Returns the channel that the user asks for, or the only one. Tristimulus values are not colours without the light
/// that they hold for, which the file does not state.
fn chosen(channels: Vec<Channel>, how: &Interpretation) -> Result<Channel, FormatError> {
    let names: Vec<&str> = channels.iter().map(|channel| channel.name).collect();
    let names = names.join(", ");
    let at = match &how.column {
        None if channels.len() == 1 => Some(0),
        None => {
            return Err(needs(format!(
                "tristimulus values of a light that the file does not state, expected the option column, the name of one \
                 channel: {names} (Y is the luminous one)"
            )));
        }
        Some(wanted) => {
            let by_number = wanted.parse().ok().and_then(|number: usize| number.checked_sub(1));
            let by_name = || channels.iter().position(|channel| channel.name.eq_ignore_ascii_case(wanted));
            by_number.or_else(by_name)
        }
    };
    let wanted = how.column.as_deref().unwrap_or_default();
    at.and_then(|at| channels.into_iter().nth(at))
        .ok_or_else(|| needs(format!("no channel {}, expected one of: {names}", snippet(wanted))))
}

/// Returns the pairs of directions `[theta_i, phi_i, theta_o, phi_o]` in degrees above the surface, with their values.
fn pairs(header: &Header, channel: &Channel, is_rotated: bool, report: &mut ParseReport) -> (Vec<[f64; 4]>, Vec<f32>) {
    let (mut pairs, mut values) = (Vec::with_capacity(channel.values.len()), Vec::with_capacity(channel.values.len()));
    let mut below = 0_usize;
    let mut numbers = channel.values.iter();
    for &rotation in &header.rotations {
        let rotation = if is_rotated { rotation } else { 0.0 };
        for &theta in &header.incidences {
            for &azimuth in &header.azimuths {
                for (&radial, &value) in header.radials.iter().zip(&mut numbers) {
                    match pair(header, Incidence { theta, rotation }, azimuth, radial) {
                        Some(pair) => {
                            pairs.push(pair);
                            values.push(value);
                        }
                        None => below += 1,
                    }
                }
            }
        }
    }
    if below > 0 {
        report.note(ScatteringNote::BehindSurface { samples: below, of: channel.values.len() });
    }
    (pairs, values)
}
