#!/usr/bin/env python3
"""Reads exported LM-63 and EULUMDAT files with readers of its own and compares their flux with that of the material.

    luminaire_flux.py WAVELUME      the built program

The flux of a file is the sum over cells of the mean intensity of the four corners times the solid angle; it must be
within 0.5 % of what `wavelume physics` says of the material. Lines of LM-63 must have at most 132 characters. Needs
numpy only. Exit code 0 if all hold, 1 if not, 2 if something is missing.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    print(f"luminaire_flux.py: {error}; install numpy: python3 -m pip install numpy", file=sys.stderr)
    sys.exit(2)

ROOT = Path(__file__).resolve().parent.parent.parent
TOLERANCE = 0.005
# A measurement, its options (of a coarse one a level at which the smooth form keeps the cells' flux), the formats that
# hold it, and the flux that the files speak of.
LAMPS = [
    ("data/aerolamp.ies", [], ["lm63"], "total"),
    ("data/aerolamp.ies", ["--spectrum", "data/aerolamp.csv"], ["lm63"], "total"),
    ("tests/fixtures/ies/iesna2002_example_typec.ies", ["--outgoing-level", "4"], ["lm63", "eulumdat"], "luminous"),
    ("tests/fixtures/ldt/example.ldt", [], ["lm63", "eulumdat"], "luminous"),
]


def lm63(text):
    """C and gamma in degrees, intensities [c, gamma]."""
    head, numbers = text.split("TILT=NONE", 1)
    assert head.startswith("IESNA:LM-63-2002") and max(map(len, text.splitlines())) <= 132
    numbers = [float(x) for x in numbers.split()]
    lamps, lumens, multiplier, gammas, planes, kind, units = numbers[:7]
    assert (lamps, kind, units) == (1, 1, 2) and (lumens == -1 or lumens > 0), numbers[:7]
    gammas, planes = int(gammas), int(planes)
    gamma, c = numbers[13 : 13 + gammas], numbers[13 + gammas : 13 + gammas + planes]
    values = np.array(numbers[13 + gammas + planes :]).reshape(planes, gammas)
    return np.array(c), np.array(gamma), values * multiplier * numbers[10] * numbers[11]


def eulumdat(text):
    lines = text.splitlines()
    assert lines[2] == "0" and lines[25] == "1" and lines[26] in ("1", "-1"), lines[:30]
    planes, gammas, lumens = int(lines[3]), int(lines[5]), float(lines[28])
    numbers = [float(x) for x in lines[42:]]
    c, gamma = np.array(numbers[:planes] + [360.0]), np.array(numbers[planes : planes + gammas])
    values = np.array(numbers[planes + gammas :]).reshape(planes, gammas) / 1000 * lumens * float(lines[23])
    return c, gamma, np.concatenate([values, values[:1]])


def flux(c, gamma, values):
    zone = -np.diff(np.cos(np.radians(gamma)))
    means = (values[1:, 1:] + values[:-1, 1:] + values[1:, :-1] + values[:-1, :-1]) / 4
    return float((np.radians(np.diff(c))[:, None] * zone * means).sum())


def run(*command):
    done = subprocess.run([str(part) for part in command], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout


def main(wavelume):
    wavelume, failed = Path(wavelume).resolve(), False
    with tempfile.TemporaryDirectory() as directory:
        material, out = Path(directory) / "m.wlm", Path(directory) / "out"
        for path, options, formats, which in LAMPS:
            run(wavelume, "compress", path, "-o", material, "--er-l2", "0.005", *options)
            own = json.loads(run(wavelume, "physics", material, "--json"))["energy"]["flux"][0]
            for name in formats:
                report = json.loads(run(wavelume, "export", material, "--format", name, "-o", out, "--json"))
                read = {"lm63": lm63, "eulumdat": eulumdat}[name]
                found = flux(*read(out.read_bytes().decode("ascii")))
                error = found / own[which] - 1
                good = abs(error) <= TOLERANCE
                failed |= not good
                print(f"{Path(path).name:34} {name:8} {report['unit']:5} {report['resolution']:34} flux {found:.5g}: {100 * error:+.3f} %,"
                      f" er(L2) {100 * report['error']['er_l2']:.3f} %{'' if good else '   TOO FAR'}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    sys.exit(main(sys.argv[1]))
