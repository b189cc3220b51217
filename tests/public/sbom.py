#!/usr/bin/env python3
"""Lists the packages that the program is built from for Linux, as a software bill of materials in CycloneDX 1.6.

Usage: sbom.py write       writes docs/sbom.cdx.json
       sbom.py check       exit code 1 if that file is not what Cargo.lock says, or the Dockerfile leaves it out

The file has every package that `cargo tree` names as a normal or build dependency of `wavelume` for one of TARGETS: its
version, licence, package URL, SHA-256 in Cargo.lock and dependencies. Packages that only the build needs have the scope
`excluded`. The file has no date, so that the same Cargo.lock gives the same bytes. It is kept in the repository because
the stage of the Dockerfile that compiles has no Python. `check` compares it with `cargo tree` and Cargo.lock twice: by
its own reading, and with what `write` would write. Python 3.11, standard library only.
"""
import difflib
import json
import re
import sys
import uuid
from urllib.parse import quote

from supply import Failure, ROOT, locked, metadata_of_all, output, parsed

FILE = ROOT / "docs" / "sbom.cdx.json"
IN_THE_IMAGE = "/usr/share/doc/wavelume/"
PROGRAM = "wavelume"
TARGETS = ("x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu")
# Namespace of serial numbers: fixed, so that the same packages have the same serial number.
NAMESPACE = uuid.UUID("0d5bb4b0-0b0c-4f0a-9f0e-6b1c5d7a2e43")
# A line of `cargo tree --prefix depth`.
BRANCH = re.compile(r"(\d+)([A-Za-z][\w-]*) v(\S+)")


def tree(kinds, target):
    """Packages as pairs of name and version, each with those that it depends on, as cargo resolves them for a build."""
    words = ["--package", PROGRAM, "--edges", kinds, "--target", target, "--prefix", "depth"]
    above, found = [], {}
    for line in output("cargo", "tree", "--locked", *words).splitlines():
        match = BRANCH.match(line)
        if not match:
            raise Failure(f"cargo tree: found the line `{line}`, expected a depth, a name and a version")
        package = (match[2], match[3])
        del above[int(match[1]) :]
        found.setdefault(package, set())
        if above:
            found[above[-1]].add(package)
        above.append(package)
    return found


def united(kinds):
    """The trees of all targets as one."""
    found = {}
    for target in TARGETS:
        for package, needs in tree(kinds, target).items():
            found.setdefault(package, set()).update(needs)
    return found


def purl(package):
    """The package URL: the same name for the package in every tool."""
    return f"pkg:cargo/{package[0]}@{quote(package[1], safe='')}"


def expression(part, inside=None):
    """The licence in today's form of SPDX, from the tree that `parsed` makes."""
    if isinstance(part, str):
        return part
    operator, left, right = part
    text = f"{expression(left, operator)} {operator} {expression(right, operator)}"
    return f"({text})" if inside not in (None, operator) else text


def component(package, licence, checksum, is_linked):
    """One entry of the list; packages of the workspace have no checksum."""
    return {
        "type": "application" if package[0] == PROGRAM else "library",
        "bom-ref": purl(package),
        "name": package[0],
        "version": package[1],
        "scope": "required" if is_linked else "excluded",
        **({"hashes": [{"alg": "SHA-256", "content": checksum}]} if checksum else {}),
        "licenses": [{"expression": expression(parsed(licence))}],
        "purl": purl(package),
    }


