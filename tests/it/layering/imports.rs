//! References between the files of a crate: imports and paths in code, followed through re-exports to the defining
//! file.
//!
//! Rust's own lexer reads the files (the `proc-macro2` package). Calls of methods are not seen: an `impl` in another
//! file than its type's refers to that type, not the other way round.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::{fs, mem};

/// The files of a crate, and the files that each of them refers to.
pub(super) struct Files {
    paths: Vec<PathBuf>,
    names: Vec<BTreeSet<usize>>,
}

/// A module: a file, or an inline `mod name { … }` of one.
#[derive(Default)]
struct Module {
    file: usize,
    parent: usize,
    children: BTreeMap<String, usize>,
    /// Names of items defined here.
    items: BTreeSet<String>,
    /// Imports by the name that they have here.
    imports: BTreeMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    /// The paths in all other code.
    used: Vec<Vec<String>>,
}

/// Upper bound on the re-exports through which a path is followed.
const DEEPEST: usize = 16;

/// Keywords before the name of an item.
const DEFINES: [&str; 9] = ["struct", "enum", "fn", "const", "static", "trait", "type", "union", "macro_rules"];

/// The modules read so far.
struct Reader {
    modules: Vec<Module>,
    paths: Vec<PathBuf>,
}

impl Files {
    /// Reads the crate whose root is the file `root` (`src/lib.rs`), without what is compiled for tests alone.
    pub(super) fn read(root: &Path) -> Self {
        let mut reader = Reader { modules: Vec::new(), paths: Vec::new() };
        let folder = root.parent().unwrap();
        reader.file(root.to_owned(), folder, 0);
        let names = reader.names();
        Self { paths: reader.paths, names }
    }

    /// Returns groups of two or more files in which each refers to all others, directly or through other files.
    pub(super) fn circles(&self) -> Vec<Vec<PathBuf>> {
        let reached: Vec<BTreeSet<usize>> = (0..self.paths.len()).map(|file| self.reached(file)).collect();
        let mut seen = BTreeSet::new();
        let mut circles = Vec::new();
        for file in 0..self.paths.len() {
            if seen.contains(&file) || !reached[file].contains(&file) {
                continue;
            }
            let circle: Vec<usize> =
                reached[file].iter().copied().filter(|&other| reached[other].contains(&file)).collect();
            seen.extend(circle.iter().copied());
            circles.push(circle.iter().map(|&file| self.paths[file].clone()).collect());
        }
        circles
    }

    fn reached(&self, file: usize) -> BTreeSet<usize> {
        let mut reached = BTreeSet::new();
        let mut open: Vec<usize> = self.names[file].iter().copied().collect();
        while let Some(next) = open.pop() {
            if reached.insert(next) {
                open.extend(&self.names[next]);
            }
        }
        reached
    }
}

impl Reader {
    /// Reads the file of a module; its children lie in `folder`.
    fn file(&mut self, path: PathBuf, folder: &Path, parent: usize) -> usize {
        let text = fs::read_to_string(&path).unwrap();
        let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        self.paths.push(path);
        self.module(tokens, self.paths.len() - 1, folder, parent)
    }

    /// Reads the module `name`, whose declaration continues with `next`: its body, or the end if it has a file of its
    /// own.
    fn child(&mut self, name: &str, next: &TokenTree, file: usize, folder: &Path, parent: usize) -> usize {
        let inside = folder.join(name);
        if let TokenTree::Group(body) = next {
            return self.module(body.stream(), file, &inside, parent);
        }
        let own = folder.join(format!("{name}.rs"));
        let path = if own.exists() { own } else { inside.join("mod.rs") };
        self.file(path, &inside, parent)
    }

