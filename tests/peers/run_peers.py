#!/usr/bin/env python3
"""Bytes of wavelume and of other compressors on the same arrays at the same error: CSV, markdown, and the goals.

Usage: run_peers.py --binary target/release/wavelume --out DIR [--arrays NAME,...] [--targets 1,2,5]
       run_peers.py --binary … --out DIR --stored       # the peers from results/, wavelume measured now
       run_peers.py --binary … --out DIR --policies --publish [--stored]  # docs/peers.md and the plot too
       run_peers.py --binary … --out DIR --figures      # wavelume against the goals alone
       run_peers.py --list                              # the arrays

An array is synthetic (gen.py), or a measurement through `wavelume project`. A name with `_floor` is the same array
clipped from below at that fraction of its maximum, for every compressor alike, before any of them sees it.

The error is er(L2) = sqrt(mean(((s' - s) / s)²)) over samples with s > 0, of float32 in and out, computed here in
float64. Peers get negative samples as zeros, and may decode anything where s <= 0; wavelume keeps signs and zeros and
pays for them. Each peer runs on the array as it is and on the triangles' rhombic grids (`grid`), on values and on
logarithms (`log`). Its knob is searched for the smallest file with an error within the target, from the loosest target
on; the best of these is its entry, and what is 1.5 times larger is not followed further. The search is bounded by a
number of encodings, so the same arrays give the same results; arrays above 10 MB get the grid, the logarithm, fewer
encodings, and no slow peers. Whatever did not run is listed with its reason. The noise of each array, and the least
bytes that any coder spends on it, are as rate_bound.py says.
"""

import argparse
import csv
import glob
import importlib.metadata
import json
import math
import os
import subprocess
import sys
import time

