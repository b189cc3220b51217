#!/usr/bin/env python3
"""Compares BSDFs of WINDOW and Radiance (XML), compressed without loss, with a parser of its own.

    bsdf_xml.py PROGRAM [--quick | FILE.xml …]

For matrices: the value at the centre of every pair of patches, and at random directions inside outgoing patches,
must be that of the file to 1e-5; the directional albedo that `physics` reports for each incident patch must be the
sum of values times projected solid angles to 1e-4. For tensor trees: the averages over triangles that lie in one
cell must be the cell's value to 1e-5. Without files it takes those of tests/fixtures/bsdf_xml and makes matrices of
all of Klems' bases; --quick leaves out the large ones, which take minutes. The order of a matrix and of a tree is
that of Radiance's bsdf_m.c and bsdf_t.c; directions are vectors in the axes of WINDOW (z indoors, y up), as
EnergyPlus has them, until they are turned to the side of the light. Needs numpy. Exit code 0 if all agree, 1 if
not.
"""
import io
import json
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    print(f"bsdf_xml.py: {error}; install numpy: python3 -m pip install numpy", file=sys.stderr)
    sys.exit(2)

import bsdf_xml_make as make

ROOT = Path(__file__).resolve().parents[2]
VALUES = 1e-5
ALBEDOS = 1e-4
# Random outgoing directions for each incident patch, and of a tree.
INSIDE = 40
TREE_QUERIES = 4000
# For each rank of trees: level of the triangles, and degrees about a query within which a tree must be constant, more
# than such a triangle is wide.
LEVELS = {3: (6, 3.2), 4: (4, 6.4)}
failures = []


