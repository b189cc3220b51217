//! Files as users have them: read, damaged, projected, compressed and exported; and the example programs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking, its helpers too")]

mod bsdf_xml;
mod damaged;
mod examples;
mod formats;
mod narrow_lobes;
mod partly;
mod phases;
mod projection;
mod recorded;
mod restated;
mod scattered;

use std::path::Path;

/// Yields one in `n` cases of a long test, beginning with number `first`; all of them if `WAVELUME_ALL_CASES` is set,
/// as `tests/nightly cases` sets it.
fn one_in<T>(n: usize, first: usize, cases: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    let (n, first) = if std::env::var_os("WAVELUME_ALL_CASES").is_some() { (1, 0) } else { (n, first) };
    cases.into_iter().skip(first).step_by(n)
}

/// The root of the project, where `data`, `docs` and `tests` are.
fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}
