//! The README and the pages of `docs/`: the README stays short, every page is in the index, and no link leads nowhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Upper bound on the lines of the README; whatever is beyond it belongs on a page of `docs/`.
const README_LINES: usize = 250;
/// Upper bound on the lines of CONTRIBUTING.md, one printed page; whatever is beyond it belongs on a page of `docs/`.
const CONTRIBUTING_LINES: usize = 55;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the files of the repository, relative to it, without what is built, fetched or hidden.
pub(crate) fn files() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root().join(&folder)).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            if name.starts_with('.') || ["__pycache__", "corpus", "shared", "target"].contains(&name.as_str()) {
                continue;
            }
            let kind = entry.file_type().unwrap();
            if kind.is_dir() {
                folders.push(folder.join(name));
            } else if kind.is_file() {
                found.push(folder.join(name));
            }
        }
    }
    found.sort();
    found
}

/// Returns the pages whose links are checked, relative to the repository.
fn pages() -> Vec<PathBuf> {
    files().into_iter().filter(|path| path.extension() == Some("md".as_ref())).collect()
}

/// Returns the lines of a page outside its blocks of code, numbered from 1.
fn prose(text: &str) -> Vec<(usize, &str)> {
    let mut is_code = false;
    let outside = text.lines().zip(1..).filter(|(line, _)| {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        !is_fence && !is_code
    });
    outside.map(|(line, number)| (number, line)).collect()
}

/// Returns a line without its code between backticks, in which brackets are no links.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join("`")
}

/// Returns the anchor of a heading as GitHub makes it: lower case, punctuation dropped, blanks as hyphens.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    text.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c)).map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Returns the anchors of a page; a heading that stands twice has a number on its second anchor.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen = BTreeMap::<String, usize>::new();
    let mut found = BTreeSet::new();
    for (_, line) in prose(text).into_iter().filter(|(_, line)| line.starts_with('#')) {
        let name = anchor(line);
        let count = seen.entry(name.clone()).or_default();
        found.insert(if *count == 0 { name } else { format!("{name}-{count}") });
        *count += 1;
    }
    found
}

/// Returns the targets of the links and pictures of a page, each with its line.
fn links(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (number, line) in prose(text) {
        let line = without_code(line);
        let targets = line.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
        found.extend(targets.map(|(target, _)| (number, target.to_owned())));
    }
    found
}

#[test]
fn pages_at_the_root_stay_short() {
    for (page, most) in [("README.md", README_LINES), ("CONTRIBUTING.md", CONTRIBUTING_LINES)] {
        let lines = fs::read_to_string(root().join(page)).unwrap().lines().count();
        assert!(lines <= most, "{page} has {lines} lines, at most {most}: move something to docs/");
    }
}

#[test]
fn every_link_leads_somewhere() {
    let mut broken = Vec::new();
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(root().join(&page)).unwrap();
        for (line, target) in links(&text) {
            count += 1;
            if target.starts_with("https://") || target.starts_with("http://") {
                continue;
            }
            let (file, fragment) = target.split_once('#').unwrap_or((&target, ""));
            let path = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            let Ok(canonical) = root().join(&path).canonicalize() else {
                broken.push(format!("{}:{line}: {target}: no such file", page.display()));
                continue;
            };
            if !canonical.starts_with(root().canonicalize().unwrap()) {
                broken.push(format!("{}:{line}: {target}: outside of the repository", page.display()));
            } else if !fragment.is_empty() && !anchors(&fs::read_to_string(&canonical).unwrap()).contains(fragment) {
                broken.push(format!("{}:{line}: {target}: no such heading", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(count > 100, "only {count} links were found");
}

#[test]
fn every_page_is_in_the_index() {
    let index = links(&fs::read_to_string(root().join("docs/README.md")).unwrap());
    let named: BTreeSet<_> = index.iter().map(|(_, target)| Path::new("docs").join(target)).collect();
    let in_docs = pages().into_iter().filter(|page| page.starts_with("docs") && !page.ends_with("README.md"));
    let missing: Vec<_> = in_docs.filter(|page| !named.contains(page)).collect();
    assert!(missing.is_empty(), "pages without a line in docs/README.md: {missing:?}");
}

#[test]
fn anchors_and_links_are_those_of_github() {
    assert_eq!(anchor("### 7.1 Axes, `wi` & more"), "71-axes-wi--more");
    assert_eq!(anchors("# A\n```sh\n# no heading\n```\n## A\n"), BTreeSet::from(["a".to_owned(), "a-1".to_owned()]));
    let text = "a [b](c.md#d) `[no](link)` ![e](f.png)\n";
    assert_eq!(links(text), [(1, "c.md#d".to_owned()), (1, "f.png".to_owned())]);
}