    fn module(&mut self, tokens: TokenStream, file: usize, folder: &Path, parent: usize) -> usize {
        let at = self.modules.len();
        self.modules.push(Module { file, parent, ..Module::default() });
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut for_tests = false;
        let mut i = 0;
        while i < tokens.len() {
            match &tokens[i] {
                TokenTree::Punct(mark) if mark.as_char() == '#' => {
                    let inner = matches!(&tokens[i + 1], TokenTree::Punct(mark) if mark.as_char() == '!');
                    let attribute = tokens[i + 1 + usize::from(inner)].to_string();
                    for_tests |= attribute.replace(' ', "") == "[cfg(test)]";
                    i += 2 + usize::from(inner);
                }
                TokenTree::Ident(word) if word == "pub" => {
                    let limited =
                        matches!(&tokens[i + 1], TokenTree::Group(to) if to.delimiter() == Delimiter::Parenthesis);
                    i += 1 + usize::from(limited);
                }
                TokenTree::Ident(word) if word == "mod" => {
                    let name = tokens[i + 1].to_string();
                    if !mem::take(&mut for_tests) {
                        let child = self.child(&name, &tokens[i + 2], file, folder, at);
                        self.modules[at].children.insert(name, child);
                    }
                    i += 3;
                }
                TokenTree::Ident(word) if word == "use" => {
                    let end = (i..tokens.len()).find(|&j| is_mark(&tokens[j], ';')).unwrap();
                    if !mem::take(&mut for_tests) {
                        self.import(at, &tokens[i + 1..end], &[]);
                    }
                    i = end + 1;
                }
                _ => {
                    // One item, up to its body or semicolon.
                    let end = end_of_item(&tokens, i);
                    if !mem::take(&mut for_tests) {
                        self.define(at, &tokens[i..end]);
                        self.paths_in(at, &tokens[i..end]);
                    }
                    i = end;
                }
            }
        }
        at
    }

    fn define(&mut self, at: usize, item: &[TokenTree]) {
        for (i, token) in item.iter().enumerate() {
            let TokenTree::Ident(word) = token else { continue };
            if word == "impl" {
                return;
            }
            if DEFINES.iter().any(|known| word == known) {
                let name = item[i + 1..].iter().find_map(|token| match token {
                    TokenTree::Ident(name) if name != "fn" && name != "unsafe" && name != "mut" => {
                        Some(name.to_string())
                    }
                    _ => None,
                });
                self.modules[at].items.extend(name);
                return;
            }
        }
    }

    /// Reads the tree of an import behind `prefix`.
    fn import(&mut self, at: usize, tokens: &[TokenTree], prefix: &[String]) {
        let mut path = prefix.to_vec();
        let mut alias = None;
        let mut i = 0;
        while i < tokens.len() {
            match &tokens[i] {
                TokenTree::Ident(word) if word == "as" => {
                    alias = Some(tokens[i + 1].to_string());
                    i += 1;
                }
                TokenTree::Ident(word) if word == "self" && !path.is_empty() => {}
                TokenTree::Ident(word) => path.push(word.to_string()),
                TokenTree::Group(list) => {
                    let inside: Vec<TokenTree> = list.stream().into_iter().collect();
                    for part in inside.split(|token| is_mark(token, ',')).filter(|part| !part.is_empty()) {
                        self.import(at, part, &path);
                    }
                    return;
                }
                TokenTree::Punct(mark) if mark.as_char() == '*' => {
                    self.modules[at].globs.push(path);
                    return;
                }
                _ => {}
            }
            i += 1;
        }
        let name = alias.unwrap_or_else(|| path.last().unwrap().clone());
        if name == "_" {
            self.modules[at].used.push(path);
        } else {
            self.modules[at].imports.insert(name, path);
        }
    }

    /// Collects the paths of code, in bodies and macros too.
    fn paths_in(&mut self, at: usize, tokens: &[TokenTree]) {
        let mut i = 0;
        while i < tokens.len() {
            match &tokens[i] {
                TokenTree::Group(group) => {
                    let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                    self.paths_in(at, &inside);
                    i += 1;
                }
                TokenTree::Ident(word) if word == "use" => {
                    let end = (i..tokens.len()).find(|&j| is_mark(&tokens[j], ';')).unwrap_or(tokens.len());
                    // An import inside a body counts as the module's; `use<'a>` of a return type is not an import.
                    if tokens.get(i + 1).is_some_and(|next| matches!(next, TokenTree::Ident(_))) {
                        self.import(at, &tokens[i + 1..end], &[]);
                        i = end;
                    } else {
                        i += 1;
                    }
                }
                TokenTree::Ident(word) => {
                    let preceded = i > 0 && is_mark(&tokens[i - 1], '.') && !(i > 1 && is_mark(&tokens[i - 2], '.'));
                    let mut path = vec![word.to_string()];
                    while i + 3 < tokens.len()
                        && is_mark(&tokens[i + 1], ':')
                        && is_mark(&tokens[i + 2], ':')
                        && matches!(tokens[i + 3], TokenTree::Ident(_))
                    {
                        path.push(tokens[i + 3].to_string());
                        i += 3;
                    }
                    if !preceded {
                        self.modules[at].used.push(path);
                    }
                    i += 1;
                }
                _ => i += 1,
            }
        }
    }

