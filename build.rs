//! Version of the program for `--version`, with the commit that it was built from where that is known.
//!
//! `WAVELUME_COMMIT` states the commit; without it, a release build reads it from `.git`, and is built again after the
//! next commit. Builds for development and tests have no commit, so that commits do not build them again. No program is
//! started, and a source tree without `.git` builds as well.

use std::path::Path;
use std::{env, fs};

/// Digits of the commit that `--version` shows.
const DIGITS: usize = 12;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=WAVELUME_COMMIT");
    let stated = env::var("WAVELUME_COMMIT").ok();
    let is_release = env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let commit = stated.or_else(|| if is_release { head(Path::new(".git")) } else { None });
    let commit = commit.filter(|text| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_hexdigit()));
    let version = env!("CARGO_PKG_VERSION");
    let version = match commit.as_deref().map(|text| &text[..text.len().min(DIGITS)]) {
        Some(commit) => format!("{version} (commit {commit})"),
        None => version.to_owned(),
    };
    println!("cargo::rustc-env=WAVELUME_VERSION={version}");
}

/// Returns the commit that a repository has checked out, and has the program built again once it changes.
fn head(git: &Path) -> Option<String> {
    let read = |name: &str| {
        let path = git.join(name);
        path.exists().then(|| println!("cargo::rerun-if-changed={}", path.display()))?;
        fs::read_to_string(path).ok()
    };
    let head = read("HEAD")?;
    let Some(name) = head.trim().strip_prefix("ref: ") else { return Some(head.trim().to_owned()) };
    if let Some(commit) = read(name) {
        return Some(commit.trim().to_owned());
    }
    let packed = read("packed-refs")?;
    packed.lines().find_map(|line| line.strip_suffix(name)?.strip_suffix(' ').map(str::to_owned))
}
