//! NVIDIA MDL measured BSDFs (`.mbsdf`): isotropic, plane-symmetric tables of reflection and transmission, scalar or
//! RGB.
//!
//! A block holds f32 values in sr⁻¹, little-endian, `[theta_in, theta_out, phi, channel]`; the n polar angles are
//! `i · 90°/n`, the m azimuths `j · 180°/(m − 1)` between the two directions, 180° where one mirrors the other (MDL
//! SDK, `IBsdf_isotropic_data`). This is the convention of this crate, so that values are not moved.

mod about;
mod angles;
mod blocks;
mod joined;
mod refusal;
mod restate;
mod write;

pub use restate::restate_mbsdf;
pub use write::{MbsdfGrid, write_mbsdf};

use super::acquisition::{Acquisition, AngleGrid, Angles, AzimuthExtent, Azimuths, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::reader::{Reader, Sample};
use crate::domain::{Axis, Quantity, Unit};
use crate::notes::{ScatteringNote, ValueNote};
use about::{ABOUT, NAME};
use angles::{azimuths, outside, polar_angles};
use blocks::{Block, blocks};
use joined::joined;
use refusal::malformed;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &[],
    probe: |sample: &Sample<'_>| match sample.head.find("NVIDIA ARC MBSDF") {
        Some(0) => 100,
        // Extra bytes precede the signature.
        Some(1..=64) => 60,
        _ => 0,
    },
    read,
};

