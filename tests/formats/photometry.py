#!/usr/bin/env python3
"""Computes flux, zones, beam and field angles of luminaires from their files, and compares `wavelume physics`.

    photometry.py WAVELUME      the built program

A reader of its own unfolds the planes of every LM-63, EULUMDAT and TM-33 file of data/ and tests/fixtures/ that has
intensities, and integrates them over parts of 0.05 degrees in gamma (type B: 0.1 degrees in both angles). Beam and
field angles are read off a plane sampled every 0.005 degrees. Between the angles of a file intensities are straight
lines, and 0 outside of them. Flux and zones must agree within 0.1 %, angles within 0.1 degrees, also of a luminaire
with steps of 1 degree that the script writes itself. Needs numpy only. Exit code 0 if all agree, 1 if not, 2 if
something is missing.
"""
import json
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    print(f"photometry.py: {error}; install numpy: python3 -m pip install numpy", file=sys.stderr)
    sys.exit(2)

ROOT = Path(__file__).resolve().parent.parent.parent
ZONES = [0, 30, 40, 60, 90, 120, 180]
FLUX, ANGLE = 1e-3, 0.1
# Fixtures that are no luminaire, and the options of those that need one.
SKIPPED = ["test_file_format_error.ies", "grow.xml"]
OPTIONS = {"downlight.xml": ["--unit", "cd"]}


def unfolded(c, values):
    """Planes from 0 to 360 degrees, from those that a file lists by symmetry. `values` is [plane, gamma]."""
    c = list(c)
    if len(c) == 1:
        return np.array([0.0, 360.0]), np.array([values[0], values[0]])
    planes = {}
    for angle, row in zip(c, values):
        images = [angle]
        if c[0] == 0 and c[-1] == 90:
            images = [angle, 180 - angle, 180 + angle, 360 - angle]
        elif c[0] == 0 and c[-1] == 180:
            images = [angle, 360 - angle]
        elif c[0] == 90 and c[-1] == 270:
            images = [angle, 180 - angle]
        for image in images:
            planes.setdefault(image % 360, row)
    angles = sorted(planes)
    rows = [planes[angle] for angle in angles]
    # Around the circle.
    angles, rows = [angles[-1] - 360] + angles + [angles[0] + 360], [rows[-1]] + rows + [rows[0]]
    return np.array(angles), np.array(rows)


class TypeC:
    """Intensities on C planes."""

    def __init__(self, c, gamma, values):
        self.c, self.values = unfolded(c, np.asarray(values, float))
        self.gamma = np.asarray(gamma, float)

    def half(self, c, gamma):
        at = np.clip(np.searchsorted(self.c, c % 360, "right") - 1, 0, len(self.c) - 2)
        t = (c % 360 - self.c[at]) / (self.c[at + 1] - self.c[at])
        row = (1 - t) * self.values[at] + t * self.values[at + 1]
        return np.interp(gamma, self.gamma, row, left=0, right=0)

    def zones(self):
        edges = np.linspace(0, 180, 3601)
        middle = (edges[1:] + edges[:-1]) / 2
        # Straight lines between planes: the mean over C of each circle is that of trapezoids.
        whole = np.unique(np.concatenate([[0, 360], self.c[(self.c > 0) & (self.c < 360)]]))
        rows = np.array([self.half(c, middle) if c < 360 else self.half(0, middle) for c in whole])
        mean = ((rows[1:] + rows[:-1]) / 2 * np.diff(whole)[:, None]).sum(0) / 360
        ring = 2 * np.pi * -np.diff(np.cos(np.radians(edges))) * mean
        return [ring[(middle > a) & (middle < b)].sum() for a, b in zip(ZONES, ZONES[1:])]


