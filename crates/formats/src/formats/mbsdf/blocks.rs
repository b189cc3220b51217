//! Blocks of a measured BSDF: one table of values per side of the surface, after lines of metadata.

use super::about::NAME;
use super::refusal::malformed;
use crate::domain::first_where;
use crate::domain::limits::MAX_SAMPLES;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::snippet;

/// Name of the metadata that records the line `MBSDF_DATA=`, with which the first programs for the format began the
/// data.
pub(super) const SHORT_LINE: &str = "data_line";

/// First line of every measured BSDF file.
pub(super) const VERSION: &[u8] = b"NVIDIA ARC MBSDF V1\n";
const MAX_LINE: usize = 1 << 12;
const MAX_LINES: usize = 1000;

/// Table of reflection or transmission values in a measured BSDF file.
pub(super) struct Block {
    pub(super) theta: usize,
    pub(super) phi: usize,
    pub(super) rgb: bool,
    pub(super) values: Vec<f32>,
}

impl Block {
    pub(super) fn describe(&self) -> String {
        let kind = if self.rgb { "RGB" } else { "scalar" };
        format!("{kind} {} × {} × {}", self.theta, self.theta, self.phi)
    }
}

/// Returns the reflection table and the transmission table of a measured BSDF file; `None` for a missing one.
pub(super) fn blocks(bytes: &[u8], report: &mut ParseReport) -> Result<(Option<Block>, Option<Block>), FormatError> {
    if !bytes.starts_with(b"NVIDIA ARC MBSDF") {
        let found = String::from_utf8_lossy(&bytes[..bytes.len().min(64)]).into_owned();
        return Err(malformed(0, format!("found {}, expected `NVIDIA ARC MBSDF V1`", snippet(&found))));
    }
    if !bytes.starts_with(VERSION) {
        let message = "another version of the format, expected `NVIDIA ARC MBSDF V1`";
        return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, 0, message));
    }
    let (mut reflection, mut transmission) = (None, None);
    let mut at = VERSION.len();
    let mut lines = 0;
    while at < bytes.len() {
        let rest = &bytes[at..];
        let line = rest.iter().take(MAX_LINE).position(|&b| b == b'\n').map(|end| &rest[..end]);
        let found = String::from_utf8_lossy(line.unwrap_or(&rest[..rest.len().min(64)])).into_owned();
        let expected = "a line of metadata or MBSDF_DATA_REFLECTION=, MBSDF_DATA_TRANSMISSION=";
        let Some(line) = line.filter(|line| !line.contains(&0)) else {
            return Err(malformed(at, format!("found {}, expected {expected}", snippet(&found))));
        };
        let start = at;
        at += line.len() + 1;
        let side = match line.trim_ascii_end() {
            b"MBSDF_DATA=" => {
                report.metadata.push((SHORT_LINE.to_owned(), "MBSDF_DATA=".to_owned()));
                &mut reflection
            }
            b"MBSDF_DATA_REFLECTION=" => &mut reflection,
            b"MBSDF_DATA_TRANSMISSION=" => &mut transmission,
            _ => {
                let is_metadata = reflection.is_none() && transmission.is_none() && lines < MAX_LINES;
                if !is_metadata || found.starts_with("MBSDF_DATA") {
                    return Err(malformed(start, format!("found {}, expected {expected}", snippet(&found))));
                }
                lines += 1;
                let (key, value) = found.split_once('=').unwrap_or(("comment", &found));
                report.metadata.push((key.trim().trim_matches('"').to_owned(), value.trim().to_owned()));
                continue;
            }
        };
        let (block, end) = block(bytes, at)?;
        if side.replace(block).is_some() {
            return Err(malformed(start, "two tables for one side of the surface, expected one for each side"));
        }
        at = end;
    }
    Ok((reflection, transmission))
}

/// Parses a table of reflection or transmission values from byte `at` of a measured BSDF file on. Returns the table and
/// the byte offset of its end.
fn block(bytes: &[u8], at: usize) -> Result<(Block, usize), FormatError> {
    let head = bytes.get(at..at + 12).ok_or_else(|| {
        malformed(
            bytes.len(),
            "the file ends in the head of a table of values, expected 12 bytes: a type and two numbers of angles",
        )
    })?;
    let word = |i: usize| u32::from_le_bytes([head[4 * i], head[4 * i + 1], head[4 * i + 2], head[4 * i + 3]]);
    let rgb = match word(0) {
        0 => false,
        1 => true,
        other => return Err(malformed(at, format!("type {other} of values, expected 0 (scalar) or 1 (RGB)"))),
    };
    let (theta, phi) = (word(1) as usize, word(2) as usize);
    if theta == 0 || phi == 0 {
        return Err(malformed(at + 4, format!("{theta} polar and {phi} azimuth angles, expected at least 1 of each")));
    }
    let count = [theta, theta, phi, if rgb { 3 } else { 1 }].into_iter().try_fold(1_usize, usize::checked_mul);
    let Some(count) = count.filter(|&n| n <= MAX_SAMPLES) else {
        let message = format!("{theta} × {theta} × {phi} values are more than the limit of {MAX_SAMPLES}");
        return Err(FormatError::at_byte(FormatErrorKind::OverLimit, NAME, at + 4, message));
    };
    let start = at + 12;
    let body = bytes.get(start..start + 4 * count).ok_or_else(|| {
        malformed(
            bytes.len(),
            format!("{} bytes of values, expected {} for {theta} × {theta} × {phi}", bytes.len() - start, 4 * count),
        )
    })?;
    let values: Vec<f32> = body.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect();
    if let Some(i) = first_where(&values, |value| !value.is_finite()) {
        return Err(malformed(start + 4 * i, format!("value {i} is {}, expected a finite number", values[i])));
    }
    Ok((Block { theta, phi, rgb, values }, start + 4 * count))
}
