//! Values of a Zemax BSDF file: for each channel, sample rotation and incidence the total integrated scatter, and a
//! table of azimuths and radial angles.

use super::geometry::scattered;
use super::header::{Header, Symmetry};
use super::words::Words;
use crate::domain::limits::MAX_SAMPLES;
use crate::formats::error::{FormatError, FormatErrorKind};

/// Values of one channel.
pub(super) struct Channel {
    /// Name of the channel: `Monochrome`, `X`, `Y` or `Z`.
    pub(super) name: &'static str,
    /// Total integrated scatter of each sample rotation and incidence.
    pub(super) tis: Vec<f64>,
    /// Values in 1/sr, row-major `[rotation, incidence, azimuth, radial]`.
    pub(super) values: Vec<f32>,
}

/// Keywords that begin the data of a channel, with the names of the channels.
const CHANNELS: [(&str, &str); 4] =
    [("Monochrome", "Monochrome"), ("TristimulusX", "X"), ("TristimulusY", "Y"), ("TristimulusZ", "Z")];

/// Reads the values of all channels that `header` announces.
pub(super) fn read(words: &mut Words<'_>, header: &Header) -> Result<Vec<Channel>, FormatError> {
    let wanted = if header.is_xyz { &CHANNELS[1..] } else { &CHANNELS[..1] };
    let mut channels = Vec::with_capacity(wanted.len());
    for (key, name) in wanted {
        let token = words.word(key)?;
        if !token.text.eq_ignore_ascii_case(key) {
            return Err(words.refused(FormatErrorKind::Malformed, token, key));
        }
        skip(words, "DataBegin");
        channels.push(channel(words, header, name)?);
        skip(words, "DataEnd");
    }
    match words.next() {
        None => Ok(channels),
        Some(token) => Err(words.refused(FormatErrorKind::Malformed, token, "the end of the file after DataEnd")),
    }
}

/// Takes the word `key`, if it is the next one.
fn skip(words: &mut Words<'_>, key: &str) {
    if words.peek().is_some_and(|token| token.text.eq_ignore_ascii_case(key)) {
        words.next();
    }
}

fn channel(words: &mut Words<'_>, header: &Header, name: &'static str) -> Result<Channel, FormatError> {
    let blocks = header.rotations.len().checked_mul(header.incidences.len());
    let block = header.azimuths.len().checked_mul(header.radials.len());
    let all = blocks.zip(block).and_then(|(blocks, block)| blocks.checked_mul(block));
    let all = words.check(all, MAX_SAMPLES)?;
    let (mut tis, mut values) = (Vec::new(), Vec::with_capacity(all));
    while values.len() < all {
        let token = words.word("TIS")?;
        if !token.text.eq_ignore_ascii_case("TIS") {
            let (found, tables) = (tis.len(), blocks.unwrap_or_default());
            let expected = format!("TIS and the next table ({found} of {tables} were read)");
            return Err(words.refused(FormatErrorKind::Malformed, token, &expected));
        }
        tis.push(words.number("the total integrated scatter")?.0);
        for _ in 0..block.unwrap_or_default() {
            let (value, offset) = words.number("a value of the BSDF")?;
            if (value as f32).is_infinite() {
                return Err(words.too_large(value, offset));
            }
            values.push(value as f32);
        }
    }
    Ok(Channel { name, tis, values })
}

impl Channel {
    /// Returns the factor between the integral of the values times the cosine and the total integrated scatter that the
    /// file states, of the table in which it is farthest from 1. Returns `None` if the tables cover no hemisphere or
    /// state none.
    pub(super) fn farthest_factor(&self, header: &Header) -> Option<f64> {
        let (azimuths, radials) = (&header.azimuths, &header.radials);
        let turn = azimuths.last()? - azimuths.first()?;
        let part = if header.symmetry == Symmetry::Plane { 180.0 } else { 360.0 };
        let increase = |angles: &[f64]| angles.array_windows().all(|[a, b]| a < b);
        let is_whole =
            (turn - part).abs() < 1e-9 && radials.first() == Some(&0.0) && radials.len() > 2 && azimuths.len() > 2;
        if !is_whole || !increase(azimuths) || !increase(radials) {
            return None;
        }
        let tables = self.values.chunks_exact(azimuths.len() * radials.len());
        let incidences = header.incidences.iter().cycle();
        let factor = |((table, &theta), &tis): ((&[f32], &f64), &f64)| {
            let found = integral(table, theta, azimuths, radials) * 360.0 / part;
            (tis > 0.0 && found > 0.0).then(|| found / tis)
        };
        let factors = tables.zip(incidences).zip(&self.tis).filter_map(factor);
        factors.max_by(|a, b| a.ln().abs().total_cmp(&b.ln().abs()))
    }
}

/// Returns the integral of a table over the hemisphere, weighted by the cosine from the normal. Each cell between
/// neighbouring angles has the mean of its corners.
fn integral(table: &[f32], theta: f64, azimuths: &[f64], radials: &[f64]) -> f64 {
    let n = radials.len();
    let weighed = |p: usize, s: usize| {
        let cosine = scattered(theta, azimuths[p], radials[s])[2].max(0.0);
        f64::from(table[p * n + s]) * cosine
    };
    let mut sum = 0.0;
    for (p, [a, b]) in azimuths.array_windows().enumerate() {
        for (s, [near, far]) in radials.array_windows().enumerate() {
            let ring = libm::cos(near.to_radians()) - libm::cos(far.to_radians());
            let corners = weighed(p, s) + weighed(p, s + 1) + weighed(p + 1, s) + weighed(p + 1, s + 1);
            sum += 0.25 * corners * ring * (b - a).to_radians();
        }
    }
    sum
}
