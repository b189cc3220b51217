#!/usr/bin/env python3
"""Compresses every gridded fixture on its own grid through the service, and compares what is evaluated there at the file's
own angles with the numbers of the file, as the readers of gridded.py have them.

Usage: promises.py BINARY
"""
import os
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import gridded

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TARGETS = [0.02, 0.01, 0.005]
FIXTURES = """
    data/aerolamp.ies data/nukit_lantern.ies data/ushio_b1.ies
    tests/fixtures/ies/examp1.ies tests/fixtures/ies/example_modules.ies
    tests/fixtures/ies/iesna2002_example_typec.ies tests/fixtures/ies/test.ies
    tests/fixtures/ldt/absolute.ldt tests/fixtures/ldt/example.ldt tests/fixtures/ldt/multiple_lamp_sets.ldt
    tests/fixtures/ldt/symmetry_to_c0c180.ldt tests/fixtures/ldt/symmetry_to_c90c270.ldt
    tests/fixtures/mbsdf/test_reflection_scalar_theta_2_phi_3.mbsdf tests/fixtures/mbsdf/test_rgb_theta_2_phi_3.mbsdf
    tests/fixtures/mbsdf/test_transmission_scalar_theta_2_phi_4.mbsdf
""".split()
# The car paint has 546,750 samples: one target shows what the small ones cannot.
LARGE = ("data/carpaint_blue.mbsdf", [0.01])


def check(base, path, targets):
    """The number of promises that are broken."""
    broken = 0
    for target in targets:
        found, allowed = gridded.promise(base, os.path.join(ROOT, path), target, domain="grid")
        verdict = "ok" if found <= allowed else f"BROKEN: expected at most {100 * allowed:.4f} %"
        broken += found > allowed
        print(f"  {os.path.basename(path):<52} asked {100 * target:4.1f} %, found {100 * found:7.4f} %  {verdict}", flush=True)
    return broken


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.splitlines()[-1])
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.argv[1], "serve", "--data", scratch, "--listen", "127.0.0.1:0"]
        with open(os.path.join(scratch, "log"), "w+") as log:
            service = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
            try:
                line = service.stdout.readline()
                address = re.search(r"http://[0-9.]+:[0-9]+", line)
                if not address:
                    sys.exit(f"promises.py: the service said {line!r}, expected its address")
                every = [(path, TARGETS) for path in FIXTURES] + [LARGE]
                broken = sum(check(address.group(), path, targets) for path, targets in every)
            finally:
                service.terminate()
                service.wait()
    sys.exit(f"{broken} promises are broken" if broken else 0)


if __name__ == "__main__":
    main()
