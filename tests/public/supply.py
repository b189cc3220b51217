#!/usr/bin/env python3
"""Checks the licences, sources and duplicate versions of all packages in Cargo.lock against tests/public/supply.toml.

Usage: supply.py               checks itself as below, then the packages
       supply.py --self-test   checks this program only, on made-up packages

Exit code 0 if the rules allow every package, 1 with one line for each fault, 2 if the packages cannot be listed.

Packages for tests, for other targets and for features that are off count as well. A package passes if

* its licence, an SPDX expression or the older `MIT/Apache-2.0`, is met by the licences that the rules allow,
* it belongs to the workspace, or comes from an allowed registry and has a checksum in Cargo.lock,
* no other incompatible version of it is in Cargo.lock, or the rules name both.

An entry of the rules that no package needs is a fault, too. `cargo deny check licenses sources bans` checks the
same; it is not used because installing it compiles for more than two minutes. Python 3.11, standard library only.
"""
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RULES = ROOT / "tests" / "public" / "supply.toml"
TOKEN = re.compile(r"\s*(?:([()/])|([A-Za-z0-9.+:-]+))")
OPERATORS = {"AND", "OR", "WITH"}


class Failure(Exception):
    """A text that cannot be read: found X, expected Y."""


def tokens(text):
    """The words and signs of a licence expression, each with its column, and the end of the text as the last."""
    found, at = [], 0
    while at < len(text.rstrip()):
        match = TOKEN.match(text, at)
        if not match:
            column = at + len(text[at:]) - len(text[at:].lstrip()) + 1
            raise Failure(f"found `{text[column - 1]}` at column {column}, expected a licence or AND, OR, WITH, ( or )")
        word = match[1] or match[2]
        found.append(("OR" if word == "/" else word, match.end() - len(word) + 1))
        at = match.end()
    return [*found, (None, len(text) + 1)]


def parsed(text):
    """The tree of a licence expression: a licence as a string, or ("OR" | "AND", left, right).

    WITH binds closer than AND, and AND closer than OR; `/` is an older sign for OR.
    """
    rest = tokens(text)

    def refuse(expected):
        word, column = rest[0]
        raise Failure(f"found {'the end' if word is None else f'`{word}`'} at column {column}, expected {expected}")

    def licence(expected):
        if rest[0][0] is None or rest[0][0] in OPERATORS | {"(", ")"}:
            refuse(expected)
        return rest.pop(0)[0]

    def simple():
        if rest[0][0] == "(":
            rest.pop(0)
            inner = chain("OR", lambda: chain("AND", simple))
            if rest[0][0] != ")":
                refuse("AND, OR or )")
            rest.pop(0)
            return inner
        name = licence("a licence or (")
        if rest[0][0] == "WITH":
            rest.pop(0)
            name += f" WITH {licence('an exception')}"
        return name

    def chain(operator, part):
        tree = part()
        while rest[0][0] == operator:
            rest.pop(0)
            tree = (operator, tree, part())
        return tree

    tree = chain("OR", lambda: chain("AND", simple))
    if rest[0][0] is not None:
        refuse("AND, OR or the end")
    return tree


def met(tree, allowed):
    """True if the allowed licences are enough for the expression."""
    if isinstance(tree, str):
        return tree in allowed
    operator, left, right = tree
    return (any if operator == "OR" else all)(met(part, allowed) for part in (left, right))


def line_of(version):
    """The version up to its first number that is not 0: packages with the same are compatible for cargo."""
    numbers = re.split(r"[-+]", version)[0].split(".")
    first = next((at for at, number in enumerate(numbers) if number != "0"), len(numbers) - 1)
    return ".".join(numbers[: first + 1])


def order(line):
    return [int(number) for number in line.split(".")]


def licence_faults(packages, allowed):
    """Packages that the allowed licences do not cover, and allowed licences that no package needs."""
    faults, trees = [], []
    for package in packages:
        name, text = f"{package['name']} {package['version']}", package["license"]
        if not text:
            faults.append(f"{name}: found no licence in its Cargo.toml, expected an SPDX expression")
            continue
        try:
            tree = parsed(text)
        except Failure as error:
            faults.append(f"{name}: licence `{text}`: {error}")
            continue
        trees.append(tree)
        if not met(tree, allowed):
            expected = f"expected one that {', '.join(sorted(allowed))} meet"
            faults.append(f"{name}: found the licence `{text}`, {expected}")
    for licence in allowed:
        if all(met(tree, allowed - {licence}) or not met(tree, allowed) for tree in trees):
            faults.append(f"supply.toml: no package needs the licence {licence}; remove it")
    return faults


