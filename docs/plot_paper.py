#!/usr/bin/env python3
"""Draws the plots of docs/paper.md, and writes its tables, from what `wavelume paper` prints.

Usage: plot_paper.py [--check] PAPER.json [PAPER.txt]

PAPER.json is the output of `wavelume paper --json`, PAPER.txt that of `wavelume paper`; with the latter the text blocks
of paper.md, which begin with `Table N.`, are replaced. --check changes nothing; exit code 1 if a plot or a table is out
of date.
"""
import json
import math
import os
import re
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(os.path.dirname(HERE), "tests", "acceptance"))
from pictures import is_same  # noqa: E402

INK, GREY, GRID = "#222222", "#666666", "#dddddd"
OURS, PAPER = "#0b62a8", "#c2410c"
BY_COUNT = {16: "#0b62a8", 8: "#0f8a5f", 4: "#c2410c"}


class Drawing:
    """The elements of an SVG, in the order of painting."""

    def __init__(self, width, height):
        self.parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
            'font-family="DejaVu Sans, Verdana, Helvetica, Arial, sans-serif">',
            f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        ]

    def line(self, x1, y1, x2, y2, colour=GRID, width=1.0):
        self.parts.append(
            f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" stroke-width="{width}"/>'
        )

    def path(self, points, colour, dashed=False):
        where = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dash = ' stroke-dasharray="6 4"' if dashed else ""
        self.parts.append(f'<polyline points="{where}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>')

    def dot(self, x, y, colour, hollow=False):
        fill = "#ffffff" if hollow else colour
        self.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{fill}" stroke="{colour}" stroke-width="1.6"/>')

    def frame(self, x, y, width, height):
        self.parts.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" fill="none" stroke="{GREY}"/>'
        )

    def text(self, x, y, words, size=12, anchor="start", colour=INK, bold=False, turned=False):
        weight = ' font-weight="bold"' if bold else ""
        turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
        self.parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="{colour}"{weight}{turn}>{words}</text>'
        )

    def svg(self):
        return "\n".join([*self.parts, "</svg>", ""])


def scale(low, high, start, end):
    """A logarithmic axis from `low` at `start` to `high` at `end`."""
    unit = (end - start) / math.log(high / low)
    return lambda value: start + unit * math.log(value / low)


def number(value):
    return f"{value:g}"


def errors(table, row):
    """`{number before the column's name: (ours, the paper's)}` of the L2 columns."""
    columns = zip(table["columns"], row["cells"])
    found = {column.split()[0]: (cell["ours"], cell["paper"]) for column, cell in columns if column.endswith(" L2")}
    return {int(name.split(":")[0]): pair for name, pair in found.items()}


def table1(table):
    """Our er(L2) over the paper's, every spectrum and number of coefficients."""
    by_method = {(row["label"], row["method"]): errors(table, row) for row in table["rows"]}
    labels = list(dict.fromkeys(row["label"] for row in table["rows"]))
    left, top, step, width = 130, 96, 48, 600
    bottom = top + step * len(labels)
    draw = Drawing(left + width + 30, bottom + 62)
    x = scale(0.001, 3.0, left, left + width)
    draw.text(left, 24, "Table 1: er(L2) of spectra, ours as a fraction of the paper’s", 15, bold=True)
    keys = left
    for count, colour in BY_COUNT.items():
        draw.dot(keys + 5, 46, colour)
        draw.text(keys + 15, 50, f"{count} of 80 coefficients")
        keys += 165
    draw.dot(left + 5, 66, GREY, hollow=True)
    draw.text(left + 15, 70, "plain: the largest coefficients as they are", colour=GREY)
    draw.dot(left + 335, 66, GREY)
    draw.text(left + 345, 70, "greedy: chosen and fitted for er(L2)", colour=GREY)
    for decade in range(-3, 1):
        for digit in range(1, 10):
            value = digit * 10.0**decade
            if value <= 3.0:
                draw.line(x(value), top, x(value), bottom, GRID, 1.0 if digit == 1 else 0.4)
        draw.text(x(10.0**decade), bottom + 18, number(10.0**decade), anchor="middle")
    draw.text(x(3.0), bottom + 18, "3", anchor="middle")
    for i, label in enumerate(labels):
        y = top + step * i
        draw.line(left, y, left + width, y)
        draw.text(left - 8, y + step / 2 + 4, label, anchor="end")
        for j, (count, colour) in enumerate(BY_COUNT.items()):
            plain, greedy = (
                x(ours / paper) for ours, paper in (by_method[label, method][count] for method in ("plain", "greedy"))
            )
            at = y + step * (j + 0.75) / 3.5 + 2
            draw.line(plain, at, greedy, at, colour, 1.2)
            draw.dot(plain, at, colour, hollow=True)
            draw.dot(greedy, at, colour)
    draw.line(x(1.0), top, x(1.0), bottom, INK, 1.6)
    draw.text(x(1.0) + 4, top - 4, "1: the paper’s", 10)
    draw.frame(left, top, width, bottom - top)
    draw.text(left + width / 2, bottom + 44, "our er(L2) / the paper’s er(L2), logarithmic; right of the line is worse", anchor="middle")
    return draw.svg()


