//! Files as users have them: read, damaged, projected, compressed and exported; and the example programs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking, its helpers too")]

mod damaged;
mod examples;
mod formats;
mod narrow_lobes;
mod phases;
mod projection;
mod recorded;
mod restated;
mod scattered;

use std::path::Path;

/// The root of the project, where `data`, `docs` and `tests` are.
fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}
