#!/usr/bin/env python3
"""Bytes of whole files of measurements on their own grids of angles, and their errors at the samples of the source: the table
of docs/performance.md.

Usage: grids.py BINARY [NAME...]

Every file is compressed by the service without its provenance; every sample that the source states is then evaluated over
HTTP and compared with the number that a reader of its own (tests/acceptance/gridded.py) found in the source. A target is
missed where that error exceeds it. `ggx_grid` and `aniso_grid` are made here, by seeded noise over analytic reflectances.
"""
import contextlib
import datetime
import json
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, os.path.join(ROOT, "tests", "acceptance")]
import gen  # noqa: E402
import gridded  # noqa: E402

TARGETS = [0.005, 0.01, 0.02, 0.05]
FLOOR = 1e-3
FILES = ["aerolamp.ies", "nukit_lantern.ies", "ushio_b1.ies", "carpaint_blue.mbsdf", "carpaint_red.mbsdf"]
PLACES = [os.path.join(ROOT, "data"), os.path.join(ROOT, "tests", "fixtures", "ies"), os.environ.get("MEASUREMENTS", "")]


def directions(theta, phi):
    t, p = np.meshgrid(np.radians(theta), np.radians(phi), indexing="ij")
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)


def reflection(nm, wi, wo):
    """The reflectances of gen.py for directions of one's own."""
    r = gen.Reflection()
    r.nm, r.n, r.wi, r.wo = nm, 1.46 + 0.0085 / (nm / 1000) ** 2, wi, wo
    r.ci, r.co = wi[:, 2][:, None], wo[:, 2][None, :]
    r.h = gen.unit(wi[:, None] + wo[None])
    r.cd = (wi[:, None] * r.h).sum(-1)
    return r


def noise(shape, seed):
    return 1 + 0.003 * np.random.default_rng(seed).standard_normal(shape)


def ggx_grid():
    """theta_i 0..80, theta_o 0..85, phi_o 0..180 (180 is forward), 380..750 nm; one value at the pole."""
    wo = directions(np.arange(0, 86, 5.0), np.arange(0, 181, 5.0))
    r = reflection(np.arange(380, 751, 5.0), directions(np.arange(0, 81, 10.0), [0.0]), wo)
    a = (r.patch("red") / np.pi + r.ggx(0.15)).reshape(9, 18, 37, 75)
    a = a * noise(a.shape, 1)
    a[:, 0] = a[:, 0, :1]
    extent = {"extent": "mirrored"}
    return a, [degrees("theta_i", 10, 9), degrees("theta_o", 5, 18), degrees("phi_o", 5, 37, **extent), "lambda:380:5:75"]


def aniso_grid():
    """theta_i 0..60, phi_i 0..315, theta_o 0..80, phi_o 0..350, 400..700 nm: a tilted, turned gloss; one value at a pole."""
    wi = directions(np.arange(0, 61, 15.0), np.arange(0, 360, 45.0))
    r = reflection(np.linspace(400, 700, 31), wi, directions(np.arange(0, 81, 10.0), np.arange(0, 360, 10.0)))
    a = r.aniso().reshape(5, 8, 9, 36, 31)
    a = a * noise(a.shape, 3)
    a[0] = a[0, :1]
    a[:, :, 0] = a[:, :, 0, :1]
    axes = [degrees("theta_i", 15, 5), degrees("phi_i", 45, 8), degrees("theta_o", 10, 9), degrees("phi_o", 10, 36)]
    return a, [*axes, "lambda:400:10:31"]


def degrees(kind, step, count, **more):
    return {"kind": kind, "unit": "deg", "values": [float(step * i) for i in range(count)], **more}


def sources(scratch, names):
    """(name, file, manifest or None, floor or None) of each measurement that is there."""
    for file in FILES:
        name = file.split(".")[0]
        path = next((p for place in PLACES if place and os.path.exists(p := os.path.join(place, file))), None)
        for shown, floor in ((name, None), (name + ", floor 0.1 %", FLOOR)):
            if floor and not name.startswith("carpaint") or names and shown not in names:
                continue
            if path is None:
                print(f"{file} is not there; MEASUREMENTS names a directory that has it", file=sys.stderr)
            else:
                yield shown, path, None, floor
    for make in (ggx_grid, aniso_grid):
        if names and make.__name__ not in names:
            continue
        values, axes = make()
        path = os.path.join(scratch, make.__name__ + ".npy")
        np.save(path, values.astype(np.float32))
        yield make.__name__, path, {"quantity": "brdf", "value_unit": "1/sr", "cosine_included": False, "axes": axes}, None


@contextlib.contextmanager
def service(binary, scratch):
    """The address of a service with an empty store."""
    command = [binary, "serve", "--data", os.path.join(scratch, "store"), "--listen", "127.0.0.1:0"]
    with open(os.path.join(scratch, "log"), "w") as log:
        running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        try:
            line = running.stdout.readline()
            address = re.search(r"http://[0-9.]+:[0-9]+", line)
            if not address:
                sys.exit(f"grids.py: the service said {line!r}, expected its address")
            yield address.group()
        finally:
            running.terminate()
            running.wait()


def row(base, name, path, manifest, floor):
    """A line of the table; whether an error exceeds its target."""
    samples = gridded.read(path, manifest)
    options = {"metadata": False, "domain": "grid"}
    options |= {"axes": manifest} if manifest else {}
    options |= {"floor": floor} if floor else {}
    least = floor * np.nanmax(samples.values) if floor else 0.0
    cells, missed = [], False
    for target in TARGETS:
        job = gridded.compress(base, path, target, **options)
        material = json.loads(gridded.call(f"{base}/v1/materials/{job['material']}"))
        found = gridded.er_l2(samples, gridded.evaluate(base, job["material"], samples), least)
        missed |= found > target * (1 + 1e-4)
        cells.append(f"{material['bytes']:,} · {100 * found:.3f}")
    return f"| {name} | " + " | ".join(cells) + " |", missed


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__.split("\n\n")[1])
    print(f"{datetime.date.today()}: bytes of the file · er(L2) in per cent at the source's own samples\n")
    print("| | " + " | ".join(f"{100 * t:g} %" for t in TARGETS) + " |\n|---|" + "--:|" * len(TARGETS))
    broken = []
    with tempfile.TemporaryDirectory() as scratch, service(sys.argv[1], scratch) as base:
        for name, path, manifest, floor in sources(scratch, sys.argv[2:]):
            line, missed = row(base, name, path, manifest, floor)
            print(line, flush=True)
            broken += [name] if missed else []
    if broken:
        sys.exit(f"above the target: {', '.join(broken)}")


if __name__ == "__main__":
    main()