def run(program, *arguments):
    done = subprocess.run([str(program), *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


class Basis:
    """Rings of patches: bounds in degrees, and the number of patches of each."""

    def __init__(self, rings):
        self.low = np.array([low for low, _ in rings], float)
        self.high = np.append(self.low[1:], 90.0)
        self.count = np.array([count for _, count in rings])
        ring = np.repeat(np.arange(len(rings)), self.count)
        within = np.concatenate([np.arange(count) for count in self.count])
        self.ring, self.within = ring, within
        middle = (self.low + self.high) / 2
        middle[(self.low == 0) & (self.count == 1)] = 0
        self.centres = np.stack([middle[ring], 360.0 * within / self.count[ring]], axis=1)
        squares = np.cos(np.radians(self.low)) ** 2 - np.cos(np.radians(self.high)) ** 2
        self.solid_angles = (np.pi * squares / self.count)[ring]

    def inside(self, random, size):
        """Random patches, and directions in them at least a thousandth of their width from the border."""
        patch = random.integers(len(self.ring), size=size)
        ring = self.ring[patch]
        u, v = random.uniform(0.001, 0.999, (2, size))
        theta = self.low[ring] + u * (self.high - self.low)[ring]
        phi = 360.0 * (self.within[patch] + v - 0.5) / self.count[ring]
        return patch, np.stack([theta, np.where(self.count[ring] == 1, 360 * v, phi) % 360], axis=1)


def parse(path):
    """Structure, bases by name, and functions (band, direction) with their elements."""
    text = Path(path).read_text(encoding="utf-8")
    text = text[text.index("<?xml") :] if "<?xml" in text else text
    root = ElementTree.fromstring(text.encode())
    for element in root.iter():
        element.tag = element.tag.split("}")[-1]
    definition = root.find("Optical/Layer/DataDefinition")
    bases = {name: Basis(rings) for name, rings in make.BASES.items() if name.startswith("LBNL")}
    for basis in definition.findall("AngleBasis"):
        rings = [
            (float(block.findtext("ThetaBounds/LowerTheta")), int(block.findtext("nPhis")))
            for block in basis.findall("AngleBasisBlock")
        ]
        bases[basis.findtext("AngleBasisName").strip()] = Basis(rings)
    functions = {}
    for data in root.findall("Optical/Layer/WavelengthData"):
        for block in data.findall("WavelengthDataBlock"):
            functions[data.findtext("Wavelength").strip(), block.findtext("WavelengthDataDirection").strip()] = block
    return definition.findtext("IncidentDataStructure").strip(), bases, functions


def evaluate(program, material, pairs, *options):
    """Values at pairs of directions, rows of theta_i, phi_i, theta_o, phi_o."""
    rows = "\n".join(",".join(repr(float(x)) for x in pair) for pair in pairs)
    text = "theta_i,phi_i,theta_o,phi_o\n" + rows + "\n"
    done = subprocess.run(
        [str(program), "evaluate", material, "--directions", "-", *options],
        input=text, capture_output=True, text=True, check=False,
    )
    if done.returncode != 0:
        raise SystemExit(f"evaluate {material}: {done.stderr.strip()}")
    return np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1, ndmin=2)[:, 0]


def check(name, what, difference, tolerance):
    worst = float(np.max(difference))
    is_right = worst <= tolerance
    print(f"{'ok   ' if is_right else 'WRONG'} {name}: {what} to {worst:.2g}")
    if not is_right:
        failures.append(name)


def relative(found, wanted):
    return np.abs(found - wanted) / np.maximum(np.abs(wanted), 1e-9)


def spoken(direction):
    kind, side = direction.split()
    return {"Transmission": "btdf", "Reflection": "brdf"}[kind], side.lower()


def turned(vectors, side):
    """Vectors in WINDOW's axes as seen from the side of the light: half a turn about y for the front."""
    return vectors * ([-1, 1, -1] if side == "front" else [1, 1, 1])


def angles_of(vectors):
    """Rows of theta and phi in degrees; 0 as the azimuth of a pole."""
    x, y, z = np.asarray(vectors, float).T
    sine = np.hypot(x, y)
    phi = np.where(sine < 1e-12, 0.0, np.degrees(np.arctan2(y, x)))
    return np.stack([np.degrees(np.arctan2(sine, z)), phi % 360], axis=1)


def light_of(centres, side):
    """Angles from which light comes whose patches have these angles of propagation."""
    course = vector(*centres.T).T * ([1, 1, 1] if side == "front" else [1, 1, -1])
    return angles_of(turned(-course, side))


def leaving_of(centres, side, transmits):
    """Angles to which light leaves whose patches have these angles."""
    indoors = transmits == (side == "front")
    return angles_of(turned(vector(*centres.T).T * ([1, 1, 1] if indoors else [1, 1, -1]), side))


def check_matrix(program, path, name, structure, bases, band, direction, block, directory):
    columns, rows = (bases[block.findtext(key).strip()] for key in ("ColumnAngleBasis", "RowAngleBasis"))
    numbers = np.array(block.findtext("ScatteringData").replace(",", " ").split(), float)
    incoming, outgoing = columns, rows
    values = numbers.reshape(len(rows.ring), len(columns.ring))
    if structure == "Columns":
        values = values.T
    quantity, side = spoken(direction)
    transmits = quantity == "btdf"
    material = Path(directory) / "m.wlm"
    options = ["--quantity", quantity, "--side", side, "--band", band, "--lossless"]
    run(program, "compress", path, *options, "-o", material)
    light = light_of(incoming.centres, side)
    leaving = leaving_of(outgoing.centres, side, transmits)
    pairs = np.concatenate([np.repeat(light, len(leaving), axis=0), np.tile(leaving, (len(light), 1))], axis=1)
    found = evaluate(program, material, pairs).reshape(values.shape)
    check(name, f"{values.size} values at centres", relative(found, values), VALUES)
    random = np.random.default_rng(5)
    patch, inside = outgoing.inside(random, INSIDE * len(light))
    inside = leaving_of(inside, side, transmits)
    number = np.repeat(np.arange(len(light)), INSIDE)
    found = evaluate(program, material, np.concatenate([light[number], inside], axis=1))
    check(name, f"{len(found)} values inside patches", relative(found, values[number, patch]), VALUES)
    report = json.loads(run(program, "physics", material, "--json"))
    entries = report["energy"]["albedo"]["entries"]
    angles = np.array([entry["wi"] for entry in entries], float)
    reported = np.array([entry["value"] for entry in entries])
    difference = []
    for (theta, phi), wanted in zip(light, values @ outgoing.solid_angles):
        turn = np.abs((angles[:, 1] - phi + 180) % 360 - 180) * (theta > 0)
        nearest = np.argmin(np.abs(angles[:, 0] - theta) + turn)
        if abs(angles[nearest, 0] - theta) + turn[nearest] > 1e-6:
            raise SystemExit(f"{name}: physics has no albedo for light from {theta}, {phi}")
        difference.append(abs(reported[nearest] - wanted) / max(wanted, 1e-9))
    check(name, f"{len(difference)} albedos", difference, ALBEDOS)


def read_tree(text, rank):
    """The tree as nested lists of children, or arrays of values `[cell of dimension 0, …]`."""
    tokens = text.replace("{", " { ").replace("}", " } ").replace(",", " ").split()
    at = 0

    def node():
        nonlocal at
        at += 1
        if tokens[at] == "{":
            found = [node() for _ in range(1 << rank)]
        else:
            start = at
            while tokens[at] != "}":
                at += 1
            side = round((at - start) ** (1 / rank))
            found = np.array(tokens[start:at], float).reshape((side,) * rank)
        at += 1
        return found

    return node()


def square(x, y):
    """Shirley and Chiu's map of the disk to the unit square."""
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    if angle < -np.pi / 4:
        angle += 2 * np.pi
    quarter = int((angle + np.pi / 4) // (np.pi / 2))
    along = (angle - quarter * np.pi / 2) * radius * 4 / np.pi
    a, b = [(radius, along), (-along, radius), (-radius, -along), (along, -radius)][quarter % 4]
    return [(a + 1) / 2, (b + 1) / 2]


def look_up(tree, position):
    position = np.clip(position, 0, 1 - 1e-15)
    while isinstance(tree, list):
        halves = (position >= 0.5).astype(int)
        tree = tree[int(sum(half << k for k, half in enumerate(halves)))]
        position = position * 2 - halves
    return tree[tuple((position * tree.shape[0]).astype(int))]


def tree_value(tree, rank, side, wi, wo):
    wi, wo = turned(wi, side), turned(wo, side)
    if rank == 4:
        return look_up(tree, np.array(square(-wi[0], -wi[1]) + square(wo[0], wo[1])))
    sine = np.hypot(wi[0], wi[1])
    turn = np.arctan2(-wi[1], -wi[0])
    x, y = np.cos(turn) * wo[0] + np.sin(turn) * wo[1], np.cos(turn) * wo[1] - np.sin(turn) * wo[0]
    return look_up(tree, np.array([0.5 - 1e-9 - 0.5 * sine, *square(x, y)]))


def vector(theta, phi):
    theta, phi = np.radians(theta), np.radians(phi)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def around(direction, width, random):
    """Directions within `width` degrees, at several distances and azimuths; the first is the direction itself."""
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    across = np.cross(direction, helper)
    across /= np.linalg.norm(across)
    other = np.cross(direction, across)
    found = [direction]
    for distance in (width / 2, width):
        for turn in np.arange(12) * np.pi / 6 + random.uniform(0, np.pi / 6):
            step = np.tan(np.radians(distance)) * (np.cos(turn) * across + np.sin(turn) * other)
            found.append((direction + step) / np.linalg.norm(direction + step))
    return found


def check_tree(program, path, name, structure, band, direction, block, directory):
    rank = int(structure[-1])
    tree = read_tree(block.findtext("ScatteringData"), rank)
    quantity, side = spoken(direction)
    material = Path(directory) / "t.wlm"
    level, width = LEVELS[rank]
    levels = ["--outgoing-level", level] + (["--incoming-level", level] if rank == 4 else [])
    options = ["--quantity", quantity, "--side", side, "--band", band, "--lossless", *levels]
    run(program, "compress", path, *options, "-o", material)
    random = np.random.default_rng(6)
    # Elevations at the middles of cells: smallest cells of 1/8.
    elevations = np.degrees(np.arcsin((2 * np.arange(4) + 1) / 8))
    pairs, wanted = [], []
    for _ in range(TREE_QUERIES):
        theta_i = random.choice(elevations) if rank == 3 else np.degrees(np.arccos(np.sqrt(random.uniform(0.1, 1))))
        theta_o, phi_i, phi_o = random.uniform(4, 80), *random.uniform(0, 360, 2)
        wi, wo = vector(theta_i, phi_i), vector(theta_o, phi_o)
        lights = around(wi, width, random) if rank == 4 else [wi]
        near = {tree_value(tree, rank, side, light, to) for light in lights for to in around(wo, width, random) if light[2] > 0}
        if len(near) == 1:
            pairs.append([theta_i, phi_i, 180 - theta_o if quantity == "btdf" else theta_o, phi_o])
            wanted += near
    found = evaluate(program, material, pairs, "--interpolation", "constant")
    check(name, f"{len(pairs)} averages inside cells", relative(found, np.array(wanted)), VALUES)
    if len(pairs) < 100:
        failures.append(f"{name}: too few queries lie in one cell")


def main(program, files, is_quick=False):
    with tempfile.TemporaryDirectory() as directory:
        if not files:
            files = sorted((ROOT / "tests/fixtures/bsdf_xml").glob("*.xml"))
            if is_quick:
                files = [path for path in files if path.name != "tree_4.xml"]
            for basis in ("Quarter",) if is_quick else ("Full", "Half", "Quarter"):
                made = Path(directory) / f"{basis}.xml"
                functions = [("Visible", "Transmission Front"), ("Visible", "Reflection Front")]
                made.write_text(make.klems(f"LBNL/Klems {basis}", functions, is_stated=basis == "Half"))
                files.append(made)
        for path in files:
            structure, bases, functions = parse(path)
            for (band, direction), block in functions.items():
                name = f"{Path(path).name}, {band} {direction}"
                if structure.startswith("TensorTree"):
                    check_tree(program, path, name, structure, band, direction, block, directory)
                else:
                    check_matrix(program, path, name, structure, bases, band, direction, block, directory)
    if failures:
        print(f"FAILED: {'; '.join(failures)}")
    return 1 if failures else 0


if __name__ == "__main__":
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    is_quick = "--quick" in sys.argv[2:]
    sys.exit(main(sys.argv[1], [Path(name) for name in sys.argv[2:] if name != "--quick"], is_quick))