def bill():
    """The text of the file."""
    packages, linked = united("normal,build"), united("normal,no-proc-macro")
    licences = {(entry["name"], entry["version"]): entry["license"] for entry in metadata_of_all()["packages"]}
    checksums = {(entry["name"], entry["version"]): entry.get("checksum") for entry in locked()}
    listed = [
        component(package, licences[package], checksums[package], package in linked) for package in sorted(packages)
    ]
    main = next(entry for entry in listed if entry["name"] == PROGRAM)
    content = {
        "metadata": {
            "lifecycles": [{"phase": "pre-build"}],
            "component": {key: value for key, value in main.items() if key != "scope"},
            "properties": [{"name": "wavelume:target", "value": target} for target in TARGETS],
        },
        "components": [entry for entry in listed if entry is not main],
        "dependencies": [
            {"ref": purl(package), "dependsOn": [purl(other) for other in sorted(needs)]}
            for package, needs in sorted(packages.items())
        ],
    }
    head = {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": uuid.uuid5(NAMESPACE, json.dumps(content)).urn,
        "version": 1,
    }
    return json.dumps(head | content, indent=1) + "\n"


def faults(text, dockerfile):
    """Differences between the file and what Cargo.lock and `cargo tree` say, read without the code that writes it."""
    try:
        document = json.loads(text)
        main = document["metadata"]["component"]
        listed = {(entry["name"], entry["version"]): entry for entry in [main, *document["components"]]}
        count = 1 + len(document["components"])
    except (ValueError, KeyError, TypeError) as error:
        return [f"{FILE.name}: {error!r}; expected a bill of materials in CycloneDX"]
    found = [] if count == len(listed) else [f"{FILE.name}: {count} entries for {len(listed)} packages"]
    expected = set()
    for target in TARGETS:
        words = ["--edges", "normal,build", "--target", target, "--prefix", "none", "--format", "{p}"]
        for line in output("cargo", "tree", "--locked", "--package", PROGRAM, *words).splitlines():
            name, version = line.split()[:2]
            expected.add((name, version.removeprefix("v")))
    found += [f"{FILE.name}: {' '.join(package)} is missing" for package in sorted(expected - listed.keys())]
    found += [f"{FILE.name}: {' '.join(package)} is no dependency" for package in sorted(listed.keys() - expected)]
    checksums = {(entry["name"], entry["version"]): entry.get("checksum") for entry in locked()}
    for package, entry in sorted(listed.items()):
        name, digest = " ".join(package), checksums.get(package)
        hashes = [{"alg": "SHA-256", "content": digest}] if digest else None
        if entry.get("hashes") != hashes:
            found.append(f"{FILE.name}: {name}: found the hashes {entry.get('hashes')}, expected {hashes}")
        if entry.get("purl") != f"pkg:cargo/{package[0]}@{package[1].replace('+', '%2B')}":
            found.append(f"{FILE.name}: {name}: found the package URL {entry.get('purl')}")
        if not all(licence.get("expression") for licence in entry.get("licenses") or [{}]):
            found.append(f"{FILE.name}: {name} has no licence")
    copied = [line.split()[1:] for line in dockerfile.splitlines() if line.startswith("COPY ")]
    if not any(str(FILE.relative_to(ROOT)) in words[:-1] and words[-1] == IN_THE_IMAGE for words in copied):
        found.append(f"Dockerfile: found no COPY of {FILE.relative_to(ROOT)} to {IN_THE_IMAGE}")
    return found


def main(arguments):
    if arguments not in (["write"], ["check"]):
        sys.exit(__doc__)
    text = bill()
    if arguments == ["write"]:
        FILE.write_text(text)
        return 0
    try:
        current = FILE.read_text()
    except OSError as error:
        raise Failure(f"{FILE}: {error.strerror}; python3 tests/public/sbom.py write") from error
    found = faults(current, (ROOT / "Dockerfile").read_text())
    if current != text:
        lines = difflib.unified_diff(current.splitlines(), text.splitlines(), "found", "expected", n=1, lineterm="")
        found = found or list(lines)[:20]
        found.append(f"{FILE.name} is out of date; python3 tests/public/sbom.py write")
    if found:
        print("\n".join(found), file=sys.stderr)
        return 1
    count = len(json.loads(current)["components"])
    print(f"{FILE.name} lists the {count} packages that {PROGRAM} is built from for {' and '.join(TARGETS)}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except (OSError, KeyError, ValueError, Failure) as error:
        print(f"sbom.py: {error}", file=sys.stderr)
        sys.exit(2)