def table3(table):
    """er(L2) against the ratio, one panel a material."""
    rows = [row for row in table["rows"] if row["method"] == "generic"]
    width, height, gap, left, top = 220, 190, 26, 66, 62
    draw = Drawing(left + 3 * width + 2 * gap + 20, top + 2 * height + 100)
    draw.text(left, 24, "Table 3: er(L2) of spectral BRDFs by ratio, policy generic", 15, bold=True)
    draw.text(left, 42, "virtual materials, not the paper’s, chosen to come in its order at every ratio", 12, colour=GREY)
    for i, row in enumerate(rows):
        x0 = left + (i % 3) * (width + gap)
        y0 = top + (i // 3) * (height + 40)
        x = scale(1.0, 256.0, x0 + 12, x0 + width - 12)
        y = scale(0.2, 50.0, y0 + height, y0)
        for ratio in (1, 2, 8, 16, 64, 128, 256):
            draw.line(x(ratio), y0, x(ratio), y0 + height)
            draw.text(x(ratio), y0 + height + 15, ratio, 10, anchor="middle")
        for value in (0.2, 0.5, 1, 2, 5, 10, 20, 50):
            draw.line(x0, y(value), x0 + width, y(value))
            if i % 3 == 0:
                draw.text(x0 - 6, y(value) + 4, number(value), 10, anchor="end")
        found = errors(table, row)
        for k, colour in ((0, OURS), (1, PAPER)):
            points = [(x(ratio), y(pair[k])) for ratio, pair in found.items()]
            draw.path(points, colour, dashed=k == 1)
            for point in points:
                draw.dot(*point, colour, hollow=k == 1)
        draw.frame(x0, y0, width, height)
        draw.text(x0 + 10, y0 + 18, row["label"], 13, bold=True)
    x0, y0 = left + 2 * (width + gap) + 20, top + height + 40
    for k, (colour, words) in enumerate(((OURS, "ours, generic"), (PAPER, "the paper’s"))):
        y = y0 + 60 + 30 * k
        draw.path([(x0, y), (x0 + 50, y)], colour, dashed=k == 1)
        draw.dot(x0 + 25, y, colour, hollow=k == 1)
        draw.text(x0 + 60, y + 4, words, 13)
    draw.text(left + width + gap / 2, top + 2 * height + 80, "samples : coefficients, logarithmic", anchor="middle")
    draw.text(20, top + height + 20, "er(L2), %, logarithmic", anchor="middle", turned=True)
    return draw.svg()


def with_tables(path, page):
    """The text of paper.md with the tables of the file at `path` in its blocks of text."""
    with open(path) as file:
        tables = re.split(r"\n\n(?=Table \d\.)", file.read().strip())
    for table in tables:
        head = re.escape(table.split(".")[0] + ".")
        page = re.sub(rf"```text\n{head}.*?```", lambda _, table=table: f"```text\n{table}\n```", page, flags=re.DOTALL)
    return page


def main():
    is_check = sys.argv[1:2] == ["--check"]
    files = sys.argv[1 + is_check :]
    if len(files) not in (1, 2):
        sys.exit(__doc__.splitlines()[2])
    with open(files[0]) as file:
        tables = {table["number"]: table for table in json.load(file)}
    made = {"paper-table1.svg": table1(tables[1]), "paper-table3.svg": table3(tables[3])}
    if len(files) == 2:
        with open(os.path.join(HERE, "paper.md")) as file:
            made["paper.md"] = with_tables(files[1], file.read())
    outdated = []
    for name, text in made.items():
        path = os.path.join(HERE, name)
        with open(path) as file:
            kept = file.read()
        if not is_check:
            with open(path, "w") as file:
                file.write(text)
        elif not (is_same(kept, text) if name.endswith(".svg") else kept == text):
            outdated.append(f"docs/{name} is out of date: python3 docs/plot_paper.py {' '.join(files)}")
    if outdated:
        sys.exit("\n".join(outdated))


if __name__ == "__main__":
    main()