os.environ.update({name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")})
import numpy as np  # noqa: E402  (after the number of threads)

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import gen  # noqa: E402
import others  # noqa: E402
import plot_rd  # noqa: E402
import rate_bound  # noqa: E402
import search  # noqa: E402
import tables  # noqa: E402
from search import FIELDS, processor  # noqa: E402
from tables import smallest  # noqa: E402

ROOT = gen.ROOT
FLOOR = 1e-3
RATIOS = [4, 8, 16, 32, 64, 128, 256, 512]  # of the paper's policies; 32 times as much for arrays above 10 MB

# ---- the arrays: name -> (files to project) ; the synthetic ones are gen.ARRAYS
MEASURED = {
    "aerolamp": ("aerolamp.ies", "aerolamp.csv"),
    "nukit_lantern": ("nukit_lantern.ies", "nukit_lantern.csv"),
    "ushio_b1": ("ushio_b1.ies", "ushio_b1.csv"),
    "carpaint_red": ("carpaint_red.mbsdf", None),
    "carpaint_blue": ("carpaint_blue.mbsdf", None),
}
NOISY_VIRTUAL = {"brushed_copper_1pct": ("data/virtual/brushed_copper.json", 0.01)}
PLACES = ["data", "tests/fixtures/ies", "tests/fixtures/mbsdf"]
NAMES = [*gen.ARRAYS, *NOISY_VIRTUAL, *(name + end for name in MEASURED for end in ("", "_floor"))]

# ---- the goals: bytes at er(L2) of 0.5, 1, 2 and 5 %; at 0.1 % for phase functions; pointwise at 2 %
GOALS = {
    "brdf_aniso": {0.5: 8364, 1: 4064, 2: 2064, 5: 1064},
    "brdf_gloss": {0.5: 1064, 1: 664, 2: 414, 5: 264},
    "brdf_wood": {0.5: 914, 1: 514, 2: 324, 5: 244},
    "brdf_velvet": {0.5: 614, 1: 364, 2: 264, 5: 144},
    "brdf_spectralon": {0.5: 254, 1: 164, 2: 128, 5: 128},
    "edf_d65": {0.5: 814, 1: 664, 2: 504, 5: 284},
    "edf_f11": {0.5: 714, 1: 614, 2: 514, 5: 394},
    "edf_led": {0.5: 1164, 1: 814, 2: 584, 5: 374},
    "phase_rayleigh": {0.1: 128},
    "phase_hazy": {0.1: 128},
    "phase_murky": {0.1: 128},
}
POINTWISE_GOALS = {"brdf_gloss": {2: 1664}}
# Measurements have no goal in bytes, but one against the best peer: so many times smaller, above and below the noise.
AGAINST_PEERS = [*(name + end for name in MEASURED for end in ("", "_floor")), *NOISY_VIRTUAL]
MARGIN, MARGIN_BELOW = tables.MARGIN, tables.MARGIN_BELOW
SECONDS_GOAL = 1.5


class Refused(Exception):
    """An array that cannot be made here, or a file that misses its promise."""


# ---- making arrays


def find(name, places):
    for place in places:
        path = os.path.join(ROOT, place, name)
        if os.path.exists(path):
            return path
    raise Refused(f"{name} is not in {', '.join(places)}; --measurements names one more directory")


def project(binary, path, extra, out):
    if not binary:
        raise Refused(f"{os.path.basename(path)} is projected by the program, which --binary names")
    command = [binary, "project", path, *extra, "-o", out]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise Refused(f"{' '.join(command)}: {done.stderr.strip()}")
    return out


def make(name, options):
    """The path of an array's .npy; its manifest is beside it."""
    room = os.path.join(options.out, "arrays")
    os.makedirs(room, exist_ok=True)
    path = os.path.join(room, name + ".npy")
    if os.path.exists(path):
        return path
    if name in gen.ARRAYS:
        return gen.generate(room, name)
    if name.endswith("_floor"):
        whole = make(name.removesuffix("_floor"), options)
        x = np.load(whole)
        np.save(path, np.where(np.isnan(x), x, np.maximum(x, np.float32(FLOOR) * np.nanmax(x))))
        with open(whole[:-4] + ".axes.json") as source, open(path[:-4] + ".axes.json", "w") as file:
            file.write(source.read())
        return path
    if name in NOISY_VIRTUAL:
        document, noise = NOISY_VIRTUAL[name]
        with open(os.path.join(ROOT, document)) as file:
            virtual = json.load(file)
        virtual["noise"]["relative"] = noise
        document = os.path.join(room, name + ".json")
        with open(document, "w") as file:
            json.dump(virtual, file)
        return project(options.binary, document, [], path)
    places = PLACES + ([os.path.abspath(options.measurements)] if options.measurements else [])
    files = MEASURED[name]
    extra = ["--spectrum", find(files[1], places)] if files[1] else []
    return project(options.binary, find(files[0], places), extra, path)


class Array(search.Truth):
    """An array in a .npy with its manifest beside it."""

    def __init__(self, name, path):
        with open(path[:-4] + ".axes.json") as file:
            super().__init__(name, np.load(path), others.axes_of(json.load(file)))
        self.path, self.noise = path, None  # the noise as wavelume estimates it; nothing without the program

    def listen(self, binary):
        floor = FLOOR if self.name.endswith("_floor") else 0.0
        self.noise = rate_bound.estimate(binary, self.path, self.values, floor)


# ---- wavelume


def run_wavelume(truth, options, target, promise, setting, extra=()):
    """One row: compressed by the program, decoded by it, scored here; refused where it misses what it promised."""
    material = os.path.join(options.out, truth.name + ".wlm")
    decoded = os.path.join(options.out, truth.name + ".decoded.npy")
    command = [options.binary, "compress", truth.path, "-o", material, "--no-metadata", "--json", *promise, *extra]
    start, busy = time.perf_counter(), processor()
    done = subprocess.run(command, capture_output=True, text=True)
    seconds, encode = time.perf_counter() - start, processor() - busy
    if done.returncode != 0:
        why = done.stderr.strip().replace(truth.path, os.path.basename(truth.path))
        return truth.row(target, "wavelume", "wavelume", setting, note=f"failed: {why}")
    busy = processor()
    done = subprocess.run([options.binary, "decode", material, "-o", decoded], capture_output=True, text=True)
    decode = processor() - busy
    if done.returncode != 0:
        return truth.row(target, "wavelume", "wavelume", setting, note=f"decode failed: {done.stderr.strip()}")
    er_l1, er_l2, largest = truth.errors(np.load(decoded))
    note = ""
    if promise[0] == "--er-l2" and er_l2 > float(promise[1]) * (1 + 1e-6):
        note = f"missed: er(L2) {100 * er_l2:.4g} %"
    if promise[0] == "--max-relative-error" and largest > float(promise[1]) * (1 + 1e-6):
        note = f"missed: largest relative error {100 * largest:.4g} %"
    size, bound = os.path.getsize(material), {}
    if truth.noise and promise[0] == "--er-l2":
        least = truth.noise.bound(target / 100)
        bound = {"noise": truth.noise.relative, "bound_bytes": math.ceil(least), "over_bound": size / least if least else ""}
    for made in (material, decoded, decoded[:-4] + ".axes.json"):
        os.remove(made)
    return truth.row(
        target, "wavelume", "wavelume", setting, bytes=size, er_l1=er_l1, er_l2=er_l2, max_relative=largest, note=note,
        encode_mb_s=truth.megabytes / encode, decode_mb_s=truth.megabytes / decode, seconds=seconds,
        **bound,
    )  # fmt: skip


def run_policies(truth, options):
    """The paper's policies at fixed ratios, for the plot."""
    for policy in ("conventional", "generic", "adaptive"):
        for ratio in RATIOS:
            ratio *= 32 if truth.large else 1
            extra = ["--policy", policy, "--basis", "bior4.4"]
            row = run_wavelume(truth, options, 0, ["--ratio", str(ratio)], f"ratio {ratio}", extra)
            yield {**row, "peer": policy, "group": "paper"}


# ---- output


def show(value):
    return f"{value:.5g}" if isinstance(value, float) else value


def write_csv(path, rows):
    with open(path, "w", newline="") as file:
        out = csv.DictWriter(file, FIELDS, lineterminator="\n")
        out.writeheader()
        out.writerows({key: show(value) for key, value in row.items()} for row in rows)


def read_csv(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def versions():
    with open(os.path.join(HERE, "requirements.txt")) as file:
        names = [line.split("==")[0] for line in file if "==" in line and not line.startswith("#")]
    for name in names:
        try:
            yield f"{name} {importlib.metadata.version(name)}"
        except importlib.metadata.PackageNotFoundError:
            yield f"{name} not installed"


def stored_rows():
    """The peers' results kept in the repository: the newest file, and what was measured elsewhere of peers not on
    PyPI."""
    dated = sorted(glob.glob(os.path.join(HERE, "results", "peers-*.csv")))
    elsewhere = sorted(glob.glob(os.path.join(HERE, "results", "tthresh-*.csv")))
    return [row for path in dated[-1:] + elsewhere[-1:] for row in read_csv(path)]


# ---- the goals


def goals_of(name, stored, noise):
    """(promise, target in %, goal in bytes or nothing, where it is from) of an array."""
    for target, goal in GOALS.get(name, {}).items():
        yield "--er-l2", target, goal, "goal"
    for target, goal in POINTWISE_GOALS.get(name, {}).items():
        yield "--max-relative-error", target, goal, "goal"
    if name in AGAINST_PEERS:
        for target in (1.0, 2.0, 5.0):
            best = smallest(stored, name, target)
            margin = MARGIN_BELOW if target < noise else MARGIN
            if best is None:
                yield "--er-l2", target, None, "no peer stored"
            else:
                where = f", below the noise of {noise:.2g} %" if target < noise else ""
                yield "--er-l2", target, math.floor(best[0] / margin), f"{best[1]} {best[0]:,} / {margin:g}{where}"


def figures(options, names, rows):
    """The table of goals, ours and verdicts, printed as it grows; whether all are reached."""
    stored, met, cells, slowest = stored_rows(), 0, 0, (0.0, "")
    print("| array | bound | goal, bytes | from | ours, bytes | ours / goal | error, % | seconds | |")
    print("|---|--:|--:|---|--:|--:|--:|--:|---|")
    for name in names:
        if name not in (*GOALS, *POINTWISE_GOALS, *AGAINST_PEERS):
            continue
        try:
            truth = Array(name, make(name, options))
        except Refused as why:
            print(f"| {name} | | | | | | | | {why} |")
            cells += len(list(goals_of(name, stored, 0.0)))
            continue
        truth.listen(options.binary)
        goals = list(goals_of(name, stored, 100 * truth.noise.relative))
        for option, target, goal, origin in goals:
            row = run_wavelume(truth, options, target, [option, repr(target / 100)], "", options.extra)
            rows.append({**row, "setting": option})
            pointwise = option == "--max-relative-error"
            bound = f"{target:g} % {'of every sample' if pointwise else ''}".strip()
            wanted = f"| {name} | {bound} | {f'{goal:,}' if goal else '–'} | {origin}"
            cells += 1
            if row["bytes"] == "":
                print(f"{wanted} | | | | | **{row['note']}** |", flush=True)
                continue
            error = 100 * (row["max_relative"] if pointwise else row["er_l2"])
            good = goal is not None and row["bytes"] <= goal and not row["note"]
            verdict = row["note"] or ("ok" if good else "miss" if goal else "no goal")
            share = f"{row['bytes'] / goal:.2f}" if goal else "–"
            met += good
            if name.startswith("brdf_") and not pointwise:
                slowest = max(slowest, (row["seconds"], f"{name} {bound}"))
            got = f"{row['bytes']:,} | {share} | {error:.4g} | {row['seconds']:.2f} | {verdict}"
            print(f"{wanted} | {got} |", flush=True)
    print(f"\n{met} of {cells} reached.")
    if slowest[1]:
        print(f"Slowest er(L2) on a synthetic BRDF, wall clock of the whole program: {slowest[0]:.2f} s ({slowest[1]});")
        print(f"goal {SECONDS_GOAL:g} s.")
    return met == cells


# ---- the command


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], epilog="more in the head of this file")
    parser.add_argument("--binary", help="the wavelume program; without it peers only, on synthetic arrays")
    parser.add_argument("--out", help="directory for peers.csv, peers.md and the arrays")
    parser.add_argument("--arrays", help="names, comma-separated; all without it")
    parser.add_argument(
        "--targets", help="er(L2) in %%, comma-separated; 0.5,1,2,5, and 0.1 for phase functions, without it"
    )
    parser.add_argument("--peers", help="names of peers, comma-separated; all that are installed without it; none for none")
    parser.add_argument("--measurements", help="one more directory with measured files")
    parser.add_argument("--stored", action="store_true", help="take the peers' results from results/")
    parser.add_argument("--policies", action="store_true", help="also the paper's policies, on the arrays that are plotted")
    parser.add_argument("--publish", action="store_true", help="write docs/peers.md and the plot")
    parser.add_argument("--figures", action="store_true", help="wavelume against the goals; exit code 1 if one is missed")
    parser.add_argument("--extra", default="", help="more options for `wavelume compress`, in one string")
    parser.add_argument("--list", action="store_true", help="the names of the arrays")
    options = parser.parse_args()
    if options.list:
        sys.exit(print("\n".join(NAMES)))
    if not options.out or (options.figures and not options.binary):
        parser.error("--out is needed, and --binary for --figures")
    options.extra = options.extra.split()
    options.binary = options.binary and os.path.abspath(options.binary)
    chosen = options.arrays.split(",") if options.arrays else NAMES
    if unknown := [name for name in chosen if name not in NAMES]:
        parser.error(f"unknown arrays {', '.join(unknown)}; --list names them")
    return options, chosen


def main():
    options, chosen = arguments()
    os.makedirs(options.out, exist_ok=True)
    rows, missed = [], False
    if options.figures:
        reached = figures(options, chosen, rows)
        write_csv(os.path.join(options.out, "figures.csv"), rows)
        sys.exit(0 if reached else 1)
    peers, missing = others.installed() if not options.stored and options.peers != "none" else ([], {})
    if options.peers:
        peers = [peer for peer in peers if peer.name in options.peers.split(",")]
        missing = {name: why for name, why in missing.items() if name in options.peers.split(",")}
    kept, every = stored_rows() if options.stored else [], set()
    stale = lambda truth: any(row["array"] == truth.name and row["digest"] not in ("", truth.digest) for row in kept)
    for name in chosen:
        start = time.perf_counter()
        targets = [float(one) for one in options.targets.split(",")] if options.targets else [0.5, 1.0, 2.0, 5.0]
        if name.startswith("phase_") and not options.targets:
            targets = [0.1, *targets]
        every |= set(targets)
        print(name, file=sys.stderr, flush=True)
        try:
            truth = Array(name, make(name, options))
        except Refused as why:
            print(f"  not made: {why}", file=sys.stderr)
            absent = {"array": name, "target": "0", "group": "wavelume", "peer": "array", "note": f"not made: {why}"}
            rows.append({**dict.fromkeys(FIELDS, ""), **absent})
            continue
        for row in kept:
            if row["array"] == name and float(row["target"]) in [0.0, *targets]:
                rows.append(row)
        if stale(truth):
            print("  the stored results are of an array with other bits", file=sys.stderr)
        rows += search.run(truth, targets, peers, missing, sys.stderr)
        if options.binary:
            truth.listen(options.binary)
            for target in targets:
                promise, setting = ["--er-l2", repr(target / 100)], " ".join(options.extra)
                rows.append(run_wavelume(truth, options, target, promise, setting, options.extra))
                missed |= bool(rows[-1]["note"])
            write_csv(os.path.join(options.out, "peers.csv"), rows)
            if options.policies and name in plot_rd.ARRAYS:
                rows += run_policies(truth, options)
        print(f"  {time.perf_counter() - start:.1f} s", file=sys.stderr)
        write_csv(os.path.join(options.out, "peers.csv"), rows)
    write_csv(os.path.join(options.out, "peers.csv"), rows)
    table = tables.markdown(rows, sorted(every))
    if peers:
        table += f"\nPackages: {', '.join(versions())}.\n"
    with open(os.path.join(options.out, "peers.md"), "w") as file:
        file.write(table)
    print(table)
    if options.publish:
        tables.publish(ROOT, rows, table, AGAINST_PEERS)
        plot_rd.draw([os.path.join(options.out, "peers.csv")], os.path.join(ROOT, "docs", "rate-distortion.svg"))
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
