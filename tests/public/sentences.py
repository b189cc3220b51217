#!/usr/bin/env python3
"""Draws comments, messages and help texts for somebody who has not seen the code, to say what each describes.

Usage: sentences.py SEED [COMMENTS MESSAGES HELP]        (60, 20 and 10 without numbers)

Each line is the number, the kind and the text; with --where the file and line stand behind it. The same seed draws the
same sentences from the same code. A message that only passes on another one, as "{0}", has no words of its own and is
not drawn.
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
            is_help = at < len(lines) and re.match(r"\s*#\[(arg|command)\(", lines[at])
            (helps if is_help else comments).append((first, f"{place}:{start + 1}"))
        for found in re.finditer(r'#\[error\(\s*"((?:[^"\\]|\\.)*)"', text):
            message = re.sub(r"\\\s*\n\s*", "", found.group(1)).replace('\\"', '"')
            if re.search(r"[a-z]", re.sub(r"\{[^}]*\}", "", message)):
                messages.append((message, f"{place}:{text.count(chr(10), 0, found.start()) + 1}"))
    return [("comment", comments), ("message", messages), ("help", helps)]


def main(arguments):
    where = "--where" in arguments
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
