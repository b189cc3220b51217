//! Matrices over patches: bases by name or as the file defines them, numbers, and their order.

use super::super::acquisition::{ParseReport, Samples};
use super::super::error::{FormatError, FormatErrorKind};
use super::super::text::{Source, Tokens, snippet};
use super::basis::Basis;
use super::blocks::{Block, File, Structure};
use super::choice::Choice;
use super::steps::{self, Part};
use crate::domain::Note;
use crate::notes::{Quoted, ScatteringNote, ValueNote};

/// Reads the chosen matrices as samples on a grid of angles; also returns a description of their patches.
pub(super) fn samples(
    file: &File<'_>,
    choice: &Choice<'_>,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(String, Samples), FormatError> {
    let mut parts = Vec::new();
    for block in choice.blocks() {
        parts.push(part(file, block, source, report)?);
    }
    let values = || parts.iter().flat_map(|part| &part.values);
    let negative = values().filter(|value| **value < 0.0).count();
    if negative > 0 {
        let lowest = values().copied().fold(0.0, f32::min);
        report.note(ValueNote::NegativeOf { values: negative, of: values().count(), lowest });
    }
    let sizes: Vec<String> = parts
        .iter()
        .map(|part| format!("{} × {} patches ({})", part.incoming.len(), part.outgoing.len(), part.outgoing.name))
        .collect();
    let sizes = if sizes.iter().all(|size| *size == sizes[0]) { sizes[0].clone() } else { sizes.join(" and ") };
    let grid = steps::grid(&parts, report)?;
    Ok((format!("matrix of {sizes}"), Samples::Grid(grid)))
}

fn part(file: &File<'_>, block: &Block<'_>, source: &Source, report: &mut ParseReport) -> Result<Part, FormatError> {
    let [columns, rows] = ["ColumnAngleBasis", "RowAngleBasis"].map(|name| block.element.text_of(name));
    for (name, text) in [("ColumnAngleBasis", columns), ("RowAngleBasis", rows)] {
        if text.is_empty() {
            let message = format!("no element {name} in a BSDF of WINDOW, expected the name of a basis of patches");
            return Err(source.malformed(block.element.offset, message));
        }
    }
    let unsupported = |message: String| source.error(FormatErrorKind::Unsupported, block.element.offset, message);
    if file.structure == Structure::Rows && !columns.eq_ignore_ascii_case(rows) {
        return Err(unsupported(format!(
            "incident rows of {} and columns of {}, expected one basis: programs differ in which of two is the incident one",
            snippet(rows),
            snippet(columns)
        )));
    }
    let bases = |name: &str| match file.bases.iter().find(|basis| basis.name.eq_ignore_ascii_case(name)) {
        Some(basis) => vec![basis.clone()],
        None => Basis::known(name),
    };
    let (incoming, outgoing) = (bases(columns), bases(rows));
    for (name, found) in [(columns, &incoming), (rows, &outgoing)] {
        if found.is_empty() {
            let message = format!(
                "basis {}, which the file does not define (DataDefinition/AngleBasis), expected LBNL/Klems Full, Half or Quarter",
                snippet(name)
            );
            return Err(unsupported(message));
        }
    }
    let is_one = columns.eq_ignore_ascii_case(rows);
    let pairs: Vec<(&Basis, &Basis)> =
        incoming.iter().flat_map(|i| outgoing.iter().map(move |o| (i, o))).filter(|(i, o)| !is_one || i == o).collect();
    let sizes: Vec<usize> = pairs.iter().map(|(i, o)| i.len() * o.len()).collect();
    let numbers = numbers(block, source, sizes.iter().copied().max().unwrap_or(0))?;
    let Some(at) = sizes.iter().position(|&size| size == numbers.len()) else {
        let expected: Vec<String> = pairs.iter().map(|(i, o)| format!("{} × {}", i.len(), o.len())).collect();
        let message = format!("{} numbers, expected {}", numbers.len(), expected.join(" or "));
        return Err(source.malformed(block.data.content.end, message));
    };
    let (incoming, outgoing) = pairs[at];
    note_on(incoming, file, report);
    note_on(outgoing, file, report);
    let (n_in, n_out) = (incoming.len(), outgoing.len());
    let values = match file.structure {
        Structure::Rows => numbers,
        _ => (0..n_in * n_out).map(|at| numbers[at % n_out * n_in + at / n_out]).collect(),
    };
    Ok(Part {
        incoming: incoming.clone(),
        outgoing: outgoing.clone(),
        values,
        side: block.side,
        is_below: block.transmits,
    })
}

/// Notes a basis that the file only names, or whose patches differ from those that its name stands for; once each.
fn note_on(basis: &Basis, file: &File<'_>, report: &mut ParseReport) {
    let known = Basis::known(&basis.name);
    let is_stated = file.bases.iter().any(|stated| stated.name.eq_ignore_ascii_case(&basis.name));
    let shape = |basis: &Basis| basis.rings.iter().map(|ring| (ring.bounds, ring.count)).collect::<Vec<_>>();
    let name = Quoted::of(&basis.name);
    let note = if !is_stated {
        ScatteringNote::BasisByName { basis: name, patches: basis.len() }
    } else if !known.is_empty() && known.iter().all(|known| shape(known) != shape(basis)) {
        ScatteringNote::BasisUnlikeItsName { basis: name }
    } else {
        return;
    };
    let note: Note = note.into();
    if !report.notes.contains(&note) {
        report.note(note);
    }
}

/// Returns the numbers of a function, at most one more than `most`.
fn numbers(block: &Block<'_>, source: &Source, most: usize) -> Result<Vec<f32>, FormatError> {
    let content = block.data.content.clone();
    let text = source.text().get(..content.end).unwrap_or_default();
    let mut numbers = Vec::with_capacity(most.min(content.len() / 2 + 1));
    for token in Tokens::new(text, content.start).take(most + 1) {
        numbers.push(value(source.number(token, "a value in 1/sr")?, token.offset, source)?);
    }
    Ok(numbers)
}

/// Returns a value of a function in single precision; refuses one that is out of its range.
pub(super) fn value(number: f64, offset: usize, source: &Source) -> Result<f32, FormatError> {
    let value = number as f32;
    if value.is_finite() {
        return Ok(value);
    }
    Err(source.malformed(offset, format!("value {number:e}, expected a number within the range of float32")))
}
