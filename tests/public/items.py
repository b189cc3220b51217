#!/usr/bin/env python3
"""Lists every documented public item of the library crates, so that none appears, changes or vanishes unnoticed.

    items.py write      writes docs/public-items.txt
    items.py check      compares that file with the sources

Exit code 0 if they agree, 1 with a diff if not, 2 if the items cannot be listed.

Each line has an item's path, kind and signature. Items stand where users see them: a re-export under its own path, a
method under its type. Items hidden by `#[doc(hidden)]` are left out. The line of a type names the traits it implements,
without blanket implementations; of the automatic traits only a missing Send or Sync is shown.

The items come from rustdoc's JSON. The stable toolchain writes it if rustdoc's unstable options are allowed, which
tests/public/rustdoc does for that one program: dependencies in cargo's target directory stay compiled. Standard library
only.
"""
import difflib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIST = ROOT / "docs" / "public-items.txt"
CRATES = ("wavelume-core", "wavelume-formats", "wavelume")
# Versions of rustdoc's JSON format (`rustdoc_types::FORMAT_VERSION`) that this file reads: 57 is that of Rust 1.95.
FORMATS = (57,)
# Implemented by derives beside the trait that was asked for.
UNSAID = {"StructuralPartialEq"}
# Automatic traits whose absence is told.
AUTOMATIC = {"Send", "Sync"}


class Failure(Exception):
    """Why nothing can be said, and what to do."""


def documented():
    """Runs rustdoc; returns its JSON of each crate, by name."""
    target = Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target")
    files = {name: ROOT / target / "doc" / f"{name.replace('-', '_')}.json" for name in CRATES}
    # Flags that differ from run to run make cargo run rustdoc again, whatever it finds in the directory.
    flags = f'-Zunstable-options --output-format=json --cfg=items="{time.time_ns()}"'
    environment = os.environ | {"RUSTDOC": str(Path(__file__).with_name("rustdoc")), "RUSTDOCFLAGS": flags}
    packages = [argument for name in CRATES for argument in ("--package", name)]
    command = ["cargo", "doc", "--locked", "--profile", "test", "--quiet", "--no-deps", "--lib", *packages]
    if subprocess.run(command, cwd=ROOT, env=environment).returncode != 0:
        raise Failure("rustdoc failed, see above; `cargo doc --workspace --no-deps` must pass first")
    found = {}
    for name, file in files.items():
        try:
            crate = json.loads(file.read_text())
        except (OSError, ValueError) as error:
            raise Failure(f"{file}: {error}; expected the JSON that rustdoc writes") from error
        version = crate.get("format_version")
        if version not in FORMATS:
            raise Failure(
                f"{file}: format version {version}, expected {' or '.join(map(str, FORMATS))} (Rust 1.95); read the "
                "changelog of the crate rustdoc-types, add the version to FORMATS in tests/public/items.py, and "
                "see that the list keeps its lines"
            )
        found[name] = crate
    return found


def rename(found, names):
    """Gives re-exported types the names of their re-exports wherever they are mentioned."""
    if isinstance(found, dict):
        if found.get("id") in names and "path" in found:
            found["path"] = names[found["id"]]
        found = list(found.values())
    if isinstance(found, list):
        for part in found:
            rename(part, names)


def one(tagged):
    """Splits `{kind: content}`, or a kind without content."""
    return (tagged, None) if isinstance(tagged, str) else next(iter(tagged.items()))


def arguments(args):
    """Renders generic arguments, `<'a, T, Item = U>`."""
    if args is None:
        return ""
    kind, content = one(args)
    if kind == "parenthesized":
        return f"({', '.join(map(type_of, content['inputs']))}){returned(content['output'])}"
    if kind == "return_type_notation":
        return "(..)"
    render = {"lifetime": str, "type": type_of, "const": lambda value: value["expr"], "infer": lambda _: "_"}
    parts = []
    for argument in content["args"]:
        kind, value = one(argument)
        parts.append(render[kind](value))
    for constraint in content["constraints"]:
        kind, value = one(constraint["binding"])
        name = constraint["name"] + arguments(constraint["args"])
        parts.append(f"{name}: {bounds(value)}" if kind == "constraint" else f"{name} = {term(value)}")
    return f"<{', '.join(parts)}>" if parts else ""