def source_faults(metadata, lock, allowed):
    """Packages of other origins or without a checksum, and packages of Cargo.lock that cargo's metadata lacks."""
    faults, unused, members = [], set(allowed), set(metadata["workspace_members"])
    checksums = {(entry["name"], entry["version"], entry.get("source")): entry.get("checksum") for entry in lock}
    reached = set()
    for package in metadata["packages"]:
        name, source = f"{package['name']} {package['version']}", package["source"]
        key = (package["name"], package["version"], source)
        reached.add(key)
        if source is None:
            if package["id"] not in members:
                path = package["manifest_path"]
                faults.append(f"{name}: found the path {path}, expected a package of this workspace")
        elif source not in allowed:
            faults.append(f"{name}: found the source {source}, expected {' or '.join(sorted(allowed))}")
        else:
            unused.discard(source)
            if not re.fullmatch("[0-9a-f]{64}", checksums.get(key) or ""):
                faults.append(f"{name}: found no SHA-256 in Cargo.lock, expected one for a package of a registry")
    for name, version, _ in sorted(checksums.keys() - reached, key=str):
        faults.append(f"{name} {version}: in Cargo.lock, but not in the output of cargo metadata; it was not checked")
    faults += [f"supply.toml: no package comes from {source}; remove it" for source in sorted(unused)]
    return faults


def duplicate_faults(packages, rules):
    """Packages in several versions that the rules do not name, and entries that are not what Cargo.lock has."""
    faults, lines = [], {}
    for package in packages:
        lines.setdefault(package["name"], []).append(line_of(package["version"]))
    accepted = {entry["name"]: sorted(entry["lines"], key=order) for entry in rules}
    for name in sorted(lines.keys() | accepted.keys()):
        found = sorted(lines.get(name, []), key=order)
        expected = accepted.get(name)
        if expected is None and len(found) > 1:
            faults.append(
                f"{name}: found the versions {', '.join(found)}, expected one; unite them, or name both in supply.toml "
                f"with a reason (`cargo tree --target all -i {name}@VERSION` shows who needs one)"
            )
        elif expected is not None and len(found) < 2:
            faults.append(f"supply.toml: {name} is a duplicate no more; remove its entry")
        elif expected is not None and found != expected:
            listed = f"{', '.join(expected)} as in supply.toml"
            faults.append(f"{name}: found the versions {', '.join(found)}, expected {listed}")
    return faults


def rules_of(text):
    """The rules, complete and each with a reason; raises `Failure` otherwise."""
    try:
        rules = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise Failure(str(error)) from error
    keys = {"sources", "licences", "duplicate", "advisory"}
    if rules.keys() != keys:
        raise Failure(f"found the keys {', '.join(sorted(rules))}, expected {', '.join(sorted(keys))}")
    for table in ("sources", "licences"):
        for name, reason in rules[table].items():
            if not isinstance(reason, str) or not reason.strip():
                raise Failure(f"{table}: {name} has no reason")
    for table, fields in (("duplicate", {"name", "lines", "reason"}), ("advisory", {"id", "package", "reason"})):
        for entry in rules[table]:
            if entry.keys() != fields or not all(entry.values()):
                raise Failure(f"[[{table}]]: found {entry}, expected values for {', '.join(sorted(fields))}")
        names = [entry["name" if table == "duplicate" else "id"] for entry in rules[table]]
        for name in {name for name in names if names.count(name) > 1}:
            raise Failure(f"[[{table}]]: {name} stands twice")
    return rules


def faults(metadata, lock, rules):
    packages = metadata["packages"]
    return [
        *source_faults(metadata, lock, set(rules["sources"])),
        *licence_faults(packages, set(rules["licences"])),
        *duplicate_faults(packages, rules["duplicate"]),
    ]


def output(*words):
    """Standard output of a program in the root of the repository."""
    try:
        run = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    except OSError as error:
        raise Failure(f"{words[0]}: {error.strerror}; install it") from error
    if run.returncode != 0:
        raise Failure(f"`{' '.join(words)}` failed:\n{run.stderr.strip()}")
    return run.stdout


def metadata_of_all():
    """cargo's description of all packages, for every target and with every feature."""
    return json.loads(output("cargo", "metadata", "--locked", "--format-version", "1", "--all-features"))


def locked(path=ROOT / "Cargo.lock"):
    """The packages of a Cargo.lock."""
    return tomllib.loads(path.read_text())["package"]