class TypeB:
    """Intensities over the vertical angle V and the lateral angle H of a type B goniometer, listed from -90 to 90."""

    def __init__(self, v, h, values):
        self.v, self.h, self.values = np.asarray(v, float), np.asarray(h, float), np.asarray(values, float)

    def at(self, v, h):
        rows = np.array([np.interp(v, self.v, row, left=0, right=0) for row in self.values])
        at = np.clip(np.searchsorted(self.h, h, "right") - 1, 0, len(self.h) - 2)
        t = (h - self.h[at]) / (self.h[at + 1] - self.h[at])
        pick = np.arange(rows.shape[1])
        return np.where((h < self.h[0]) | (h > self.h[-1]), 0, (1 - t) * rows[at, pick] + t * rows[at + 1, pick])

    def half(self, c, gamma):
        g, c = np.radians(gamma), np.radians(c)
        x, y, z = np.sin(g) * np.cos(c), np.sin(g) * np.sin(c), -np.cos(g)
        return self.at(np.round(np.degrees(np.arctan2(x, -z)), 9), np.round(np.degrees(np.arcsin(np.clip(-y, -1, 1))), 9))

    def zones(self):
        sums, edges = np.zeros(6), np.linspace(-90, 90, 1801)
        middle = (edges[1:] + edges[:-1]) / 2
        weights = np.diff(np.sin(np.radians(edges)))
        for h, weight in zip(middle, weights):
            gamma = np.degrees(np.arccos(np.cos(np.radians(h)) * np.cos(np.radians(middle))))
            part = self.at(middle, np.full_like(middle, h)) * weight * np.radians(0.1)
            sums += [part[(gamma > a) & (gamma <= b)].sum() for a, b in zip(ZONES, ZONES[1:])]
        return list(sums)


def lm63(text):
    tag = text.splitlines()[0]
    tilt, numbers = re.search(r"TILT=(.*)\n((?s:.*))", text).groups()
    n = [float(x) for x in re.split(r"[\s,]+", numbers.strip()) if x]
    if tilt.strip() == "INCLUDE":
        n = n[2 + 2 * int(n[1]) :]
    _, _, multiplier, verticals, horizontals, kind = n[:6]
    verticals, horizontals = int(verticals), int(horizontals)
    factor = multiplier * n[10] * (n[11] if tag.startswith("IESNA91") or not tag.startswith("IES") else 1)
    vertical = n[13 : 13 + verticals]
    horizontal = n[13 + verticals : 13 + verticals + horizontals]
    values = factor * np.array(n[13 + verticals + horizontals :][: verticals * horizontals]).reshape(horizontals, verticals)
    if kind == 1:
        return TypeC(horizontal, vertical, values)
    assert kind == 2 and vertical[0] == -90 and horizontal[0] == -90, (kind, vertical, horizontal)
    return TypeB(vertical, horizontal, values)


