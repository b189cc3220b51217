#!/usr/bin/env python3
"""Draws docs/security.svg: who may do what with a service, by what a request shows.

Usage: access.py write     draws the picture
       access.py check     exit code 1 where the picture is not that of this table

The rights themselves are in src/api/needs.rs, and tests/it/http/keys.rs walks over every route with each of them.
"""
import sys
from pathlib import Path

PICTURE = Path(__file__).resolve().parents[2] / "docs" / "security.svg"

# Lines above the columns.
WHAT = [
    ("health, formats,", "description"), ("public", "materials"), ("materials shared", "with the tenant"),
    ("own materials,", "measurements"), ("upload, delete,", "share"), ("queue and", "cancel jobs"),
    ("keys, audit", "of the tenant"), ("tenants, limits,", "metrics"),
]
# Rows: what a request shows, a word about it, and for each column: # may, o with a limit, . may not.
WHO = [
    ("no key", "", "#o......"),
    ("signed link", "one file", "#ooo...."),
    ("token", "from a key", "#ooooo.."),
    ("key: read", "", "####...."),
    ("key: write", "", "#...#..."),
    ("key: jobs", "", "#....#.."),
    ("key: tenant", "administers its tenant", "#.....#."),
    ("key: instance", "administers the service", "#......#"),
]
LIMITS = ("with a limit: no key in the mode keys+anonymous-read; a link for the file that it names; "
          "a token within the scopes of its key")
# Widths and heights of the picture's parts.
NAMES, COLUMN, HEAD, ROW, FOOT = 150, 92, 70, 34, 44
BLUE = "#2b6cb0"


def mark(x, y, may):
    """A full circle for a right, a ring for one with a limit."""
    if may == "#":
        return f'<circle cx="{x}" cy="{y}" r="7" fill="{BLUE}"/>'
    return f'<circle cx="{x}" cy="{y}" r="6.5" fill="#fff" stroke="{BLUE}" stroke-width="1.5"/>'


def draw():
    width, height = NAMES + len(WHAT) * COLUMN + 10, HEAD + len(WHO) * ROW + FOOT
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
           'font-size="12" fill="#222">', f'<rect width="{width}" height="{height}" fill="#fff"/>']
    for column, lines in enumerate(WHAT):
        x = NAMES + column * COLUMN + COLUMN // 2
        out += [f'<text x="{x}" y="{28 + 16 * at}" text-anchor="middle">{line}</text>' for at, line in enumerate(lines)]
    for row, (name, word, rights) in enumerate(WHO):
        y = HEAD + row * ROW
        if row % 2 == 0:
            out.append(f'<rect x="0" y="{y}" width="{width}" height="{ROW}" fill="#f3f5f8"/>')
        out.append(f'<text x="12" y="{y + (16 if word else 21)}" font-weight="bold">{name}</text>')
        if word:
            out.append(f'<text x="12" y="{y + 29}" font-size="10" fill="#666">{word}</text>')
        out += [mark(NAMES + at * COLUMN + COLUMN // 2, y + ROW // 2, may) for at, may in enumerate(rights) if may != "."]
    y = height - 24
    out += [mark(20, y, "#"), f'<text x="34" y="{y + 4}">may</text>', mark(90, y, "o"),
            f'<text x="104" y="{y + 4}">{LIMITS}</text>', "</svg>"]
    return "\n".join(out) + "\n"


def main(arguments):
    if arguments == ["write"]:
        PICTURE.write_text(draw())
    elif arguments == ["check"]:
        if PICTURE.read_text() != draw():
            sys.exit("docs/security.svg is not that of its table: python3 tests/public/access.py write")
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
