#!/usr/bin/env python3
"""Instructions and cache misses of one call of each kind, as callgrind counts them: the same on any machine and load.

Usage: tests/benches/instructions.py        (needs cargo, valgrind)

The caches simulated are those of the machine at hand. Valgrind knows vectors of 256 bits, not of 512.
"""

import json
import os
import subprocess
import sys
import tempfile

COUNTED = "evaluate::calls::counted"
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def executable():
    command = ["cargo", "bench", "--locked", "--package", "wavelume-core", "--bench", "evaluate", "--no-run", "--message-format=json"]
    built = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    for line in built.stdout.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["target"]["name"] == "evaluate":
            return message["executable"]
    sys.exit("instructions.py: cargo built no bench")


def main():
    program = executable()
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "counts")
        options = ["--cache-sim=yes", "--collect-atstart=no", f"--toggle-collect={COUNTED}", f"--dump-after={COUNTED}"]
        command = ["valgrind", "--tool=callgrind", *options, f"--callgrind-out-file={out}", program, "count"]
        run = subprocess.run(command, capture_output=True, text=True)
        if run.returncode:
            sys.exit(f"instructions.py: {' '.join(command)} failed:\n{run.stderr[-2000:]}")
        names = [line.split(" ", 1) for line in run.stdout.splitlines() if line]
        print("| one call | instructions | loads | stores | misses of the first cache | of the last |")
        print("|---|--:|--:|--:|--:|--:|")
        for number, (calls, name) in enumerate(names, 1):
            with open(f"{out}.{number}") as file:
                lines = dict(line.split(":", 1) for line in file if line.startswith(("events:", "totals:", "summary:")))
            counts = dict(zip(lines["events"].split(), map(int, (lines.get("totals") or lines["summary"]).split())))
            each = {key: counts.get(key, 0) / int(calls) for key in ("Ir", "Dr", "Dw", "D1mr", "D1mw", "DLmr", "DLmw")}
            print(
                f"| {name} | {each['Ir']:.0f} | {each['Dr']:.0f} | {each['Dw']:.0f} "
                f"| {each['D1mr'] + each['D1mw']:.1f} | {each['DLmr'] + each['DLmw']:.2f} |"
            )


if __name__ == "__main__":
    main()
