#!/usr/bin/env python3
"""Compares the reader of MERL tables with the lookup published with the data, written here from its description.

    merl_lookup.py EXAMPLE [--pairs N]      EXAMPLE is the built example program `rgl`

It makes tables of random numbers, some of them negative (missing): 90 x 90 x 180 in both byte orders, and 90 x 90 x
360. At N (10,000) random pairs every value must agree to 1e-6 relative, and the missing ones must be those missing
here. Pairs within 1e-7 of the edge of a cell are left out: rounding decides there. Needs numpy only. Exit code 0 if all
agree, 1 if not.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    print(f"merl_lookup.py: {error}; install numpy: python3 -m pip install numpy", file=sys.stderr)
    sys.exit(2)

TOLERANCE = 1e-6
EDGE = 1e-7
SCALES = np.array([1.0, 1.15, 1.66]) / 1500


def write(path, table, order):
    """`table` is [channel, theta_h, theta_d, phi_d] as stored."""
    with open(path, "wb") as file:
        file.write(np.array(table.shape[1:], f"{order}i4").tobytes())
        file.write(table.astype(f"{order}f8").tobytes())


def rotate(v, axis, angle):
    """About a unit axis, by Rodrigues' formula."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return v * c + np.cross(axis, v) * s + axis * (v @ axis)[:, None] * (1 - c)


def lookup(table, wi, wo):
    """The values [pair, channel], NaN = missing, and whether a pair is well inside its cell."""
    half = wi + wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    theta_h, phi_h = np.arccos(half[:, 2]), np.arctan2(half[:, 1], half[:, 0])
    difference = rotate(rotate(wi, np.array([0.0, 0.0, 1.0]), -phi_h), np.array([0.0, 1.0, 0.0]), -theta_h)
    theta_d = np.arccos(np.clip(difference[:, 2], -1, 1))
    phi_d = np.arctan2(difference[:, 1], difference[:, 0])
    count = table.shape[3]
    turn = np.pi if count == 180 else 2 * np.pi
    phi_d = np.where(phi_d < 0, phi_d + turn, phi_d)
    places = [np.sqrt(np.degrees(theta_h) * 90), theta_d / (np.pi / 2) * 90, phi_d / turn * count]
    cells = [np.clip(p.astype(int), 0, n - 1) for p, n in zip(places, table.shape[1:])]
    inside = np.all([(p % 1 > EDGE) & (p % 1 < 1 - EDGE) for p in places], axis=0)
    stored = table[:, cells[0], cells[1], cells[2]].T
    return np.where(stored < 0, np.nan, stored * SCALES), inside


def pairs(count, random):
    z = random.uniform(0.01, 1, (count, 2))
    phi = random.uniform(-np.pi, np.pi, (count, 2))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def ours(example, path, directions):
    text = "\n".join(" ".join(repr(float(x)) for x in pair.ravel()) for pair in directions)
    done = subprocess.run([example, path], input=text, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{example} {path}: {done.stderr.strip()}")
    return np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()])


def main(example, count):
    failed = False
    with tempfile.TemporaryDirectory() as directory:
        for seed, (azimuths, order) in enumerate([(180, "<"), (180, ">"), (360, "<")]):
            random = np.random.default_rng(seed)
            table = random.gamma(2.0, 50.0, (3, 90, 90, azimuths))
            table[random.uniform(size=table.shape) < 0.02] = -1.0
            path = Path(directory) / f"{azimuths}.binary"
            write(path, table, order)
            directions = pairs(count, random)
            wanted, inside = lookup(table, directions[:, 0].copy(), directions[:, 1].copy())
            found = ours(example, path, directions)
            missing = np.isnan(wanted)
            same = np.array_equal(missing[inside], np.isnan(found)[inside])
            known = inside[:, None] & ~missing
            error = np.abs(found[known] / wanted[known] - 1).max()
            good = same and error <= TOLERANCE and inside.mean() > 0.99
            failed |= not good
            name = f"90 x 90 x {azimuths}, {'little' if order == '<' else 'big'}-endian"
            print(f"{name:34} {inside.sum()} pairs, {missing.sum()} values missing: relative difference at most {error:.1e}"
                  f"{'' if good else '   DISAGREES'}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    match sys.argv[1:]:
        case [example]:
            sys.exit(main(example, 10_000))
        case [example, "--pairs", count]:
            sys.exit(main(example, int(count)))
        case _:
            print(__doc__, file=sys.stderr)
            sys.exit(2)
