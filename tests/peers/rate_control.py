#!/usr/bin/env python3
"""Checks that files use the error that they are allowed: on every array of the benchmark and every measurement on a
grid of more than 2,000 samples, er(L2) lies within 3 % below its target, or a step 2 % coarser than the one reported
misses the target or saves less than 0.3 % of the bytes.

Usage: rate_control.py BINARY OUT [NAME...]   # OUT keeps the arrays; MEASUREMENTS has carpaint_red.mbsdf
"""
import json
import os
import subprocess
import sys
import types

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import grids  # noqa: E402
import run_peers  # noqa: E402

TARGETS = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1]
USED, COARSER, SAVED = 0.97, 1.02, 0.003
LEAST_SAMPLES = 2000
RESOLUTION = 1e-4  # of an error that a header states
LARGEST_STEP = 64.0  # that the program takes


def compress(binary, path, out, *options):
    """The report of a compression, or the message of its refusal."""
    command = [binary, "compress", path, "-o", out, "--no-metadata", "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True)
    return json.loads(done.stdout) if done.returncode == 0 else done.stderr.strip().splitlines()[-1]


def verdict(binary, path, out, target, report):
    """A word on how a file uses its target, and whether that is enough."""
    share = report["er_l2"] / target
    if share > 1 + RESOLUTION:
        return f"{share:.3f} of the target: BROKEN", False
    if share >= USED:
        return f"{share:.3f} of the target", True
    if COARSER * report["step"] > LARGEST_STEP:
        return f"{share:.3f} of the target; nothing is coarser", True
    coarser = compress(binary, path, out, "--step", repr(COARSER * report["step"]))
    if isinstance(coarser, str):
        return f"{share:.3f} of the target; a coarser step: {coarser}", False
    saved = 1 - coarser["bytes"] / report["bytes"]
    is_kept = coarser["er_l2"] > target or saved < SAVED
    text = f"{share:.3f} of the target; a coarser step: {coarser['er_l2'] / target:.3f}, {100 * saved:.2f} % saved"
    return text if is_kept else f"{text}: MISSED", is_kept


def arrays(binary, out, names):
    """(name, path) of every array of the benchmark, and of every measurement on a grid."""
    os.makedirs(out, exist_ok=True)
    options = types.SimpleNamespace(out=out, binary=binary, measurements=os.environ.get("MEASUREMENTS"))
    for name in run_peers.NAMES:
        if not names or name in names:
            yield name, run_peers.make(name, options)
    for source in grids.sources(out):
        if source.floor or names and source.name not in names:
            continue
        if source.manifest is not None:
            with open(source.path[: -len(".npy")] + ".axes.json", "w") as file:
                json.dump(source.manifest, file)
        yield f"{source.name} (file)", source.path


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__.split("\n\n")[1])
    binary, out = sys.argv[1:3]
    missed = []
    for name, path in arrays(binary, out, sys.argv[3:]):
        for target in TARGETS:
            report = compress(binary, path, os.path.join(out, "trial.wlm"), "--er-l2", repr(target))
            if isinstance(report, str):
                text, is_kept = report, False
            elif report["samples"] <= LEAST_SAMPLES:
                break
            else:
                text, is_kept = verdict(binary, path, os.path.join(out, "trial.wlm"), target, report)
                text = f"{report['bytes']:>9,} bytes  {report['seconds']:6.2f} s  {text}"
            print(f"{name:<24} {100 * target:5.1f} %  {text}", flush=True)
            missed += [] if is_kept else [f"{name} {100 * target:g} %"]
    print(f"{len(missed)} missed" + "".join(f"\n  {one}" for one in missed))
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