    /// Returns, for each file, the files that define the names it uses.
    fn names(&self) -> Vec<BTreeSet<usize>> {
        let mut names = vec![BTreeSet::new(); self.paths.len()];
        for (at, module) in self.modules.iter().enumerate() {
            for path in module.imports.values().chain(&module.globs).chain(&module.used) {
                let mut found = BTreeSet::new();
                self.resolve(at, path, &mut found, 0);
                found.remove(&module.file);
                names[module.file].extend(found);
            }
        }
        names
    }

    /// Finds the file that defines the item that `path` names in module `at`, through re-exports.
    fn resolve(&self, at: usize, path: &[String], found: &mut BTreeSet<usize>, depth: usize) {
        // Globs may name each other's modules.
        if depth > DEEPEST {
            return;
        }
        let Some((first, rest)) = path.split_first() else { return };
        let module = &self.modules[at];
        match first.as_str() {
            "crate" => return self.resolve(0, rest, found, depth + 1),
            "self" => return self.resolve(at, rest, found, depth + 1),
            "super" => return self.resolve(module.parent, rest, found, depth + 1),
            _ => {}
        }
        if let Some(&child) = module.children.get(first) {
            // A path that ends here names the module, not what is in it.
            self.resolve(child, rest, found, depth + 1);
        } else if module.items.contains(first) {
            found.insert(module.file);
        } else if let Some(import) = module.imports.get(first) {
            let whole: Vec<String> = import.iter().chain(rest).cloned().collect();
            if whole != path {
                self.resolve(at, &whole, found, depth + 1);
            }
        } else {
            for glob in &module.globs {
                let whole: Vec<String> = glob.iter().chain(path).cloned().collect();
                self.resolve(at, &whole, found, depth + 1);
            }
        }
    }
}

fn is_mark(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark)
}

/// Returns the index one past the item that begins at `start`.
fn end_of_item(tokens: &[TokenTree], start: usize) -> usize {
    let mut has_assignment = false;
    for (i, token) in tokens.iter().enumerate().skip(start) {
        match token {
            TokenTree::Punct(mark) if mark.as_char() == ';' => return i + 1,
            TokenTree::Punct(mark) if mark.as_char() == '=' => has_assignment = true,
            TokenTree::Group(body) if body.delimiter() == Delimiter::Brace && !has_assignment => {
                return i + 1;
            }
            _ => {}
        }
    }
    tokens.len()
}

/// Writes a crate of these files and returns its circles, by names of files.
fn circles_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("imports");
    for (name, text) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let circles = Files::read(&folder.join("lib.rs")).circles();
    let name = |path: PathBuf| path.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
    circles.into_iter().map(|circle| circle.into_iter().map(name).collect()).collect()
}

#[test]
fn circles_between_files_are_found_through_reexports_and_macros() {
    let a = ("a/mod.rs", "pub mod leaf;\nmod work;\npub use leaf::Leaf;\npub fn run() { work::done(); }");
    let leaf = ("a/leaf.rs", "pub struct Leaf;");
    let work = |text| [("lib.rs", "mod a; mod b;"), a, leaf, ("b.rs", "pub fn b() {}"), ("a/work.rs", text)];
    // A name that the module file re-exports belongs to the leaf.
    assert!(circles_of(&work("use super::Leaf; pub fn done() -> Leaf { crate::b::b(); Leaf }")).is_empty());
    let both = [["a/mod.rs".to_owned(), "a/work.rs".to_owned()].to_vec()];
    assert_eq!(circles_of(&work("use super::run; pub fn done() { run() }")), both);
    assert_eq!(circles_of(&work("pub fn done() { vec![super::run()]; }")), both);
    assert_eq!(circles_of(&work("pub fn done() { use crate::a::*; run() }")), both);
    // Tests may look at everything.
    assert!(circles_of(&work("pub fn done() {} #[cfg(test)] mod tests { use super::super::run; }")).is_empty());
    assert!(circles_of(&work("pub fn done() {} #[cfg(test)] use super::run;")).is_empty());
}