/// Tables of a measured BSDF file that are read: one of reflection and transmission, or both.
enum Part {
    One(Block),
    Both(Block, Block),
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let mut report = ParseReport::default();
    let (reflection, transmission) = blocks(bytes, &mut report)?;
    if reflection.is_none() && transmission.is_none() {
        return Err(malformed(
            bytes.len(),
            "no measurement data, expected a line MBSDF_DATA_REFLECTION= or MBSDF_DATA_TRANSMISSION=",
        ));
    }
    let needs = |message: &str| FormatError::new(FormatErrorKind::NeedsOption, NAME, message);
    if how.unit.is_some_and(|unit| unit != Unit::PerSteradian) {
        return Err(needs("a unit was asked for that this format does not have, expected 1/sr"));
    }
    let sides = match (&reflection, &transmission) {
        (Some(_), Some(_)) => "reflection and transmission",
        (Some(_), None) => "reflection",
        _ => "transmission",
    };
    let (quantity, part) = match (how.quantity(), reflection, transmission) {
        (None | Some(Quantity::Bsdf), Some(above), Some(below)) => (Quantity::Bsdf, Part::Both(above, below)),
        (None | Some(Quantity::Brdf), Some(block), _) => (Quantity::Brdf, Part::One(block)),
        (None | Some(Quantity::Btdf), _, Some(block)) => (Quantity::Btdf, Part::One(block)),
        (Some(quantity), ..) => {
            return Err(needs(&format!("quantity {quantity} was asked for, expected what the file holds: {sides}")));
        }
        // Without a quantity one of the first three arms applies, because a block exists.
        (None, None, None) => {
            return Err(needs("the file holds no measurement data, expected reflection or transmission"));
        }
    };
    report.note(ScatteringNote::PolarAnglesEven);
    let (sizes, grid) = match part {
        Part::One(block) => (block.describe(), grid(quantity, block)),
        Part::Both(above, below) => {
            let (a, b) = (above.describe(), below.describe());
            report.note(ScatteringNote::HorizonRowsRepeated);
            if a != b {
                report.note(ScatteringNote::SidesLinear);
            }
            (if a == b { a } else { format!("{a} and {b}") }, joined(&above, &below)?)
        }
    };
    let dialect = format!("V1, {sides}, {sizes}");
    count_negatives(&grid.values, &mut report);
    Ok(Acquisition {
        format: NAME,
        dialect,
        quantity,
        unit: Unit::PerSteradian,
        samples: Samples::Grid(grid),
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

fn count_negatives(values: &[f32], report: &mut ParseReport) {
    let negative = values.iter().filter(|v| **v < 0.0).count();
    if negative > 0 {
        let lowest = values.iter().copied().fold(0.0, f32::min);
        let all = values.len();
        report.note(ValueNote::NegativeOf { values: negative, of: all, lowest });
    }
}

/// Returns the grid of angles of reflection or transmission values.
fn grid(quantity: Quantity, block: Block) -> AngleGrid {
    let Block { theta: n, phi: m, rgb, mut values } = block;
    let incoming: Vec<f64> = polar_angles(n).collect();
    let (outgoing, covers): (Vec<f64>, _) = if quantity == Quantity::Btdf {
        let row = m * if rgb { 3 } else { 1 };
        values =
            values.chunks_exact(n * row).flat_map(|table| table.chunks_exact(row).rev().flatten()).copied().collect();
        (polar_angles(n).rev().map(|theta| 180.0 - theta).collect(), (90.0, 180.0))
    } else {
        (incoming.clone(), (0.0, 90.0))
    };
    let phi = (m > 1).then(|| Azimuths { phi: azimuths(m), extent: AzimuthExtent::Mirrored });
    AngleGrid {
        index: Vec::new(),
        incoming: Some(Angles { theta: incoming, covers: (0.0, 90.0), phi: None }),
        outgoing: Some(Angles { theta: outgoing, covers, phi }),
        spectral: rgb.then_some(Axis::Rgb),
        outside: outside(m),
        values: values.into(),
        stated: None,
        sigma: None,
    }
}

#[cfg(test)]
mod tests {
    use super::blocks::VERSION;
    use super::joined::BELOW_HORIZON;
    use super::*;

    fn file(blocks: &[(&str, [u32; 3], usize)]) -> Vec<u8> {
        let mut bytes = VERSION.to_vec();
        for (line, head, count) in blocks {
            bytes.extend_from_slice(line.as_bytes());
            bytes.push(b'\n');
            bytes.extend(head.iter().flat_map(|word| word.to_le_bytes()));
            bytes.extend((0..*count).flat_map(|i| (i as f32).to_le_bytes()));
        }
        bytes
    }

    const UP: &str = "MBSDF_DATA_REFLECTION=";
    const DOWN: &str = "MBSDF_DATA_TRANSMISSION=";

    fn grid_as(bytes: &[u8], quantity: Option<Quantity>) -> Result<(Quantity, AngleGrid), FormatError> {
        let how = Interpretation { quantity: quantity.map(Into::into), ..Interpretation::default() };
        let acquisition = read(bytes, &how)?;
        match acquisition.samples {
            Samples::Grid(grid) => Ok((acquisition.quantity, grid)),
            _ => panic!("expected a grid"),
        }
    }

    #[test]
    fn the_sides_are_picked_by_quantity() {
        let both = file(&[(UP, [0, 2, 2], 8), (DOWN, [0, 2, 2], 8)]);
        let (quantity, grid) = grid_as(&both, Some(Quantity::Brdf)).unwrap();
        assert_eq!((quantity, grid.values[1]), (Quantity::Brdf, 1.0));
        let (_, grid) = grid_as(&both, Some(Quantity::Btdf)).unwrap();
        let outgoing = grid.outgoing.unwrap();
        assert_eq!((outgoing.theta, outgoing.covers), (vec![135.0, 180.0], (90.0, 180.0)));
        assert_eq!(grid.values, [2.0, 3.0, 0.0, 1.0, 6.0, 7.0, 4.0, 5.0]);
        let (quantity, grid) = grid_as(&both, None).unwrap();
        assert_eq!(quantity, Quantity::Bsdf);
        assert_eq!(grid.outgoing.unwrap().theta, [0.0, 45.0, 90.0, BELOW_HORIZON, 135.0, 180.0]);
        assert_eq!(grid.values[..12], [0.0, 1.0, 2.0, 3.0, 2.0, 3.0, 2.0, 3.0, 2.0, 3.0, 0.0, 1.0]);
        let up = file(&[(UP, [0, 2, 2], 8)]);
        for quantity in [Quantity::Btdf, Quantity::Bsdf, Quantity::Edf] {
            assert_eq!(grid_as(&up, Some(quantity)).unwrap_err().kind, FormatErrorKind::NeedsOption);
        }
        let asked = Interpretation { unit: Some(crate::domain::Unit::Candela), ..Interpretation::default() };
        let error = super::super::read(&up, &asked).unwrap_err();
        assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("expected 1/sr"), "{error}");
    }

    #[test]
    fn sides_of_different_resolution_are_joined_on_the_angles_of_both() {
        // 2 polar angles and 2 azimuths above, scalar; 3 and 3 below, RGB.
        let uneven = file(&[(UP, [0, 2, 2], 8), (DOWN, [1, 3, 3], 81)]);
        let (quantity, grid) = grid_as(&uneven, None).unwrap();
        assert_eq!((quantity, grid.spectral), (Quantity::Bsdf, Some(Axis::Rgb)));
        let (incoming, outgoing) = (grid.incoming.unwrap(), grid.outgoing.unwrap());
        assert_eq!(incoming.theta, [0.0, 30.0, 45.0, 60.0]);
        assert_eq!(outgoing.theta, [0.0, 45.0, 90.0, BELOW_HORIZON, 120.0, 150.0, 180.0]);
        assert_eq!(outgoing.phi.unwrap().phi, [0.0, 90.0, 180.0]);
        let at = |i: usize, o: usize, p: usize, c: usize| grid.values[((i * 7 + o) * 3 + p) * 3 + c];
        // Above: the values count 0, 1 over azimuth, then rows of 2, then incoming angles of 4; grey.
        assert_eq!([at(0, 0, 0, 0), at(0, 0, 1, 1), at(0, 0, 2, 2), at(2, 1, 2, 0)], [0.0, 0.5, 1.0, 7.0]);
        assert!((at(1, 0, 0, 0) - 4.0 * 30.0 / 45.0).abs() < 1e-6 && at(3, 0, 0, 0) == 4.0);
        // Below: channels count 1, azimuths 3, rows 9, incoming angles 27.
        assert_eq!([at(0, 6, 0, 0), at(0, 6, 0, 2), at(0, 5, 1, 0), at(1, 4, 2, 1)], [0.0, 2.0, 12.0, 52.0]);
        assert_eq!((at(2, 6, 0, 0), at(0, 3, 0, 0)), (40.5, 18.0));
        let huge = |theta| Block { theta, phi: 100, rgb: false, values: Vec::new() };
        assert_eq!(joined(&huge(2000), &huge(2001)).unwrap_err().kind, FormatErrorKind::OverLimit);
    }

    #[test]
    fn sizes_are_checked_against_the_bytes_that_follow() {
        use FormatErrorKind::{Malformed, OverLimit};
        for (bytes, kind) in [
            (file(&[(UP, [0, 8192, 5], 100)]), OverLimit),
            (file(&[(UP, [1, u32::MAX, u32::MAX], 100)]), OverLimit),
            (file(&[(UP, [0, 4096, 4], 200)]), Malformed),
            (file(&[(UP, [0, 2, 2], 7)]), Malformed),
            (file(&[(UP, [0, 2, 2], 9)]), Malformed),
            (file(&[(UP, [2, 2, 2], 8)]), Malformed),
            (file(&[(UP, [0, 0, 2], 0)]), Malformed),
            (file(&[(UP, [0, 2, 2], 8), (UP, [0, 2, 2], 8)]), Malformed),
            (file(&[("MBSDF_DATA_SIDEWAYS=", [0, 2, 2], 8)]), Malformed),
            ([VERSION, b"MBSDF_DATA=\n\0\0"].concat(), Malformed),
            ([VERSION, b"a line that does not end"].concat(), Malformed),
        ] {
            let error = grid_as(&bytes, None).unwrap_err();
            assert_eq!(error.kind, kind, "{error}");
            assert!(error.position.is_some(), "{error}");
        }
        let mut version = file(&[(UP, [0, 2, 2], 8)]);
        version[18] = b'9';
        assert_eq!(grid_as(&version, None).unwrap_err().kind, FormatErrorKind::Unsupported);
        let mut infinite = file(&[(UP, [0, 2, 2], 8)]);
        let end = infinite.len();
        infinite[end - 4..].copy_from_slice(&f32::INFINITY.to_le_bytes());
        assert_eq!(grid_as(&infinite, None).unwrap_err().position, Some(super::super::Position::Byte(end - 4)));
    }

    #[test]
    fn lines_before_the_data_are_metadata() {
        let mut bytes = VERSION.to_vec();
        bytes.extend_from_slice(b"material=\"carpaint\"\nmeasured somewhere\n");
        bytes.extend_from_slice(&file(&[("MBSDF_DATA=", [0, 1, 1], 1)])[VERSION.len()..]);
        let acquisition = read(&bytes, &Interpretation::default()).unwrap();
        assert_eq!(acquisition.report.metadata[0], ("material".to_owned(), "\"carpaint\"".to_owned()));
        assert_eq!(acquisition.report.metadata[1], ("comment".to_owned(), "measured somewhere".to_owned()));
    }
}
