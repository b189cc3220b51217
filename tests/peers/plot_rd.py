#!/usr/bin/env python3
"""Draws er(L2) against bytes, logarithmic, one panel an array: wavelume, its best peers, and the paper's policies.

Usage: plot_rd.py CSV... -o OUT.svg [--arrays NAME,...] [--each N]

CSV is what run_peers.py writes (with --policies for the paper's); of several files the last one that has an entry
counts. In each panel stand the N best packaged peers and the N best recipes at er(L2) 1 % (or the next target that
there is).
"""

import argparse
import csv
import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "docs"))
from plot_paper import GREY, GRID, Drawing, number, scale  # noqa: E402

TITLES = {
    "brdf_gloss": "plastic, synthetic BRDF, 0.3 % noise",
    "brdf_aniso": "anisotropic, synthetic BRDF, 0.3 % noise",
    "aerolamp": "far-UVC lamp, measured",
    "aerolamp_floor": "far-UVC lamp, measured, floor 0.1 % of its largest",
    "carpaint_red": "red car paint, measured",
    "carpaint_red_floor": "red car paint, measured, floor 0.1 % of its largest",
    "carpaint_blue_floor": "blue car paint, measured, floor 0.1 % of its largest",
    "carpaint_blue": "blue car paint, measured",
    "brushed_copper_1pct": "brushed copper, virtual, 1 % noise",
}
OURS = "#0b62a8"
PAPER = {"conventional": "#d9a441", "generic": "#b07a10", "adaptive": "#7a5200"}
PEERS = ["#c2410c", "#0f8a5f", "#7c3aed", "#be185d", "#84a816", "#0891b2", "#64748b", "#1e293b", "#f08080", "#38bdf8", "#a78bfa"]
ARRAYS = ["brdf_gloss", "brdf_aniso", "brushed_copper_1pct", "aerolamp_floor", "carpaint_red_floor", "carpaint_blue_floor"]
LOW, HIGH = 0.3, 40.0
WIDTH, HEIGHT, GAP, LEFT, TOP = 400, 270, 44, 70, 50


def read(paths):
    """{array: {peer: (group, {key: (bytes, er(L2) in %)})}}; a target or a setting is a key once."""
    found = {}
    for path in paths:
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                if row["bytes"] == "" or row["note"].startswith("missed"):
                    continue
                key = row["setting"] if row["group"] == "paper" else float(row["target"])
                point = float(row["bytes"]), 100 * float(row["er_l2"])
                found.setdefault(row["array"], {}).setdefault(row["peer"], (row["group"], {}))[1][key] = point
    return found


def best(peers, group, count):
    """The peers of a group with the fewest bytes at 1 %, or at the smallest target above it that they have."""
    rank = {}
    for name, (its, points) in peers.items():
        reached = sorted(target for target in points if its == group and target >= 1)
        if reached:
            rank[name] = (reached[0], points[reached[0]][0])
    return sorted(rank, key=rank.get)[:count]


def close(points, others):
    """Tells if two curves lie on each other: equal settings, bytes and errors within 3 %."""
    return points.keys() == others.keys() and all(
        abs(a - b) <= 0.03 * b for key in points for a, b in zip(points[key], others[key])
    )


def inside(points):
    """Points on the plot, without those that another one beats in bytes and error."""
    points = {(b, e) for b, e in points if LOW <= e <= HIGH}
    return sorted(one for one in points if not any(b <= one[0] and e <= one[1] and (b, e) != one for b, e in points))


