#!/usr/bin/env python3
"""Draws docs/architecture.svg: the rooms of the code and what they import, read from the sources.

Usage: architecture.py write     draws the picture
       architecture.py check     exit code 1 where the picture is not that of the sources
       architecture.py list      prints the imports of every room

A room is a module at the root of a crate; the crate of the paper is one room. An arrow goes from a room to one that it
imports, and is left out where it follows from others. Places, words and the numbers of an upload's way are below; the
arrows are not.
"""
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PICTURE = os.path.join(ROOT, "docs", "architecture.svg")

# Each crate: its folder, its name in code, the room that all of it is (if it is one), and the words above its band.
CRATES = {
    "src": ("wavelume", None, "wavelume", "the program: command line and HTTP service"),
    "crates/formats/src": ("wavelume_formats", None, "wavelume-formats", "files of instruments and renderers"),
    "crates/paper/src": ("wavelume_paper", "paper", "wavelume-paper", ""),
    "crates/core/src": ("wavelume_core", None, "wavelume-core", "all that a renderer links"),
}
# Bands of the crates: x, y, width, height, colour of the band and of its names, x of the words beside the name.
BANDS = {
    "src": (30, 20, 940, 196, "#e9f1fc", "#1d4f91", 137),
    "crates/formats/src": (268, 256, 702, 406, "#e8f5ec", "#1f6b3a", 447),
    "crates/paper/src": (30, 330, 208, 104, "#f1ecf8", "#5b3a8c", 0),
    "crates/core/src": (30, 702, 940, 428, "#fdf2e2", "#9a5a00", 284),
}
WIDTH, HEIGHT = 1000, 1150
BOX = (188, 52)
COLUMNS = [40, 284, 528, 772]
# Rooms: column, y, what is in it in two lines, and the step of an upload's way, which docs/architecture.md describes.
ROOMS = {
    "cli": (0, 60, "one file a command", "", None),
    "api": (1, 60, "HTTP: translation only,", "one file a resource", 1),
    "jobs": (2, 60, "work beyond one request:", "queue, leases, workers", 2),
    "catalog": (3, 60, "descriptions by digest,", "in SQL", 5),
    "store": (3, 148, "bytes under their digest", "", 4),
    "trust": (1, 148, "tenants, keys, and what", "they allow", None),
    "reading": (3, 296, "reads a file by its path", "", None),
    "pipeline": (2, 296, "bytes and a request in,", "a material and its report out", 6),
    "projection": (1, 370, "samples as measured →", "a tensor on chosen axes", 7),
    "export": (2, 370, "materials as files of others", "", None),
    "paper": (0, 370, "the tables of [CPB06],", "one file a table", None),
    "preview": (2, 444, "colours and pictures", "", None),
    "formats": (1, 518, "files ⇄ measurements,", "one file a format", 3),
    "appearance": (2, 518, "light, observer, linear sRGB", "", None),
    "notes": (1, 592, "notes and warnings,", "one file a subject", None),
    "open": (1, 742, "opens a material by its path", "", None),
    "roles": (3, 742, "surface, light, medium or", "spectrum", 12),
    "evaluate": (2, 816, "a material in use: spectra,", "densities, directions", 11),
    "algebra": (0, 816, "sums and products without", "decoding", None),
    "compress": (2, 890, "policies, rate control, errors", "of the decoded bytes", 8),
    "codec": (1, 964, "coefficients ⇄ bytes:", "container, entropy coder", 10),
    "transform": (2, 964, "generic wavelet transform", "", 9),
    "domain": (1, 1038, "what a measurement is;", "the conventions", None),
    "numeric": (2, 1038, "linear systems, wide loops", "", None),
}


def code(path):
    """The text of a source without comments and without its tests."""
    with open(path) as file:
        text = re.split(r"#\[cfg\(test\)\]\s*(?:pub\(\w+\) )?mod \w+ \{", file.read())[0]
    return "\n".join(line.split("//")[0] for line in text.splitlines())


def listed(tree):
    """The first names of a tree of imports: `{a::b, c::{d}}` has a and c."""
    names, depth, word = [], 0, ""
    for letter in tree[1:-1] + ",":
        if letter == "," and depth == 0:
            names.append(re.match(r"\s*(\w*)", word)[1])
            word = ""
            continue
        depth += (letter == "{") - (letter == "}")
        word += letter
    return names


def imports():
    """The rooms, each with the rooms that it imports."""
    files = {}
    for folder, (_, whole, _, _) in CRATES.items():
        for place, _, names in os.walk(os.path.join(ROOT, folder)):
            for name in names:
                path = os.path.join(place, name)
                room = whole or os.path.relpath(path, os.path.join(ROOT, folder)).split(os.sep)[0].removesuffix(".rs")
                is_test = name == "tests.rs" or name.endswith("_tests.rs")
                if name.endswith(".rs") and not is_test and room not in ("lib", "main"):
                    files.setdefault(room, []).append(path)
    crates = "|".join(["crate", *(name for name, _, _, _ in CRATES.values())])
    found = {room: set() for room in files}
    for room, paths in files.items():
        for path in paths:
            for crate, tree in re.findall(rf"(?<!\w)({crates})::(\{{[^;]*?\}}(?=;)|\w+)", code(path)):
                names = listed(tree) if tree.startswith("{") else [tree]
                # Names inside the crate of the paper are its own, whatever rooms of others are called.
                found[room] |= {"paper"} if crate == "wavelume_paper" else {name for name in names if name in files}
        found[room].discard(room)
    return found


