//! Intensities by direction of an emitter: what the file says about them, and their order on C planes.

use super::words::{Placed, number_of};
use crate::domain::Unit;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::intensities::{Intensities, Stated};
use crate::formats::text::{Brief, Source, snippet};
use crate::notes::{LuminaireNote, Quoted};

/// Quantity of the intensities of a distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Metric {
    Luminous,
    Radiant,
    Photon,
}

impl Metric {
    pub(super) fn unit(self) -> Unit {
        match self {
            Self::Luminous => Unit::Candela,
            Self::Radiant => Unit::WattPerSteradian,
            Self::Photon => Unit::MicromolePerSecondSteradian,
        }
    }

    /// Returns the name of the element that holds intensities of this quantity.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Luminous => "LuminousData",
            Self::Radiant => "RadiantData",
            Self::Photon => "PhotonData",
        }
    }
}

/// Intensity in one direction as the file lists it.
pub(super) struct Intensity {
    pub(super) horizontal: f64,
    pub(super) vertical: f64,
    pub(super) value: f64,
    pub(super) offset: usize,
}

/// Intensities by direction of an emitter, with what the file says about them.
pub(super) struct Distribution {
    pub(super) metric: Metric,
    pub(super) offset: usize,
    pub(super) points: Vec<Intensity>,
    pub(super) is_absolute: Option<bool>,
    /// Type of the goniometer, if the distribution states it.
    pub(super) photometry: Option<Placed<String>>,
    pub(super) flux: Option<f64>,
    /// Range of wavelengths in nm that radiant and photon intensities cover.
    pub(super) range: [Option<f64>; 2],
    symmetry: Option<Placed<String>>,
    multiplier: Option<Placed<f64>>,
    /// Numbers of horizontal and of vertical angles.
    counts: [Option<Placed<f64>>; 2],
}

impl Distribution {
    pub(super) fn new(metric: Metric, offset: usize) -> Self {
        Self {
            metric,
            offset,
            points: Vec::new(),
            is_absolute: None,
            photometry: None,
            flux: None,
            range: [None; 2],
            symmetry: None,
            multiplier: None,
            counts: [None; 2],
        }
    }