def eulumdat(text):
    lines = text.split("\n")
    number = lambda line: float(lines[line - 1].strip().replace(",", "."))
    symmetry, planes, gammas, sets = (int(number(line)) for line in (3, 4, 6, 26))
    factor = number(24) * number(29) / 1000
    at = 26 + 6 * sets + 10
    numbers = np.array([float(line.strip().replace(",", ".")) for line in lines[at:] if line.strip()])
    c, gamma, values = numbers[:planes], numbers[planes : planes + gammas], numbers[planes + gammas :]
    listed = {
        0: list(range(planes)), 1: [0], 2: list(range(planes // 2 + 1)), 4: list(range(planes // 4 + 1)),
        3: [(3 * planes // 4 + i) % planes for i in range(planes // 2 + 1)],
    }[symmetry]
    values = factor * values[: len(listed) * gammas].reshape(len(listed), gammas)
    if symmetry == 3:
        # C270 over C0 to C90: mirrored about the plane of C90 and C270.
        angles = [c[i] for i in listed]
        both = {angle % 360: row for angle, row in zip(angles, values)} | {(180 - angle) % 360: row for angle, row in zip(angles, values)}
        return TypeC(sorted(both), gamma, [both[angle] for angle in sorted(both)])
    return TypeC([c[i] for i in listed], gamma, values)


def tm33(text):
    root = ElementTree.fromstring(text)
    for node in root.iter():
        node.tag = node.tag.split("}")[-1]
    factor = float(next((node.text for node in root.iter("Multiplier")), 1))
    angle = lambda one, name: float(one.get(name) or one.get(name[0]))
    listed = [one for one in root.iter() if one.tag in ("IntData", "IntensityData") and one.text]
    data = {(angle(one, "horz"), angle(one, "vert")): factor * float(one.text) for one in listed}
    c, gamma = sorted({h for h, _ in data}), sorted({v for _, v in data})
    return TypeC(c, gamma, [[data[h, v] for v in gamma] for h in c])


def width(lamp, c, part):
    """Angle between the first places with at most `part` of the maximum on both sides of it; None if there is none."""
    step = 0.005
    gamma = np.arange(0, 180 + step / 2, step)
    plane = np.concatenate([lamp.half(c + 180, gamma)[:0:-1], lamp.half(c, gamma)[:-1]])
    away = np.concatenate([gamma[:0:-1], gamma[:-1]])
    if plane.max() <= 0:
        return None
    nearest = np.flatnonzero(plane >= plane.max() * (1 - 1e-12))
    at = nearest[np.lexsort((nearest < len(gamma) - 1, away[nearest]))[0]]
    total = 0
    for way in (1, -1):
        around = np.roll(plane, -at)[:: way] if way == 1 else np.roll(plane, -at - 1)[::-1]
        below = np.flatnonzero(around <= part * plane.max())
        if len(below) == 0:
            return None
        total += below[0] * step
    return total


def run(*command):
    done = subprocess.run([str(part) for part in command], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout


def degrees_steps(path):
    """Writes a luminaire with steps of 1 degree, an oblique lobe whose peak lies off every plane."""
    gamma, c = np.arange(0, 91), np.arange(0, 361, 5)
    g, a = np.radians(gamma)[None, :], np.radians(c)[:, None]
    aim = np.radians(17)
    cosine = np.sin(g) * np.sin(aim) * np.cos(a - np.radians(30)) + np.cos(g) * np.cos(aim)
    values = 2000 * np.clip(cosine, 0, 1) ** 40 + 30 * np.cos(g)
    lines = ["IESNA:LM-63-2002", "TILT=NONE", f"1 -1 1 {len(gamma)} {len(c)} 1 2 0 0 0", "1 1 10"]
    lines += [" ".join(map(str, gamma)), " ".join(map(str, c))]
    lines += [" ".join(f"{value:.4f}" for value in row) for row in values]
    path.write_text("\n".join(lines) + "\n")


def main(wavelume):
    wavelume, failed = Path(wavelume).resolve(), False
    paths = [*ROOT.glob("data/*.ies"), *(ROOT / "tests/fixtures").glob("**/*.ies")]
    paths += [*(ROOT / "tests/fixtures").glob("**/*.ldt"), *(ROOT / "tests/fixtures/tm33").glob("*.xml")]
    with tempfile.TemporaryDirectory() as directory:
        material, made = Path(directory) / "m.wlm", Path(directory) / "steps.ies"
        degrees_steps(made)
        for path in [*sorted(path for path in paths if path.name not in SKIPPED), made]:
            text = path.read_bytes().decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
            lamp = {".ies": lm63, ".ldt": eulumdat, ".xml": tm33}[path.suffix](text)
            run(wavelume, "compress", path, "-o", material, "--lossless", *OPTIONS.get(path.name, []))
            own = json.loads(run(wavelume, "physics", material, "--json"))["luminaire"][0]
            zones = lamp.zones()
            flux = sum(zones)
            worst = abs(own["flux"] / flux - 1)
            for zone, found in zip(zones, own["zones"]):
                worst = max(worst, abs(found["flux"] - zone) / max(zone, 1e-4 * flux))
            off = 0.0
            for plane, c in zip(own["planes"], (0, 90)):
                for name, part in (("beam", 0.5), ("field", 0.1)):
                    wanted, found = width(lamp, c, part), plane[name]
                    off = max(off, abs(wanted - found) if None not in (wanted, found) else 360.0 * (wanted is not found))
            good = worst <= FLUX and off <= ANGLE
            failed |= not good
            planes = ", ".join(f"{plane['beam'] or 0:.1f}/{plane['field'] or 0:.1f}" for plane in own["planes"])
            print(f"{path.name:42} flux {flux:9.5g}: off {100 * worst:.3f} % at most; beam/field {planes}: off {off:.3f}°"
                  f"{'' if good else '   TOO FAR'}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    sys.exit(main(sys.argv[1]))
