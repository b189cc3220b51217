#!/usr/bin/env python3
"""Draws comments, messages and help texts for somebody who has not seen the code, to say what each describes.

Usage: sentences.py SEED [COMMENTS MESSAGES HELP]        (60, 20 and 10 without numbers)

Each line is the number, the kind and the text; with --where the file and line stand behind it, and --count prints only
how many there are of each kind. The same seed draws the same sentences from the same code.

A message is a sentence of four words or more in the code, outside of tests, SQL and assertions: errors, details and
titles of problems, refusals of parsers, notes, findings of `doctor`, lines of the log. A help text is the comment on an
option of the command line or on a declared option, which the command line shows.
"""
import os
import random
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
FOLDERS = ["src", "crates/core/src", "crates/formats/src", "crates/paper/src"]


def files():
    for folder in FOLDERS:
        for directory, _, names in sorted(os.walk(os.path.join(ROOT, folder))):
            yield from (os.path.join(directory, name) for name in sorted(names) if name.endswith(".rs"))


TOKENS = re.compile(
    r"//[^\n]*|/\*.*?\*/|'(?:\\.|[^'\\\n])'|r(#*)\".*?\"\1|\"((?:[^\"\\]|\\.)*)\"|#!?\[(\w+)|(\w+)!\s*[(\[{]|\b(expect)\(|[\[\](){}]",
    re.DOTALL,
)
# Attributes and macros whose texts no user reads.
SILENT = {
    "allow", "cfg", "cfg_attr", "ignore", "deprecated", "derive", "doc", "expect", "must_use", "schema", "serde", "param", "path",
    "assert", "assert_eq", "assert_ne", "debug_assert", "debug_assert_eq", "panic", "todo", "unimplemented", "unreachable",
    "arg", "command", "utoipa", "into_params",
}
QUERY = re.compile(r"\b(SELECT|INSERT|UPDATE|DELETE|CREATE|ALTER|SET|WHERE|FROM|VALUES|CONFLICT|PRAGMA)\b|default-src")
# Signs of a sentence. Texts without them are parts that another text takes in, as what was expected.
SENTENCE = re.compile(
    r"\b(is|are|was|were|be|has|have|does|did|do|can|cannot|may|must|will|expected|needs?|takes?|taken|found|ended|failed|not|no|none)\b|[:;]"
)


def is_test(place, text):
    """Tells if a file holds tests only: by its name, or because its tests stand in no module of their own."""
    return re.search(r"(^|/)tests/|tests\.rs$", place) or ("#[test]" in text and "#[cfg(test)]" not in text)


def messages_of(text):
    """Texts of four words or more that the program may show, each with its offset."""
    text = re.split(r"#\[cfg\(test\)\]\s*(?:pub\(\w+\) )?mod \w+ \{", text)[0]
    found, nested = [], []
    for token in TOKENS.finditer(text):
        whole, content = token.group(0), token.group(2)
        if content is None:
            if whole[-1] in "([{" and not whole.startswith("//") or token.group(3) or token.group(5):
                # An attribute opens a bracket, a macro or `expect` a parenthesis; all that is within inherits the name.
                name = token.group(3) or token.group(4) or token.group(5) or ""
                nested.append(name in SILENT or bool(nested and nested[-1]))
            elif whole in ")]}" and nested:
                nested.pop()
            continue
        words = re.sub(r"\\\s*\n\s*", "", content).replace('\\"', '"')
        bare = re.sub(r"\{[^}]*\}", "", words)
        is_silent = nested and nested[-1] or QUERY.search(bare)
        if not is_silent and len(re.findall(r"[A-Za-z]{2,}", bare)) >= 4 and " " in bare and SENTENCE.search(bare):
            found.append((words, token.start()))
    return found


def gathered():
    """Comments, messages and help texts with their places."""
    comments, messages, helps = [], [], []
    for path in files():
        with open(path) as file:
            text = file.read()
        lines = text.split("\n")
        place = os.path.relpath(path, ROOT)
        at = 0
        while at < len(lines):
            start = at
            block = []
            while at < len(lines) and (found := re.match(r"\s*/// ?(.*)", lines[at])):
                block.append(found.group(1))
                at += 1
            if not block:
                at += 1
                continue
            first = " ".join(block).split("```")[0].split("  ")[0].strip()
            item = next((line for line in lines[at:] if not re.match(r"\s*#\[(serde|schema|allow)\b", line)), "")
            is_help = re.match(r"\s*#\[(arg|command)\(|\s*pub \w+: .* = .* =>", item)
            (helps if is_help else comments).append((first, f"{place}:{start + 1}"))
        if not is_test(place, text):
            messages += [(words, f"{place}:{text.count(chr(10), 0, offset) + 1}") for words, offset in messages_of(text)]
    return [("comment", comments), ("message", messages), ("help", helps)]


def main(arguments):
    where = "--where" in arguments
    if "--count" in arguments:
        print(", ".join(f"{len(known)} of kind {kind}" for kind, known in gathered()))
        return
    numbers = [int(argument) for argument in arguments if argument != "--where"]
    if len(numbers) not in (1, 4):
        sys.exit(__doc__)
    chance, count = random.Random(numbers[0]), 0
    for (kind, known), wanted in zip(gathered(), numbers[1:] or [60, 20, 10]):
        for text, place in chance.sample(known, min(wanted, len(known))):
            count += 1
            print(f"{count}. {kind}: {text}" + (f"    [{place}]" if where else ""))


if __name__ == "__main__":
    main(sys.argv[1:])
