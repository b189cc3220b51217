#!/usr/bin/env python3
"""Writes BSDFs as WINDOW and Radiance do (XML), of smooth made-up functions without any symmetry.

    bsdf_xml_make.py DIRECTORY

The files go to tests/fixtures/bsdf_xml: a quarter matrix that a tool's note precedes, a small basis of its own with
all eight functions, and tensor trees of rank 3 and 4. `bsdf_xml.py` makes larger ones with the same functions.
Needs Python alone.
"""
import math
import sys
from pathlib import Path

# Rings of each basis: lower bound in degrees, number of patches.
BASES = {
    "LBNL/Klems Full": [(0, 1), (5, 8), (15, 16), (25, 20), (35, 24), (45, 24), (55, 24), (65, 16), (75, 12)],
    "LBNL/Klems Half": [(0, 1), (6.5, 8), (19.5, 12), (32.5, 16), (45.5, 20), (58.5, 12), (71.5, 8)],
    "LBNL/Klems Quarter": [(0, 1), (9, 8), (27, 12), (45, 12), (63, 8)],
    "own": [(0, 1), (20, 3), (55, 4)],
}
FUNCTIONS = ["Transmission Front", "Transmission Back", "Reflection Front", "Reflection Back"]


def patches(rings):
    """Theta and azimuth of the centre of each patch, in radians, in the order of the file."""
    ends = [low for low, _ in rings[1:]] + [90]
    for (low, count), high in zip(rings, ends):
        theta = 0 if low == 0 and count == 1 else math.radians((low + high) / 2)
        for k in range(count):
            yield theta, 2 * math.pi * k / count


def vector(theta, phi):
    return math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)


def function(number, travelling, leaving):
    """A lobe about the unscattered direction over a base that depends on both azimuths; `number` tells functions
    apart. Both vectors are those of the patches: light travels along the first, with z turned up."""
    cosine = sum(a * b for a, b in zip(travelling, leaving))
    lobe = math.exp((6 + number) * (cosine - 1)) * 0.25
    base = 0.04 + 0.01 * number + 0.02 * travelling[0] + 0.015 * leaving[1] + 0.01 * travelling[1] * leaving[0]
    return lobe + base


def matrix(rings, number, structure="Columns"):
    """Numbers of a matrix as the file has them: a row for each outgoing patch, or for each incident one."""
    directions = [vector(*patch) for patch in patches(rings)]
    outer_is_outgoing = structure == "Columns"
    rows = []
    for outer in directions:
        pairs = [(inner, outer) if outer_is_outgoing else (outer, inner) for inner in directions]
        rows.append(", ".join(f"{function(number, i, o):.6f}" for i, o in pairs) + ",")
    return "\n".join(rows)


def rings_as_xml(name, rings):
    ends = [low for low, _ in rings[1:]] + [90]
    blocks = "".join(
        f"<AngleBasisBlock><Theta>{0 if low == 0 else (low + high) / 2:g}</Theta><nPhis>{count}</nPhis><ThetaBounds>"
        f"<LowerTheta>{low:g}</LowerTheta><UpperTheta>{high:g}</UpperTheta></ThetaBounds></AngleBasisBlock>"
        for (low, count), high in zip(rings, ends)
    )
    return f"<AngleBasis><AngleBasisName>{name}</AngleBasisName>{blocks}</AngleBasis>"


def document(structure, functions, definition="", head=""):
    """`functions` are (band, direction, elements that name the bases, numbers)."""
    blocks = "".join(
        f'<WavelengthData><LayerNumber>System</LayerNumber><Wavelength unit="Integral">{band}</Wavelength>\n'
        f"<WavelengthDataBlock><WavelengthDataDirection>{direction}</WavelengthDataDirection>{bases}"
        f"<ScatteringDataType>BTDF</ScatteringDataType>\n<ScatteringData>\n{numbers}\n</ScatteringData>"
        "</WavelengthDataBlock></WavelengthData>\n"
        for band, direction, bases, numbers in functions
    )
    return (
        f'{head}<?xml version="1.0" encoding="UTF-8"?>\n<WindowElement xmlns="http://windows.lbl.gov">'
        "<WindowElementType>System</WindowElementType><FileType>BSDF</FileType>\n<Optical><Layer>"
        '<Material><Name>Made up</Name><Manufacturer>nobody</Manufacturer><Thickness unit="Millimeter">1</Thickness>'
        f"<DeviceType>Other</DeviceType></Material>\n<DataDefinition><IncidentDataStructure>{structure}"
        f"</IncidentDataStructure>{definition}</DataDefinition>\n{blocks}</Layer></Optical></WindowElement>\n"
    )


def klems(name, functions, structure="Columns", is_stated=False, head=""):
    """A file of matrices on the basis `name`; `functions` are (band, direction)."""
    bases = f"<ColumnAngleBasis>{name}</ColumnAngleBasis><RowAngleBasis>{name}</RowAngleBasis>"
    rings = BASES[name]
    written = [
        (band, direction, bases, matrix(rings, number, structure)) for number, (band, direction) in enumerate(functions)
    ]
    return document(structure, written, rings_as_xml(name, rings) if is_stated else "", head)


def tree(rank, halvings, value, low=None, depth=0):
    """A tree whose nodes have children down to one halving above the cells; `value` gives that of a cell's corner."""
    low = low or [0.0] * rank
    side = 0.5**depth
    if depth < halvings - 1:
        children = []
        for child in range(1 << rank):
            corner = [x + side / 2 * (child >> k & 1) for k, x in enumerate(low)]
            children.append(tree(rank, halvings, value, corner, depth + 1))
        return "{\n" + "\n".join(children) + "\n}"
    cells = []
    # The last dimension varies fastest among cells, the first among children.
    for cell in range(1 << rank):
        cells.append(value([x + side / 2 * (cell >> (rank - 1 - k) & 1) for k, x in enumerate(low)]))
    if all(cell == cells[0] for cell in cells):
        return f"{{ {cells[0]} }}"
    return "{ " + " ".join(cells) + " }"


def cell_value(number):
    """A number for each corner of a cell; a part of the cube has one value, as pruned trees have."""

    def value(corner):
        if corner[0] < 0.25 and corner[1] < 0.5:
            return f"{0.05 + 0.01 * number:.5f}"
        return f"{0.02 + 0.01 * number + 0.03 * sum((k + 1) * x * x for k, x in enumerate(corner)):.5f}"

    return value


def trees(rank, halvings, functions):
    basis = "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>"
    written = [
        (band, direction, basis, tree(rank, halvings, cell_value(number)))
        for number, (band, direction) in enumerate(functions)
    ]
    return document(f"TensorTree{rank}", written)


FILES = {
    "quarter.xml": lambda: klems(
        "LBNL/Klems Quarter", [("Visible", "Reflection Back")], head="Recover using: genBSDF -recover /tmp/genBSDF.1\n"
    ),
    "own_basis.xml": lambda: klems(
        "own", [(band, function) for band in ("Visible", "Solar") for function in FUNCTIONS], "Rows", is_stated=True
    ),
    "tree_3.xml": lambda: trees(3, 3, [("Visible", "Reflection Front"), ("Visible", "Transmission Front")]),
    "tree_4.xml": lambda: trees(4, 2, [("Visible", "Transmission Back")]),
}


def main(directory):
    directory.mkdir(parents=True, exist_ok=True)
    for name, make in FILES.items():
        (directory / name).write_text(make())


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    main(Path(sys.argv[1]))
