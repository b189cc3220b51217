//! Index of the coarser levels of a grid chunk: for each, the bytes needed, the halvings left out, and the error.
//!
//! ```text
//! levels   varint  number, at least 1; for each, coarse first:
//!            varint  bytes of the stream that it needs, less those of the level before, at least 1
//!            u8      halvings that it leaves out, at least 1, fewer than the level before
//!            u24     er(L2) of evaluating it at the samples of the file, rounded up; 7F7FFF: unknown
//! ```

use super::super::super::stated::{read_error, rounded_up, write_error};
use crate::codec::{CodecError, Reader, Writer};

/// Upper bound on the number of coarser grids in a grid chunk; each merges neighbouring angles a different number of
/// times.
const MOST: usize = 96;
/// Smallest number of coded bytes with which a coarser grid is worth an entry in the index. Raising it saves about six
/// bytes for each entry in small files.
const LEAST: usize = 512;
/// Smallest ratio, in per cent, of the bytes that a listed grid of lower resolution needs to those of the one listed
/// before, which is coarser. Raising it lists fewer grids in the file.
const APART: usize = 115;

/// Coarser grid of angles that can be decoded from the first bytes of a grid chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GridLevel {
    /// Bytes needed to decode the coarser grid, counted from the start of the coded stream.
    pub(crate) end: usize,
    /// Number of halvings (merges of neighbouring angles along one axis) that separate the coarser grid from the full
    /// one.
    pub(crate) left_out: usize,
    /// Relative RMS error er(L2) of evaluating the coarser grid at the samples of the file, `f64::MAX` if unknown.
    pub(crate) er_l2: f64,
}

/// Returns true if a coarser grid of angles, decoded from the first `end` bytes of a stream of `stream` bytes, is worth
/// listing. It must need enough bytes, clearly more than the next coarser grid listed (`before`), and clearly fewer
/// than the whole.
pub(super) fn is_stated(end: usize, before: usize, stream: usize) -> bool {
    end >= LEAST && 100 * end >= APART * before && 100 * stream >= APART * end
}

/// Writes the table of the coarser grids of angles that can be decoded from the start of a chunk, at least one,
/// coarsest first.
pub(super) fn write(w: &mut Writer, levels: &[GridLevel]) {
    w.varint(levels.len() as u64);
    let mut before = 0;
    for level in levels {
        w.varint((level.end - before) as u64);
        w.u8(level.left_out as u8);
        write_error(w, level.er_l2);
        before = level.end;
    }
}

/// Reads the table of lower-resolution grids in a chunk of samples on a grid of angles that ends at offset `end`. The
/// bytes that these grids need must lie between the end of the table and `end`.
pub(super) fn read(r: &mut Reader<'_>, end: usize) -> Result<Vec<GridLevel>, CodecError> {
    let count = r.size(MOST, "number of levels")?;
    if count == 0 {
        return Err(r.malformed("the grid chunk lists 0 coarser levels, expected at least 1"));
    }
    let mut levels: Vec<GridLevel> = Vec::with_capacity(count);
    for _ in 0..count {
        let before = levels.last();
        let more = r.size(usize::MAX >> 1, "bytes of a level")?;
        let left_out = usize::from(r.u8("halvings that a level leaves out")?);
        if more == 0 || left_out == 0 || before.is_some_and(|before| before.left_out <= left_out) {
            return Err(r.malformed("the coarser levels of the grid chunk are not listed from coarse to fine"));
        }
        let er_l2 = read_error(r, "er(L2) of a level")?;
        let er_l2 = if er_l2 >= f64::from(rounded_up(f64::MAX)) { f64::MAX } else { er_l2 };
        levels.push(GridLevel { end: before.map_or(0, |before| before.end).saturating_add(more), left_out, er_l2 });
    }
    let (needed, behind) = (levels[count - 1].end, end.saturating_sub(r.offset()));
    if needed > behind {
        return Err(r.malformed(format!(
            "the coarser levels need {needed} bytes behind their table, but the grid chunk has {behind} there"
        )));
    }
    Ok(levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_read_as_they_were_written_and_cut_short_they_are_an_error() {
        let level = |end, left_out, er_l2| GridLevel { end, left_out, er_l2 };
        let levels = [level(600, 9, 0.5), level(1000, 4, 0.125), level(70_000, 1, f64::MAX)];
        let mut w = Writer::default();
        write(&mut w, &levels);
        let bytes = w.into_bytes();
        let read = |bytes: &[u8], end| super::read(&mut Reader::new(bytes, 0), end);
        assert_eq!(read(&bytes, bytes.len() + 70_000), Ok(levels.to_vec()));
        assert!(read(&bytes, bytes.len() + 69_999).is_err());
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end], 1 << 20).is_err());
        }
        let mut w = Writer::default();
        write(&mut w, &[level(600, 4, 0.5), level(1000, 4, 0.125)]);
        assert!(read(&w.into_bytes(), 1 << 20).is_err());
    }

    #[test]
    fn levels_are_an_eighth_apart_and_not_too_small() {
        assert!(is_stated(512, 0, 600) && !is_stated(511, 0, 600) && !is_stated(512, 0, 580));
        assert!(is_stated(1150, 1000, 2000) && !is_stated(1149, 1000, 2000));
    }
}