def term(value):
    kind, content = one(value)
    return type_of(content) if kind == "type" else content["expr"]


def last(path):
    return path.rsplit("::", 1)[-1]


def path_of(path):
    words = path["path"].split("::")
    # `Error` and `Result` are many: those keep the module that they were written with.
    kept = 2 if words[-1] in ("Error", "Result") else 1
    return "::".join(words[-kept:]) + arguments(path["args"])


def bounds(found):
    parts = []
    for bound in found:
        kind, content = one(bound)
        if kind == "trait_bound":
            marks = {"none": "", "maybe": "?", "maybe_const": "[const] "}[content["modifier"]]
            parts.append(higher(content["generic_params"]) + marks + path_of(content["trait"]))
        else:
            parts.append(content if kind == "outlives" else f"use<{', '.join(one(p)[1] for p in content)}>")
    return " + ".join(parts)


def higher(params):
    return f"for<{', '.join(p['name'] for p in params)}> " if params else ""


def type_of(found):
    """Renders a type as it is written, paths by their last name."""
    kind, t = one(found)
    if kind == "resolved_path":
        return path_of(t)
    if kind in ("generic", "primitive"):
        return {"never": "!", "unit": "()"}.get(t, t) if kind == "primitive" else t
    if kind == "tuple":
        return f"({', '.join(map(type_of, t))}{',' if len(t) == 1 else ''})"
    if kind == "slice":
        return f"[{type_of(t)}]"
    if kind == "array":
        return f"[{type_of(t['type'])}; {t['len']}]"
    if kind == "borrowed_ref":
        lifetime = f"{t['lifetime']} " if t["lifetime"] else ""
        inner = type_of(t["type"])
        if one(t["type"])[0] in ("dyn_trait", "impl_trait") and " + " in inner:
            inner = f"({inner})"
        return f"&{lifetime}{'mut ' if t['is_mutable'] else ''}{inner}"
    if kind == "raw_pointer":
        return f"*{'mut' if t['is_mutable'] else 'const'} {type_of(t['type'])}"
    if kind == "impl_trait":
        return f"impl {bounds(t)}"
    if kind == "dyn_trait":
        traits = [higher(b["generic_params"]) + path_of(b["trait"]) for b in t["traits"]]
        return f"dyn {' + '.join(traits + ([t['lifetime']] if t['lifetime'] else []))}"
    if kind == "qualified_path":
        name = t["name"] + arguments(t["args"])
        if not t["trait"] or not t["trait"]["path"]:
            return f"{type_of(t['self_type'])}::{name}"
        return f"<{type_of(t['self_type'])} as {path_of(t['trait'])}>::{name}"
    if kind == "function_pointer":
        return f"{higher(t['generic_params'])}{head(t['header'])}fn{signature(t['sig'])}"
    if kind == "infer":
        return "_"
    raise Failure(f"a type of kind {kind}, which tests/public/items.py cannot write; add it to type_of there")


def returned(output):
    return f" -> {type_of(output)}" if output else ""


def head(header):
    words = [word for word in ("const", "async", "unsafe") if header[f"is_{word}"]]
    kind, _ = one(header["abi"])
    words += [] if kind == "Rust" else [f'extern "{kind}"']
    return "".join(f"{word} " for word in words)


def signature(sig):
    inputs = []
    for name, found in sig["inputs"]:
        rendered = type_of(found)
        receivers = {"Self": "self", "&Self": "&self", "&mut Self": "&mut self"}
        inputs.append(receivers.get(rendered, f"self: {rendered}") if name == "self" else rendered)
    return f"({', '.join(inputs)}){returned(sig['output'])}"


def generics(found):
    """Renders the parameters in angle brackets, and the where clause; `impl Trait` stays where it is written."""
    parts = []
    for param in found["params"]:
        kind, content = one(param["kind"])
        if kind == "lifetime":
            outlives = " + ".join(content["outlives"])
            parts.append(param["name"] + (f": {outlives}" if outlives else ""))
        elif kind == "const":
            parts.append(f"const {param['name']}: {type_of(content['type'])}")
        elif not content["is_synthetic"]:
            limits = f": {bounds(content['bounds'])}" if content["bounds"] else ""
            default = f" = {type_of(content['default'])}" if content["default"] else ""
            parts.append(param["name"] + limits + default)
    clauses = []
    for predicate in found["where_predicates"]:
        kind, p = one(predicate)
        if kind == "bound_predicate":
            clauses.append(f"{higher(p['generic_params'])}{type_of(p['type'])}: {bounds(p['bounds'])}")
        elif kind == "lifetime_predicate":
            clauses.append(f"{p['lifetime']}: {' + '.join(p['outlives'])}")
        else:
            clauses.append(f"{type_of(p['lhs'])} == {term(p['rhs'])}")
    return f"<{', '.join(parts)}>" if parts else "", f" where {', '.join(clauses)}" if clauses else ""


