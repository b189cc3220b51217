//! Structure of the code: imports go neither upward nor in circles, and the scientific rooms know no runtime, database,
//! network, clock or global randomness.

mod imports;

use imports::Files;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Rooms (top-level modules), each with the rooms that it may name. A new room needs a line here.
const ROOMS: &[(&str, &[&str])] = &[
    ("numeric", &[]),
    ("domain", &["numeric"]),
    ("notes", &["domain"]),
    ("formats", &["notes", "domain", "numeric"]),
    ("projection", &["notes", "formats", "domain", "numeric"]),
    ("transform", &["domain", "numeric"]),
    ("codec", &["transform", "domain", "numeric"]),
    ("compress", &["codec", "transform", "domain", "numeric"]),
    ("algebra", &["compress", "codec", "transform", "domain", "numeric"]),
    ("evaluate", &["compress", "codec", "transform", "domain", "numeric"]),
    ("roles", &["evaluate", "domain"]),
    ("open", &["evaluate", "compress"]),
    ("appearance", &["evaluate", "domain", "numeric"]),
    ("preview", &["appearance", "evaluate", "domain", "numeric"]),
    ("export", &["appearance", "preview", "evaluate", "formats", "domain", "numeric"]),
    ("paper", &["projection", "formats", "compress", "codec", "transform", "domain", "numeric"]),
    ("pipeline", SCIENCE),
    ("reading", &["pipeline", "formats"]),
    ("trust", &[]),
    ("store", &["trust"]),
    ("catalog", &["store", "trust", "domain", "numeric"]),
    ("jobs", BELOW_JOBS),
    ("api", BELOW_JOBS),
    ("cli", BELOW_JOBS),
];

/// Rooms of the service, each of which may name those before it, too.
const SERVICE: &[&str] = &["jobs", "api", "cli"];

const SCIENCE: &[&str] = &[
    "numeric",
    "domain",
    "notes",
    "formats",
    "projection",
    "transform",
    "codec",
    "compress",
    "algebra",
    "evaluate",
    "appearance",
    "preview",
    "export",
];
const BELOW_JOBS: &[&str] = &[
    "numeric",
    "domain",
    "formats",
    "projection",
    "transform",
    "codec",
    "compress",
    "algebra",
    "evaluate",
    "preview",
    "export",
    "paper",
    "pipeline",
    "trust",
    "store",
    "catalog",
];
/// Names that the scientific rooms must not use.
const SERVICE_NAMES: &[&str] = &[
    "tokio",
    "sqlx",
    "axum",
    "reqwest",
    "hyper",
    "tower",
    "object_store",
    "async",
    "await",
    "Instant",
    "SystemTime",
    "thread_rng",
    "ThreadRng",
    "OsRng",
    "SysRng",
    "getrandom",
    "clap",
];
/// Packages that the renderer's crate must not link: runtimes, SQL, HTTP, formats of files, command lines.
const NOT_FOR_RENDERERS: &[&str] = &[
    "tokio",
    "futures-core",
    "sqlx-core",
    "libsqlite3-sys",
    "http",
    "hyper",
    "axum",
    "reqwest",
    "object_store",
    "quick-xml",
    "zip",
    "flate2",
    "png",
    "clap",
    "wavelume-formats",
    "wavelume",
];
const SERVICE_PATHS: &[&str] = &["std::time", "std::net", "std::process", "rand::rng(", "rand::random"];

/// Returns the files of Rust in a folder and in the folders below it.
fn sources(directory: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The code of a file: its comments blanked, doc links among them.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// The folders of source, each with the room that all of it is, if it is one.
const FOLDERS: &[(&str, Option<&str>)] =
    &[("src", None), ("crates/core/src", None), ("crates/formats/src", None), ("crates/paper/src", Some("paper"))];

/// Returns a folder or file of the repository.
pub(crate) fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Returns all source files, each with its room; those of a crate's root have no room.
fn all_sources() -> Vec<(PathBuf, Option<String>)> {
    let mut found = Vec::new();
    for (name, whole) in FOLDERS {
        let folder = folder(name);
        found.extend(sources(&folder).into_iter().map(|path| {
            let first = path.strip_prefix(&folder).unwrap().components().next().unwrap().as_os_str().to_str().unwrap();
            let name = whole.unwrap_or(first.trim_end_matches(".rs"));
            let room = (!["lib", "main"].contains(&name)).then(|| name.to_owned());
            (path, room)
        }));
    }
    found
}

/// The folder of a room; `None` if it is a single file.
fn directory_of(room: &str) -> Option<PathBuf> {
    FOLDERS.iter().find_map(|(name, whole)| {
        let path = if *whole == Some(room) { folder(name) } else { folder(name).join(room) };
        (path.is_dir() && whole.is_none_or(|whole| whole == room)).then_some(path)
    })
}

fn leading_name(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    &text[..end]
}

/// Returns the names directly after `crate::`, single or in braces, and after chains of `super::`.
fn named_at_the_root(code: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for root in ["crate::", "super::"] {
        for (at, _) in code.match_indices(root) {
            // `my_crate::` is another word.
            if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
                continue;
            }
            let rest = &code[at + root.len()..];
            let Some(list) = rest.strip_prefix('{') else {
                names.insert(leading_name(rest).to_owned());
                continue;
            };
            let mut depth = 0;
            let mut expects_name = true;
            for (i, c) in list.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => expects_name = true,
                    c if depth == 0 && expects_name && c.is_alphabetic() => {
                        names.insert(leading_name(&list[i..]).to_owned());
                        expects_name = false;
                    }
                    _ => {}
                }
            }
        }
    }
    names
}