def panel(draw, x0, y0, title, lines):
    """One array; lines = [(name, colour, dashed, points)]."""
    sizes = [b for _, _, _, points in lines for b, _ in points]
    x = scale(min(sizes) / 1.4, max(sizes) * 1.4, x0, x0 + WIDTH)
    y = scale(LOW, HIGH, y0 + HEIGHT, y0)
    decade = 1
    while decade <= max(sizes) * 1.4:
        for digit in (1, 2, 5):
            value = digit * decade
            if min(sizes) / 1.4 <= value <= max(sizes) * 1.4:
                draw.line(x(value), y0, x(value), y0 + HEIGHT, GRID, 1.0 if digit == 1 else 0.4)
                if digit == 1 or max(sizes) < 200 * min(sizes):
                    draw.text(x(value), y0 + HEIGHT + 15, f"{value:,}", 10, anchor="middle")
        decade *= 10
    for value in (0.5, 1, 2, 5, 10, 20):
        draw.line(x0, y(value), x0 + WIDTH, y(value))
        draw.text(x0 - 6, y(value) + 4, number(value), 10, anchor="end")
    for name, colour, dashed, points in lines:
        draw.path([(x(b), y(e)) for b, e in points], colour, dashed)
        for b, e in points:
            draw.dot(x(b), y(e), colour, hollow=name != "wavelume")
    draw.frame(x0, y0, WIDTH, HEIGHT)
    draw.text(x0 + 8, y0 - 7, title, 13, bold=True)


def draw(paths, out, arrays=None, each=2):
    """The plot of these CSVs, one panel an array, into an SVG."""
    found, panels, colours, apart = read(paths), [], {"wavelume": OURS, **PAPER}, []
    for array in arrays or ARRAYS:
        peers = found.get(array, {})
        names = [*best(peers, "packaged", each), *best(peers, "recipe", each)]
        names += [name for name in (*PAPER, "wavelume") if name in peers]
        if "generic" in names and not close(peers["conventional"][1], peers["generic"][1]):
            apart.append(array)
        lines = [(name, inside(peers[name][1].values())) for name in names]
        lines = [(name, points) for name, points in lines if points]
        for name, _ in lines:
            colours.setdefault(name, PEERS[(len(colours) - 4) % len(PEERS)])
        if lines:
            panels.append((array, [(name, colours[name], name in PAPER, points) for name, points in lines]))
        else:
            print(f"{array}: nothing in {', '.join(paths)}", file=sys.stderr)
    if not panels:
        sys.exit("nothing to draw")
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    wide = LEFT + columns * (WIDTH + GAP)
    shown = [name for name in colours if any(name == line[0] for _, lines in panels for line in lines)]
    words = {name: f"paper, {name}" for name in PAPER}
    if "generic" in shown and not apart:  # one curve under the other
        shown.remove("conventional")
        words["generic"] = "paper, conventional and generic"
    legend = -(-len(shown) // (2 * columns))
    bottom = TOP + rows * (HEIGHT + 56)
    page = Drawing(wide, bottom + 26 + 20 * legend)
    page.text(LEFT, 22, "Error of the decoded file against its size", 15, bold=True)
    for i, (array, lines) in enumerate(panels):
        x0, y0 = LEFT + (i % columns) * (WIDTH + GAP), TOP + 12 + (i // columns) * (HEIGHT + 56)
        panel(page, x0, y0, TITLES.get(array, array), lines)
    page.text(LEFT + (wide - LEFT) / 2, bottom + 4, "bytes of the file, logarithmic", anchor="middle", colour=GREY)
    page.text(20, TOP + (bottom - TOP) / 2, "er(L2), %, logarithmic", anchor="middle", colour=GREY, turned=True)
    for i, name in enumerate(shown):
        x0, y0 = LEFT + (i % (2 * columns)) * 215, bottom + 26 + 20 * (i // (2 * columns))
        page.path([(x0, y0), (x0 + 36, y0)], colours[name], name in PAPER)
        page.dot(x0 + 18, y0, colours[name], hollow=name != "wavelume")
        page.text(x0 + 44, y0 + 4, words.get(name, name))
    with open(out, "w") as file:
        file.write("\n".join([*page.parts, "</svg>", ""]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("csv", nargs="+")
    parser.add_argument("-o", required=True, dest="out")
    parser.add_argument("--arrays", default=",".join(ARRAYS))
    parser.add_argument("--each", type=int, default=2)
    options = parser.parse_args()
    draw(options.csv, options.out, options.arrays.split(","), options.each)


if __name__ == "__main__":
    main()
