//! One coefficient with its index, and the union of two sorted lists of them.

use std::cmp::Ordering;

/// One coefficient of a sparse spectrum: its index in the basis and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Index of the coefficient of a spectrum in the basis, counted from 0.
    pub index: u32,
    /// Value of one coefficient of a spectrum in a basis, not quantised: the factor of one basis function.
    pub value: f64,
}

/// Iterator over the coefficients of two sparse spectra by rising index. A coefficient missing in one of them counts as
/// zero.
#[derive(Clone)]
pub(super) struct Union<'a> {
    pub(super) a: &'a [Entry],
    pub(super) b: &'a [Entry],
}

impl Iterator for Union<'_> {
    type Item = (u32, f64, f64);

    fn next(&mut self) -> Option<Self::Item> {
        let index = |entries: &[Entry]| entries.first().map_or(u32::MAX, |entry| entry.index);
        let order = index(self.a).cmp(&index(self.b));
        let take = |entries: &mut &[Entry], wanted: bool| -> Option<Entry> {
            let (first, rest) = entries.split_first().filter(|_| wanted)?;
            *entries = rest;
            Some(*first)
        };
        let a = take(&mut self.a, order != Ordering::Greater);
        let b = take(&mut self.b, order != Ordering::Less);
        let index = a.or(b)?.index;
        Some((index, a.map_or(0.0, |a| a.value), b.map_or(0.0, |b| b.value)))
    }
}
