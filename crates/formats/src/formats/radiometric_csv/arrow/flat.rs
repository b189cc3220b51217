//! Bounds-checked reader of flatbuffer tables, limited to what the metadata of Arrow messages need.
//!
//! A table starts with the distance to its vtable, which holds the position of each field (0 = absent). References are
//! distances from their own position (the internals of flatbuffers). All numbers are little-endian.

/// Error of a flatbuffer: an offset leads outside the buffer, or a text is not UTF-8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Broken;

fn chunk<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], Broken> {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).copied().ok_or(Broken)
}

fn whole(bytes: &[u8], at: usize) -> Result<u32, Broken> {
    chunk(bytes, at).map(u32::from_le_bytes)
}

/// Returns the byte offset that the flatbuffer reference at byte `at` points to.
fn follow(bytes: &[u8], at: usize) -> Result<usize, Broken> {
    at.checked_add(whole(bytes, at)? as usize).filter(|&to| to < bytes.len()).ok_or(Broken)
}

/// Table in a flatbuffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
    vtable: usize,
}

impl<'a> Table<'a> {
    /// Returns the root table of a flatbuffer.
    pub(super) fn root(bytes: &'a [u8]) -> Result<Self, Broken> {
        Self::new(bytes, follow(bytes, 0)?)
    }

    fn new(bytes: &'a [u8], at: usize) -> Result<Self, Broken> {
        let back = chunk(bytes, at).map(i32::from_le_bytes)?;
        let vtable = i64::try_from(at).map_err(|_| Broken)? - i64::from(back);
        let vtable = usize::try_from(vtable).map_err(|_| Broken)?;
        let size = usize::from(chunk(bytes, vtable).map(u16::from_le_bytes)?);
        if size < 4 || vtable.checked_add(size).is_none_or(|end| end > bytes.len()) {
            return Err(Broken);
        }
        Ok(Self { bytes, at, vtable })
    }

    /// Returns the byte offset of field number `slot` in a flatbuffer table; `None` if it is absent.
    fn field(self, slot: usize) -> Result<Option<usize>, Broken> {
        let entry = 4 + 2 * slot;
        let size = usize::from(chunk(self.bytes, self.vtable).map(u16::from_le_bytes)?);
        if entry + 2 > size {
            return Ok(None);
        }
        let place = usize::from(chunk(self.bytes, self.vtable + entry).map(u16::from_le_bytes)?);
        Ok((place != 0).then_some(self.at + place))
    }

    fn scalar<const N: usize>(self, slot: usize) -> Result<[u8; N], Broken> {
        self.field(slot)?.map_or(Ok([0; N]), |at| chunk(self.bytes, at))
    }

    /// Returns a one-byte field of a flatbuffer table by its number `slot`; 0 if it is absent.
    pub(super) fn byte(self, slot: usize) -> Result<u8, Broken> {
        self.scalar(slot).map(u8::from_le_bytes)
    }

    /// Returns a two-byte field of a flatbuffer table by its number `slot`; 0 if it is absent.
    pub(super) fn short(self, slot: usize) -> Result<i16, Broken> {
        self.scalar(slot).map(i16::from_le_bytes)
    }

    /// Returns a four-byte field of a flatbuffer table by its number `slot`; 0 if it is absent.
    pub(super) fn int(self, slot: usize) -> Result<i32, Broken> {
        self.scalar(slot).map(i32::from_le_bytes)
    }

    /// Returns an eight-byte field of a flatbuffer table by its number `slot`; 0 if it is absent.
    pub(super) fn long(self, slot: usize) -> Result<i64, Broken> {
        self.scalar(slot).map(i64::from_le_bytes)
    }

    /// Returns the flatbuffer table to which field number `slot` of another one refers; `None` if the field is absent.
    pub(super) fn table(self, slot: usize) -> Result<Option<Self>, Broken> {
        self.field(slot)?.map(|at| Self::new(self.bytes, follow(self.bytes, at)?)).transpose()
    }

    /// Returns a text field of a flatbuffer table by its number `slot`; `None` if it is absent.
    pub(super) fn text(self, slot: usize) -> Result<Option<&'a str>, Broken> {
        let Some(at) = self.field(slot)? else { return Ok(None) };
        let at = follow(self.bytes, at)?;
        let start = at.checked_add(4).ok_or(Broken)?;
        let end = start.checked_add(whole(self.bytes, at)? as usize).ok_or(Broken)?;
        let text = self.bytes.get(start..end).ok_or(Broken)?;
        std::str::from_utf8(text).map(Some).map_err(|_| Broken)
    }

    /// Returns a list field of a flatbuffer table by its number `slot`, with items of `size` bytes each; empty if it is
    /// absent.
    pub(super) fn list(self, slot: usize, size: usize) -> Result<List<'a>, Broken> {
        let Some(at) = self.field(slot)? else { return Ok(List { bytes: self.bytes, start: 0, len: 0, size }) };
        let at = follow(self.bytes, at)?;
        let len = whole(self.bytes, at)? as usize;
        let start = at.checked_add(4).ok_or(Broken)?;
        let end = len.checked_mul(size).and_then(|bytes| start.checked_add(bytes)).ok_or(Broken)?;
        if end > self.bytes.len() {
            return Err(Broken);
        }
        Ok(List { bytes: self.bytes, start, len, size })
    }

    /// Returns the list of flatbuffer tables in field number `slot` of another one; empty if the field is absent.
    pub(super) fn tables(self, slot: usize) -> Result<List<'a>, Broken> {
        self.list(slot, 4)
    }
}

/// List in a flatbuffer that is known to lie within its buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct List<'a> {
    bytes: &'a [u8],
    start: usize,
    len: usize,
    size: usize,
}

impl<'a> List<'a> {
    /// Returns the number of items in the flatbuffer list.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Returns the flatbuffer table to which item `i` of a flatbuffer list of tables refers.
    pub(super) fn table(&self, i: usize) -> Result<Table<'a>, Broken> {
        if i >= self.len {
            return Err(Broken);
        }
        Table::new(self.bytes, follow(self.bytes, self.start + i * self.size)?)
    }

    /// Returns item `i` of a flatbuffer list whose items are pairs of 64-bit integers.
    pub(super) fn pair(&self, i: usize) -> Result<[i64; 2], Broken> {
        if i >= self.len {
            return Err(Broken);
        }
        let at = self.start + i * self.size;
        Ok([chunk(self.bytes, at).map(i64::from_le_bytes)?, chunk(self.bytes, at + 8).map(i64::from_le_bytes)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Property of the reader: arbitrary bytes are a flatbuffer table or an error; no read is out of bounds and no
        /// arithmetic overflows.
        #[test]
        fn every_offset_is_checked(bytes in proptest::collection::vec(prop_oneof![Just(0_u8), Just(4), Just(255), any::<u8>()], 0..80)) {
            let Ok(root) = Table::root(&bytes) else { return Ok(()) };
            for slot in 0..8 {
                let _ = (root.byte(slot), root.short(slot), root.int(slot), root.long(slot), root.text(slot));
                if let Ok(Some(table)) = root.table(slot) {
                    let _ = table.long(slot);
                }
                for size in [4, 16] {
                    if let Ok(list) = root.list(slot, size) {
                        prop_assert!(list.len() * size <= bytes.len());
                        let _ = (list.table(0), list.table(list.len()), list.pair(0));
                    }
                }
            }
        }
    }
}