def function(item):
    f = item["inner"]["function"]
    params, clauses = generics(f["generics"])
    return f"{head(f['header'])}fn{params}{signature(f['sig'])}{clauses}"


class Crate:
    """The public items of one crate, as lines."""

    def __init__(self, name, found):
        self.index = found["index"]
        self.paths = found["paths"]
        self.lines = set()
        uses = [item["inner"]["use"] for item in self.index.values() if "use" in item["inner"]]
        renamed = [use for use in uses if not use["is_glob"] and last(use["source"]) != use["name"]]
        rename(self.index, {use["id"]: use["name"] for use in renamed})
        self.open = []
        root = self.get(found["root"])
        self.items(name.replace("-", "_"), root["inner"]["module"]["items"])

    def get(self, key):
        return self.index.get(str(key))

    def items(self, path, keys):
        for key in keys:
            item = self.get(key)
            if item is not None:
                self.item(path, item)

    def item(self, above, item, name=None):
        kind, inner = one(item["inner"])
        if kind == "use":
            self.use(above, inner)
            return
        path = f"{above}::{name or item['name']}"
        if item["id"] in self.open:
            return
        self.open.append(item["id"])
        if kind == "module":
            self.lines.add(f"{path} mod")
            self.items(path, inner["items"])
        elif kind == "function":
            self.lines.add(f"{path} {function(item)}")
        elif kind in ("struct", "union", "enum"):
            self.type(path, item, kind, inner)
        elif kind == "trait":
            self.trait(path, inner)
        elif kind == "type_alias":
            params, clauses = generics(inner["generics"])
            self.lines.add(f"{path} type{params} = {type_of(inner['type'])}{clauses}")
        elif kind in ("constant", "assoc_const", "static"):
            self.lines.add(f"{path} {'static' if kind == 'static' else 'const'} {type_of(inner['type'])}")
        elif kind == "assoc_type":
            limits = f": {bounds(inner['bounds'])}" if inner["bounds"] else ""
            default = f" = {type_of(inner['type'])}" if inner["type"] else ""
            self.lines.add(f"{path} type{limits}{default}")
        elif kind == "struct_field":
            self.lines.add(f"{path} field {type_of(inner)}")
        elif kind == "variant":
            self.lines.add(f"{path} variant{self.variant(inner)}{mark(item)}")
        elif kind in ("macro", "proc_macro"):
            self.lines.add(f"{path} macro")
        else:
            raise Failure(f"{path}: an item of kind {kind}, which tests/public/items.py cannot list; add it there")
        self.open.pop()

    def use(self, above, use):
        """Follows a re-export inside the crate; one of another crate is a line."""
        target = self.get(use["id"]) if use["id"] is not None else None
        if target is None:
            known = self.paths.get(str(use["id"]))
            if known and known["crate_id"] == 0:
                return  # hidden where it is declared
            source = "::".join(known["path"]) if known else use["source"]
            self.lines.add(f"{above}::{'*' if use['is_glob'] else use['name']} use {source}")
        elif use["is_glob"]:
            kind, inner = one(target["inner"])
            self.items(above, inner["variants" if kind == "enum" else "items"])
        else:
            self.item(above, target, use["name"])

    def type(self, path, item, kind, inner):
        params, clauses = generics(inner["generics"])
        shape = ""
        fields = inner.get("variants", inner.get("fields", []))
        private = inner.get("has_stripped_variants", inner.get("has_stripped_fields"))
        if kind == "struct":
            form, content = one(inner["kind"])
            if form == "plain":
                fields, private = content["fields"], content["has_stripped_fields"]
            elif form == "tuple":
                fields, private = [key for key in content if key is not None], None in content
                shape = "()"
        hidden = " (others private)" if private and fields else " (private)" if private else ""
        traits = self.traits(inner["impls"], item["id"], path)
        listed = f": {', '.join(traits)}" if traits else ""
        self.lines.add(f"{path} {kind}{params}{shape}{clauses}{hidden}{mark(item)}{listed}")
        self.items(path, fields)

    def traits(self, impls, type_id, path):
        """The traits of a type, by name; its own items are listed on the way."""
        found = set()
        for key in impls:
            item = self.get(key)
            if item is None:
                continue
            implementation = item["inner"]["impl"]
            trait = implementation["trait"]
            if trait is None:
                self.items(path, implementation["items"])
                continue
            name = path_of(trait)
            if implementation["is_synthetic"]:
                if implementation["is_negative"] and name in AUTOMATIC:
                    found.add(f"!{name}")
            elif implementation["blanket_impl"] is None and name not in UNSAID and self.is_for(implementation, type_id):
                named = [self.get(i) for i in implementation["items"]]
                types = [
                    f"{i['name']} = {type_of(i['inner']['assoc_type']['type'])}"
                    for i in named
                    if i is not None and "assoc_type" in i["inner"]
                ]
                found.add(f"{name}{' with ' if types else ''}{' and '.join(types)}")
        return sorted(found)

    @staticmethod
    def is_for(implementation, type_id):
        """Tells an implementation for a type or a reference to it from one that only names it (`From<it> for
        Other`)."""
        kind, t = one(implementation["for"])
        if kind == "borrowed_ref":
            kind, t = one(t["type"])
        return kind == "resolved_path" and t["id"] == type_id

    def trait(self, path, inner):
        params, clauses = generics(inner["generics"])
        above = f": {bounds(inner['bounds'])}" if inner["bounds"] else ""
        self.lines.add(f"{path} {'unsafe ' if inner['is_unsafe'] else ''}trait{params}{above}{clauses}")
        for key in inner["items"]:
            item = self.get(key)
            if item is not None and "function" in item["inner"]:
                provided = " (provided)" if item["inner"]["function"]["has_body"] else ""
                self.lines.add(f"{path}::{item['name']} {function(item)}{provided}")
            elif item is not None:
                self.item(path, item)
        for key in inner["implementations"]:
            item = self.get(key)
            implementation = item and item["inner"]["impl"]
            kind, t = one(implementation["for"]) if implementation else (None, None)
            if kind is None or (kind == "resolved_path" and self.get(t["id"]) is not None):
                continue
            params, clauses = generics(implementation["generics"])
            self.lines.add(f"{path} impl{params} for {type_of(implementation['for'])}{clauses}")

    def variant(self, inner):
        form, content = one(inner["kind"])
        if form == "plain":
            return ""
        keys = content if form == "tuple" else content["fields"]
        found = [self.get(key) for key in keys if key is not None]
        rendered = [type_of(field["inner"]["struct_field"]) for field in found if field is not None]
        if form == "tuple":
            return f"({', '.join(rendered)})"
        names = [field["name"] for field in found if field is not None]
        return f" {{ {', '.join(f'{name}: {t}' for name, t in zip(names, rendered))} }}"


def mark(item):
    return " non_exhaustive" if "non_exhaustive" in item["attrs"] else ""


def listing():
    lines = []
    for name, found in documented().items():
        lines += [f"# {name}", *sorted(Crate(name, found).lines), ""]
    return "\n".join(lines)


def main(arguments):
    if arguments not in (["write"], ["check"]):
        print(f"items.py: found {' '.join(arguments) or 'no command'}, expected `write` or `check`", file=sys.stderr)
        return 2
    try:
        found = listing()
    except Failure as failure:
        print(f"items.py: {failure}", file=sys.stderr)
        return 2
    if arguments == ["write"]:
        LIST.write_text(found)
        return 0
    listed = LIST.read_text() if LIST.exists() else ""
    if found == listed:
        return 0
    name = str(LIST.relative_to(ROOT))
    diff = difflib.unified_diff(listed.splitlines(), found.splitlines(), name, "the sources", n=0, lineterm="")
    print("\n".join(diff))
    print(
        f"The public items are not those of {name}. If the change is meant, write the list anew with\n"
        "  python3 tests/public/items.py write\n"
        "and commit it; if not, make the item pub(crate), or #[doc(hidden)] if another crate of the project needs it."
    )
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