    /// Takes the text of the element `name` of the distribution. An empty element says nothing.
    pub(super) fn set(&mut self, name: &str, text: &str, offset: usize, source: &Source) -> Result<(), FormatError> {
        if text.is_empty() {
            return Ok(());
        }
        let unsupported = |expected: &str| {
            Err(source.error(
                FormatErrorKind::Unsupported,
                offset,
                format!("{name} {}, expected {expected}", snippet(text)),
            ))
        };
        let number = || number_of(text, name, offset, source);
        match name {
            "AbsolutePhotometry" | "Absolute" => {
                self.is_absolute = match text.to_ascii_lowercase().as_str() {
                    "true" | "1" => Some(true),
                    "false" | "0" => Some(false),
                    _ => {
                        let message = format!("found {}, expected true or false as {name}", snippet(text));
                        return Err(source.malformed(offset, message));
                    }
                }
            }
            "Symm" | "SymmType" => self.symmetry = Some((text.to_owned(), offset)),
            "PhotometryType" => self.photometry = Some((text.to_owned(), offset)),
            "Metric" => {
                self.metric = match text {
                    "Luminous" => Metric::Luminous,
                    "Radiant" => Metric::Radiant,
                    "Photon" => Metric::Photon,
                    _ => return unsupported("Luminous, Radiant or Photon"),
                }
            }
            "Units" => {
                let known = ["cd", "candela", "W/sr", "umol/s/sr", "µmol/s/sr"];
                if !known.iter().any(|unit| unit.eq_ignore_ascii_case(text)) {
                    return unsupported("cd, W/sr or umol/s/sr");
                }
            }
            "Multiplier" => self.multiplier = Some((number()?, offset)),
            "NumberHorz" => self.counts[0] = Some((number()?, offset)),
            "NumberVert" => self.counts[1] = Some((number()?, offset)),
            "LuminousFlux" | "RadiantFlux" | "PhotonFlux" => self.flux = Some(number()?),
            "MinWavelength" => self.range[0] = Some(number()?),
            "MaxWavelength" => self.range[1] = Some(number()?),
            "HorizontalAngles" | "VerticalAngles" => {
                return unsupported("the angles of each intensity as its attributes");
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the intensities in the order of increasing angles, `[horizontal][vertical]`. Every pair of a horizontal
    /// and a vertical angle must occur once.
    pub(super) fn stated(&self, source: &Source, report: &mut ParseReport) -> Result<Stated, FormatError> {
        let horizontal = angles(self.points.iter().map(|point| (point.horizontal, point.offset)));
        let vertical = angles(self.points.iter().map(|point| (point.vertical, point.offset)));
        let (h, v, found) = (horizontal.len(), vertical.len(), self.points.len());
        for (count, angles, name) in [(self.counts[0], h, "NumberHorz"), (self.counts[1], v, "NumberVert")] {
            // Programs that do not count write 0.
            if let Some((count, offset)) = count
                && count != 0.0
                && count != angles as f64
            {
                let message = format!("{name} {}, expected {angles}, the number of such angles listed", Brief(count));
                return Err(source.malformed(offset, message));
            }
        }
        if h.checked_mul(v).is_none_or(|pairs| pairs > found) {
            let message = format!(
                "{found} intensities at {h} horizontal and {v} vertical angles, expected {h} × {v}, one for each pair"
            );
            return Err(source.malformed(self.offset, message));
        }
        let at = |angles: &[(f64, usize)], angle: f64| angles.partition_point(|&(listed, _)| listed < angle);
        let mut order = vec![None; h * v];
        for point in &self.points {
            let place = &mut order[at(&horizontal, point.horizontal) * v + at(&vertical, point.vertical)];
            if place.replace(point).is_some() {
                let (c, gamma) = (Brief(point.horizontal), Brief(point.vertical));
                let message = format!("a second intensity at horizontal {c}°, vertical {gamma}°, expected one");
                return Err(source.malformed(point.offset, message));
            }
        }
        let factor = self.multiplier.map_or(1.0, |(multiplier, _)| multiplier);
        if factor <= 0.0 {
            report.note(LuminaireNote::MultipliersNotPositive { factor: Brief(factor) });
        }
        let mut intensities = Intensities::new(factor, h * v);
        let (mut negative, mut lowest) = (0_usize, 0.0_f32);
        for point in order.into_iter().flatten() {
            let intensity = intensities.push(point.value);
            if !intensity.is_finite() {
                let message = format!("intensity {} × {} is too large for float32", Brief(point.value), Brief(factor));
                return Err(source.malformed(point.offset, message));
            }
            negative += usize::from(intensity < 0.0);
            lowest = lowest.min(intensity);
        }
        if negative > 0 {
            report.note(LuminaireNote::NegativeIntensities { intensities: negative, lowest });
        }
        Ok(Stated { vertical, horizontal, intensities })
    }

    /// Compares the symmetry that the file states with the one that its planes have. One plane, and planes that list
    /// more than the symmetry needs, are read as they are; planes that list less are refused.
    pub(super) fn check_symmetry(
        &self,
        found: &'static str,
        source: &Source,
        report: &mut ParseReport,
    ) -> Result<(), FormatError> {
        let Some((text, offset)) = &self.symmetry else { return Ok(()) };
        let fitting: &[&str] = match plain(text).trim_start_matches("SYMM") {
            "NONE" | "ARBITRARY" => &[ALL_ROUND],
            "BI0" => &[ABOUT_0, ALL_ROUND],
            "BI90" => &[ABOUT_90, ALL_ROUND],
            "QUAD" => &[QUADRANT, ABOUT_0, ABOUT_90, ALL_ROUND],
            "FULL" => &[ONE_PLANE, QUADRANT, ABOUT_0, ABOUT_90, ALL_ROUND],
            _ => {
                let message = format!(
                    "symmetry {}, expected Symm_None, Symm_Bi_0, Symm_Bi_90, Symm_Quad, Symm_Full or Symm_Arbitrary",
                    snippet(text)
                );
                return Err(source.error(FormatErrorKind::Unsupported, *offset, message));
            }
        };
        if fitting[0] == found {
            return Ok(());
        }
        if fitting.contains(&found) || found == ONE_PLANE {
            report.note(LuminaireNote::SymmetryNotOfPlanes { stated: Quoted::of(text), found });
            return Ok(());
        }
        let message = format!("symmetry {}, expected {found}, as the horizontal angles are", snippet(text));
        Err(source.malformed(*offset, message))
    }
}

/// Words for the symmetry of planes, as the conversion to C planes gives them.
const ALL_ROUND: &str = "no symmetry";
const ABOUT_0: &str = "symmetric about the 0-180 plane";
const ABOUT_90: &str = "symmetric about the 90-270 plane";
const QUADRANT: &str = "quadrant symmetric";
const ONE_PLANE: &str = "axially symmetric";

/// Returns a word of an enumeration without blanks and underscores, in capitals: writers differ in them.
pub(super) fn plain(word: &str) -> String {
    word.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_uppercase()).collect()
}

/// Returns the distinct angles in increasing order, each with the byte offset of an intensity there.
fn angles(listed: impl Iterator<Item = (f64, usize)>) -> Vec<(f64, usize)> {
    let mut angles: Vec<(f64, usize)> = listed.collect();
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    angles.dedup_by_key(|(angle, _)| *angle);
    angles
}
