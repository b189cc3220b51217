//! BSDFs of LBNL WINDOW and Radiance (XML): matrices over patches of directions (Klems bases), and tensor trees.
//!
//! A file holds one function for each side of the light (front or back), kind (reflection or transmission) and band
//! (`Visible`, `Solar`). The quantity and the options `side` and `band` choose among them. Values are in 1/sr and
//! without the cosine. Bases, the order of a matrix and the axes of a tree are read as Radiance's `bsdf_m.c` and
//! `bsdf_t.c` read them (G. Ward), directions also as `EnergyPlus` reads them (J. Klems).

mod about;
mod basis;
mod blocks;
mod choice;
mod element;
mod matrix;
mod steps;
#[cfg(test)]
mod tests;
mod tree;
mod tree_function;

use super::acquisition::{Acquisition, ParseReport};
use super::error::{FormatError, FormatErrorKind};
use super::foreign;
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::reader::{Reader, Sample};
use super::text::Source;
use crate::domain::Unit;
use crate::notes::ScatteringNote;
use about::{ABOUT, NAME, ROOT};

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &["side", "band"],
    probe: |sample: &Sample<'_>| if foreign::xml_root(&sample.head) == Some(ROOT) { 100 } else { 0 },
    read,
};

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    if let Some(other) = how.unit.filter(|&unit| unit != Unit::PerSteradian) {
        let message = format!("unit {other} was asked for, expected 1/sr, which the file holds");
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    }
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let root = element::root(&source, &mut report)?;
    let file = blocks::File::of(&root, &source, &mut report)?;
    let choice = choice::choose(&file.blocks, how)?;
    report.note(ScatteringNote::SideOfLight { side: choice.side().name() });
    if let Some(functions) = choice.left_out(&file.blocks) {
        report.note(ScatteringNote::OtherFunctionsHeld { functions });
    }
    let (layout, samples) = match file.structure {
        blocks::Structure::Columns | blocks::Structure::Rows => matrix::samples(&file, &choice, &source, &mut report)?,
        blocks::Structure::Tree { rank } => tree_function::samples(rank, &choice, &source, &mut report)?,
    };
    Ok(Acquisition {
        format: NAME,
        dialect: format!("{layout}, {}", choice.describe()),
        quantity: choice.quantity,
        unit: Unit::PerSteradian,
        samples,
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}
