//! The share of the cases of long tests that runs each time.

/// Yields one in `n` cases of a long test, beginning with number `first`; all of them if `WAVELUME_ALL_CASES` is set,
/// as `tests/nightly cases` sets it.
pub(crate) fn one_in<T>(n: usize, first: usize, cases: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    let (n, first) = if std::env::var_os("WAVELUME_ALL_CASES").is_some() { (1, 0) } else { (n, first) };
    cases.into_iter().skip(first).step_by(n)
}
