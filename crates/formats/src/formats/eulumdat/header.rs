//! Lines of an EULUMDAT file before its angles: sizes, lamps, and the factors of the intensities.

use super::about::NAME;
use super::lines::{self, ANGLE, LENGTH, LampSet, Lines, NONE, PERCENT};
use crate::domain::Unit;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::text::Brief;
use crate::notes::LuminaireNote;

/// Header fields of an EULUMDAT file that determine the intensities.
pub(super) struct Header {
    pub(super) symmetry: usize,
    pub(super) planes: usize,
    /// Distance between C planes in degrees, if the file states it.
    plane_step: Option<f64>,
    pub(super) angles: usize,
    conversion: f64,
    /// Light output ratio of the luminaire in percent.
    output_ratio: Option<f64>,
    sets: Vec<LampSet>,
}

/// Names of the dimensions in mm on lines 13 to 21 of an EULUMDAT file.
pub(super) const DIMENSIONS: [&str; 9] = [
    "luminaire_length_mm",
    "luminaire_width_mm",
    "luminaire_height_mm",
    "luminous_length_mm",
    "luminous_width_mm",
    "luminous_height_c0_mm",
    "luminous_height_c90_mm",
    "luminous_height_c180_mm",
    "luminous_height_c270_mm",
];
/// Upper bound on the C planes that a file without values for them lists.
pub(super) const MOST_PLANES: usize = 720;
/// Room indices for which an EULUMDAT file lists the direct ratios.
pub(super) const ROOM_INDICES: [&str; 10] = ["0.6", "0.8", "1", "1.25", "1.5", "2", "2.5", "3", "4", "5"];

impl Header {
    pub(super) fn read(lines: &mut Lines<'_>, report: &mut ParseReport) -> Result<Self, FormatError> {
        let mut keep = |key: &str, value: String| {
            if !value.is_empty() {
                report.metadata.push((key.to_owned(), value));
            }
        };
        keep("company", lines.text("the company")?);
        keep("luminaire_type", lines.whole("the type of luminaire", 0, 3)?.to_string());
        let symmetry = lines.whole("the symmetry", 0, 4)?;
        let planes = lines.count("the number of C planes")?;
        let plane_step = lines.optional("the distance between C planes", ANGLE)?;
        let angles = lines.count("the number of gamma angles")?;
        let angle_step = lines.optional("the distance between gamma angles", ANGLE)?;
        keep("symmetry", symmetry.to_string());
        keep("c_planes", planes.to_string());
        keep("c_step", written(plane_step));
        keep("gamma_angles", angles.to_string());
        keep("gamma_step", written(angle_step));
        for (key, expected) in [
            ("report", "the number of the report"),
            ("luminaire", "the name of the luminaire"),
            ("luminaire_number", "the number of the luminaire"),
            ("file_name", "the name of the file"),
            ("date", "the date"),
        ] {
            keep(key, lines.text(expected)?);
        }
        for key in DIMENSIONS {
            keep(key, written(lines.optional("a dimension in mm", LENGTH)?));
        }
        keep("downward_flux_percent", written(lines.optional("the downward flux fraction in percent", PERCENT)?));
        let output_ratio = lines.optional("the light output ratio in percent", PERCENT)?;
        keep("light_output_ratio_percent", written(output_ratio));
        let conversion_at = lines.at();
        let conversion = lines.optional("the conversion factor of the intensities", NONE)?;
        keep("conversion_factor", written(conversion));
        if let Some(factor) = conversion.filter(|factor| *factor <= 0.0) {
            let message = format!(
                "conversion factor {}, expected more than 0 (line 24 of the format; is a line above it missing?)",
                Brief(factor)
            );
            return Err(lines.refused(conversion_at, message));
        }
        let tilt = lines.optional("the tilt during measurement in degrees", ANGLE)?;
        keep("tilt_degrees", written(tilt));
        let (sets, blocks) = lines::lamp_sets(lines)?;
        for (i, set) in sets.iter().enumerate() {
            let key = |name: &str| if sets.len() == 1 { name.to_owned() } else { format!("set_{}_{name}", i + 1) };
            keep(&key("lamps"), Brief(set.count).to_string());
            keep(&key("lamp"), set.kind.clone());
            keep(&key("lumens"), Brief(set.lumens).to_string());
            keep(&key("colour"), set.colour.clone());
            keep(&key("colour_rendering"), set.rendering.clone());
            keep(&key("watts"), written(set.watts));
        }
        for index in ROOM_INDICES {
            keep(&format!("direct_ratio_k{index}"), written(lines.optional("a direct ratio", PERCENT)?));
        }
        if conversion.is_none() {
            report.note(LuminaireNote::ConversionFactorNotStated);
        }
        if let Some(tilt) = tilt.filter(|tilt| *tilt != 0.0) {
            report.note(LuminaireNote::MeasuredWithTilt { tilt_degrees: Brief(tilt) });
        }
        for found in sets.iter().filter_map(|set| set.odd_watts.clone()) {
            report.note(LuminaireNote::WattsUnread { found });
        }
        if blocks {
            report.note(LuminaireNote::LampSetsByField);
        }
        if sets.len() > 1 {
            report.note(LuminaireNote::AlternativeLampSets { sets: sets.len() });
        }
        Ok(Self { symmetry, planes, plane_step, angles, conversion: conversion.unwrap_or(1.0), output_ratio, sets })
    }