def needed(found):
    """The imports that do not follow from others, as pairs."""

    def reached(room, seen):
        for other in found[room] - seen:
            seen.add(other)
            reached(other, seen)
        return seen

    below = {room: reached(room, set()) for room in found}
    circles = sorted(room for room in found if room in below[room])
    if circles:
        sys.exit(f"rooms in a circle of imports: {', '.join(circles)}")
    return sorted(
        (room, other) for room in found for other in found[room] if not any(other in below[between] for between in found[room])
    )


# The ways of arrows that would cross boxes: the sides where they leave and arrive, and the x or y of the lanes between.
WAYS = {
    ("jobs", "paper"): ("b", "t", [("y", 236)]),
    ("catalog", "domain"): ("r", "b", [("x", 984), ("y", 1114)]),
    ("cli", "algebra"): ("l", "l", [("x", 16)]),
    ("notes", "domain"): ("l", "l", [("x", 259)]),
    ("open", "evaluate"): ("r", "t", []),
    ("roles", "evaluate"): ("b", "r", []),
    ("algebra", "compress"): ("b", "l", []),
    ("paper", "compress"): ("b", "l", [("y", 452), ("x", 246)]),
    ("pipeline", "projection"): ("l", "t", []),
    ("export", "formats"): ("l", "r", [("x", 500)]),
}
# Places of arrows along a side, from 0 to 1, if not spread evenly: clear of the names of bands, or straight.
PLACES = {
    ("jobs", "pipeline"): (0.85, 0.85),
    ("jobs", "paper"): (0.5, 0.85),
    ("open", "evaluate"): (0.5, 0.25),
    ("appearance", "evaluate"): (0.5, 0.5),
    ("compress", "transform"): (0.6, 0.6),
    ("codec", "domain"): (0.5, 0.5),
    ("transform", "domain"): (0.5, 0.75),
}
LEGEND = (756, 979)


def box(room):
    column, y = ROOMS[room][:2]
    return COLUMNS[column], y, *BOX


def side_of(room, other):
    """The sides where an arrow without a way of its own leaves and arrives."""
    (x0, y0, w, _), (x1, y1, _, _) = box(room), box(other)
    if y0 == y1:
        return ("r", "l") if x0 < x1 else ("l", "r")
    return "b", "t"


def point(room, side, place):
    """A point on a side of a box; `place` from 0 to 1 along it."""
    x, y, w, h = box(room)
    return {"t": (x + w * place, y), "b": (x + w * place, y + h), "l": (x, y + h * place), "r": (x + w, y + h * place)}[side]


def corners(start, sides, lanes, end):
    """The corners of a way of level and upright pieces through the lanes."""
    points, upright = [start], sides[0] in "tb"
    (x, y), (ex, ey) = start, end
    for axis, value in lanes:
        if (axis == "y") != upright:
            # Two turns between lanes of one kind.
            x, y = (ex, y) if upright is False else (x, ey)
            points.append((x, y))
            upright = not upright
        x, y = (x, value) if axis == "y" else (value, y)
        points.append((x, y))
        upright = not upright
    last_upright = sides[1] in "tb"
    if upright and last_upright and x != ex:
        middle = (y + ey) / 2
        points += [(x, middle), (ex, middle)]
    elif not upright and not last_upright and y != ey:
        middle = (x + ex) / 2
        points += [(middle, y), (middle, ey)]
    elif upright != last_upright:
        points.append((x, ey) if upright else (ex, y))
    return [*points, end]


def path(points, radius=9):
    """A path with round corners."""
    out = [f"M{points[0][0]:g} {points[0][1]:g}"]
    for before, at, after in zip(points, points[1:], points[2:]):
        lengths = [abs(a[0] - at[0]) + abs(a[1] - at[1]) for a in (before, after)]
        if 0 in lengths:
            continue
        r = min(radius, *(length / 2 for length in lengths))
        ends = [tuple(at[i] + (a[i] - at[i]) * r / length for i in (0, 1)) for a, length in zip((before, after), lengths)]
        out.append(f"L{ends[0][0]:g} {ends[0][1]:g}Q{at[0]:g} {at[1]:g} {ends[1][0]:g} {ends[1][1]:g}")
    return "".join([*out, f"L{points[-1][0]:g} {points[-1][1]:g}"])