def self_test():
    """Expressions, versions and made-up packages, good and bad."""

    def shown(text):
        try:
            return parsed(text)
        except Failure as error:
            return str(error)

    trees = {
        "MIT": "MIT",
        "MIT/Apache-2.0": ("OR", "MIT", "Apache-2.0"),
        "Apache-2.0 / MIT": ("OR", "Apache-2.0", "MIT"),
        "A OR B AND C": ("OR", "A", ("AND", "B", "C")),
        "A AND B OR C": ("OR", ("AND", "A", "B"), "C"),
        "(A OR B) AND C": ("AND", ("OR", "A", "B"), "C"),
        "((A))": "A",
        "A WITH X OR GPL-2.0+": ("OR", "A WITH X", "GPL-2.0+"),
        "": "found the end at column 1, expected a licence or (",
        "MIT OR": "found the end at column 7, expected a licence or (",
        "OR MIT": "found `OR` at column 1, expected a licence or (",
        "MIT Apache-2.0": "found `Apache-2.0` at column 5, expected AND, OR or the end",
        "MIT or Apache-2.0": "found `or` at column 5, expected AND, OR or the end",
        "(MIT": "found the end at column 5, expected AND, OR or )",
        "MIT)": "found `)` at column 4, expected AND, OR or the end",
        "A WITH": "found the end at column 7, expected an exception",
        "A WITH (B)": "found `(` at column 8, expected an exception",
        "(A) WITH B": "found `WITH` at column 5, expected AND, OR or the end",
        "MIT,  ISC": "found `,` at column 4, expected a licence or AND, OR, WITH, ( or )",
    }
    for text, tree in trees.items():
        assert shown(text) == tree, (text, shown(text), tree)
    allowed = {"MIT", "ISC", "A WITH X"}
    for text in ["MIT", "GPL-3.0 OR MIT", "MIT AND ISC", "(GPL-3.0 OR MIT) AND ISC", "GPL-3.0/ISC", "A WITH X"]:
        assert met(parsed(text), allowed), text
    for text in ["GPL-3.0", "MIT AND GPL-3.0", "A", "A WITH Y", "MIT WITH X", "mit", "(MIT OR ISC) AND GPL-3.0"]:
        assert not met(parsed(text), allowed), text
    lines = {"1.2.3": "1", "0.22.1": "0.22", "0.0.3": "0.0.3", "0.9.0-rc.1": "0.9", "1.1.0+a-1": "1", "0.0.0": "0.0.0"}
    for version, line in lines.items():
        assert line_of(version) == line, (version, line_of(version))

    registry, digest = "registry+here", "0" * 64
    rules = {"sources": {registry: "r"}, "licences": {"MIT": "r"}, "duplicate": [], "advisory": []}

    def package(name, version="1.0.0", licence="MIT", source=registry):
        place = {"id": f"{name} {version}", "manifest_path": f"/{name}/Cargo.toml"}
        return {"name": name, "version": version, "license": licence, "source": source, **place}

    def found(packages, changes={}, lock=None, members=("own 1.0.0",)):
        entries = [{**entry, "checksum": digest} if entry["source"] else entry for entry in packages]
        metadata = {"packages": packages, "workspace_members": list(members)}
        return faults(metadata, entries if lock is None else lock, {**rules, **changes})

    own, a = package("own", source=None), package("a")
    assert found([own, a]) == []
    both = [a, package("a", "2.1.0")]
    pair = {"name": "a", "lines": ["2", "1"], "reason": "r"}
    cases = [
        ("expected one that MIT meet", found([own, a, package("b", licence="GPL-3.0")])),
        ("found no licence", found([own, a, package("b", licence=None)])),
        ("licence `MIT AND`: found the end", found([own, a, package("b", licence="MIT AND")])),
        ("no package needs the licence ISC", found([own, a], {"licences": {"MIT": "r", "ISC": "r"}})),
        ("found the source git+there, expected registry+here", found([own, a, package("b", source="git+there")])),
        ("found the path /own/Cargo.toml", found([own, a], members=())),
        ("no package comes from registry+old", found([own, a], {"sources": {registry: "r", "registry+old": "r"}})),
        ("found no SHA-256", found([own, a], lock=[own, a])),
        ("b 1.0.0: in Cargo.lock, but not", found([own, a], lock=[own, {**a, "checksum": digest}, package("b")])),
        ("found the versions 1, 2, expected one", found([own, *both])),
        ("a is a duplicate no more", found([own, a], {"duplicate": [pair]})),
        ("b is a duplicate no more", found([own, a], {"duplicate": [{**pair, "name": "b"}]})),
        ("found the versions 1, 2, expected 1, 3", found([own, *both], {"duplicate": [{**pair, "lines": ["1", "3"]}]})),
    ]
    for words, lines in cases:
        assert len(lines) == 1 and words in lines[0], (words, lines)
    assert found([own, *both], {"duplicate": [pair]}) == []
    for text in ["", "[sources]\nx = ''\n[licences]\n[[duplicate]]\n[[advisory]]", "[licences", "sources = 1"]:
        try:
            rules_of(text)
        except Failure:
            continue
        raise AssertionError(text)


def main(arguments):
    if arguments not in ([], ["--self-test"]):
        sys.exit(__doc__)
    self_test()
    if arguments:
        print("supply.py reads expressions and finds made-up faults")
        return 0
    try:
        rules = rules_of(RULES.read_text())
    except (OSError, Failure) as error:
        print(f"{RULES.relative_to(ROOT)}: {error}", file=sys.stderr)
        return 2
    try:
        metadata, lock = metadata_of_all(), locked()
    except (OSError, ValueError, Failure) as error:
        print(f"supply.py: the packages cannot be listed: {error}", file=sys.stderr)
        return 2
    wrong = faults(metadata, lock, rules)
    if wrong:
        print("\n".join(wrong), file=sys.stderr)
        return 1
    print(f"{len(lock)} packages, all of this workspace or from {', '.join(sorted(rules['sources']))}")
    print(f"licences that all of them can be used under: {', '.join(sorted(rules['licences']))}")
    print(f"{len(rules['duplicate'])} packages in more than one version, each with a reason in supply.toml")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