    /// Returns the angles of the C planes that the stated number of planes and distance between them make, from C0 on;
    /// `None` if they make no circle.
    pub(super) fn even_planes(&self) -> Option<Vec<f64>> {
        even_planes(self.planes as f64, self.plane_step.unwrap_or(0.0))
    }

    pub(super) fn is_absolute(&self) -> bool {
        self.sets.first().is_some_and(|set| set.count < 0.0)
    }

    /// Returns the lumens of the lamps to which the intensities refer; `None` if the file has none.
    fn lumens(&self) -> Option<f64> {
        self.sets.first().map(|set| set.lumens).filter(|lumens| *lumens > 0.0)
    }

    /// Returns the unit of the intensities, and the factor from the stored numbers to them. The unit is the requested
    /// one, else candela if the lumens of the lamps are known.
    pub(super) fn unit(&self, how: &Interpretation, report: &mut ParseReport) -> Result<(Unit, f64), FormatError> {
        let per_kilolumen = self.conversion;
        let needs = |message: String| FormatError::new(FormatErrorKind::NeedsOption, NAME, message);
        match (how.unit, self.lumens()) {
            (Some(Unit::CandelaPerKilolumen), _) => Ok((Unit::CandelaPerKilolumen, per_kilolumen)),
            (Some(unit), _) if unit != Unit::Candela && unit.per_nanometre().is_none() => Err(needs(format!(
                "unit {unit} was asked for, expected an intensity: cd, cd/klm, W/sr, mW/sr, uW/sr, umol/s/sr or relative"
            ))),
            (asked, Some(lumens)) => {
                let first = &self.sets[0];
                if !self.is_absolute() {
                    report.note(LuminaireNote::RelativePhotometryInAll {
                        lamps: Brief(first.count),
                        flux_lm: Brief(lumens),
                    });
                }
                Ok((asked.unwrap_or(Unit::Candela), per_kilolumen * lumens / 1000.0))
            }
            (None | Some(Unit::Relative), None) => {
                let flux_lm = self.sets.first().map(|set| Brief(set.lumens));
                report.note(LuminaireNote::LampFluxNotStated { flux_lm });
                Ok((how.unit.unwrap_or(Unit::CandelaPerKilolumen), per_kilolumen))
            }
            (Some(unit), None) => Err(needs(format!(
                "unit {unit} was asked for, but the file does not state the lumens of its lamps: ask for cd/klm or relative"
            ))),
        }
    }

    /// Adds a warning if the flux integrated from the intensities differs from the lamps' flux times the light output
    /// ratio. Absolute files are compared with the stated flux of the luminaire.
    pub(super) fn check_flux(&self, found: f64, report: &mut ParseReport) {
        let Some(lumens) = self.lumens() else { return };
        let ratio = if self.is_absolute() { 100.0 } else { self.output_ratio.unwrap_or(0.0) };
        let stated = lumens * ratio / 100.0;
        report.metadata.push(("flux_of_the_intensities_lm".to_owned(), format!("{found:.1}")));
        if stated > 0.0 && (found / stated - 1.0).abs() > 0.05 {
            report.note(LuminaireNote::FluxDiffers {
                flux_lm: found,
                part_percent: 100.0 * found / stated,
                stated_lm: Brief(stated),
            });
        }
    }
}

/// Returns the angles of `count` C planes that are `step` degrees apart, from C0 on; `None` if they make no circle. One
/// plane is C0.
pub(super) fn even_planes(count: f64, step: f64) -> Option<Vec<f64>> {
    let is_circle = count == 1.0 || (count * step - 360.0).abs() < 1e-9;
    let is_possible = (1.0..=MOST_PLANES as f64).contains(&count) && is_circle;
    is_possible.then(|| (0..count as usize).map(|plane| plane as f64 * step).collect())
}

/// Formats a number of the header for the metadata; empty for a blank line.
fn written(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| Brief(value).to_string())
}