fn words(code: &str) -> BTreeSet<&str> {
    code.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect()
}

/// Returns the rooms that a room may name.
fn allowed(room: &str) -> BTreeSet<&'static str> {
    let (_, listed) = ROOMS.iter().find(|(name, _)| *name == room).unwrap();
    let place = SERVICE.iter().position(|name| *name == room).unwrap_or(0);
    listed.iter().chain(&SERVICE[..place]).copied().collect()
}

/// Returns the rooms that a cell of the table in docs/architecture.md allows. Rooms are in backticks. After a room,
/// "and what it names" adds the rooms that it may name; "all above but" takes all rows above without those that follow.
fn allowed_by(cell: &str, above: &[(&str, BTreeSet<String>)]) -> BTreeSet<String> {
    let pieces: Vec<&str> = cell.split('`').collect();
    let names: BTreeSet<String> = pieces.iter().skip(1).step_by(2).map(|name| (*name).to_owned()).collect();
    if cell.starts_with("all above but") {
        return above.iter().map(|(room, _)| (*room).to_owned()).filter(|room| !names.contains(room)).collect();
    }
    let mut allowed = names;
    for pair in pieces[1..].chunks(2).filter(|pair| pair.len() == 2 && pair[1].starts_with(" and what it names")) {
        let (_, further) = above.iter().find(|(room, _)| *room == pair[0]).unwrap();
        allowed.extend(further.iter().cloned());
    }
    allowed
}

#[test]
fn the_page_of_the_architecture_has_the_table() {
    let page = fs::read_to_string(folder("docs/architecture.md")).unwrap();
    let (_, section) = page.split_once("\n## The rooms\n").unwrap();
    let (section, _) = section.split_once("\n## ").unwrap();
    let mut shown: Vec<(&str, BTreeSet<String>)> = Vec::new();
    for row in section.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        shown.push((cells[1].trim_matches('`'), allowed_by(cells[3], &shown)));
    }
    let tested: Vec<(&str, BTreeSet<String>)> =
        ROOMS.iter().map(|(room, _)| (*room, allowed(room).into_iter().map(str::to_owned).collect())).collect();
    assert_eq!(shown, tested, "the table of the rooms on the page (left) differs from ROOMS");
}

#[test]
fn every_room_is_in_the_table() {
    let table: BTreeSet<_> = ROOMS.iter().map(|(name, _)| (*name).to_owned()).collect();
    let found: BTreeSet<_> = all_sources().into_iter().filter_map(|(_, room)| room).collect();
    let unknown: Vec<_> = found.difference(&table).collect();
    assert!(unknown.is_empty(), "rooms without a line in the table: {unknown:?}");
}

#[test]
fn nothing_imports_upward() {
    let mut upward = Vec::new();
    for (path, room) in all_sources() {
        let Some(room) = room else { continue };
        let allowed = allowed(&room);
        // A room's own modules may have the name of another room (`cli/compress.rs`), but only `super::` reaches them.
        let own: BTreeSet<String> = directory_of(&room)
            .map(|directory| sources(&directory))
            .unwrap_or_default()
            .iter()
            .map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned())
            .collect();
        let code = code(&path);
        for name in named_at_the_root(&code) {
            let is_room = ROOMS.iter().any(|(known, _)| *known == name);
            let is_own = name == room || (own.contains(&name) && !code.contains(&format!("crate::{name}")));
            if is_room && !is_own && !allowed.contains(name.as_str()) {
                upward.push(format!("{}: {room} names {name}", path.display()));
            }
        }
    }
    assert!(upward.is_empty(), "{}", upward.join("\n"));
}

#[test]
fn no_file_takes_part_in_a_circle_of_imports() {
    for (name, _) in FOLDERS {
        let circles = Files::read(&folder(name).join("lib.rs")).circles();
        assert!(circles.is_empty(), "files that import one another: {circles:#?}");
    }
}

#[test]
fn the_scientific_rooms_know_no_service() {
    let mut found = Vec::new();
    for room in SCIENCE.iter().chain(&["paper", "pipeline"]) {
        for path in directory_of(room).map(|directory| sources(&directory)).unwrap_or_default() {
            let code = code(&path);
            let words = words(&code);
            let names = SERVICE_NAMES.iter().filter(|name| words.contains(**name));
            let paths = SERVICE_PATHS.iter().filter(|path| code.contains(**path));
            found.extend(names.chain(paths).map(|name| format!("{}: {name}", path.display())));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn what_a_renderer_links_brings_no_service_and_no_file_formats() {
    let tree = ["tree", "--locked", "--offline", "-p", "wavelume-core", "-e", "normal", "--prefix", "none"];
    let output = Command::new(env!("CARGO")).args(tree).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let linked: BTreeSet<&str> = text.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!(linked.contains("wavelume-core") && linked.contains("rayon"), "{linked:?}");
    let found: Vec<_> = NOT_FOR_RENDERERS.iter().filter(|name| linked.contains(**name)).collect();
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn every_file_begins_with_its_charter() {
    for (path, _) in all_sources() {
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("//! "), "{}: no charter on its first line", path.display());
    }
}

#[test]
fn imports_are_found_in_every_form() {
    let code = "use crate::api::x;\nuse crate::{jobs, store::{self, catalog}, cli as c};\nlet y = crate::evaluate::z;";
    let names = named_at_the_root(code);
    assert_eq!(names.iter().map(String::as_str).collect::<Vec<_>>(), ["api", "cli", "evaluate", "jobs", "store"]);
    assert!(named_at_the_root("use super::super::jobs;").contains("jobs"));
    assert!(named_at_the_root("other_crate::jobs").is_empty());
}
