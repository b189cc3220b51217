#!/usr/bin/env python3
"""Bytes of whole files of measurements on their own grids of angles, and their errors at the samples of the source:
the tables of docs/performance.md.

Usage: grids.py BINARY [NAME...]             # needs numpy
       grids.py --peers BINARY [NAME...]     # needs tests/peers/requirements.txt

Every file is compressed by the service without its provenance; every sample that the source states is then evaluated
over HTTP and compared with the number that a reader of its own (tests/acceptance/gridded.py) found in the source. A
target is missed where that error exceeds it. `ggx_grid` and `aniso_grid` are made here, by seeded noise over analytic
reflectances.

With --peers the luminaires and surfaces of tests/fixtures are added; those with the same samples are one line, for
which the largest of their files counts. own_grids.py says what peers get and how many bytes a file may have beside
the best of them. The exit code is 1 where a target is missed, no file is made, or a file has more bytes than that.
"""
import argparse
import contextlib
import datetime
import glob
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field

os.environ.update({name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")})
import numpy as np  # noqa: E402  (after the number of threads)

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [HERE, os.path.join(ROOT, "tests", "acceptance")]
import gen  # noqa: E402
import gridded  # noqa: E402
import others  # noqa: E402
import own_grids  # noqa: E402
import tables  # noqa: E402

TARGETS = [0.005, 0.01, 0.02, 0.05]
FLOOR = 1e-3
FILES = ["aerolamp.ies", "nukit_lantern.ies", "ushio_b1.ies", "carpaint_blue.mbsdf", "carpaint_red.mbsdf"]
FIXTURES = ("ies", "ldt", "mbsdf")
PLACES = [os.path.join(ROOT, "data"), os.path.join(ROOT, "tests", "fixtures", "ies"), os.environ.get("MEASUREMENTS")]


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
    axes = [degrees("theta_i", 10, 9), degrees("theta_o", 5, 18), degrees("phi_o", 5, 37, extent="mirrored")]
    return a, [*axes, "lambda:380:5:75"]


def aniso_grid():
    """theta_i 0..60, phi_i 0..315, theta_o 0..80, phi_o 0..350, 400..700 nm: a tilted, turned gloss.

    At a pole there is one value.
    """
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


@dataclass
class Source:
    """A measurement on a grid of angles; an array needs a manifest.

    Samples below `floor` times the largest do not count.
    """

    name: str
    path: str
    manifest: dict | None = None
    floor: float | None = None


def sources(scratch):
    """The measurements of the table that are there."""
    for file in FILES:
        name = file.split(".")[0]
        path = next((p for place in PLACES if place and os.path.exists(p := os.path.join(place, file))), None)
        if path is None:
            print(f"{file} is not there; MEASUREMENTS names a directory that has it", file=sys.stderr)
            continue
        yield Source(name, path)
        if name.startswith("carpaint"):
            yield Source(name + ", floor 0.1 %", path, floor=FLOOR)
    for make in (ggx_grid, aniso_grid):
        values, axes = make()
        path = os.path.join(scratch, make.__name__ + ".npy")
        np.save(path, values.astype(np.float32))
        manifest = {"quantity": "brdf", "value_unit": "1/sr", "cosine_included": False, "axes": axes}
        yield Source(make.__name__, path, manifest)


def fixtures():
    """The luminaires and surfaces of the tests that are not in the table already."""
    room = os.path.join(ROOT, "tests", "fixtures")
    for ending in FIXTURES:
        for path in sorted(glob.glob(os.path.join(room, ending, "**", "*." + ending), recursive=True)):
            if os.path.basename(path) not in FILES:
                yield Source(os.path.splitext(os.path.relpath(path, room))[0], path)


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


@dataclass
class Found:
    """A measurement's samples, the noise that its files state, and the bytes and error of its file at each target.

    Where no file was made these are None, and `failed` has the reason.
    """

    name: str
    floor: float | None
    samples: gridded.Samples
    noise: float = 0.0
    size: list = field(default_factory=list)
    error: list = field(default_factory=list)
    failed: dict = field(default_factory=dict)
    files: int = 1

    def line(self):
        cells = [f"{size:,} · {100 * error:.3f}" if size else "–" for size, error in zip(self.size, self.error)]
        return f"| {self.name} | " + " | ".join(cells) + " |"

    def missed(self):
        return any(error is None or error > target * (1 + 1e-4) for target, error in zip(TARGETS, self.error))

    def join(self, other):
        """Takes in another file with the same samples; the larger bytes and errors count, a failure before either."""
        larger = lambda mine, theirs: [a and b and max(a, b) for a, b in zip(mine, theirs)]
        self.size, self.error = larger(self.size, other.size), larger(self.error, other.error)
        self.failed |= other.failed
        self.files += 1


def measured(base, source):
    """Compresses a measurement to every target."""
    found = Found(source.name, source.floor, gridded.read(source.path, source.manifest))
    for target in TARGETS:
        try:
            size, error, found.noise = compressed(base, source, target, found.samples)
        except RuntimeError as why:
            found.failed[target], size, error = str(why), None, None
        found.size.append(size)
        found.error.append(error)
    return found


def compressed(base, source, target, samples):
    """Bytes of the file, its error at the samples, and the noise that it states; 0 where it states none."""
    options = {"metadata": False, "domain": "grid"}
    options |= {"axes": source.manifest} if source.manifest else {}
    options |= {"floor": source.floor} if source.floor else {}
    least = source.floor * np.nanmax(samples.values) if source.floor else 0.0
    job = gridded.compress(base, source.path, target, **options)
    material = json.loads(gridded.call(f"{base}/v1/materials/{job['material']}"))
    error = gridded.er_l2(samples, gridded.evaluate(base, job["material"], samples), least)
    return material["bytes"], error, (material["noise"] or {"relative": 0.0})["relative"]


def own_table(binary, names, more):
    """Prints our bytes and errors; returns what was found, with more also that of the fixtures."""
    print(f"{datetime.date.today()}: bytes of the file · er(L2) in per cent at the source's own samples\n")
    print("| | " + " | ".join(f"{100 * t:g} %" for t in TARGETS) + " |\n|---|" + "--:|" * len(TARGETS))
    every = []
    with tempfile.TemporaryDirectory() as scratch, service(binary, scratch) as base:
        for source in sources(scratch):
            if not names or source.name in names:
                every.append(measured(base, source))
                print(every[-1].line(), flush=True)
        if more:
            every += measured_fixtures(base, names)
    print_failures(every)
    return every


def print_failures(every):
    """Prints why there is no file, each reason once for a measurement."""
    for found in every:
        for why in dict.fromkeys(found.failed.values()):
            targets = [f"{100 * target:g}" for target, other in found.failed.items() if other == why]
            print(f"\n{found.name} at {', '.join(targets)} %, no file: {why}.")


def measured_fixtures(base, names):
    """The results of the fixtures, those with the same samples as one; prints a line of each to stderr."""
    found = {}
    for source in fixtures():
        if names and source.name not in names:
            continue
        try:
            one = measured(base, source)
        except ValueError as why:
            print(f"{source.name} left out: {why}", file=sys.stderr)
            continue
        print(one.line(), file=sys.stderr)
        key = one.samples.values.tobytes(), str(one.samples.grids)
        found[key].join(one) if key in found else found.setdefault(key, one)
    return list(found.values())


# ---- beside the peers


def beside_peers(every):
    """Prints the best peer's bytes beside ours, a line for each target; returns the names that have too many."""
    peers, missing = others.installed()
    print("\n| | er(L2) | ours | best peer | | ours / best | allowed | samples | noise | |")
    print("|---|--:|--:|--:|---|--:|--:|--:|--:|---|")
    rows, over, start = [], [], time.perf_counter()
    for found in every:
        print(found.name, file=sys.stderr)
        grid = own_grids.Grid(found.name, found.samples, found.floor)
        targets = [100 * target for target in TARGETS]
        theirs = own_grids.entries(grid, found.samples, found.floor, targets, peers, missing, sys.stderr)
        rows += theirs
        lines = [compared(found, grid, k, theirs) for k in range(len(TARGETS))]
        print("\n".join(line for line, _ in lines), flush=True)
        over += [found.name] if not all(good for _, good in lines) else []
    print("\n".join(tables.silent(rows)), flush=True)
    print(f"\nPeers took {(time.perf_counter() - start) / 60:.0f} minutes.", file=sys.stderr)
    return over


def compared(found, grid, k, rows):
    """A line of the table of peers, and whether our file is small enough."""
    target, size = TARGETS[k], found.size[k]
    best = tables.best_row(rows, found.name, 100 * target)
    least = int(best["bytes"]) if best else math.inf
    most = own_grids.allowed(grid.count, target < found.noise, least)
    good = size is not None and size <= most
    cells = [found.name + (f" ({found.files} files)" if found.files > 1 else ""), f"{100 * target:g} %"]
    cells += [f"{size:,}" if size else "–"]
    cells += [f"{least:,}", f"{best['peer']}, {best['setting']}"] if best else ["–", "–"]
    cells += [f"{size / least:.2f}", f"{most / least:.2f}"] if best and size else ["–", "–"]
    cells += [f"{grid.count:,}", f"{100 * found.noise:.2g} %" if found.noise else "–"]
    cells += ["ok" if good else f"**{size - int(most):,} B over**" if size else "**no file**"]
    return "| " + " | ".join(cells) + " |", good


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], epilog="more in the head of this file")
    parser.add_argument("binary", help="the wavelume program")
    parser.add_argument("names", nargs="*", help="names as in the tables; all without any")
    parser.add_argument("--peers", action="store_true", help="the best of other compressors on the same grids, too")
    options = parser.parse_intermixed_args()
    every = own_table(options.binary, options.names, options.peers)
    broken = [found.name for found in every if found.missed()]
    over = beside_peers(every) if options.peers else []
    if broken:
        print(f"above the target: {', '.join(broken)}", file=sys.stderr)
    if over:
        print(f"more bytes than allowed beside peers: {', '.join(over)}", file=sys.stderr)
    sys.exit(1 if broken or over else 0)


if __name__ == "__main__":
    main()