def ways(arrows):
    """The corners of every arrow; those that share a side are spread along it in the order of their other ends."""
    sides, lanes = {}, {}
    for arrow in arrows:
        leave, arrive, lanes[arrow] = WAYS.get(arrow, (*side_of(*arrow), []))
        sides[arrow] = leave, arrive
    shared = {}
    for arrow in arrows:
        for end, (room, other) in enumerate((arrow, arrow[::-1])):
            shared.setdefault((room, sides[arrow][end]), []).append((arrow, end, other))
    places = {}
    for (room, side), users in shared.items():
        along = 0 if side in "tb" else 1

        def order(user):
            arrow, end, other = user
            first = [value for axis, value in lanes[arrow] if axis == "xy"[along]]
            return (first[0] if end == 0 else first[-1]) if first else point(other, "t", 0.5)[along], arrow

        for k, (arrow, end, _) in enumerate(sorted(users, key=order)):
            places[arrow, end] = (k + 1) / (len(users) + 1)
    for arrow, both in PLACES.items():
        places[arrow, 0], places[arrow, 1] = both
    found = {}
    for arrow in arrows:
        start, end = (point(arrow[i], sides[arrow][i], places[arrow, i]) for i in (0, 1))
        found[arrow] = corners(start, sides[arrow], lanes[arrow], end)
    return found


def draw(found):
    missing, gone = sorted(set(found) - set(ROOMS)), sorted(set(ROOMS) - set(found))
    if missing or gone:
        sys.exit(f"tests/public/architecture.py: rooms without a place: {missing}; places without a room: {gone}")
    font = "font-family='Inter, Helvetica, Arial, sans-serif'"
    out = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {HEIGHT}' width='{WIDTH}' height='{HEIGHT}' {font}>",
        "<title>Rooms of the code, and what they import</title>",
        "<defs><marker id='head' viewBox='0 0 8 8' refX='7' refY='4' markerWidth='7' markerHeight='7' orient='auto'>"
        "<path d='M0 0.6L7.4 4L0 7.4z' fill='#5b6470'/></marker></defs>",
        f"<rect width='{WIDTH}' height='{HEIGHT}' rx='10' fill='#ffffff'/>",
    ]
    ink = {}
    for folder, (x, y, w, h, fill, colour, beside) in BANDS.items():
        name, about = CRATES[folder][2:]
        out.append(f"<rect x='{x}' y='{y}' width='{w}' height='{h}' rx='12' fill='{fill}'/>")
        out.append(f"<text x='{x + 12}' y='{y + 25}' font-size='15' font-weight='700' fill='{colour}'>{name}</text>")
        if about:
            out.append(f"<text x='{beside}' y='{y + 25}' font-size='13' fill='{colour}'>{about}</text>")
        for room in ROOMS:
            bx, by = box(room)[:2]
            if x <= bx < x + w and y <= by < y + h:
                ink[room] = colour
    for points in ways(needed(found)).values():
        out.append(f"<path d='{path(points)}' fill='none' stroke='#5b6470' stroke-width='1.5' marker-end='url(#head)'/>")
    for room, (_, _, first, second, step) in ROOMS.items():
        x, y, w, h = box(room)
        colour = ink[room]
        out.append(f"<rect x='{x}' y='{y}' width='{w}' height='{h}' rx='7' fill='#ffffff' stroke='{colour}' stroke-width='1.3'/>")
        out.append(
            f"<text x='{x + 11}' y='{y + (18 if second else 22)}' font-size='14' font-weight='700' fill='{colour}' "
            f"font-family='ui-monospace, Menlo, Consolas, monospace'>{room}</text>"
        )
        for line, at in [(first, 32 if second else 38), (second, 45)]:
            if line:
                out.append(f"<text x='{x + 11}' y='{y + at}' font-size='11.5' fill='#333a42'>{line}</text>")
        if step:
            out.append(f"<circle cx='{x + w - 15}' cy='{y + 14}' r='9.5' fill='{colour}'/>")
            out.append(
                f"<text x='{x + w - 15}' y='{y + 18}' font-size='11' font-weight='700' fill='#ffffff' text-anchor='middle'>{step}</text>"
            )
    x, y = LEGEND
    out.append(f"<path d='M{x} {y}h34' stroke='#5b6470' stroke-width='1.5' marker-end='url(#head)'/>")
    out.append(f"<circle cx='{x + 17}' cy='{y + 46}' r='9.5' fill='#5b6470'/>")
    out.append(f"<text x='{x + 17}' y='{y + 50}' font-size='11' font-weight='700' fill='#ffffff' text-anchor='middle'>1</text>")
    for line, at in [("imports; left out where it", 4), ("follows from other arrows", 20), ("way of an upload, as the", 50), ("page describes it", 66)]:
        out.append(f"<text x='{x + 46}' y='{y + at}' font-size='12' fill='#333a42'>{line}</text>")
    return "\n".join([*out, "</svg>"]) + "\n"


def main():
    mode = sys.argv[1] if len(sys.argv) == 2 else ""
    found = imports()
    if mode == "list":
        for room in ROOMS:
            print(f"{room}: {', '.join(sorted(found[room]))}")
    elif mode == "write":
        with open(PICTURE, "w") as file:
            file.write(draw(found))
    elif mode == "check":
        with open(PICTURE) as file:
            if file.read() != draw(found):
                sys.exit("docs/architecture.svg is not that of the sources: python3 tests/public/architecture.py write")
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
